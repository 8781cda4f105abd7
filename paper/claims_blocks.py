"""The paper's claims with blocks in place of sliders: bodies that lift, tilt and hit with their corners.

Where a claim is one of another figure, its rule is that figure's, for the block and for the slider beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from paper import claims_rigid
from paper.claims_systems import means_of
from paper.figure_scenes import Bar
from vanedamp.studies.demo import claims as shown
from vanedamp.studies.demo.claims import Curves, claim, verdict
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.report.claims import Claim

_BARS = ("light", "nominal", "heavy", "light_same_gap", "nominal_same_gap", "heavy_same_gap")
#: figures and their curves, of sliders, that the blocks of a study stand beside
SLIDERS: dict[str, dict[str, tuple[str, ...]]] = {
    "blocks": {"fig9": ("",), "fig14": ("single", "double", "quad", "double_aside", "quad_aside"), "fig19": _BARS},
    "fit": {"fig9": ("",)},
}
ROWS = ("single", "double", "triple", "quad")
#: by how much tops that are the same may differ
_SLACK = 0.005
#: a horizontal run that leaves more than the vertical ones by this share has settled flat
_SETTLED = 0.2


def blocks(curves: Curves, sliders: Mapping[str, Curves], bar: Bar, mass: float) -> list[Claim]:
    """Judge blocks; sliders: by figure and curve; bar: of nominal mass (kg)."""
    return [
        *_gaps(curves, sliders["fig9"]),
        *_drop(curves, sliders["fig9"][""][1]),
        *_numbers(curves, sliders["fig14"]),
        *_masses(curves, sliders["fig19"], bar, mass),
    ]


def _beside(block: Claim, slider: Claim, why: str) -> Claim:
    """Return a claim for blocks with the slider's finding beside it, both by one rule."""
    ours = f"block: {block.ours}; slider ({slider.verdict}): {slider.ours}"
    figures = block.figures | {f"slider_{name}": value for name, value in slider.figures.items()}
    return replace(block, ours=ours, why=why, figures=figures)


def _gaps(curves: Curves, sliders: Curves) -> list[Claim]:
    why = (
        "Block and slider differ little at the peak; above it the block leaves more.",
        "For the block as for the slider the widest gap leaves the least.",
        "Its means scatter less: a block passes from corner to corner, so that no two of its impacts are alike, but "
        "many of them make an average.",
    )
    both = zip(shown.fig9({"": curves["gap"]}), shown.fig9(sliders), why, strict=True)
    return [_beside(*parts) for parts in both]


def _drop(curves: Curves, slider: DampedCurve) -> list[Claim]:
    block = curves["gap"][1]
    return [
        _beside(
            shown.onset(curves["flat"][0]),
            shown.onset(slider),
            "This block begins flat and at rest, but its cavity turns with the structure, as the shipped cluster's "
            "does: the floor throws it up, and it hits the walls at all frequencies. In a cavity that does not turn it "
            "lies flat and has the slider's onset.",
        ),
        _beside(
            shown.drop(block),
            shown.drop(slider),
            "The block comes nearer to the curve of the fixed body, but goes through it as well: it takes energy.",
        ),
        _beside(
            shown.resonance_shift(block),
            shown.resonance_shift(slider),
            "At the peak the impacts attach more than the body's mass, as those of the slider do.",
        ),
    ]


def _tops(curves: Curves, index: int) -> dict[str, float]:
    """Return the highest means of curves by name at the first or last orientation."""
    return {name: of[index].peak().height for name, of in curves.items()}


