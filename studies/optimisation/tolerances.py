"""Amplitudes within the tolerances to first order, by derivatives of responses that repeat: beside the sampled ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vanedamp.studies.optimisation.slopes import Slope, steady_slope
from vanedamp.studies.optimisation.study import NO_DEVIATION, Design, Study

_Deviation = Mapping[str, float]
#: amplitudes at least this fraction of the worst may become the worst within the tolerances
_NEAR = 0.5


def estimate(
    study: Study,
    design: Design,
    response: np.ndarray,
    sample: Sequence[_Deviation],
    run: Callable[[Design, _Deviation], float],
) -> dict[str, Any]:
    """Return what tolerances make of a design to first order, over the reference at the same level.

    response: (f,) amplitudes of the design as it is; run: the amplitude of one that is off.
    worst: with every deviation at the worse end of its width; run: what a run has there; mean: over the sample; by: what
    each width adds to the worst, the largest first; frequency_hz: where that is, None for the mean of a band; without:
    number of responses without derivatives, by the reason: they stay as they are. All None where one of these may be
    what counts.
    """
    widths = {name: width for name in NO_DEVIATION if (width := getattr(study.table.tolerances, name)) > 0.0}
    if not widths:
        return {}
    slopes, reasons = _slopes(study, design, response, [study.paths[name] for name in widths])
    without = dict(Counter(filter(None, reasons)))
    found: dict[str, Any] = dict.fromkeys(("worst", "run", "mean", "frequency_hz")) | {"by": {}, "without": without}
    whole = study.table.over_band == "mean"
    if any(whole or not response[f] < _NEAR * np.nanmax(response) for f in np.flatnonzero(reasons)):
        return found
    if whole:
        slopes, response = slopes.mean(axis=0, keepdims=True), response.mean(keepdims=True)

    def moved(deviation: _Deviation) -> np.ndarray:
        """Return the change (f,) by a deviation."""
        ends = [study.point(design, each, float(study.frequencies[0])) for each in (NO_DEVIATION, deviation)]
        change = np.array([ends[1][study.paths[name]] - ends[0][study.paths[name]] for name in widths])
        return slopes @ change / study.reference - deviation["excitation"] * response

    ends = np.array(
        [[moved({**NO_DEVIATION, name: side * width}) for side in (1.0, -1.0)] for name, width in widths.items()]
    )
    total = response + ends.max(axis=1).sum(axis=0)
    at = int(np.argmax(total))
    signs = np.where(ends[:, 0, at] >= ends[:, 1, at], 1.0, -1.0)
    corner = {**NO_DEVIATION, **{name: sign * widths[name] for name, sign in zip(widths, signs.tolist(), strict=True)}}
    by = zip(widths, ends[:, :, at].max(axis=1).tolist(), strict=True)
    return found | {
        "worst": float(total[at]), "run": run(design, corner),
        "mean": float(np.mean([np.max(response + moved(deviation)) for deviation in sample])),
        "by": dict(sorted(by, key=lambda item: -item[1])),
        "frequency_hz": None if whole else float(study.frequencies[at]),
    }  # fmt: skip


def _slopes(study: Study, design: Design, response: np.ndarray, paths: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Return derivatives (f, P) by numbers, m by a unit of each, and why a response has none, "" where it has."""
    slopes, reasons = np.zeros((len(response), len(paths))), [""] * len(response)
    for f, frequency in enumerate(study.frequencies.tolist()):
        scene = study.scene_of(design, NO_DEVIATION, frequency)
        found = steady_slope(scene, paths, study.table.measure, study.reference * float(response[f]))
        if isinstance(found, Slope):
            slopes[f] = found.by_number
        else:
            reasons[f] = found
    return slopes, reasons
