"""Passages of scenes of sliders: the engine walked event by event, and the exact derivative of where it leads.

The engine decides everything: times, contact states, impulses. The derivative is built beside it from the equations of
motion (orbits.slider_dynamics) and checks itself: at the end of every segment and after every event the motion that its
own flows predict must be the engine's, and rows at rest must stay so.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.exact.event_driven import EngineRun
from vanedamp.coupling.exact.event_functions import RESOLUTION
from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.exact.subsystem_assembly import Flows
from vanedamp.coupling.numerics.codes import (
    BOUNDED,
    CARRIED,
    CLOSES,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    PERIOD,
    POSITION,
    ROOT,
)
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.saltation import LinearFlow
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.orbits.slider_event import Across, Before, Untrusted, across, impact
from vanedamp.coupling.orbits.slider_names import RowNames
from vanedamp.coupling.orbits.slider_start import clipped, loose
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS, new_records
from vanedamp.coupling.response.restart import fitted
from vanedamp.coupling.response.restart_state import RestartState

#: events a period after which a passage gives up: each is a step of Python
EVENTS_A_PERIOD = 2000
#: largest difference of the engine's motion and that of the derivative's own flows, as a share of the coordinate's size
AGREEMENT = 1e-8
#: share of a coordinate's typical size that counts as its size where it hardly moves
LEAST = 1e-6
#: largest motion of rows at rest by the derivative, and difference of two orders of events, as shares of their terms
STILL, ALIKE = 1e-7, 1e-9
#: points a period between which minima of event functions that do not vanish are sought
LOOKS = 32


class Stopped(ArithmeticError):
    """The engine has not come to the end."""


class Walk:
    """One passage, walked when it is made: `passage`, and the engine's run.

    flows: the engine's subsystems from an earlier walk of the same map, if there was one.
    """

    def __init__(
        self, dynamics: SliderDynamics, names: RowNames, start: RestartState, periods: int, flows: list[Flows]
    ) -> None:
        self._dynamics, self._names, self._periods, self._start = dynamics, names, periods, start
        self._initial = fitted(dynamics.whole, start)
        self._budget = EVENTS_A_PERIOD * periods
        records = new_records(dynamics.whole, periods, 0)
        self.run = EngineRun(dynamics.whole, dynamics.system, self._initial, records, True, self._budget)
        if flows:
            self.run.flows = flows[0]
        self._crossings: list[Crossing] = []
        self._clearance = (np.inf, "")
        self._status = PassageStatus.OK
        #: size of each coordinate so far, and least one that it is compared by
        self._size = LEAST * np.abs(dynamics.from_state) @ dynamics.sizes
        #: largest derivative so far of each coordinate
        self._reach = np.abs(dynamics.from_state).max(axis=1)
        #: flow, state and time at the start of the segment that holds the middle of the first period
        self._middle: tuple[LinearFlow, np.ndarray, float] | None = None
        #: saltation matrix of the last event, and when it was
        self._last: tuple[np.ndarray, float] = np.eye(dynamics.k), -np.inf
        self.passage = self._passed()

    def half_way(self) -> np.ndarray | None:
        """Return the state (k,) half a period after the start; None if the engine has not come so far."""
        if self._middle is None or self.passage.status is PassageStatus.STOPPED:
            return None
        flow, u, time = self._middle
        half, _ = flow.propagate(u, time, 0.5 * self._dynamics.system.period - time)
        return self._dynamics.to_state @ half

    def _passed(self) -> Passage:
        dynamics = self._dynamics
        derivative, arrived = np.full((dynamics.k, dynamics.k), np.nan), True
        try:
            derivative = self._walk()
        except Stopped:
            arrived = False
        except Untrusted:
            arrived = self.run.advance(self._periods, self._budget) == DONE
            self._status = PassageStatus.UNDETERMINED
        return Passage(
            dynamics.to_state @ self._state(), derivative, tuple(self._crossings), self._clearance,
            self._status if arrived else PassageStatus.STOPPED, self.run.records.peak[: self._periods].copy(),
        )  # fmt: skip

    def _walk(self) -> np.ndarray:
        """Walk to the end of the periods. Return the derivative (k, k) of states."""
        dynamics, run, st, period = self._dynamics, self.run, self.run.state, self._dynamics.system.period
        if run.begin(self._budget) != DONE:
            raise Stopped
        u, M = self._begin()
        while st.counters[PERIOD] < self._periods:
            state, applied, time = st.state.copy(), st.applied_force.copy(), float(st.time[0])
            flow = dynamics.flow(state, applied)
            if st.counters[PERIOD] == 0 and time <= 0.5 * period:
                self._middle = flow, u, time
            # what is left there of other segments is no root of this one
            run.event_functions.status[int(st.counters[CARRIED]) :] = BOUNDED
            run.chunks.clear()
            loss = float(st.ledger[IMPACT_LOSS])
            code = run.advance(int(st.counters[PERIOD]) + 1, int(st.counters[EVENTS]) + 1)
            if code not in (DONE, EVENT_BUDGET) or st.counters[EVENTS] > self._budget:
                raise Stopped
            event, tau = (-1, period - time) if code == DONE else self._event(float(st.time[0]) - time)
            self._look_around(flow, state, applied, u, time, tau)
            u, power = flow.propagate(u, time, tau)
            M = power @ M
            if code == DONE:
                u = self._agreed(u)
                continue
            watched = run.event_functions
            at = event, watched.side[event]
            row, order, meaning = int(watched.row[at]), int(watched.order[event]), int(watched.meaning[at])
            before = Before(row, order, meaning, state, flow, u, float(st.time[0]), self._size)
            u, M = self._across(before, M, float(st.ledger[IMPACT_LOSS]) - loss)
        S, then = self._last
        if self._periods * period - then <= SIMULTANEOUS * period and np.abs(S - np.eye(dynamics.k)).max() > ALIKE:
            self._status = PassageStatus.COINCIDENT  # an event at the very end
        derivative: np.ndarray = dynamics.to_state @ M
        return derivative

    def _begin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return state and derivative after the decision of the initial state."""
        dynamics, initial, b = self._dynamics, self._initial, self._dynamics.system.bodies
        given = dynamics.from_state @ np.concatenate([
            initial.displacement, initial.velocity, initial.slip, initial.slip_velocity,
            initial.elongation[dynamics.springs - b],
        ])  # fmt: skip
        moved = np.abs(initial.displacement - self._start.displacement)
        if np.any(moved > SIMULTANEOUS * dynamics.sizes[: len(moved)]):
            self._status = PassageStatus.GRAZING  # the structure would begin beyond a stop
        u, hit = self._state(), np.flatnonzero(self.run.scratch.impulse)
        M = dynamics.from_state @ clipped(dynamics, self._start, initial)
        before, after = dynamics.speed[hit] @ given, dynamics.speed[hit] @ u
        if np.any(np.abs(before) > 1e-12 * np.abs(dynamics.speed[hit]) @ np.abs(given)):
            self._status = PassageStatus.GRAZING  # an impact at the very start, which another state has a period before
            M = impact(dynamics, hit, before, after) @ M
        if loose(dynamics, self.run.state, u):
            self._status = PassageStatus.GRAZING
        return u, dynamics.settled(self.run.state.state) @ M

    def _across(self, before: Before, M: np.ndarray, loss: float) -> tuple[np.ndarray, np.ndarray]:
        """Return state and derivative after an event, and keep it. loss: energy that its impacts took, J."""
        dynamics, st, period = self._dynamics, self.run.state, self._dynamics.system.period
        rigid = bool(np.isinf(dynamics.system.spring[before.row]))
        collides = before.order == POSITION and before.meaning == CLOSES and rigid
        impulse = self.run.scratch.impulse if collides else np.zeros(len(before.state))
        after = self._agreed(before.u + dynamics.kick(impulse))
        met = {int(e[2]): float(e[3]) for chunk in self.run.chunks for e in chunk if e[1] == IMPACT}
        moment, hit = int(st.counters[PERIOD]) * period + before.time, np.flatnonzero(impulse)
        begins = moment <= SIMULTANEOUS * period
        if begins:
            # rows at rest or in touch to round-off: the passage begins with them so
            jump = impact(dynamics, hit, np.array([met.get(int(r), 0.0) for r in hit]), st.velocity[hit])
            status = PassageStatus.GRAZING if before.order == POSITION else PassageStatus.OK
            crossed = Across(dynamics.settled(st.state) @ jump, 0.0, status)
        else:
            crossed = across(dynamics, before, st, after, impulse, met)
        S = crossed.S
        if crossed.status is not PassageStatus.OK:
            self._status = crossed.status
        self._check_order(S, moment)
        M = S @ M
        self._check_still(M)
        name = self._names.event(before.state, st.state, hit)
        if name and (len(hit) or not begins):
            self._crossings.append(Crossing(moment, name, crossed.speed, loss))
        return after, M

    def _state(self) -> np.ndarray:
        """Return u (k,) as the engine has it now."""
        run, st, dynamics, system = self.run, self.run.state, self._dynamics, self._dynamics.system
        n, b, s = system.modes, system.bodies, int(st.counters[FLOW])
        m = int(run.flows.modes[s])
        y = (st.amplitude[:m] @ run.flows.shape[s, :m]).real
        y[:n] += st.constant
        slip = st.displacement[:b] + st.low_word[:b]
        parts = dynamics.scale * y, slip, st.velocity[:b], st.displacement[dynamics.springs]
        u: np.ndarray = dynamics.from_state @ np.concatenate(parts)
        return u

    def _event(self, elapsed: float) -> tuple[int, float]:
        """Return the event function that has just vanished, and the time since the segment's start."""
        watched, period = self.run.event_functions, self._dynamics.system.period
        roots = np.flatnonzero(watched.status == ROOT)
        k = int(roots[np.argmin(np.abs(watched.no_root_before[roots] - elapsed))])
        tau = float(watched.no_root_before[k])
        return k, tau if tau > RESOLUTION * period else 0.0

    def _look_around(
        self, flow: LinearFlow, state: np.ndarray, applied: np.ndarray, u: np.ndarray, time: float, duration: float
    ) -> None:
        """Keep the smallest distance to an event that does not happen in a segment."""
        functionals, rows, orders = self._dynamics.distances(state, applied)
        share, which = flow.least(functionals, u, time, duration, self._dynamics.system.period / LOOKS)
        if share < self._clearance[0]:
            self._clearance = max(share, 0.0), self._names.missed(rows[which], orders[which])

    def _agreed(self, predicted: np.ndarray) -> np.ndarray:
        """Return the engine's state. Raises Untrusted if the prediction is another."""
        u, dynamics = self._state(), self._dynamics
        # a body's place is slip plus structure, which may cancel
        size = np.abs(dynamics.from_state) @ np.abs(dynamics.to_state @ u)
        half = len(dynamics.root)
        # a coordinate and its rate have one size, since either may pass through zero
        size[:half] = size[half : 2 * half] = np.maximum(size[:half], size[half : 2 * half])
        self._size = np.maximum(self._size, size)
        if not np.all(np.abs(u - predicted) <= AGREEMENT * self._size):
            raise Untrusted
        return u

    def _check_order(self, S: np.ndarray, time: float) -> None:
        """Find a kink: two events at one time whose order matters."""
        before, then = self._last
        if time - then <= SIMULTANEOUS * self._dynamics.system.period:
            one, other = S @ before, before @ S
            if np.abs(one - other).max() > ALIKE * np.abs(one).max():
                self._status = PassageStatus.COINCIDENT
        self._last = S, time

    def _check_still(self, M: np.ndarray) -> None:
        """Raise Untrusted if the derivative moves rows that are at rest now."""
        dynamics = self._dynamics
        rows = dynamics.constraints(self.run.state.state)
        closed = rows[rows >= dynamics.system.friction_rows]
        still = np.vstack([dynamics.speed[rows], dynamics.place[closed]])
        self._reach = np.maximum(self._reach, np.abs(M).max(axis=1))
        if np.any(np.abs(still @ M).max(axis=1, initial=0.0) > STILL * np.abs(still) @ self._reach):
            raise Untrusted
