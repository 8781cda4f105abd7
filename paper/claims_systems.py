"""Other damping systems that the paper names, beside the multi-body damper with the same mass added."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.studies.demo.claims import Curves, claim, verdict
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.report.claims import Claim

#: shares of the load at which friction carries the body along, of the file's normal loads
LOADS = (0.01, 0.1, 0.3, 0.6, 1.2)
#: normal forces of the file, in forces at the undamped resonance
FORCES = (1, 2, 5, 10, 20, 40)
NAMES = {
    "multi_body": "four bodies in a row", "single_body": "one body", "many_cavities": "eight cavities, a body each",
    "particles": "row of 32 small bodies", "friction_damper": "friction damper to the casing",
    "rotating": "body in a rotating blade",
}  # fmt: skip


def claims(curves: Curves) -> list[Claim]:
    """Judge each system beside the multi-body damper, by the tops of the smoothed means."""
    multi = _top(curves, "multi_body")
    return [_friction_damper(curves, multi), _bodies(curves, multi), _particles(curves, multi), *_rotating(curves)]


def top(curve: DampedCurve) -> float:
    """Return the top of the smoothed means where impacts scatter them, or else of the means."""
    return float((curve.smooth if curve.impacts.any() else curve.mean).max())


def means_of(curves: Sequence[DampedCurve]) -> np.ndarray:
    """Return the means (k, f) of k curves at all f frequencies that one of them has; nan where a run is not ok."""
    frequencies = np.unique(np.concatenate([curve.frequency for curve in curves]))
    means = np.full((len(curves), len(frequencies)), np.nan)
    for row, curve in zip(means, curves, strict=True):
        row[np.searchsorted(frequencies, curve.frequency)] = curve.mean
    return means


def _top(curves: Curves, name: str) -> float:
    return top(curves[name][0])


def _friction_damper(curves: Curves, multi: float) -> Claim:
    heights = [top(curve) for curve in curves["friction_damper"]]
    best = int(np.argmin(heights))
    low, high = min(heights), max(heights)
    highest = curves["multi_body"][0].peak().height
    return claim(
        "Free bodies replace the spring-loaded friction damper, without a change of the structure.",
        f"four bodies {multi:.3f} (highest mean {highest:.3f}); friction damper {low:.3f} with its best normal force "
        f"({FORCES[best]} times the exciting force), up to {high:.3f} with {FORCES[-1]} times",
        verdict(highest < 1.1 * low, multi < 0.6),
        "The friction damper needs a casing to act on and the right normal force; it stiffens the cluster, so that "
        f"its peak moves up, to {curves['friction_damper'][best].peak().frequency:.0f} Hz.",
        {"multi_body": multi, "multi_body_highest": highest, "friction_damper_best": low, "friction_damper_worst": high}
        | {f"force_{force}": height for force, height in zip(FORCES, heights, strict=True)},
    )  # fmt: skip


def _bodies(curves: Curves, multi: float) -> Claim:
    single, many = _top(curves, "single_body"), _top(curves, "many_cavities")
    highest = curves["multi_body"][0].peak()
    return claim(
        "Several bodies in a cavity do more than a single-body impact damper or a body in each of many cavities.",
        f"tops of the smoothed means: four in a row {multi:.3f} (highest mean {highest}), one body {single:.3f}, "
        f"eight cavities {many:.3f}",
        verdict(multi < min(single, many) - 0.02, multi < max(single, many)),
        "Bodies in cavities of equal gaps all do the same on one mode; bodies in a row lose energy to each other as "
        "well, as long as they do not move together, which happens at single frequencies near the peak (fig14).",
        {"multi_body": multi, "multi_body_highest": highest.height, "single_body": single, "many_cavities": many},
    )


def _particles(curves: Curves, multi: float) -> Claim:
    curve, top = curves["particles"][0], _top(curves, "particles")
    peak = curve.peak()
    return claim(
        "A cavity filled with small bodies damps, too.",
        f"32 bodies in a row: top of the smoothed mean {top:.3f}, highest mean {peak}, "
        f"{curve.impacts[peak.index]:.1f} impacts per period there; four bodies {multi:.3f}",
        verdict(peak.height < 0.6, peak.height < 0.9),
        "A row is not a bed of particles: it has neither a second direction nor friction between the bodies.",
        {"particles": top, "particles_highest": peak.height, "multi_body": multi},
    )


def _rotating(curves: Curves) -> list[Claim]:
    heights = [top(curve) for curve in curves["rotating"]]
    stuck = curves["rotating"][-1]
    apart = float(np.max(np.abs(stuck.mean / stuck.fixed - 1)))
    figures = {f"load_{load:g}": height for load, height in zip(LOADS, heights, strict=True)}
    return [
        claim(
            "In a rotating blade the centrifugal load rules the body, not gravity.",
            f"under a load {LOADS[-1]} times that at which friction carries it along, the curve is that of the fixed "
            f"body to {apart:.1%}; top {heights[-1]:.3f}",
            verdict(apart < 0.01),
            "The body then adds its mass and damps nothing.",
            figures | {"distance_from_fixed": apart},
        ),
        claim(
            "There a free body is a friction damper.",
            "tops under loads of "
            + ", ".join(f"{load:g}: {height:.3f}" for load, height in zip(LOADS, heights, strict=True)),
            verdict(
                min(heights) < 0.5 and min(heights) < heights[0] and min(heights) < heights[-1], min(heights) < 0.8
            ),
            "Light loads leave it to impacts, heavy ones let it stick; between them friction takes most.",
            figures,
        ),
    ]
