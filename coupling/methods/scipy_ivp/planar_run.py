"""Bodies with extent by scipy's DOP853, stopped at every event: an independent witness of the exact engine.

It shares the rows of a scene with that engine (coupling.system.units), but neither motion nor search nor
decisions nor impacts (methods.scipy_ivp.planar_contacts). Closed contacts are constraints on accelerations, impacts
jumps between two integrations; events are searched on the solver's interpolant, where none can be missed
(methods.scipy_ivp.root_search). Energies and harmonics are integrated along (methods.scipy_ivp.planar_records).
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.scipy_ivp import Options
from vanedamp.coupling.methods.scipy_ivp.arcs import Arc, first_step, integrate
from vanedamp.coupling.methods.scipy_ivp.event_loop import STANDING, EventLoop
from vanedamp.coupling.methods.scipy_ivp.planar_contacts import (
    NEVER,
    OPEN,
    ROUND_OFF,
    STICK,
    Impact,
    Motion,
    Unforced,
    decide,
    impact,
)
from vanedamp.coupling.methods.scipy_ivp.planar_records import PlanarRecorder
from vanedamp.coupling.planar.recorder import plane_of
from vanedamp.coupling.response.evaluation import Plane
from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.assembly import Motion as PlaneMotion
from vanedamp.coupling.system.system import System

#: the shortest first step, as a share of a period
_SHORTEST = 1e-26
#: gaps below this share of the play, and of the terms that they are sums of, are closed; speeds below this share of the
#: scene's are none
_TOUCH, _NEAR, _STILL = 1e-11, 10 * ROUND_OFF, 1e-11
#: flights shorter than this share of a period, and all that follow them, are the end of a chatter
_CHATTER = 1e-6


class PlanarIvpRun(EventLoop):
    """A run by solve_ivp: state y = (q, v, integrals), states of the units. Times count from the period's start."""

    AT_ONCE = 1e-13

    def __init__(self, system: System, options: Options, initial: PlaneMotion, records: Records, events: bool) -> None:
        self.system = system
        self.free = free = Unforced(system)
        record = PlanarRecorder(free, records, options.steps_per_period, events)
        start = np.concatenate([initial.q, initial.v, np.zeros(record.count)])
        super().__init__(system, rows_of_units(system), options, record, start)
        self.sizes = self.record.sizes(float(system.omega))
        self.absolute = options.rtol * self.sizes
        self.state, self.struck = np.full(free.u, OPEN), np.full(free.u, -np.inf)  # times of the last impacts
        self.motion: Motion
        self.guard, self.order = np.zeros((0, free.extent)), np.zeros(0, int)

    def _begin(self) -> bool:
        self.record.section(self.y)
        decided = self._decide()
        if decided:
            self.record.start(self.y)
        return decided

    def _plane(self) -> Plane:
        return plane_of(self.system, self.record, self.options.linearisation)

    # -- motion between events

    def _integrate(self, grid: np.ndarray) -> Arc:
        free, guard = self.free, self.guard
        return integrate(
            self._rate, self.y, self.time, grid, lambda t, y: guard @ free.extended(t, y[: free.size]), self.order,
            self.options.rtol, self.absolute, self._first_step(), self.step,
        )  # fmt: skip

    def _pass(self, duration: float) -> None:
        self.record.flight(duration)

    def _go_on(self) -> None:
        self.order = np.zeros_like(self.order)

    def _happen(self, event: int) -> bool:
        return self._decide()

    def _end_period(self) -> Status:
        self.struck -= self.system.period
        return super()._end_period()

    def _first_step(self) -> float:
        now = self.free.extended(self.time, self.y[: self.free.size])
        # accelerations of what leaves by its third derivative are round-off
        early = self.order < 3
        guard, order, rate = self.guard[early], self.order[early], self.motion.rate @ now
        value = np.where(order > 0, 0.0, guard @ now)
        slope, curvature = guard @ rate, guard @ (self.motion.rate @ rate)
        return first_step(value, slope, curvature, _SHORTEST * self.system.period, self.step)

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the rates of the state and of the integrals."""
        extended = self.free.extended(t, y[: self.free.size])
        rate = (self.motion.rate @ extended)[: self.free.size]
        return np.concatenate([rate, self.record.rates(extended, self.motion.force @ extended)])

    # -- events

    def _decide(self) -> bool:
        """Apply impacts, then decide the states. Returns False if nothing is possible."""
        free, system, normal = self.free, self.system, self.free.normal[: self.system.contacts]
        q, v = self.y[free.q], self.y[free.v]
        self.record.turning(self.time, self.y)
        self.sizes[: free.size] = np.maximum(self.sizes[: free.size], np.abs(self.y[: free.size]))
        self.fastest = max(self.fastest, float((np.abs(system.J) @ np.abs(v)).max(initial=0.0)), system.speed)
        slow = _STILL * self.fastest
        terms = system.rest[: system.contacts] + np.abs(normal) @ self.sizes[free.q]
        touch = np.maximum(_TOUCH * system.play[: system.contacts], _NEAR * terms)
        closed = (self.state[: system.contacts] != OPEN) | (free.gaps(q) <= touch)
        self._bring(q, normal[closed], free.gaps(q)[closed])
        for _ in range(STANDING):
            if not np.any(normal[closed] @ v < -slow):
                break
            found = impact(free, v, np.flatnonzero(closed).tolist(), self._restitution())
            if found is None:
                return False
            self._jump(v, found)
            self._catch(v, closed, slow)
        else:
            return False
        motion = self._motion(closed, touch, slow)
        if motion is None:
            # no forces can hold what slips: impulses stop it (Painleve's paradox)
            step = self._short_step(v, closed)
            if step is None:
                return False
            self._jump(v, Impact(step.impulse, v + (system.J / system.mass).T @ step.impulse, step.state))
            self._stop(v, step)
            motion = self._motion(closed, touch, slow)
        if motion is None:
            return False
        self.motion, self.state, self.record.state = motion, motion.state, motion.state
        watched = motion.order != NEVER
        self.guard, self.order = motion.guard[watched], motion.order[watched]
        self.record.turning(self.time, self.y)
        return True

    def _motion(self, closed: np.ndarray, touch: np.ndarray, slow: float) -> Motion | None:
        """Return the motion that begins now, with speeds that are round-off set to zero."""
        free, system, v = self.free, self.system, self.y[self.free.v]
        rows = [*np.flatnonzero(closed), *(free.u + np.flatnonzero(np.r_[closed, ~free.contact[system.contacts :]]))]
        still = [row for row in rows if abs(system.J[row] @ v) <= slow]
        self._bring(v, system.J[still], system.J[still] @ v)
        now = free.extended(self.time, self.y[: free.size])
        sizes = np.concatenate([self.sizes[: free.size], np.ones(free.extent - free.size)])
        return decide(free, now, sizes, self.state, touch, slow)

    def _restitution(self) -> np.ndarray:
        """Return the coefficients (u,): impacts that follow each other at once end without rebound."""
        collapses = self.time - self.struck < self.AT_ONCE * self.system.period
        return np.where(collapses, 0.0, self.system.restitution)

    def _jump(self, v: np.ndarray, found: Impact) -> None:
        """Change the velocities, in place, by an impact."""
        self.record.impact(self.time, v, found)
        self.struck[(found.impulse[: self.free.u] > 0.0) & (self.free.normal @ v < 0.0)] = self.time
        v[:] = found.v

    def _bring(self, values: np.ndarray, rows: np.ndarray, off: np.ndarray) -> None:
        """Take from coordinates or velocities (N,), in place, what rows (k, N) are off zero."""
        if np.any(off != 0.0):
            root = np.sqrt(self.system.mass)
            values -= np.linalg.pinv(rows / root, rcond=1e-9) @ off / root

    def _catch(self, v: np.ndarray, closed: np.ndarray, slow: float) -> None:
        """Stop contacts that part for a flight shorter than _CHATTER: all that push in a step of that length."""
        step = self._short_step(v, closed)
        if step is not None and np.any((step.impulse[: self.free.u] > 0.0) & (self.free.normal @ v > slow)):
            self._stop(v, step)

    def _short_step(self, v: np.ndarray, closed: np.ndarray) -> Impact | None:
        """Return the impulses of a step of Moreau's scheme of length _CHATTER, without restitution."""
        free, system = self.free, self.system
        accelerations = free.accelerations @ free.extended(self.time, np.concatenate([self.y[free.q], v]))
        slides = np.where(free.contact | free.sprung, 0.0, -system.limit * np.sign(free.slip @ v))
        accelerations += (free.slip / system.mass).T @ slides
        ahead = v + _CHATTER * system.period * accelerations
        return impact(free, ahead, np.flatnonzero(closed).tolist(), np.zeros(free.u))

    def _stop(self, v: np.ndarray, step: Impact) -> None:
        """Stop, in place, the contacts that push in a step, and the slips of those that stick."""
        free = self.free
        pushed = np.flatnonzero(step.impulse[: free.u] > 0.0)
        stuck = [r for r in pushed if step.state[r] == STICK and free.rubs[r]]
        rows, before = np.vstack([free.normal[pushed], free.slip[stuck]]), v.copy()
        self._bring(v, rows, rows @ v)
        self.record.stopped(before, v)
