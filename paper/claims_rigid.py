"""The paper's claims on each figure computed with rigid models, and what these models show.

Claims are in words of our own. A verdict is a rule on figures; where a claim holds in part or not, `why` says what the
model has or lacks. Amplitudes are relative to the maximum without bodies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from paper.figure_scenes import Bar
from vanedamp.studies.demo.claims import Curves, claim, verdict
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.report.claims import Claim

#: mean amplitude above which a row near its peak moves together like one body: between its two steady states
TOGETHER = 0.3


def _gained(left: Mapping[str, float]) -> str:
    """Return what curves have gained by their names; left: highest means over the maximum without bodies."""
    return ", ".join(f"{name.replace('_', ' ')} {1 - value:.0%} gained" for name, value in left.items())


def fig14(curves: Curves) -> list[Claim]:
    """Judge single, double, quad; horizontal to vertical."""
    tops = {name: [float(curve.smooth.max()) for curve in of] for name, of in curves.items()}
    slack = {name: [2 * curve.peak().confidence + 0.01 for curve in of] for name, of in curves.items()}
    kinds = ("single", "double", "quad", "double_aside", "quad_aside")
    level = {name: tops[name][0] for name in kinds}
    upright = {name: tops[name][-1] for name in kinds}
    multi = {name: value for name, value in level.items() if name != "single"}
    between = [
        min(of[0], of[-1]) - slack[name][index] <= of[index] <= max(of[0], of[-1]) + slack[name][index]
        for name, of in tops.items() if name in kinds for index in range(1, len(of) - 1)
    ]  # fmt: skip
    figures = {f"{name}_horizontal": value for name, value in level.items()} | {
        f"{name}_vertical": value for name, value in upright.items()
    }
    text = ", ".join(f"{name.replace('_', ' ')} {value:.3f}" for name, value in level.items())
    light = "Gravity is a sixteen-hundredth of the walls' acceleration here, so that it matters only to a body at rest."
    best = min(level, key=lambda name: level[name])
    together = {name: np.concatenate([curve.mean for curve in curves[f"{name}_starts"]]) for name in ("double", "quad")}
    share = {name: float(np.mean(means > TOGETHER)) for name, means in together.items()}
    linked = {name: float(max(curve.mean.max() for curve in curves[f"{name}_linked"])) for name in together}
    worst = {name: max(float(means.max()), linked[name]) for name, means in together.items()}
    figures |= {f"together_{name}": value for name, value in share.items()}
    figures |= {f"worst_{name}": value for name, value in worst.items()}
    return [
        claim(
            "Horizontally, several bodies damp better than one.",
            f"tops of the smoothed means: {text}",
            verdict(max(multi.values()) < level["single"] - 0.01, min(multi.values()) < level["single"] - 0.01),
            "In a row they do, from rest, but rows have several steady states near their peak: of the runs from "
            f"different starts there, {share['double']:.0%} of the halves' and {share['quad']:.0%} of the quarters' "
            "end with the row moving together like one body, and with each frequency begun from its neighbour's "
            f"state they do so over the whole peak: up to a mean of {worst['double']:.3f} and {worst['quad']:.3f}. "
            "Side by side, halves and quarters do what the whole body does, since one mode moves all walls alike.",
            figures,
        ),
        claim(
            "Horizontally, several bodies take more than half of the amplitude away.",
            "reductions: " + _gained(multi),
            verdict(max(*multi.values(), *worst.values()) < 0.5, min(multi.values()) < 0.5),
            f"A row that moves together gains {1 - max(worst.values()):.0%}.",
            figures={f"reduction_{name}": 1 - value for name, value in multi.items()},
        ),
        claim(
            "Vertically the amplitude is reduced as well.",
            "reductions: " + _gained(upright),
            verdict(max(upright.values()) < 0.7, max(upright.values()) < 0.9),
            figures={f"reduction_{name}": 1 - value for name, value in upright.items()},
        ),
        claim(
            "Results between both orientations lie between theirs, and these differ.",
            f"{sum(between)} of {len(between)} within the scatter; single {level['single']:.3f} and "
            f"{upright['single']:.3f}. In a cavity eight times as wide: {tops['wide'][0]:.3f} horizontally, "
            f"{tops['wide'][-1]:.3f} vertically",
            verdict(False, np.mean(between) > 0.7),
            f"{light} The wide cavity shows where orientation counts: a body at rest out of reach of the walls stays "
            "there, unless gravity brings it back. The test's difference also has causes that the model lacks, such "
            "as friction at side walls and a body's tilt.",
            {"between": float(np.mean(between)), "wide_horizontal": tops["wide"][0], "wide_vertical": tops["wide"][-1]},
        ),
        claim(
            "Two bodies damp best in both orientations.",
            f"best here: {best.replace('_', ' ')}, {level[best]:.3f}; two in a row {level['double']:.3f}, four "
            f"{level['quad']:.3f}",
            verdict(best.startswith("double")),
            "From rest: each more body in a row has more collisions to lose energy in; in the worst state all are "
            "alike. What made the test's quarters worse "
            "(their fit, their tilt, their rubbing on each other) is not in a model of point masses.",
            figures,
        ),
    ]  # fmt: skip


_BARS = ("light", "nominal", "heavy")


def fig19(curves: Curves, bar: Bar, mass: float) -> list[Claim]:
    """Judge masses 6 % off, with and without the gap; bar: of nominal mass (kg)."""
    reference = curves["nominal"][0].reference
    change = 0.06 * bar.length(mass)
    peaks = {name: curves[name][0].peak() for name in curves}
    tops = {name: float(curves[name][0].largest.max()) for name in curves}
    real, highest = [peaks[name].height for name in _BARS], [tops[name] for name in _BARS]
    alone = [peaks[f"{name}_same_gap"].height for name in _BARS]
    figures = {name: peak.height for name, peak in peaks.items()} | {f"{name}_max": top for name, top in tops.items()}
    return [
        claim(
            "The damper's mass by +-6 %, with the gap that goes with it, changes the reduction a lot.",
            f"the bar is {1e3 * bar.length(mass):.2f} mm long, 6 % of it {1e6 * change:.0f} µm or "
            f"{change / reference:.1f} amplitudes without bodies; highest means (maxima): "
            + ", ".join(f"{name} {peaks[name].height:.3f} ({tops[name]:.3f})" for name in _BARS),
            verdict(max(real) - min(real) > 0.1 or max(highest) - min(highest) > 0.2),
            "The change of the gap is many times the gap that damps best; the peak moves between the frequencies of "
            "the fixed and of the free cluster. The bodies start at a wall: in the middle of the wider gaps the "
            "walls would not reach them at all.",
            figures | {"length": bar.length(mass), "gap_change": change, "gap_change_relative": change / reference},
        ),
        claim(
            "It is the mass and the gap that matter.",
            "with the gap held at reference/2, highest means: "
            + ", ".join(f"{name} {peaks[f'{name}_same_gap'].height:.3f}" for name in _BARS),
            verdict(max(alone) - min(alone) > 0.1, max(alone) - min(alone) < max(real) - min(real)),
            "The mass by itself hardly counts; its length does, through the gap.",
            figures,
        ),
    ]  # fmt: skip


def attached_closed_form(amplitude: np.ndarray, half_gap: float, restitution: float) -> tuple[np.ndarray, np.ndarray]:
    """Return theta and attached mass fraction of the 1:1 impact regime at amplitudes (n,) in half gaps.

    Theurich and Krack's analytics for a light body (repository tobiaswdm/CC); xi the amplitude in half gaps,
    rho = 2 (1-e)/(pi (1+e)), Theta = (1 + sqrt((1 + rho^2) xi^2 - rho^2))/(1 + rho^2), a = 8 Theta (Theta-1)/(pi xi)^2.
    nan where the regime does not exist.
    """
    rho = 2 / np.pi * (1 - restitution) / (1 + restitution)
    xi = amplitude / half_gap
    with np.errstate(invalid="ignore"):
        theta = (1 + np.sqrt((1 + rho**2) * xi**2 - rho**2)) / (1 + rho**2)
    return theta, 8 * theta * (theta - 1) / (np.pi * xi) ** 2


#: beyond this Theta the symmetric regime is not stable
MOST_THETA = 1 / (1 - 4 / np.pi**2)


def regime(curve: DampedCurve, half_gap: float, restitution: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which points (n,) are in the symmetric 1:1 regime, and its attached mass fraction there."""
    theta, attached = attached_closed_form(curve.mean, half_gap, restitution)
    return curve.periodic & (np.abs(curve.impacts - 2) < 1e-9) & (theta < MOST_THETA), attached