def _text(tops: Mapping[str, float]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {value:.3f}" for name, value in tops.items())


def _numbers(curves: Curves, sliders: Curves) -> list[Claim]:
    chosen = {name: curves[name] for name in (*ROWS, "double_aside", "quad_aside")}
    level, upright = _tops(chosen, 0), _tops({name: curves[name] for name in ROWS}, -1)
    beside, above = _tops(sliders, 0), _tops(sliders, -1)
    others = {name: curves[f"{name}_restitution"] for name in ROWS}  # with 0.9 the last
    elastic, soft = _tops(others, -1), _tops({name: of for name, of in others.items() if len(of) > 1}, 0)
    text = f"highest means, blocks: {_text(level)}; sliders: {_text(beside)}"
    vertical = f"highest means vertically, blocks: {_text(upright)}; sliders: {_text(above)}"
    multi = {name: value for name, value in level.items() if name != "single"}
    figures = {f"{name}_horizontal": value for name, value in level.items()}
    figures |= {f"{name}_vertical": value for name, value in upright.items()}
    best, best_upright = (min(of, key=lambda name: of[name]) for of in ({n: level[n] for n in ROWS}, upright))
    starts = {name: np.concatenate([curve.mean for curve in curves[f"{name}_starts"]]) for name in ("double", "quad")}
    together = {name: float(np.mean(means > claims_rigid.TOGETHER)) for name, means in starts.items()}
    return [
        claim(
            "Two halves in cavities of their own damp no worse than the single body, nor than in one cavity together.",
            text,
            verdict(
                level["double_aside"] <= min(level["single"], level["double"]) + _SLACK,
                level["double_aside"] <= level["single"] + _SLACK,
            ),
            "Shorter blocks tilt more easily and damp better than the whole one; in a row they lose energy to each "
            "other as well, which takes far more.",
            figures,
        ),
        claim(
            "Horizontally, several bodies damp better than one.",
            text,
            verdict(max(multi.values()) < level["single"] - _SLACK, min(multi.values()) < level["single"] - _SLACK),
            f"A row of sliders that moves together damps like one; of the rows of blocks from {len(starts['double'])} "
            f"starts near the peak {together['double']:.0%} do so, of the quarters {together['quad']:.0%} of "
            f"{len(starts['quad'])}.",
            figures | {f"together_{name}": value for name, value in together.items()},
        ),
        claim(
            "Horizontally, several bodies take more than half of the amplitude away.",
            text,
            verdict(max(multi.values()) < 0.5, min(multi.values()) < 0.5),
            figures=figures,
        ),
        claim(
            "Vertically the amplitude is reduced as well.",
            vertical,
            verdict(max(upright.values()) < 0.7, max(upright.values()) < 0.9),
            figures=figures,
        ),
        claim(
            "Two bodies damp best in both orientations.",
            f"best row of blocks: {best} ({level[best]:.3f}) horizontally, {best_upright} "
            f"({upright[best_upright]:.3f}) vertically; {text}",
            verdict(best == best_upright == "double", "double" in (best, best_upright)),
            "Each more block in the row leaves more above the resonance; rows of sliders go on gaining. It goes with "
            f"the restitution: with 0.9 {_text(elastic)}, with 0.5 {_text(soft)}.",
            figures
            | {f"{name}_restitution_0.9": value for name, value in elastic.items()}
            | {f"{name}_restitution_0.5": value for name, value in soft.items()},
        ),
    ]


def _masses(curves: Curves, sliders: Curves, bar: Bar, mass: float) -> list[Claim]:
    bars = {name: curves[name] for name in _BARS}
    why = (
        "In wide gaps a block is hit now and then, as a slider is; in the narrow one it leaves more above its peak.",
        "The mass by itself hardly counts for the block either; its length does, through the gap.",
    )
    both = zip(claims_rigid.fig19(bars, bar, mass), claims_rigid.fig19(sliders, bar, mass), why, strict=True)
    return [_beside(*parts) for parts in both]


def highest_means(curves: Sequence[DampedCurve], shape: Sequence[int]) -> np.ndarray:
    """Return the tops of curves in the order of their axes, of this shape."""
    return np.reshape([curve.peak().height for curve in curves], shape)


def fit(curves: Curves, play: np.ndarray, friction: np.ndarray, slider: DampedCurve) -> list[Claim]:
    """Judge fit and friction, horizontally and vertically; play: in m."""
    tops = highest_means(curves["map"], (2, len(play), len(friction)))
    _, row, column = np.unravel_index(np.argmin(tops), tops.shape)
    alike = slider.peak().height
    apart = float(np.abs(tops[0] - tops[1])[-1].max())
    level, upright = np.split(means_of(curves["starts"]), 2)
    usual = np.nanmedian(upright, axis=0)
    settled = (level > (1 + _SETTLED) * usual)[np.isfinite(level)]
    worst, vertical = float(np.nanmax(level)), float(np.nanmax(upright))
    return [
        claim(
            "The fit of the bodies decides how much is gained.",
            f"highest means {tops.min():.3f} to {tops.max():.3f}, least with a play of {1e6 * play[row]:.0f} µm and "
            f"friction {friction[column]:g}; with {1e6 * play[-1]:.0f} µm {tops[:, -1].min():.3f} to "
            f"{tops[:, -1].max():.3f}; slider {alike:.3f}",
            verdict(tops.max() - tops.min() > 0.2),
            figures={"least": tops.min(), "most": tops.max(), "slider": alike, "wide": tops[:, -1].max()},
        ),
        claim(
            "Horizontal and vertical orientation differ.",
            f"with a play of {1e6 * play[0]:.0f} µm highest means {worst:.3f} horizontally and {vertical:.3f} "
            f"vertically, from {len(level)} starts each; {settled.mean():.0%} of the horizontal runs leave more than "
            f"the vertical ones by a fifth. With {1e6 * play[-1]:.0f} µm tops differ by at most {apart:.3f}",
            verdict(worst - vertical > 0.1, worst - vertical > 0.05),
            "In a tight cavity that does not turn, gravity decides whether a block settles flat on the floor, where it "
            "is the slider, or goes on tilting. Once it tilts, orientation does not matter.",
            {"horizontal": worst, "vertical": vertical, "settled": settled.mean(), "differs_wide": apart},
        ),
    ]
