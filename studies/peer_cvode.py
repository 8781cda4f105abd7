"""SUNDIALS CVODE with root finding, through scikit-sundae: Adams formulas of up to 12th order, restarted at events.

States of contacts and friction are those of coupling.ivp, as CVODE knows equations and roots alone; the right-hand side
is the same as scipy's. Hindmarsh and others (2005).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from coupling.ivp import Arc, IvpRun, Watch
from coupling.scene import Scene
from studies.method_scenes import by
from studies.peers import PeerRun

if TYPE_CHECKING:
    from sksundae.cvode import CVODEResult

#: least number of steps a period, a multiple of the samples: roots are sign changes between two steps
_STEPS = 40


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with the relative tolerance `setting`. Raises InputError for springs before sliders."""
    ours = by(scene, method="solve_ivp", rtol=setting, steps_per_period=_STEPS)
    job = CvodeRun(ours.replace({"time.periods": periods, "time.transient": 0}), False, samples)
    started = time.thread_time()
    status = job.advance_to(periods)
    seconds = time.thread_time() - started
    left = job.outcome()
    return PeerRun(
        status.value, left.records.peak[: left.periods].copy(), left.records.samples.copy(), left.penetration, seconds
    )


class CvodeRun(IvpRun):
    """The run of coupling.ivp with CVODE in the place of scipy's solver."""

    def _integrate(self, grid: np.ndarray, watches: list[Watch]) -> Arc:
        found = self._solve(grid, watches)
        event = len(found.t_events) > 0 if found.t_events is not None else False
        # the start, and the event, are no points of the grid
        last = len(found.t) - (1 if event else 0)
        states = found.y[1:last].T
        if not event:
            return Arc(found.t[1:last], states, None, 0.0, self.y, found.nfev, not found.success)
        who = int(np.flatnonzero(found.i_events[-1])[0])
        return Arc(
            found.t[1:last], states, who, float(found.t_events[-1]), found.y_events[-1], found.nfev, not found.success
        )

    def _opens(self, row: int, y: np.ndarray) -> bool:
        return bool(self.system.J[row] @ y[self.size : 2 * self.size] > 0)

    def _solve(self, grid: np.ndarray, watches: list[Watch]) -> CVODEResult:
        from sksundae.cvode import CVODE

        def rate(t: float, y: np.ndarray, out: np.ndarray) -> None:
            out[:] = self._rate(t, y)

        def roots(t: float, y: np.ndarray, out: np.ndarray) -> None:
            for i, watch in enumerate(watches):
                out[i] = watch.value(t, y)
                # a gap that opens is no root: the first steps after an impact are of low order, and may dip below zero
                if out[i] <= 0 and watch.kind == "gap" and watch.direction < 0 and self._opens(watch.row, y):
                    out[i] = self.reach

        roots.terminal = [True] * len(watches)  # type: ignore[attr-defined]
        roots.direction = [watch.direction for watch in watches]  # type: ignore[attr-defined]
        tolerance = self.solver.rtol or 1e-9
        events = {"eventsfn": roots, "num_events": len(watches)} if watches else {}
        solver = CVODE(
            rate, method="Adams", rtol=tolerance, atol=self._tolerance(tolerance),
            max_step=self.rows.period / self.steps, max_num_steps=100_000, **events,
        )  # fmt: skip
        return solver.solve(np.concatenate([[self.time], grid]), self.y)
