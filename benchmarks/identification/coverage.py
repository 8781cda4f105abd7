"""How often intervals cover the truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.identification.truth import TRUTH, study
from vanedamp.studies.identification.fit import Fit
from vanedamp.studies.identification.statistics import covariance, held_at
from vanedamp.studies.identification.study import IdentificationStudy

#: fall of the misfit by which a minimum with a number held shows that the free one was none
_LOWER = 0.01


def rises(seeds: range) -> list[dict[str, Any]]:
    """Return for each data set the misfit, the best numbers, and the rise of the misfit with each number at its truth.

    The interval of a number covers the truth if that rise is below the threshold. Searches begin at the truth.
    """
    return [{"seed": seed} | rises_of(study(seed), TRUTH) for seed in seeds]


def rises_of(sought: IdentificationStudy, values: np.ndarray) -> dict[str, Any]:
    """Return misfit, best numbers, and rises of a study whose numbers have true values (P,)."""
    fit, truth = Fit(sought), sought.coordinates(values)
    best = fit.minimum(truth)
    for _ in range(3):
        scatter = covariance(fit.jacobian(best.z))
        held = [held_at(fit, best, scatter, number, float(truth[number])) for number in range(len(truth))]
        lowest = min(held, key=lambda each: each.misfit)
        if lowest.misfit > best.misfit - _LOWER:
            break
        best = fit.minimum(lowest.z)
    return {
        "misfit": best.misfit, "best": sought.values(best.z).tolist(),
        "deviation": (np.sqrt(np.diag(scatter)) * sought.slope(sought.values(best.z))).tolist(),
        "rise": [each.misfit - best.misfit for each in held],
    }  # fmt: skip
