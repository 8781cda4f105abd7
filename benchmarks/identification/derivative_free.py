"""What a search without derivatives takes to reach the same misfit."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution, minimize

from benchmarks.identification.truth import study
from vanedamp.studies.identification.fit import Fit
from vanedamp.studies.identification.search import candidates
from vanedamp.studies.identification.tables import SearchTable

#: misfit above the minimum at which a search has reached it, and most evaluations of one
REACHED, _MOST = 0.1, 4000


class _Reached(Exception):
    """The misfit is that of the minimum."""


class _Counted:
    """A misfit by runs, until it reaches a goal or is asked for too often."""

    def __init__(self, fit: Fit, goal: float) -> None:
        self._fit, self._goal = fit, goal
        self.evaluations, self.lowest = 0, np.inf

    def __call__(self, z: np.ndarray) -> float:
        self.evaluations += 1
        found = self._fit.quick(np.clip(z, 0.0, 1.0))
        self.lowest = min(self.lowest, found)
        if self.lowest <= self._goal or self.evaluations >= _MOST:
            raise _Reached
        return found


def compared(seed: int, tried: int) -> dict[str, Any]:
    """Return engine calls of searches to one misfit: with derivatives, Nelder-Mead, and differential evolution.

    With derivatives and by Nelder and Mead (1965) they begin at the best of the same candidates; calls of the engine
    are runs, and for orbits evaluations of the period map and of derivatives.
    """
    sought = study(seed, search=SearchTable(tried))
    fit, evaluated = Fit(sought), Fit(sought)
    start = min(candidates(sought), key=fit.quick)
    best = evaluated.minimum(start)
    ours = dict(evaluated.count)
    found = {"misfit": best.misfit, "ours": ours | {"calls": sum(ours.values())}}
    bounds = [(0.0, 1.0)] * len(start)
    for name, search in (
        ("nelder_mead", lambda of: minimize(of, start, method="Nelder-Mead", bounds=bounds, options={"maxfev": _MOST})),
        ("differential_evolution", lambda of: differential_evolution(of, bounds, seed=seed, polish=False)),
    ):
        fit = Fit(sought)
        counted = _Counted(fit, best.misfit + REACHED)
        with suppress(_Reached):
            search(counted)
        found[name] = {
            "calls": sum(fit.count.values()), "evaluations": counted.evaluations, "misfit": counted.lowest,
            "reached": counted.lowest <= best.misfit + REACHED,
        }  # fmt: skip
    return found