def mistuning(curves: Curves, half_gaps: list[float], restitution: float) -> list[Claim]:
    """Judge the attached mass in the 1:1 regime; half_gaps: of the curves, in amplitudes without bodies."""
    errors: list[float] = []
    fractions: list[float] = []
    for curve, half in zip(curves[""], half_gaps, strict=True):
        chosen, closed = regime(curve, half, restitution)
        errors += (curve.attached[chosen] / closed[chosen] - 1).tolist()
        fractions += curve.attached[chosen].tolist()
    worst = max(map(abs, errors), default=math.inf)
    middle = float(np.median(np.abs(errors))) if errors else math.inf
    spread = f"{min(fractions, default=0):.2f} to {max(fractions, default=0):.2f}"
    return [
        claim(
            "Impacts attach the bodies' mass to the structure and mistune it.",
            f"{len(errors)} points with two impacts per period: the structure feels {spread} times the body's mass; "
            f"distance from the closed form {middle:.1%} in the median, {worst:.1%} at most",
            verdict(middle < 0.015 and worst < 0.05, worst < 0.1),
            "The closed form is that of a body without mass and friction; this one has 2 % of the structure's. It "
            "is worst where the regime is about to lose its symmetry.",
            {"points": len(errors), "largest_error": worst, "median_error": middle},
        )
    ]  # fmt: skip
