"""A general solver of differential equations with events: scipy's DOP853, stopped at every change of contact.

An independent check of the exact engine: it has a scene's units in common (coupling.system.units) and the table
of their laws (coupling.system.unit_laws), but neither motion nor search nor decisions nor the solution of impacts.
Closed contacts and what sticks are constraints on accelerations (methods.scipy_ivp.motion,
methods.scipy_ivp.contact_states), impacts jumps between two integrations (methods.scipy_ivp.impacts); events are
searched on the solver's interpolant, where none can be missed (methods.scipy_ivp.root_search). Energies and harmonics
are integrated along (methods.scipy_ivp.recorder).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from vanedamp.coupling.methods.scipy_ivp import Options
from vanedamp.coupling.methods.scipy_ivp.contact_states import decide
from vanedamp.coupling.methods.scipy_ivp.impacts import ImpactSolution, impact
from vanedamp.coupling.methods.scipy_ivp.motion import NEVER, ROUND_OFF, LinearMotion, States, Unforced
from vanedamp.coupling.methods.scipy_ivp.recorder import Recorder
from vanedamp.coupling.methods.scipy_ivp.root_search import NODES, first_root
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, STICK
from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.event_log import rows_of_line, rows_of_units
from vanedamp.coupling.response.plane import plane_of
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.assembly import Coordinates
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.coupling.system.system import System

#: events without time between them before the run is given up
_STANDING = 100
#: imbalance of the energies above which a response is not to be used, in units of rtol or of _LEAST
_OPEN_LEDGER, _LEAST = 1e3, 1e-9
#: the shortest first step, as a fraction of a period
_SHORTEST = 1e-26
#: fraction of a period without events in which events happen at once: impacts are the end of a collapse; fraction of a
#: period for which gaps of sliders are known beyond the round-off of positions, after a collision
_AT_ONCE, _FRESH = 1e-13, 1e-9
#: gaps below this fraction of the play are closed at the start; above this one they are taken from the coordinates
_TOUCHING, _FAR = 1e-12, 1e-6
#: speeds below this fraction of the run's largest count as zero
_STILL = 1e-11
#: flights shorter than this fraction of a period, and all that follow them, are the end of a chatter; of elastic
#: contacts, the part of it that a flight must last
_CHATTER, _ELASTIC = 3e-7, 0.1
#: a contact that parts by so many times the speed that the loads give the contacts in such a flight does not end one
_FAST = 100.0
#: motions that are kept, by the states of the units
_KEPT = 256


class Arc(NamedTuple):
    """Motion between two events: states (size, k) at the points t (k,) of a grid, and its end.

    event: index of the event function, None at the end of the grid; duration, last: time since the start, state there.
    """

    t: np.ndarray
    y: np.ndarray
    event: int | None
    duration: float
    last: np.ndarray
    evaluations: int
    failed: bool = False


class IvpRun:
    """A run by solve_ivp: state y = (q, v, integrals), states of the units. Times count from the period's start."""

    def __init__(self, system: System, options: Options, initial: Coordinates, records: Records, events: bool) -> None:
        self.system, self.options, self.steps = system, options, options.steps_per_period
        self.free = free = Unforced(system)
        self.record = record = Recorder(free, records, self.steps, events)
        gaps, zeros = free.gaps(initial.q), np.zeros(2 * free.u + record.count)
        gaps[np.abs(gaps) <= _TOUCHING * system.play] = 0.0
        self.y = np.concatenate([initial.q, initial.v, gaps, zeros])
        self.sizes = record.sizes()
        self.absolute = options.rtol * self.sizes
        self.time, self.step = 0.0, system.period / self.steps
        self.standing, self.events, self.evaluations, self.fastest = 0, 0, 0, system.speed
        self.begun = False
        self.state, self.struck = np.full(free.u, OPEN), np.full(free.u, -np.inf)  # times of the last impacts
        self.motion: LinearMotion
        self.guard, self.order, self.watched = np.zeros((0, free.extent)), np.zeros(0, int), np.zeros(0, int)
        self.motions = lru_cache(_KEPT)(lambda states: LinearMotion(free, states))
        self.linear = lru_cache(_KEPT)(self._linear)

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        if not self.begun:
            self.begun = True
            if not self._decide():
                return Status.UNDECIDED
            self.record.section(self.y)
            self.record.start(self.y)
        with np.errstate(all="ignore"):
            while self.record.period < periods:
                if self.events >= self.options.max_events:
                    return Status.EVENT_BUDGET
                status = self._segment()
                if status is not Status.OK:
                    return status
        return Status.OK

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        record, system = self.record, self.system
        rows, plane = rows_of_line(system), None
        if system.in_plane:
            rows = rows_of_units(system)
            plane = plane_of(system, record.records, self.options.linearisation)
        numbers = {"impacts": record.impacts, "changes": self.events, "evaluations": self.evaluations}
        log, bound = [np.array(record.log)] if record.log else [], _OPEN_LEDGER * max(self.options.rtol, _LEAST)
        return Outcome(
            system, record.records, record.period, record.impacts, bound, numbers, log, rows, max(record.deep, 0.0),
            plane,
        )  # fmt: skip

    def final(self) -> None:
        """Return None: the states of contacts are no part of a motion that another run could begin with."""

    # -- motion between events

    def _segment(self) -> Status:
        """Integrate to the next event or to the end of the period."""
        grid = np.arange(1, self.steps + 1) * self.step
        grid = grid[grid > self.time]
        if not len(grid):  # an event has fallen on the period's end
            return self._end_period()
        arc = self._integrate(grid)
        self.evaluations += arc.evaluations
        if arc.failed or not np.isfinite(arc.last).all():
            return Status.DIVERGED
        self.record.points(arc.t, arc.y)
        if self.record.deep > self.options.penetration:
            return Status.PENETRATION
        self.time, self.y = self.time + arc.duration, arc.last
        self.record.flight(arc.duration)
        if arc.event is None:
            self.order = np.zeros_like(self.order)
            return self._end_period()
        self.events += 1
        self.standing = self.standing + 1 if arc.duration < _AT_ONCE * self.system.period else 0
        unit, instead = self.motion.wrong[self.watched[arc.event]]
        if self.state[unit] == OPEN or (self.state[unit] == LEAVING and instead == OPEN):
            self.y[self.free.d][unit] = 0.0
        return Status.OK if self.standing <= _STANDING and self._decide() else Status.UNDECIDED

    def _end_period(self) -> Status:
        self.time = 0.0
        self.struck -= self.system.period
        self.record.end_period(self.y)
        return Status.OK

    def _integrate(self, grid: np.ndarray) -> Arc:
        """Return the motion from now to the first event, or to the end of the grid, by scipy's DOP853."""
        free, time, order, far = self.free, self.time, self.order, grid - self.time
        solver = DOP853(
            lambda tau, y: self.rate(time + tau, y), 0.0, self.y, far[-1], max_step=self.step,
            rtol=self.options.rtol, atol=self.absolute, first_step=min(self._first_step(), far[-1]),
        )  # fmt: skip
        states, reached, root = [], 0, None
        while solver.status == "running" and root is None:
            solver.step()
            if solver.status == "failed":
                return Arc(grid[:0], self.y[:, None][:, :0], None, 0.0, self.y, solver.nfev, True)
            piece, now, last = solver.dense_output(), solver.t, solver.y
            if len(order):
                at = solver.t_old + NODES * (solver.t - solver.t_old)
                root = first_root(self.guard @ free.extended(time + at, piece(at)[: free.size]), order)
            if root is not None:
                now = solver.t_old + root[0] * (solver.t - solver.t_old)
                last = piece(now)
            # an event may fall on a point of the grid, which round-off must not leave out
            passed = np.count_nonzero((far <= now) | (grid <= time + now))
            states += [piece(tau) for tau in far[reached:passed]]
            order, reached = np.zeros_like(order), passed
        points = np.array(states).reshape(reached, len(self.y)).T
        return Arc(grid[:reached], points, None if root is None else root[1], now, last, solver.nfev)

    def _first_step(self) -> float:
        """Return twice the time to the first event by the functions' parabolas: round-off is the flight's, s."""
        now = self.free.extended(self.time, self.y[: self.free.size])
        # rows that open by the third derivative have round-off accelerations
        early = self.order < 3
        guard, order, rate = self.guard[early], self.order[early], self.motion.rate @ now
        value = np.where(order > 0, 0.0, guard @ now)
        slope, curvature = guard @ rate, guard @ (self.motion.rate @ rate)
        with np.errstate(all="ignore"):
            root = np.sqrt(slope**2 - 2 * curvature * value)
            times = np.where(slope > 0, -(slope + root) / curvature, 2 * value / (root - slope))
        times = times[np.isfinite(times) & (times > 0)]
        return float(np.clip(2 * times.min(initial=np.inf), _SHORTEST * self.system.period, self.step))

    def _linear(self, states: States) -> np.ndarray:
        motion = self.motions(states)
        return np.concatenate([motion.rate[: self.free.size], self.record.functionals(motion)])

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the rates of the state and of the integrals."""
        size, extent, z, phase = self.free.size, self.free.extent, self.found, self.system.frequency * t
        z[:size], z[size] = y[:size], 1.0
        np.cos(phase, out=z[self.free.cosine])
        np.sin(phase, out=z[self.free.sine])
        values = self.matrix @ z[:extent]
        z[extent:] = values[size:]
        return np.concatenate([values[:size], self.record.rates(z)])

    # -- events

    def _decide(self) -> bool:
        """Apply impacts, then decide the states. Returns False if nothing is possible."""
        free, system = self.free, self.system
        q, v = self.y[free.q], self.y[free.v]
        self.record.turning(self.time, self.y)
        self.sizes[: free.size] = np.maximum(self.sizes[: free.size], np.abs(self.y[: free.size]))
        self.fastest = max(self.fastest, float((np.abs(system.J) @ np.abs(v)).max(initial=0.0)))
        slow, gaps = _STILL * self.fastest, free.gaps(q)
        fresh = self.time - self.struck < _FRESH * system.period
        # a contact of sliders that has been struck, or opens, is no part of another's impact
        apart = free.rigid & ~free.extends & (fresh | (free.normal @ v > slow))
        touch = np.where(apart, 0.0, free.touch(self.sizes[free.q]))
        d = self.y[free.d] = np.where(gaps > _FAR * system.play, gaps, self.y[free.d])
        closed = np.flatnonzero(free.rigid & ((self.state != OPEN) | (d <= touch)))
        self._bring(q, free.normal[closed], gaps[closed])
        d[closed] = 0.0
        self.y[free.d] = np.where(np.abs(d) <= touch, 0.0, d)
        for _ in range(_STANDING):
            if not np.any(free.normal[closed] @ v < -slow):
                break
            solution = impact(free, v, closed.tolist(), self._restitution(v, closed))
            if solution is None:
                return False
            self._jump(v, solution)
            if self.options.complete_chatter:
                self._catch(v, closed, slow)
        else:
            return False
        chosen = self._motion(closed, touch, slow)
        if chosen is None:
            # no forces hold the slip: impulses stop it (Painleve's paradox)
            step = impact(free, self._ahead(v, closed), closed.tolist(), np.zeros(free.u))
            if step is None:
                return False
            self._jump(v, ImpactSolution(step.impulse, v + free.respond @ step.impulse, step.state))
            self._stop(v, step)
            chosen = self._motion(closed, touch, slow)
        if chosen is None:
            return False
        self.motion, order = chosen
        self.state, self.watched = self.motion.state, np.flatnonzero(order != NEVER)
        self.guard, self.order = self.motion.guard[self.watched], order[self.watched]
        self.matrix = self.linear(tuple(self.state.tolist()))
        self.found = np.empty(free.extent + len(self.matrix) - free.size)
        self.record.turning(self.time, self.y)
        self.record.follow(self.time, self.y, self.motion)
        return True

    def _motion(self, closed: np.ndarray, touch: np.ndarray, slow: float) -> tuple[LinearMotion, np.ndarray] | None:
        """Return the motion that begins now, and the orders of its zeros. Speeds that are round-off are set to zero.

        touch: (u,) gaps that count as zero, m; slow: speed that counts as zero, m/s.
        """
        free, J, v = self.free, self.system.J, self.y[self.free.v]
        slips = np.union1d(closed, np.flatnonzero(~free.contact))
        rows = np.r_[closed, free.u + slips]
        still = rows[np.abs(J[rows] @ v) <= slow]
        self._bring(v, J[still], J[still] @ v)
        speed = J @ v
        speed[still] = 0.0
        self.y[free.s] = np.where(np.abs(speed) <= slow, 0.0, speed)
        sizes = np.ones(free.extent)
        sizes[: free.size] = self.sizes[: free.size]
        # values below these bounds are zero already
        sizes[free.d], sizes[free.s] = 0.5 * touch / ROUND_OFF, 0.5 * slow / ROUND_OFF
        now = free.extended(self.time, self.y[: free.size])
        return decide(free, self.motions, now, sizes, self.state, slow)

    def _restitution(self, v: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """Return the coefficients (u,): impacts that follow each other at once end without rebound."""
        coefficients = np.zeros(self.free.u)
        coefficients[closed] = restitutions_at(self.system, closed, -self.free.normal[closed] @ v)
        collapses = self.time - self.struck < _AT_ONCE * self.system.period
        return np.where(collapses, 0.0, coefficients)

    def _jump(self, v: np.ndarray, solution: ImpactSolution) -> None:
        """Change the velocities, in place, by an impact."""
        self.record.impact(self.time, v, solution)
        self.struck[(solution.impulse[: self.free.u] > 0.0) & (self.free.normal @ v < 0.0)] = self.time
        v[:] = solution.v

    def _bring(self, values: np.ndarray, rows: np.ndarray, off: np.ndarray) -> None:
        """Take from coordinates or velocities (N,), in place, what rows (k, N) are off zero."""
        if np.any(off != 0.0):
            root = np.sqrt(self.system.mass)
            values -= np.linalg.pinv(rows / root, rcond=1e-9) @ off / root

    def _catch(self, v: np.ndarray, closed: np.ndarray, slow: float) -> None:
        """Stop contacts that part for a flight shorter than _CHATTER: all that push in a step of that length."""
        normal, ahead = self.free.normal, self._ahead(v, closed)
        leaving = normal[closed] @ v
        leaving = leaving[leaving > slow]
        if leaving.min(initial=np.inf) < _FAST * np.abs(normal @ (ahead - v)).max(initial=0.0):
            step = impact(self.free, ahead, closed.tolist(), np.zeros(self.free.u))
            if step is not None and np.any((step.impulse[: self.free.u] > 0.0) & (normal @ v > slow)):
                self._stop(v, step)

    def _ahead(self, v: np.ndarray, closed: np.ndarray) -> np.ndarray:
        """Return the velocities (N,) after half of a flight by the loads, without impulses of closed contacts.

        With those that follow it the flight takes _CHATTER: a chatter takes 1/(1 - k) times its next flight.
        """
        free, system = self.free, self.system
        z = self.y[: free.size].copy()
        z[free.v], z[free.s] = v, system.J @ v
        now = free.extended(self.time, z)
        accelerations = free.accelerations @ now
        forces = np.zeros(2 * free.u)
        pressed = free.soft & (self.state != OPEN)
        forces[: free.u][pressed] = np.maximum(free.push[pressed] @ now, 0.0)
        bounds = np.where(free.sprung, 0.0, system.limit + system.friction * forces[: free.u])
        forces[free.u :] = -bounds * np.sign(free.slip @ v)
        leaving = closed[free.normal[closed] @ v > 0.0]
        rebounds = restitutions_at(system, leaving, free.normal[leaving] @ v)
        last = np.maximum(1.0 - rebounds, _ELASTIC).min(initial=1.0)
        ahead: np.ndarray = v + 0.5 * last * _CHATTER * system.period * (accelerations + free.respond @ forces)
        return ahead

    def _stop(self, v: np.ndarray, step: ImpactSolution) -> None:
        """Stop, in place, the contacts that push in a step, and the slips of those that stick."""
        free = self.free
        pushed = np.flatnonzero(step.impulse[: free.u] > 0.0)
        stuck = [r for r in pushed if step.state[r] == STICK and free.rubs[r]]
        rows, before = np.vstack([free.normal[pushed], free.slip[stuck]]), v.copy()
        self._bring(v, rows, rows @ v)
        self.record.stopped(before, v)
