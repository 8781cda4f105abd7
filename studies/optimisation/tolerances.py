"""Amplitudes within the tolerances to first order, by derivatives of responses that repeat: beside the sampled ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vanedamp.studies.optimisation.slopes import Slope, steady_slope
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION

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

    response: (f,) amplitudes of the design as it is; run: gives the amplitude of one that is off.
    worst: with every deviation at the worse end of its width; run: what runs have there; mean: over the sample; by:
    [name, what its width adds to the worst], largest first; frequency_hz: of the worst, None for the mean of a band;
    without: number of responses without derivatives, by the reason: they stay as they are. Where one that may count has
    none, its frequency and reason only. Empty without tolerances, and where
    no amplitude counts.
    """
    widths = {name: width.half for name, width in study.widths.items()}
    if not widths or not study.table.by_amplitude:
        return {}
    changes, whole = study.changes(design), study.table.over_band == "mean"
    paths = list(dict.fromkeys(path for name in widths for path in changes.of[name]))
    slopes, without = np.zeros((len(response), len(paths))), Counter[str]()
    nothing: dict[str, Any] = dict.fromkeys(("worst", "run", "mean")) | {"by": []}
    for f in np.argsort(-response, kind="stable").tolist():
        frequency = float(study.frequencies[f])
        scene = study.scene_of(design, NO_DEVIATION, frequency)
        found = steady_slope(scene, paths, study.table.measure, study.reference * float(response[f]))
        if isinstance(found, Slope):
            slopes[f] = found.by_number
            continue
        if whole or not response[f] < _NEAR * response.max():
            return nothing | {"frequency_hz": frequency, "without": {found: 1}}
        without[found] += 1
    if whole:
        slopes, response = slopes.mean(axis=0, keepdims=True), response.mean(keepdims=True)

    def moved(deviation: _Deviation) -> np.ndarray:
        """Return the change (f,) by a deviation."""
        ends = [study.moved(changes, design, each) for each in (NO_DEVIATION, deviation)]
        change = np.array([ends[1][path] - ends[0][path] for path in paths])
        return slopes @ change / study.reference - study.level_deviation(deviation) * response

    ends = np.array(
        [[moved({**NO_DEVIATION, name: side * width}) for side in (1.0, -1.0)] for name, width in widths.items()]
    )
    total = response + ends.max(axis=1).sum(axis=0)
    at = int(np.argmax(total))
    signs = np.where(ends[:, 0, at] >= ends[:, 1, at], 1.0, -1.0)
    corner = {**NO_DEVIATION, **{name: sign * widths[name] for name, sign in zip(widths, signs.tolist(), strict=True)}}
    by = zip(widths, ends[:, :, at].max(axis=1).tolist(), strict=True)
    return {
        "worst": float(total[at]), "run": run(design, corner),
        "mean": float(np.mean([np.max(response + moved(deviation)) for deviation in sample])),
        "by": sorted(map(list, by), key=lambda item: -item[1]),
        "frequency_hz": None if whole else float(study.frequencies[at]), "without": dict(without),
    }  # fmt: skip
