"""A general solver of differential equations with events: scipy's DOP853, stopped at every change of contact.

Impacts are jumps between two integrations, closed contacts and sticking bodies constraints on accelerations; new states
come from the same complementarity problem as the exact engine's. Events are sign changes between step ends: what comes
and goes within a step is missed, which the check of penetration tells. Energies and harmonics are integrated along.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from coupling import state as st
from coupling import system as sy
from coupling.complementarity import AT_HIGH, AT_LOW, solve_box
from coupling.evaluation import Outcome
from coupling.inputs import InputError
from coupling.response import Status
from coupling.rows import rows_of
from coupling.scene import Scene
from coupling.structure import linear_structure

_OPEN, _CLOSED, _SLIDING, _STICKING, _FREE = range(5)
#: gaps below this share of the free travel are closed, speeds below this share of the fastest are rest
_TOUCH = 1e-9
#: a gap or a slip of this share is on its side of zero, and no more
_ROUND_OFF = 1e-13
#: rebounds below this share of gap times angular frequency are the end of a chatter
_SETTLED = 1e-6
#: events without time between them before the run is given up
_STANDING = 100
#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 1e-5
#: columns of the integrals that go along with the state
_EXCITATION, _VISCOUS, _FRICTION, _CONTACT, _SQUARE, _COS, _SIN, _MOMENTUM_COS, _MOMENTUM_SIN = range(9)

Function = Callable[[float, np.ndarray], float]


class Watch(NamedTuple):
    """An event function of row r, what it stands for, and the direction of its zero."""

    row: int
    kind: str
    direction: int
    value: Function


class Arc(NamedTuple):
    """Motion between two events: states (size, k) at k times, and the watch whose event has ended it, if any."""

    t: np.ndarray
    y: np.ndarray
    event: int | None
    event_time: float
    event_state: np.ndarray
    evaluations: int
    failed: bool


class IvpRun:
    """A run by solve_ivp: state y = (q, v, integrals), contact states of the rows."""

    def __init__(self, scene: Scene, events: bool, samples_per_period: int) -> None:
        """Raises InputError for Jenkins elements."""
        if any(damper.stiffness is not None for damper in scene.friction_damper):
            raise InputError("friction_damper.stiffness: solve_ivp knows no springs before sliders; leave it out")
        self.solver, self.steps = scene.solver, scene.solver.steps
        structure = linear_structure(scene)
        self.rows, displacement, velocity = rows_of(scene, structure)
        rows = self.rows
        self.system, motion = sy.start(
            sy.system_of(scene, rows), rows, displacement, velocity, structure.displacement, structure.velocity
        )
        system = self.system
        self.size, self.time = len(motion.q), 0.0
        self.y = np.concatenate([motion.q, motion.v, np.zeros(9)])
        self.records = st.new_records(rows, scene.time.periods, samples_per_period)
        self.keep = events
        self.chunks: list[tuple[float, ...]] = []
        self.last = (0.0, 0.0, 0.0)  # time, displacement and velocity of the response
        self.state = np.array(
            [
                _OPEN if r >= system.friction_rows else (_SLIDING if system.limit[r] > 0 else _FREE)
                for r in range(len(system.J))
            ]
        )
        self.sign = np.ones(system.friction_rows)
        # compliant contacts beyond their gap: the direction of the next zero is known, round-off cannot repeat the last
        self.pressed = np.isfinite(system.spring) & (system.J @ motion.q + system.offset < 0)
        self.standing = 0
        self.direct = system.J / system.mass
        self.period, self.impacts, self.events, self.evaluations, self.deep = 0, 0, 0, 0, 0.0
        self.fastest, self.impact_loss, self.begun = 0.0, 0.0, False
        self.problem = st.new_problem(len(system.J))
        self.reach = self._reach(scene)

    def _reach(self, scene: Scene) -> float:
        """A typical displacement, m, for tolerances and for what counts as rest."""
        rows = self.rows
        gaps = [cavity.gap for cavity in scene.cavity]
        linear = abs(self.system.load[:, 0] + 1j * self.system.load[:, 1]) / self.system.mass / rows.omega**2
        return float(min(gaps)) if gaps else float(linear.max(initial=1e-12))

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, or to what ends the run."""
        end = periods * self.rows.period
        if not self.begun:
            self.begun = True
            self._record()
            if len(self.records.samples):
                q = self.y[: self.size]
                self.records.samples[0] = [self._response(0.0, q), *(self.system.J[: len(self.rows.mass)] @ q)]
            if not self._decide(self.time, -1, ""):
                return Status.UNDECIDED
        with np.errstate(all="ignore"):
            while self.period < periods:
                if self.events >= self.solver.max_events:
                    return Status.EVENT_BUDGET
                status = self._segment(end)
                if status is not Status.OK:
                    return status
        return Status.OK

    def outcome(self) -> Outcome:
        """What the run leaves behind."""
        numbers = {"impacts": self.impacts, "evaluations": self.evaluations}
        log = [np.array(self.chunks)] if self.chunks else []
        return Outcome(
            self.rows, self.records, self.period, self.events, _OPEN_LEDGER, numbers, log, max(self.deep, 0.0)
        )

    # -- motion between events

    def _segment(self, end: float) -> Status:
        """Integrate to the next event or to the end of the run; record the periods that this completes."""
        period, watches = self.rows.period, self._watches()
        step = period / self.steps
        first = int(np.floor(self.time / step * (1 + 1e-14) + 1e-9)) + 1
        grid = np.arange(first, round(end / step) + 1) * step
        grid = grid[: 4 * self.steps]
        grid = grid[grid > self.time]
        if not len(grid):
            grid = np.array([self.time + step])
        found = self._integrate(grid, watches)
        self.evaluations += found.evaluations
        if found.failed or not np.isfinite(found.y).all():
            return Status.DIVERGED
        if len(found.t):
            self._grid(found.t, found.y)
            if self.deep > self.solver.deepest:
                return Status.PENETRATION
        if found.event is None:
            self.time, self.y = float(grid[-1]), found.y[:, -1].copy()
            return Status.OK
        before, self.time = self.time, found.event_time
        self.y = found.event_state.copy()
        who = found.event
        self.events += 1
        self.standing = self.standing + 1 if self.time - before < 1e-13 * period else 0
        if self.standing > _STANDING:
            return Status.UNDECIDED
        decided = self._decide(self.time, watches[who].row, watches[who].kind)
        return Status.OK if decided else Status.UNDECIDED

    def _integrate(self, grid: np.ndarray, watches: list[Watch]) -> Arc:
        """The motion from now to the first event, or to the end of the grid."""
        tolerance = self.solver.rtol or 1e-9
        found = solve_ivp(
            self._rate, (self.time, grid[-1]), self.y, "DOP853", t_eval=grid, events=[_event(w) for w in watches],
            rtol=tolerance, atol=self._tolerance(tolerance), max_step=self.rows.period / self.steps,
        )  # fmt: skip
        states = np.reshape(found.y, (len(self.y), -1)) if len(found.t) else np.zeros((len(self.y), 0))
        who = next((i for i, times in enumerate(found.t_events) if len(times)), None) if found.status == 1 else None
        event = (0.0, self.y) if who is None else (float(found.t_events[who][-1]), found.y_events[who][-1])
        return Arc(found.t, states, who, *event, int(found.nfev), found.status < 0)

    def _tolerance(self, relative: float) -> np.ndarray:
        size, omega = self.size, self.rows.omega
        place = np.full(size, relative * self.reach)
        # modal coordinates have the structure's unit: metres times the root of a mass
        for i in range(self.system.modes):
            largest = np.abs(self.system.J[:, i]).max(initial=0.0) or np.abs(self.system.response[i])
            place[i] = relative * self.reach / max(largest, 1e-300)
        energy = np.abs(self.system.mass[self.system.modes :]).sum() * (omega * self.reach) ** 2 or 1e-300
        span = 1 / omega
        mean = [self.reach**2 * span, self.reach * span, self.reach * span]
        momentum = 2 * [np.abs(self.system.mass[self.system.modes :]).sum() * omega * self.reach * span or 1e-300]
        return np.concatenate([place, omega * place, relative * np.array([energy] * 4 + mean + momentum)])

    def _loads(self, t: float) -> np.ndarray:
        phase = self.rows.omega * t
        load = self.system.load
        forces: np.ndarray = load[:, 0] * np.cos(phase) - load[:, 1] * np.sin(phase) + self.system.weight
        return forces

    def _free(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (N,) without those of closed rows, and the forces (r,) of sliding rows and pressed springs."""
        system = self.system
        force = np.zeros(len(system.J))
        for r in range(len(force)):
            if self.state[r] == _SLIDING:
                force[r] = -self.sign[r] * system.limit[r]
            elif r >= system.friction_rows and np.isfinite(system.spring[r]):
                gap = system.J[r] @ q + system.offset[r]
                if gap < 0:
                    force[r] = max(-system.spring[r] * gap - system.dashpot[r] * (system.J[r] @ v), 0.0)
        total = self._loads(t) - system.damping @ v - system.stiffness * q + force @ system.J
        return total, force

    def _forces(self, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (N,) and forces of all rows (r,)."""
        q, v = y[: self.size], y[self.size : 2 * self.size]
        total, force = self._free(t, q, v)
        closed = self._closed
        if len(closed):
            rest = self.direct[closed] @ total
            matrix = self.rows.delassus[np.ix_(closed, closed)]
            part = -rest[0] / matrix[0, 0] if len(closed) == 1 else np.linalg.lstsq(matrix, -rest, rcond=1e-12)[0]
            force[closed] += part
            total = total + np.atleast_1d(part) @ self.system.J[closed]
        return total / self.system.mass, force

    @property
    def _closed(self) -> np.ndarray:
        return np.flatnonzero((self.state == _CLOSED) | (self.state == _STICKING))

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        size, system, n = self.size, self.system, self.system.modes
        v = y[size : 2 * size]
        acceleration, force = self._forces(t, y)
        phase = self.rows.omega * t
        cosine, sine = np.cos(phase), np.sin(phase)
        x = self._response(t, y[:size])
        speeds = system.J @ v
        load = system.load[:, 0] * cosine - system.load[:, 1] * sine
        momentum = system.mass[n:] @ v[n:]
        friction = -force[: system.friction_rows] @ speeds[: system.friction_rows]
        contact = -force[system.friction_rows :] @ speeds[system.friction_rows :]
        integrals = (
            load @ v, v @ system.damping @ v, friction, contact, x * x, x * cosine, x * sine, momentum * cosine,
            momentum * sine,
        )  # fmt: skip
        return np.concatenate([v, acceleration, integrals])

    def _response(self, t: float, q: np.ndarray) -> float:
        phase = self.rows.omega * t
        table = self.system.table
        return float(self.system.response @ q + table[0] * np.cos(phase) - table[1] * np.sin(phase))

    # -- events

    def _watches(self) -> list[Watch]:
        """What is watched: gaps, slips that may end, forces at their bounds."""
        watches, system, size = [], self.system, self.size
        for r in range(len(system.J)):
            if self.state[r] == _OPEN:

                def gap(_t: float, y: np.ndarray, r: int = r) -> float:
                    return float(system.J[r] @ y[:size] + system.offset[r])

                watches.append(Watch(r, "gap", 1 if self.pressed[r] else -1, gap))
            elif self.state[r] == _SLIDING:

                def slip(_t: float, y: np.ndarray, r: int = r) -> float:
                    return float(self.sign[r] * (system.J[r] @ y[size : 2 * size]))

                watches.append(Watch(r, "slip", -1, slip))
            elif self.state[r] == _STICKING:
                for kind, side in (("low", 1.0), ("high", -1.0)):

                    def room(t: float, y: np.ndarray, r: int = r, side: float = side) -> float:
                        return float(system.limit[r] + side * self._forces(t, y)[1][r])

                    watches.append(Watch(r, kind, -1, room))
            elif self.state[r] == _CLOSED:

                def push(t: float, y: np.ndarray, r: int = r) -> float:
                    return float(self._forces(t, y)[1][r])

                watches.append(Watch(r, "low", -1, push))
        return watches

    def _decide(self, t: float, row: int, kind: str) -> bool:
        """Impacts, then new contact states. Returns False if a complementarity problem has no solution."""
        system, size = self.system, self.size
        q, v = self.y[:size], self.y[size : 2 * size]
        gaps, speeds = system.J @ q + system.offset, system.J @ v
        rest = _TOUCH * self.rows.omega * self.reach
        if kind == "slip":
            self._hasten(row, 0.0)
            speeds = system.J @ v
        if kind == "gap" and np.isfinite(system.spring[row]):
            self.pressed[row] = not self.pressed[row]
            if self.pressed[row]:
                self._count(row, speeds[row], 0.0, 0.0)
            return True
        contacts = np.arange(len(gaps)) >= system.friction_rows
        rigid = contacts & np.isinf(system.spring)
        touching = rigid & (gaps <= _TOUCH * self.reach)
        if kind == "gap":
            touching[row] = True
        if np.any(touching & (speeds < -rest)) and not self._impact(np.flatnonzero(touching), speeds, v):
            return False
        speeds = system.J @ v
        still = touching & (np.abs(speeds) <= rest)
        for r in np.flatnonzero(touching):
            # on the open side of the gap, or the next sign change could not be seen
            self._shift(r, q, _ROUND_OFF * self.reach - (system.J[r] @ q + system.offset[r]))
        return self._settle(t, still, speeds, rest, row, kind)

    def _hasten(self, r: int, speed: float) -> None:
        """Set the speed of row r; what moves is the body, if there is one."""
        v = self.y[self.size : 2 * self.size]
        bodies = np.flatnonzero(self.system.J[r, self.system.modes :])
        if len(bodies):
            i = self.system.modes + bodies[0]
            v[i] += (speed - self.system.J[r] @ v) / self.system.J[r, i]

    def _shift(self, r: int, q: np.ndarray, by: float) -> None:
        i = self.system.modes + np.flatnonzero(self.system.J[r, self.system.modes :])[0]
        q[i] += by / self.system.J[r, i]

    def _impact(self, rows: np.ndarray, speeds: np.ndarray, v: np.ndarray) -> bool:
        """Newton's law at all touching contacts at once."""
        problem, k = self.problem, len(rows)
        restitution = self.system.restitution[rows].copy()
        if self.solver.complete_chatter is not False:
            slow = -restitution * speeds[rows] < _SETTLED * self.rows.omega * self.reach
            restitution[slow] = 0.0
        problem.matrix[:k, :k] = self.rows.delassus[np.ix_(rows, rows)]
        problem.b[:k] = speeds[rows] + restitution * np.minimum(speeds[rows], 0.0)
        problem.low[:k], problem.high[:k], problem.forced[:k] = 0.0, np.inf, 0
        if not solve_box(problem, k, 0.0):
            return False
        impulse = problem.force[:k].copy()
        v += impulse @ self.system.J[rows] / self.system.mass
        after = self.system.J @ v
        self.impact_loss -= 0.5 * float(impulse @ (speeds[rows] + after[rows]))
        for r, push in zip(rows, impulse, strict=True):
            if speeds[r] < 0:
                self._count(r, speeds[r], after[r], push)
        return True

    def _count(self, r: int, before: float, after: float, impulse: float) -> None:
        self.impacts += 1
        self.records.impacts[min(self.period, len(self.records.impacts) - 1)] += 1
        self.records.collided[min(self.period, len(self.records.impacts) - 1)] += (
            0.5 * before**2 / self.rows.delassus[r, r]
        )
        if self.keep:
            self.chunks.append((self.time, st.IMPACT, r, before, after, impulse))

    def _settle(self, t: float, still: np.ndarray, speeds: np.ndarray, rest: float, row: int, kind: str) -> bool:
        """States of contacts without speed and of friction, from the accelerations."""
        system, state = self.system, self.state
        bounds = self._at_bounds(t, speeds, rest, row, kind)
        listed = [int(r) for r in np.flatnonzero(still)]
        for r in range(system.friction_rows):
            if system.limit[r] > 0:
                if abs(speeds[r]) <= rest or (kind == "slip" and r == row):
                    listed.append(r)
                    state[r] = _FREE  # its force is what is looked for
                else:
                    state[r], self.sign[r] = _SLIDING, np.sign(speeds[r])
        state[(state == _CLOSED) | (state == _STICKING)] = _OPEN
        if not listed:
            return True
        total, _ = self._free(t, self.y[: self.size], self.y[self.size : 2 * self.size])
        problem, k, rows = self.problem, len(listed), np.array(listed)
        friction = rows < system.friction_rows
        limit = np.array([system.limit[r] if r < system.friction_rows else np.inf for r in listed])
        problem.matrix[:k, :k] = self.rows.delassus[np.ix_(rows, rows)]
        problem.b[:k] = self.direct[rows] @ total
        problem.low[:k], problem.high[:k] = np.where(friction, -limit, 0.0), limit
        problem.forced[:k] = [bounds.get(int(r), 0) for r in rows]
        # the terms of an acceleration may cancel: what is round-off is told by the size of the motion
        terms = np.abs(self.direct[rows]) @ (np.abs(self.system.load).sum(axis=1) + np.abs(self.system.weight))
        scale = float(max((np.abs(self.direct[rows]) @ np.abs(total)).max(), terms.max()))
        for a in range(k):
            # a force at its bound leaves with an acceleration of round-off: it does leave
            problem.b[a] += {0: 0.0, AT_LOW: 1.0, AT_HIGH: -1.0}[int(problem.forced[a])] * _TOUCH * scale
        if not solve_box(problem, k, scale):
            return False
        for a, r in enumerate(listed):
            bound = problem.state[a] in (AT_LOW, AT_HIGH)
            if r >= system.friction_rows:
                state[r] = _OPEN if bound else _CLOSED
            elif bound:
                state[r], self.sign[r] = _SLIDING, 1.0 if problem.state[a] == AT_LOW else -1.0
                # on its way, or a step that ends beyond the next turn would find the turn at its own start, for ever
                self._hasten(r, self.sign[r] * _ROUND_OFF * self.rows.omega * self.reach)
            else:
                state[r] = _STICKING
        return True

    def _at_bounds(self, t: float, speeds: np.ndarray, rest: float, row: int, kind: str) -> dict[int, int]:
        """Rows whose force has just reached a bound, or has let go there at this instant, when that is the event."""
        if kind not in ("low", "high"):
            return {}
        system, found = self.system, {row: int(AT_LOW if kind == "low" else AT_HIGH)}
        force = self._forces(t, self.y)[1]
        for r in range(system.friction_rows):
            slack = _TOUCH * system.limit[r]
            if self.state[r] == _SLIDING and abs(speeds[r]) <= rest:
                found.setdefault(r, int(AT_LOW if self.sign[r] > 0 else AT_HIGH))
            elif self.state[r] == _STICKING and abs(force[r]) >= system.limit[r] - slack:
                found.setdefault(r, int(AT_LOW if force[r] < 0 else AT_HIGH))
        return found

    # -- records

    def _grid(self, times: np.ndarray, y: np.ndarray) -> None:
        """Peaks, samples, penetration and period ends at points of the grid."""
        system, size, steps = self.system, self.size, self.steps
        each = len(self.records.samples) // max(len(self.records.peak) - 1, 1)
        gaps = system.J @ y[:size] + system.offset[:, None]
        self.deep = max(self.deep, float((-gaps / system.gap[:, None]).max(initial=0.0)))
        self.fastest = max(self.fastest, float(np.abs(y[size : size + system.modes]).max(initial=0.0)))
        for t, state in zip(times, y.T, strict=True):
            index = round(t / self.rows.period * steps)
            x = self._response(t, state[:size])
            rate = self._response_rate(t, state[size : 2 * size])
            last_t, last_x, last_rate = self.last
            largest = max(abs(x), _cubic_peak(t - last_t, last_x, x, last_rate, rate))
            self.records.peak[self.period] = max(self.records.peak[self.period], largest)
            self.last = (t, x, rate)
            if index % steps == 0:
                self.time, self.y = float(t), state.copy()
                self.period = index // steps
                self._record()
            if each and index % (steps // each) == 0 and index // (steps // each) < len(self.records.samples):
                self.records.samples[index // (steps // each)] = [x, *(system.J[: len(self.rows.mass)] @ state[:size])]

    def _response_rate(self, t: float, v: np.ndarray) -> float:
        phase, table, omega = self.rows.omega * t, self.system.table, self.rows.omega
        return float(self.system.response @ v - omega * (table[0] * np.sin(phase) + table[1] * np.cos(phase)))

    def _record(self) -> None:
        """Section and ledger at the start of a period."""
        system, size, n, p = self.system, self.size, self.system.modes, self.period
        q, v, integrals = self.y[:size], self.y[size : 2 * size], self.y[2 * size :]
        slips, speeds, b = system.J @ q, system.J @ v, len(self.rows.mass)
        x, rate = self._response(0.0, q), self._response_rate(0.0, v)
        self.last = (self.time, x, rate)
        self.records.section[p] = [x, rate, system.mass[n:] @ v[n:], *slips[:b], *speeds[:b]]
        springs = np.where(np.isfinite(system.spring), system.spring, 0.0)
        pressed = np.where(np.arange(len(slips)) >= system.friction_rows, np.minimum(slips + system.offset, 0.0), 0.0)
        spring = 0.5 * float(springs @ pressed**2)
        energy = 0.5 * (system.mass * v**2 + system.stiffness * q**2) - system.weight * q
        self.records.parts[p] = [energy[:n].sum() + spring, *energy[n:]]
        ledger = self.records.ledger[p]
        ledger[[st.EXCITATION, st.VISCOUS, st.FRICTION]] = integrals[[_EXCITATION, _VISCOUS, _FRICTION]]
        if p == 0:
            self.spring_before, self.before = spring, integrals.copy()
        ledger[st.CONTACT] = integrals[_CONTACT] - (spring - self.spring_before)
        ledger[st.IMPACT_LOSS], ledger[st.STORED] = self.impact_loss, energy.sum() + spring
        if p > 0:
            change = integrals - self.before
            self.records.square[p - 1] = change[_SQUARE]
            self.records.harmonic[p - 1] = change[_COS] - 1j * change[_SIN]
            self.records.momentum[p - 1] = change[_MOMENTUM_COS] - 1j * change[_MOMENTUM_SIN]
        self.before = integrals.copy()


def _event(watch: Watch) -> Function:
    def function(t: float, y: np.ndarray) -> float:
        return watch.value(t, y)

    function.terminal, function.direction = True, watch.direction  # type: ignore[attr-defined]
    return function


def _cubic_peak(h: float, x0: float, x1: float, rate0: float, rate1: float) -> float:
    """|x| where the straight line through two velocities is zero, on the cubic through both ends; 0 if nowhere."""
    if not rate0 * rate1 < 0:
        return 0.0
    t = rate0 / (rate0 - rate1)
    u = 1 - t
    return abs(x0 * u * u * (1 + 2 * t) + x1 * t * t * (3 - 2 * t) + h * t * u * (u * rate0 - t * rate1))
