"""A general solver of differential equations with events: scipy's DOP853, stopped at every change of contact.

An independent witness of the exact engine: it shares the rows of a scene with it, and the solution of complementarity
problems, but neither motion nor search nor decisions. Impacts are jumps between two integrations, closed contacts and
sticking bodies constraints on accelerations (methods.scipy_ivp.motion, methods.scipy_ivp.contact_states,
methods.scipy_ivp.impacts); events are searched on the solver's interpolant, where none can be missed
(methods.scipy_ivp.root_search). Energies and harmonics are integrated along (methods.scipy_ivp.integrals).
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.scipy_ivp import Options
from vanedamp.coupling.methods.scipy_ivp.arcs import Arc, first_step, integrate
from vanedamp.coupling.methods.scipy_ivp.contact_states import decide
from vanedamp.coupling.methods.scipy_ivp.event_loop import STANDING, EventLoop
from vanedamp.coupling.methods.scipy_ivp.impacts import COLLAPSE, FRESH, TOUCH, simultaneous_impacts, zero_round_off
from vanedamp.coupling.methods.scipy_ivp.integrals import Recorder
from vanedamp.coupling.methods.scipy_ivp.motion import (
    GAP,
    HIGH,
    LOW,
    OPENS,
    REST,
    SLIP,
    UNFORCED,
    Contacts,
    Motion,
    Unforced,
)
from vanedamp.coupling.numerics.complementarity import new_problem
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.line_system import LineSystem, row_motion
from vanedamp.coupling.system.system import System

#: the shortest first step, as a share of a period
_SHORTEST = 1e-26
#: gaps below this share of the free travel are closed at the start
_TOUCHING = 1e-12


class IvpRun(EventLoop):
    """A run by solve_ivp: state y = (z, integrals) and the states of the rows. Times count from the period's start."""

    AT_ONCE = COLLAPSE

    def __init__(
        self, whole: System, system: LineSystem, start: RestartState, options: Options, records: Records,
        events: bool,
    ) -> None:  # fmt: skip
        self.system = system
        self.unforced = u = Unforced(system)
        record = Recorder(u, records, options.steps_per_period, events)
        super().__init__(whole, rows_of_line(whole), options, record, np.zeros(u.size + record.count))
        p, rate = start.displacement / system.scale, start.velocity / system.scale
        self.y[u.p], self.y[u.p_rate] = p, rate
        self.y[u.d], self.y[u.s] = row_motion(system, start.slip, start.slip_velocity, p, rate, start.elongation)
        self.problem = new_problem(u.r)
        self.since = np.full(u.r, np.inf)  # s, since each contact's last impact
        nothing = np.zeros(u.r, int)
        self._follow(Contacts(nothing + UNFORCED, nothing.astype(float), nothing, nothing))
        self.absolute = options.rtol * self.record.sizes(_reach(u))

    def _begin(self) -> bool:
        place = self.y[self.unforced.d]
        contacts = slice(self.system.friction_rows, None)
        gap = place[contacts]
        gap[np.abs(gap) <= _TOUCHING * self.system.free_travel[contacts]] = 0.0
        decided = self._decide(-1, -1)
        self.record.start(self.y)
        return decided

    # -- motion between events

    def _pass(self, duration: float) -> None:
        self.since += duration

    def _go_on(self) -> None:
        self.guards.order[:] = 0

    def _happen(self, event: int) -> bool:
        return self._decide(int(self.guards.row[event]), int(self.guards.kind[event]))

    def _integrate(self, grid: np.ndarray) -> Arc:
        """Return the motion from now to the first event, or to the end of the grid."""
        u, guards = self.unforced, self.guards
        return integrate(
            self.rate, self.y, self.time, grid, lambda t, y: guards.functional @ u.extended(t, y[: u.size]),
            guards.order, self.options.rtol, self.absolute, self._first_step(), self.step,
        )  # fmt: skip

    def _first_step(self) -> float:
        u, guards = self.unforced, self.guards
        now = u.extended(self.time, self.y[: u.size])
        rate = u.rates(self.motion, now)
        value = np.where(guards.order > 0, 0.0, guards.functional @ now)
        slope, curvature = guards.functional @ rate, guards.functional @ u.rates(self.motion, rate)
        return first_step(value, slope, curvature, _SHORTEST * self.system.period, self.step)

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the rates of the state and of the integrals."""
        u, phase = self.unforced, self.system.frequency * t
        self._extended[: u.size] = y[: u.size]
        self._extended[u.cosine], self._extended[u.sine] = np.cos(phase), np.sin(phase)
        found = self._linear @ self._extended
        return np.concatenate([found[: u.size], self.record.rates(self._extended, found[u.size :])])

    # -- events

    def _decide(self, row: int, kind: int) -> bool:
        """Apply impacts, then decide the contact states. Returns False if a complementarity problem has no solution."""
        u, z = self.unforced, self.y[: self.unforced.size]
        self._arrive(row, kind, z)
        self.record.turning(self.time, self.y)
        self._zero_round_off(z)
        for _ in range(STANDING):
            # an impact may close gaps that are about to
            if not np.any(u.rigid_contact & (z[u.d] == 0) & (z[u.s] < 0)):
                break
            if not self._impact(z):
                return False
            self._zero_round_off(z)
        else:
            return False
        self.record.turning(self.time, self.y)
        contacts = decide(u, self.time, z)
        if contacts is None:
            return False
        self.record.springs(self.time, self.y, self.motion.contacts.state, contacts.state)
        self._follow(contacts)
        return True

    def _follow(self, contacts: Contacts) -> None:
        u = self.unforced
        self.motion = Motion(u, contacts)
        self.guards = self.motion.guards()
        self._linear = np.vstack([self.motion.rate, self.motion.force, self.record.functionals])
        self._extended = np.ones(u.extent)
        self.record.states = contacts.state

    def _arrive(self, row: int, kind: int, z: np.ndarray) -> None:
        """Set the value that the event has brought to zero, or to its bound, exactly."""
        u, system = self.unforced, self.system
        if kind in (GAP, OPENS) or (kind == LOW and u.soft_contact[row] and system.dashpot[row] == 0):
            z[u.d.start + row] = 0.0
        elif kind == SLIP:
            z[u.s.start + row] = 0.0
        elif kind in (LOW, HIGH) and u.slider[row]:
            z[u.d.start + row] = (1 if kind == LOW else -1) * u.limit[row] / system.spring[row]

    def _zero_round_off(self, z: np.ndarray) -> None:
        """Zero to the round-off of the run's largest speed is zero: two slips may come to rest together."""
        self.fastest = max(self.fastest, float(np.abs(z[self.unforced.s]).max(initial=0.0)))
        # gaps of contacts that have just collided are known beyond the round-off of places
        touch = np.where(self.since > FRESH * self.system.period, TOUCH * self.system.period, 0.0)
        zero_round_off(self.unforced, z, self.fastest, touch)

    def _impact(self, z: np.ndarray) -> bool:
        u, system, complete = self.unforced, self.system, self.options.complete_chatter
        pressing, resting, collapsed = np.zeros(u.r), np.zeros(u.r, bool), np.zeros(u.r, bool)
        if complete:
            extended = u.extended(self.time, z)
            resting = self.motion.contacts.state == REST
            push = np.diag(system.delassus) * (self.motion.force @ extended)
            pressing = np.where(resting, push, -(self.motion.rate[u.s] @ extended))
            collapsed = self.since < COLLAPSE * system.period
        impact = simultaneous_impacts(u, z, pressing, resting, collapsed, self.problem)
        if impact is None:
            return False
        self.since[impact.row[impact.before < 0]] = 0.0
        self.record.impact(self.time, impact)
        return True


def _reach(u: Unforced) -> float:
    """Return a typical displacement, m: narrowest gap, least elongation at which a spring slides, or the static one."""
    system = u.system
    contacts = slice(system.friction_rows, None)
    stops = (system.left_body[contacts] < 0) & (system.right_body[contacts] < 0)
    gaps = np.where(stops, system.rest[contacts], system.free_travel[contacts])
    lengths = [*gaps, *(u.limit[u.slider] / system.spring[u.slider])]
    lengths = [length for length in lengths if length > 0]
    modes = system.of_structure
    static = np.abs(modes.J) @ (np.abs(modes.load).sum(axis=0) / modes.stiffness)
    return float(min(lengths, default=static.max(initial=1e-12)))
