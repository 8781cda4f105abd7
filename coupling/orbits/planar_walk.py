"""One passage of bodies in the plane: the engine walked event by event, and the derivative of where it leads.

The engine decides everything: times, contact states, impulses. Its own modes give the derivative between events
(orbits.planar_segment), the linear equations of its impulses that of impacts (orbits.planar_jump). Both are compared
with the engine's motion at every event: where they lead elsewhere, the derivative is undetermined.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.exact.event_functions import RESOLUTION
from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.exact.impacts import COLLAPSE
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    BOUNDED,
    CLOSES,
    EVENTS,
    OPEN,
    PARTS,
    PERIOD,
    ROOT,
    SLIP_LEFT,
    SLIP_RIGHT,
    STOPS,
    TOUCHING,
)
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.planar_frame import Frame
from vanedamp.coupling.orbits.planar_jump import Jump, impact, stopped
from vanedamp.coupling.orbits.planar_segment import Guard, Segment, acceleration_of
from vanedamp.coupling.orbits.saltation import saltation
from vanedamp.coupling.planar.contact_flow import add_flow
from vanedamp.coupling.planar.planar_run import PlanarRun
from vanedamp.coupling.response.event_log import WIDTH
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS, new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import fitted, motion_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.assembly import Motion

#: events a period after which a passage gives up: each is a step of Python
_EVENTS_A_PERIOD = 2000
#: largest difference of the engine's motion and the derivative's own, as a share of plays and speeds
_AGREEMENT = 1e-8
#: an event is tangential if its function would come back from beyond zero within this share of its scale
_TANGENTIAL = 1e-12
#: share of the terms of a sum that is round-off, and of a derivative that does not matter; by which the shifts of
#: events may differ that are one
_ROUND_OFF, _NOTHING, _ONE_INSTANT = 1e-12, 1e-9, 1e-6


class _Before(NamedTuple):
    """What an event changes: states as logged, times of the last impacts, (u,) each, and what impacts have taken, J."""

    known: np.ndarray
    hit_at: np.ndarray
    loss: float


class Walk:
    """One passage on its way: the engine's run, and the derivative of its state so far.

    M: (2N, k) of (q, q') with respect to the state at the start in units of `scale`.
    """

    def __init__(self, frame: Frame, start: RestartState, scale: np.ndarray, periods: int) -> None:
        self.frame, self.system, self.scale, self.periods = frame, frame.system, scale, periods
        self.status, self.clearance = PassageStatus.OK, (np.inf, "")
        self.crossings: list[Crossing] = []
        begun = frame.state_of(start)
        self.given = frame.from_state * scale  # derivative at the start
        elongation, most = begun[len(begun) - len(frame.drawn) :], frame.longest
        self.given[:, len(begun) - len(frame.drawn) :][:, np.abs(elongation) > most] = 0.0
        elongation[:] = np.clip(elongation, -most, most)
        motion = Motion(*np.split(frame.from_state @ begun, 2))
        gap = frame.gaps(motion.q)
        yields = np.isfinite(self.system.spring)
        if np.any((gap < -_NOTHING * self.system.play)[~yields & (np.arange(len(gap)) < self.system.contacts)]):
            self._worsen(PassageStatus.GRAZING)  # a body that would begin in a wall is put beside it
            motion = motion_of(frame.system, fitted(frame.system, start))
        self.run = PlanarRun(frame.system, motion, new_records(frame.system, periods, 0), True, 0)
        if frame.flows:
            self.run.flows = frame.flows[0]
        self.middle: Segment  # in which half of the first period is over
        self.last: tuple[float, np.ndarray] | None = None  # time of the last event with a kick, and its shifts

    def passage(self) -> Passage:
        """Walk to the end of the periods."""
        with np.errstate(invalid="ignore"):  # a derivative that is not known is nan
            M = self._walk()
        st, to_state = self.run.state, self.frame.to_state
        self.frame.flows[:] = [self.run.flows]
        return Passage(
            to_state @ np.r_[st.q, st.v], to_state @ M / self.scale, tuple(self.crossings), self.clearance, self.status,
            self.run.records.peak[: self.periods].copy(),
        )  # fmt: skip

    def _worsen(self, status: PassageStatus) -> None:
        order = list(PassageStatus)
        self.status = max(self.status, status, key=order.index)

    def _stopped(self) -> np.ndarray:
        self._worsen(PassageStatus.STOPPED)
        return np.full((2 * len(self.system.mass), len(self.scale)), np.nan)

    def _walk(self) -> np.ndarray:
        run, counters = self.run, self.run.state.counters
        budget = _EVENTS_A_PERIOD * self.periods
        if run.advance_to(self.periods) is not Status.EVENT_BUDGET:
            return self._stopped()
        segment = Segment(run)
        if np.any(self._taken()[:, 1] == IMPACT) or self._begins_at_event(segment):
            self._worsen(PassageStatus.GRAZING)
        self._look_at_idle_contacts(segment, self.frame.from_state * self.scale)
        places, rates = self.frame.followed(segment.state)
        M = block_diag(places, rates) @ segment.begun() @ self.given
        while counters[PERIOD] < self.periods:
            if counters[PERIOD] == 0 and segment.time <= 0.5 * self.system.period:
                self.middle = segment
            run.guards.status[:] = BOUNDED
            st = run.state
            before = _Before(st.known.copy(), st.last_impact.copy(), float(st.ledger[IMPACT_LOSS]))
            run.max_events = int(counters[EVENTS]) + 1
            status = run.advance_to(int(counters[PERIOD]) + 1)
            if status is Status.OK:
                duration = self.system.period - segment.time
                z, power = segment.after(duration)
                M = power @ M
                if not self._agrees(z, np.r_[run.state.q, run.state.v], segment.speed):
                    M = self._spoilt(M)
                self._watch(segment, duration, None)
                if counters[PERIOD] < self.periods:
                    run.max_events = int(counters[EVENTS])
                    if run.advance_to(self.periods) is not Status.EVENT_BUDGET:
                        return self._stopped()
                    segment = Segment(run)
            elif status is Status.EVENT_BUDGET and counters[EVENTS] <= budget:
                duration = float(run.state.time[0]) - segment.time
                z, power = segment.after(duration)
                M, segment = self._across(segment, duration, z, power @ M, before)
            else:
                return self._stopped()
        return M

    def _begins_at_event(self, segment: Segment) -> bool:
        """Return whether a contact parts with a speed, or begins to slip, as the passage begins."""
        system, u = self.system, len(self.system.rest)
        contact = np.arange(u) < system.contacts
        parts = contact & (segment.state == OPEN) & (self.frame.gaps(segment.q) <= SIMULTANEOUS * system.play)
        parts &= ~segment.rests()
        slides = np.isin(segment.state, (SLIP_LEFT, SLIP_RIGHT)) & ~segment.held & (~contact | (system.friction > 0.0))
        slips = slides & (np.abs(system.J[u:] @ segment.v) <= _ROUND_OFF * segment.speed)
        return bool(np.any(parts | slips))

    def _taken(self) -> np.ndarray:
        """Return the new entries of the log."""
        entries = np.concatenate(self.run.chunks) if self.run.chunks else np.zeros((0, WIDTH))
        self.run.chunks.clear()
        return entries

    def _spoilt(self, M: np.ndarray) -> np.ndarray:
        """Return a derivative that is not known in place of M."""
        self._worsen(PassageStatus.UNDETERMINED)
        return np.full_like(M, np.nan)

    def _agrees(self, z: np.ndarray, other: np.ndarray, speed: float) -> bool:
        """Return whether two states (2N,) are one, by their rows and by their energies."""
        n, u, system = len(self.system.mass), self.system.contacts, self.system
        apart = z - other
        root = np.sqrt(system.mass)
        fastest = np.linalg.norm(root * other[n:]) + speed * np.sqrt(system.mass.min(initial=1.0))
        gaps = np.abs(system.J[:u] @ apart[:n]) <= _AGREEMENT * system.play[:u]
        speeds = np.abs(system.J @ apart[n:]) <= _AGREEMENT * speed
        return bool(np.all(gaps) and np.all(speeds) and np.linalg.norm(root * apart[n:]) <= _AGREEMENT * fastest)

    def _look_at_idle_contacts(self, segment: Segment, M: np.ndarray) -> None:
        """Note contacts that touch without force and that motions beside this one open or hit: they have a kink."""
        idle = np.flatnonzero(segment.state == TOUCHING)
        if not len(idle):
            return
        # gaps and their rates, of which a contact with a force holds some
        for part, size in zip(np.split(segment.carried() @ M, 2), (1.0, self.system.frequency[0]), strict=True):
            opened = np.abs(self.system.J[idle] @ part).max(axis=1)
            if np.any(opened > _NOTHING * size * self.system.play[idle]):
                self._worsen(PassageStatus.GRAZING)

    def _watch(self, segment: Segment, duration: float, event: tuple[int, int] | None) -> None:
        """Note the event of a segment that was nearest and did not happen."""
        nearest = segment.nearest(duration, event)
        if nearest is not None and nearest[0] < self.clearance[0]:
            self.clearance = max(nearest[0], 0.0), self.frame.names.possible(*nearest[1:])

    def _across(
        self, segment: Segment, duration: float, z: np.ndarray, M: np.ndarray, before: _Before
    ) -> tuple[np.ndarray, Segment]:
        """Return the derivative after an event, and the segment that begins there; z, M right before it."""
        run, system, n = self.run, self.system, len(self.system.mass)
        st, new, entries = run.state, Segment(run), self._taken()
        roots = np.flatnonzero(run.guards.status == ROOT)
        if not len(roots):
            return self._spoilt(M), new
        event = roots[np.argmin(run.guards.no_root_before[roots])]
        r, what = int(run.guards.unit[event]), int(run.guards.what[event])
        self._watch(segment, duration, (r, what))
        hits = entries[entries[:, 1] == IMPACT]
        struck = hits[np.isinf(system.spring[hits[:, 2].astype(int)])]
        plastic = st.time[0] - before.hit_at < COLLAPSE * system.period
        jump = np.eye(2 * n)
        jump[n:, n:] = self._jump(z, new, struck, plastic, segment.speed)
        guard = segment.guard(r, what, duration)
        f, f_after = np.r_[z[n:], segment.acceleration(duration)], np.r_[new.v, new.acceleration(0.0)]
        kick = f_after - jump @ f
        kick[np.abs(kick) <= _ROUND_OFF * (np.abs(f_after) + np.abs(jump) @ np.abs(f))] = 0.0
        closing = self._closing(segment, new, r) if what == CLOSES and np.isfinite(system.spring[r]) else []
        shifts = -(guard.gradient @ M) / guard.rate if guard.rate else np.zeros(len(self.scale))
        time = int(st.counters[PERIOD]) * system.period + float(st.time[0])
        meets = self._meets(segment, new, z, f, M, shifts, r, what, struck, guard, time)
        matters = len(struck) > 0 or self._size(np.multiply.outer(kick, shifts)) > _NOTHING * max(self._size(M), 1.0)
        if len(closing) > 1:
            M = self._closings(segment, new, closing, z, f, M)
        elif guard.rate:
            M = saltation(jump, f, jump @ f + kick, guard.gradient, guard.rate) @ M
        else:
            M = jump @ M
        if closing:
            M = new.carried() @ M  # friction stops the slips of neighbours at once where this motion has none
        if matters:
            self.last = time, shifts
            tangential = guard.rate**2 <= 2.0 * _TANGENTIAL * guard.scale * abs(guard.curvature)
            if tangential and guard.rate * guard.curvature <= 0.0:
                self._worsen(PassageStatus.GRAZING)
            if meets:
                self._worsen(PassageStatus.COINCIDENT)
            if segment.prestressed and what in (PARTS, AT_LOW, AT_HIGH):
                M = self._spoilt(M)  # of forces that the laws leave open the engine has chosen one
        self._look_at_idle_contacts(new, M)
        name = self.frame.names.event(before.known, st.known, hits[:, 2].astype(int))
        if name:
            self.crossings.append(Crossing(time, name, guard.rate, float(st.ledger[IMPACT_LOSS] - before.loss)))
        return M, new

    def _size(self, M: np.ndarray) -> float:
        """Return the largest entry of a derivative (2N, k) in units of `scale`."""
        return float(np.abs(self.frame.to_state @ M / self.scale[:, None]).max(initial=0.0))

    def _jump(self, z: np.ndarray, new: Segment, struck: np.ndarray, plastic: np.ndarray, speed: float) -> np.ndarray:
        """Return the derivative (N, N) of the jump of speeds at an event, nan where it is not known.

        struck: entries of the log of the impacts.
        """
        system, run, n, u = self.system, self.run, len(self.system.mass), len(self.system.rest)
        _, follow = self.frame.followed(new.state)
        v, units = z[n:], struck[:, 2].astype(int)
        jump = Jump(v, np.eye(n))
        impulse = np.zeros(2 * u)
        impulse[units], impulse[u + units] = struck[:, 5], struck[:, 6]
        if len(units):
            jump = impact(system, v, impulse, run.scratch.compression, plastic, speed)
        left = follow @ (v + system.J.T @ impulse / system.mass)
        jump = Jump(follow @ jump.v, follow @ jump.derivative)
        unique = len(np.unique(units)) == len(units)
        known = unique and self._agrees(np.r_[z[:n], jump.v], np.r_[z[:n], left], speed)
        derivative = jump.derivative
        if not self._agrees(np.r_[z[:n], left], np.r_[z[:n], new.v], speed):  # a chatter has been completed
            shut = np.zeros(u, bool)
            shut[: system.contacts] = (self.frame.gaps(new.q) <= SIMULTANEOUS * system.play)[: system.contacts]
            held = follow @ stopped(system, new.v, shut, speed)
            derivative = held @ derivative
            known = known and self._agrees(np.r_[z[:n], held @ left], np.r_[z[:n], new.v], speed)
        known = known and self._agrees(np.r_[new.q, new.v], np.r_[z[:n], new.v], speed)
        if known:
            return derivative
        self._worsen(PassageStatus.UNDETERMINED)
        return np.full((n, n), np.nan)

    def _meets(
        self, segment: Segment, new: Segment, z: np.ndarray, f: np.ndarray, M: np.ndarray, shifts: np.ndarray, r: int,
        what: int, struck: np.ndarray, guard: Guard, time: float,
    ) -> bool:  # fmt: skip
        """Return whether another event takes place at the instant of one, but not in motions beside this one.

        shifts: (k,) of the time of the event.
        """
        system, n, u = self.system, len(z) // 2, len(self.system.rest)
        begun = [c for c in struck[:, 2].astype(int) if segment.state[c] == OPEN and (c, CLOSES) != (r, what)]
        apart = [(np.r_[system.J[c], np.zeros(n)], system.play[c]) for c in begun]
        slides = np.isin(segment.state, (SLIP_LEFT, SLIP_RIGHT)) & ~segment.held & (new.state != segment.state)
        slides &= (system.friction > 0.0) | (np.arange(u) >= system.contacts)
        stops = slides & (np.abs(system.J[u:] @ z[n:]) <= _ROUND_OFF * segment.speed)
        if what == STOPS:
            apart += [(np.r_[np.zeros(n), system.J[u + c]], segment.speed) for c in np.flatnonzero(stops) if c != r]
        events = [(gradient, gradient @ f, shifts, scale) for gradient, scale in apart]
        if self.last is not None and time - self.last[0] <= RESOLUTION * system.period:
            events.append((guard.gradient, guard.rate, self.last[1], guard.scale))
        for gradient, rate, shift, scale in events:
            terms = np.abs(gradient @ M) + np.abs(rate * shift)
            if np.any(np.abs(gradient @ M + rate * shift) > np.maximum(_ONE_INSTANT * terms, _NOTHING * scale)):
                return True
        return False

    def _closing(self, segment: Segment, new: Segment, r: int) -> list[int]:
        """Return the contacts that yield and begin at the event of contact r, that first."""
        begun = (segment.state == OPEN) & (new.state < OPEN) & np.isfinite(self.system.spring)
        return [r, *(c for c in np.flatnonzero(begun).tolist() if c != r)]

    def _closings(
        self, segment: Segment, new: Segment, closing: list[int], z: np.ndarray, f: np.ndarray, M: np.ndarray
    ) -> np.ndarray:
        """Return the derivative after contacts that yield have begun at one instant, each by its own gap."""
        n, ways = len(z) // 2, []
        for order in (closing, closing[::-1]):
            moved, rate, state = M, f, segment.state.copy()
            for c in order:
                state[c] = new.state[c]
                accelerated = np.r_[z[n:], self._acceleration(state, z)]
                gradient = np.r_[self.system.J[c], np.zeros(n)]
                moved = saltation(np.eye(2 * n), rate, accelerated, gradient, float(gradient @ rate)) @ moved
                rate = accelerated
            ways.append(moved)
        if self._size(ways[0] - ways[1]) > _ONE_INSTANT * self._size(ways[0]):
            self._worsen(PassageStatus.COINCIDENT)
        return ways[0]

    def _acceleration(self, state: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the accelerations (N,) at the present time with contact states (u,)."""
        run = self.run
        found = lambda: np.flatnonzero((run.flows.modes > 0) & (run.flows.key == state).all(axis=1))  # noqa: E731
        if not len(found()):
            run.flows = add_flow(run.flows, self.system, state)
        return acceleration_of(run.flows, int(found()[0]), z, run.state.amplitude[: len(self.system.frequency)])
