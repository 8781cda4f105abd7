"""SUNDIALS CVODE with root finding, through scikit-sundae: Adams formulas of up to 12th order, restarted at events.

States of contacts and friction are those of coupling.methods.scipy_ivp.run, as CVODE knows only equations and roots;
the right-hand side is the same as scipy's. Hindmarsh and others (2005).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.methods.peers import PeerRun
from vanedamp.coupling.methods.scipy_ivp import Options
from vanedamp.coupling.methods.scipy_ivp.run import Arc, IvpRun
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import on_structure

if TYPE_CHECKING:
    from sksundae.cvode import CVODEResult

#: least number of steps a period, a multiple of the samples: roots are sign changes between two steps
_STEPS = 40


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with the relative tolerance `setting`."""
    system = assemble(scene)
    options = Options(rtol=setting, steps_per_period=_STEPS)
    options.check_samples(samples)
    records = new_records(system, periods, samples)
    job = CvodeRun(on_structure(system), options, motion_of(system, start_of(scene, system)), records, False)
    started = time.thread_time()
    status = job.advance_to(periods)
    seconds = time.thread_time() - started
    left = job.outcome()
    return PeerRun(
        status.value, left.records.peak[: left.periods].copy(), left.records.samples.copy(), left.penetration, seconds
    )


class CvodeRun(IvpRun):
    """The run of coupling.methods.scipy_ivp.run with CVODE in the place of scipy's solver."""

    def _integrate(self, grid: np.ndarray) -> Arc:
        arc = self._solve(grid)
        event = len(arc.t_events) > 0 if arc.t_events is not None else False
        # the start, and the event, are no points of the grid
        last = len(arc.t) - (1 if event else 0)
        times, states = arc.t[1:last], arc.y[1:last].T
        if not event:
            end, y = (times[-1], states[:, -1]) if arc.success else (self.time, self.y)
            return Arc(times, states, None, end - self.time, y, arc.nfev, not arc.success)
        event_function = int(np.flatnonzero(arc.i_events[-1])[0])
        return Arc(times, states, event_function, float(arc.t_events[-1]) - self.time, arc.y_events[-1], arc.nfev)

    def _solve(self, grid: np.ndarray) -> CVODEResult:
        from sksundae.cvode import CVODE

        free, guard = self.free, self.guard
        leaves = self.order > 0
        size = np.abs(guard) @ np.abs(free.extended(self.time, self.y[: free.size]))

        def rate(t: float, y: np.ndarray, out: np.ndarray) -> None:
            out[:] = self.rate(t, y)

        def roots(t: float, y: np.ndarray, out: np.ndarray) -> None:
            now = free.extended(t, y[: free.size])
            out[:] = guard @ now
            # what leaves zero is no root: the first steps after an event are of low order, and may dip below zero
            early = leaves & (out <= 0) & (guard @ (self.motion.rate @ now) >= 0)
            out[early] = np.maximum(size[early], np.finfo(float).tiny)

        roots.terminal = [True] * len(leaves)  # type: ignore[attr-defined]
        roots.direction = [-1] * len(leaves)  # type: ignore[attr-defined]
        events = {"eventsfn": roots, "num_events": len(leaves)} if len(leaves) else {}
        solver = CVODE(
            rate, method="Adams", rtol=self.options.rtol, atol=self.absolute, max_step=self.step,
            max_num_steps=100_000, **events,
        )  # fmt: skip
        return solver.solve(np.concatenate([[self.time], grid]), self.y)
