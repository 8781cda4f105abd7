"""One passage: the engine's motion walked segment by segment, and the derivative of where it leads.

The engine decides everything: times, contact states, impulses. The derivative is built beside it from the equations of
motion (orbits.dynamics, orbits.jump): the product, in the order of time, of the propagators of segments and of the
saltation matrices of events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
Mechanical Systems, 2004, chapter 7). It checks itself: at every event the motion that its own flows predict must be the
engine's, and what is at rest must stay so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.engines import engine_run
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    CLOSES,
    OPEN,
    OPENS,
    PARTS,
    RECLOSES,
    STOPS,
    TOUCHING,
)
from vanedamp.coupling.orbits.dynamics import Dynamics, Flow, presses
from vanedamp.coupling.orbits.event_names import EventNames
from vanedamp.coupling.orbits.frame import Frame
from vanedamp.coupling.orbits.jump import Jump, Untrusted, impact, stopped
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.start import Start
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import fitted
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import Event, EventRun, Segment, Walk

#: events a period after which a passage gives up: each is a step of Python
_EVENTS_A_PERIOD = 2000
#: largest difference of the engine's motion and that of the own flows, relative to a coordinate's size, and that size
#: where it hardly moves, relative to its typical one
_AGREEMENT, _LEAST = 1e-8, 1e-4
#: speed that an engine has taken from a row by no impulse, relative to the fastest, beyond round-off
_CAUGHT = 1e-11
#: largest motion of rows at rest by the derivative, relative to its terms
_STILL = 1e-7
#: an event is tangential if its function would come back from beyond zero within this share of its scale
_TANGENTIAL = 1e-12
#: what reaches its bound without a jump is the same on both sides but for this part of its terms: at forces, others
_CONTINUOUS, _ROUND_OFF = 1e-9, 1e-12
#: a derivative that does not matter; a difference by which shifts of events may differ that are one
_NOTHING, _ONE_INSTANT = 1e-9, 1e-6
#: times this close, relative to a period: of an event and the passage's start or end; of two events at one instant
_SIMULTANEOUS, _INSTANT = 1e-12, 1e-15
_FORCES = (PARTS, AT_LOW, AT_HIGH)


class Guard(NamedTuple):
    """An event function right before its event: functional (2N,) of u, its rate and second derivative in time, scale.

    part: number of the part of the system that it belongs to (Dynamics.part).
    """

    gradient: np.ndarray
    rate: float
    bend: float
    scale: float
    part: int

    @property
    def tangential(self) -> bool:
        """Whether it vanishes, to round-off, only to come back."""
        comes_back = self.rate <= 0.0 <= self.bend
        return comes_back and self.rate**2 <= 2.0 * _TANGENTIAL * self.scale * abs(self.bend)


class Before(NamedTuple):
    """The moment before an event: the segment that it ends, its flow, z (K,) there, and the derivative M (2N, k)."""

    segment: Segment
    event: Event
    flow: Flow
    z: np.ndarray
    M: np.ndarray


class PassageWalk:
    """One passage, walked when it is made.

    run: the engine's, which may share what `earlier` runs have computed; half_way: (k,) the state half a period after
    the start, None if the engine has not come so far.
    """

    def __init__(
        self, frame: Frame, dynamics: Dynamics, names: EventNames, start: RestartState, scale: np.ndarray,
        periods: int, earlier: EventRun | None = None,
    ) -> None:  # fmt: skip
        self.frame, self.dynamics, self.system, self._names = frame, dynamics, frame.system, names
        self._scale, self._periods = scale, periods
        self.run = engine_run(
            self.system, fitted(self.system, start), new_records(self.system, periods, 0), True,
            _EVENTS_A_PERIOD * periods,
        )  # fmt: skip
        if earlier is not None:
            self.run.reuse(earlier)
        self._start = Start(frame, dynamics, start)
        self._crossings: list[Crossing] = []
        self._clearance, self._status = (np.inf, ""), PassageStatus.OK
        self.half_way: np.ndarray | None = None
        self._from_state = dynamics.unit[:, None] * frame.from_state
        #: size of each coordinate so far, at least that by which it is compared, and largest derivative of each
        self._to_sizes = np.abs(self._from_state)
        self._size = _LEAST * self._to_sizes @ scale
        self._reach = np.abs(self._from_state * scale).max(axis=1)
        #: the last event that matters: its time, and how derivatives shift it (k,), by parts of the system
        self._last: tuple[float, dict[int, np.ndarray]] = (-np.inf, {})

    def passage(self) -> Passage:
        """Walk to the end of the periods."""
        walk, k = Walk(self.run, self._periods), len(self._scale)
        state, derivative = np.full(k, np.nan), np.full((k, k), np.nan)
        with np.errstate(invalid="ignore"):  # a derivative that is not known is nan
            before = self._walked(walk)
            final = self.run.final() if walk.status is Status.OK else None
            if before is None or final is None:
                self._worsen(PassageStatus.STOPPED)
            else:
                state = self.frame.state_of(final)
                derivative = self._arrived(before, state)
        peaks = self.run.records.peak[: self._periods].copy()
        return Passage(state, derivative, tuple(self._crossings), self._clearance, self._status, peaks)

    def _worsen(self, status: PassageStatus) -> None:
        order = list(PassageStatus)
        self._status = max(self._status, status, key=order.index)

    def _walked(self, walk: Walk) -> Before | None:
        """Walk to the end. Returns the end of the last segment, None without any."""
        dynamics, k, half = self.dynamics, self.dynamics.one, 0.5 * self.system.period
        before: Before | None = None
        for segment in walk:
            flow, u = dynamics.flow(segment.state, segment.open_force), self._state(segment)
            if before is None:
                M = self._trusted(lambda: self._begin(walk.start, segment, flow, u))  # noqa: B023
            else:
                M = self._across(before, segment, flow, u)
            assert segment.event is not None
            z = dynamics.extended(u, segment.time)
            if segment.period == 0 and segment.time <= half <= segment.time + segment.duration:
                middle, _ = flow.after(z, half - segment.time)
                self.half_way = self.frame.to_state @ (middle[:k] / dynamics.unit)
            least, unit, what = flow.least(z, segment.duration, (segment.event.unit, segment.event.what))
            if least < self._clearance[0]:
                self._clearance = least, self._names.possible(unit, what)
            z, power = flow.after(z, segment.duration)
            before = Before(segment, segment.event, flow, z, power @ M)
        return before

    def _arrived(self, before: Before, final: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of the state at the end, `final` (k,), by that at the start."""
        reached = self.frame.to_state @ (before.z[: self.dynamics.one] / self.dynamics.unit)
        if not self._agrees(self._from_state @ reached, self._from_state @ final):
            self._worsen(PassageStatus.UNDETERMINED)
            return np.full((len(final), len(final)), np.nan)
        if self._periods * self.system.period - self._last[0] <= _SIMULTANEOUS * self.system.period:
            self._worsen(PassageStatus.COINCIDENT)  # an event at the very end
        derivative: np.ndarray = self.frame.to_state @ (before.M / self.dynamics.unit[:, None]) / self._scale
        return derivative

    def _trusted(self, found: Callable[[], np.ndarray]) -> np.ndarray:
        """Return a derivative (2N, k), nan where it is not known."""
        try:
            return found()
        except Untrusted:
            self._worsen(PassageStatus.UNDETERMINED)
            return np.full_like(self._from_state, np.nan)

    def _begin(self, event: Event, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return the derivative at the start. event: at time zero."""
        self._check_idle(segment, self._from_state * self._scale)
        M, status = self._start.derivative(event, segment, flow, u)
        self._worsen(status)
        return M * self._scale

    def _state(self, segment: Segment) -> np.ndarray:
        """Return u (2N,) as the engine has it at the start of a segment."""
        state: np.ndarray = self.dynamics.unit * np.concatenate([segment.q, segment.v])
        return state

    def _agrees(self, predicted: np.ndarray, found: np.ndarray) -> bool:
        """Return whether two states u (2N,) are one."""
        # a body's place is slip plus structure, which may cancel
        size = self._to_sizes @ np.abs(self.frame.to_state @ (found / self.dynamics.unit))
        half = len(size) // 2
        # a coordinate and its rate have one size, since either may pass through zero
        size[:half] = size[half:] = np.maximum(size[:half], size[half:])
        self._size = np.maximum(self._size, size)
        agree = np.abs(predicted - found) <= _AGREEMENT * self._size
        agree[self.dynamics.sliders] = agree[half + self.dynamics.sliders] = True
        return bool(agree.all())

    def _across(self, before: Before, new: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return the derivative after an event, or a period's end, and keep the event."""
        event, begins = before.event, new.start <= _SIMULTANEOUS * self.system.period
        if event.unit < 0:
            return self._trusted(lambda: self._continued(before, u))
        guards = self._guards(before, new)
        M = self._trusted(lambda: self._moved(before, new, flow, u, guards, begins))
        self._check_idle(new, M)
        name = self._names.event(before.flow.named, flow.named, event.struck)
        if name and (event.impulse.any() or not begins):
            self._crossings.append(Crossing(new.start, name, guards[0].rate, event.loss))
        return M

    def _continued(self, before: Before, u: np.ndarray) -> np.ndarray:
        """Return the derivative as a period ends and the motion goes on from u (2N,). Raises Untrusted."""
        if not self._agrees(before.z[: self.dynamics.one], u):
            raise Untrusted
        return before.M

    def _moved(
        self, before: Before, new: Segment, flow: Flow, u: np.ndarray, guards: list[Guard], begins: bool
    ) -> np.ndarray:
        """Return the derivative after an event. begins: whether it is one as the passage begins. Raises Untrusted."""
        event, jump = before.event, np.eye(self.dynamics.one)
        jump[self.dynamics.rates, self.dynamics.rates], kick = self._jump(before, new, u)
        if begins:  # rows at rest or in touch to round-off: the passage begins with them so
            M = self.dynamics.begun(new.state, self._start.closed(new)) @ jump @ before.M
            if event.what in (CLOSES, OPENS, RECLOSES):
                self._worsen(PassageStatus.GRAZING)
        else:
            M = self._saltation(before, new, flow, u, jump, kick, guards)
        self._check_still(new, M)
        return M

    def _jump(self, before: Before, new: Segment, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative (N, N) of w after an event by w before, and the jump (N,) of w.

        Raises Untrusted where the engine's speeds do not follow from their laws.
        """
        dynamics, system, event = self.dynamics, self.system, before.event
        rates, root, u_before = dynamics.rates, dynamics.root, before.z[: dynamics.one]
        follow = dynamics.followed(new.state)[rates, rates]
        at = lambda w: np.concatenate([u_before[dynamics.places], w])  # noqa: E731
        kick = dynamics.kick(event.impulse)
        left = follow @ (u_before[rates] + kick)
        jump = Jump(u_before[rates] / root, np.eye(len(root)))
        if event.impulse.any():
            jump = impact(system, jump.v, event, before.segment.speed)
        derivative = follow @ (root[:, None] * jump.derivative / root)
        known = len(np.unique(event.struck)) == len(event.struck)
        known = known and self._agrees(at(follow @ (root * jump.v)), at(left))
        if np.any(np.abs(self.dynamics.rows @ (left - u[rates])) > _CAUGHT * new.speed):  # a chatter has been completed
            held = follow @ (root[:, None] * stopped(system, new.v, self._start.closed(new), new.speed) / root)
            derivative, kick = held @ derivative, u[rates] - u_before[rates]
            known = known and self._agrees(at(held @ left), at(u[rates]))
        if not known or not self._agrees(at(u[rates]), u):
            raise Untrusted
        kick[dynamics.sliders] = (u - u_before)[rates][dynamics.sliders]
        return derivative, kick

    def _guards(self, before: Before, new: Segment) -> list[Guard]:
        """Return the event functions that vanish at an event: its own first, then of others at the same time."""
        segment, event, system, u = before.segment, before.event, self.system, len(new.state)
        events = [(event.unit, event.what)]
        rigid = event.struck[np.isinf(system.spring[event.struck])]
        events += [(c, int(CLOSES)) for c in rigid.tolist() if segment.state[c] == OPEN and c != event.unit]
        if event.what == STOPS:
            own = before.flow
            slides = (own.way != 0.0) & ~own.slips_held & own.rubs & (new.state != segment.state)
            still = np.abs(system.J[u:] @ new.v) <= _ROUND_OFF * segment.speed
            events += [(c, int(STOPS)) for c in np.flatnonzero(slides & still).tolist() if c != event.unit]
        met = dict(zip(event.struck.tolist(), event.before.tolist(), strict=True))
        return [self._guard(before, r, what, met.get(r) if what == CLOSES else None) for r, what in events]

    def _guard(self, before: Before, r: int, what: int, met: float | None) -> Guard:
        """Return an event function. met: its rate as the engine has it."""
        functional, scale = before.flow.function(r, what)
        slope = functional @ before.flow.X
        rate, bend = float(slope @ before.z), float(slope @ before.flow.X @ before.z)
        if not np.isfinite(scale):
            terms = float(np.abs(functional) @ np.abs(before.z))
            scale = before.segment.speed if what == STOPS else terms
        gradient = functional[: self.dynamics.one]
        touched = np.flatnonzero(gradient)
        part = int(self.dynamics.part[touched[0] % len(self.dynamics.root)]) if len(touched) else -1
        return Guard(gradient, rate if met is None else met, bend, scale, part)

    def _saltation(
        self, before: Before, new: Segment, flow: Flow, u: np.ndarray, jump: np.ndarray, jumped: np.ndarray,
        guards: list[Guard],
    ) -> np.ndarray:  # fmt: skip
        """Return the derivative after an event: jump M, and what the event's shift in time brings.

        jumped: (N,) of w. Parts of the system that do not feel each other have their own events.
        """
        dynamics, event, M, k = self.dynamics, before.event, before.M, self.dynamics.one
        rate = (before.flow.X @ before.z)[:k]
        rate_after = (flow.X @ dynamics.extended(u, new.time))[:k]
        kick = rate_after - jump @ rate
        round_off = _CONTINUOUS if event.what in _FORCES else _ROUND_OFF
        kick[np.abs(kick) <= round_off * (np.abs(rate_after) + np.abs(jump) @ np.abs(rate))] = 0.0
        if event.impulse.any():
            kick[dynamics.places] = dynamics.rate * jumped
        parts = {guard.part: guard for guard in guards[::-1]}  # the first of each
        others = [part for part in parts if part != guards[0].part]
        owner = np.tile(np.where(np.isin(dynamics.part, others), dynamics.part, guards[0].part), 2)
        shifts = {part: -(each.gradient @ M) / (each.rate or np.inf) for part, each in parts.items()}
        moved = jump @ M
        for part, shift in shifts.items():
            moved = moved - np.multiply.outer(np.where(owner == part, kick, 0.0), shift)
        matters = event.impulse.any() or self._largest(moved - jump @ M) > _NOTHING * max(self._largest(M), 1.0)
        closing = self._closing(before, new)
        if len(closing) > 1:
            moved = self._closings(before, new, closing)
        if closing:  # friction stops the slips of neighbours at once where this motion has none
            moved = dynamics.begun(new.state, presses(new.state)) @ moved
        if not matters:
            return moved
        if any(guard.tangential for guard in guards):
            self._worsen(PassageStatus.GRAZING)
        if self._ends_chatter(before, guards, event):
            moved = dynamics.held(self._start.closed(new), np.zeros(len(new.state), bool)) @ jump @ M
        elif self._meets(M, guards, shifts, new.start):
            self._worsen(PassageStatus.COINCIDENT)
        if before.segment.open_force.any() and event.what in _FORCES:
            raise Untrusted  # of forces that the laws leave open the engine has chosen one
        self._last = new.start, shifts
        return moved

    def _largest(self, M: np.ndarray) -> float:
        """Return the largest entry of a derivative (2N, k) in units of the sizes of states."""
        states = self.frame.to_state @ (M / self.dynamics.unit[:, None])
        return float(np.abs(states / self._scale[:, None]).max(initial=0.0))

    def _ends_chatter(self, before: Before, guards: list[Guard], event: Event) -> bool:
        """Return whether sliders come to rest at several contacts: nothing is left of gaps and speeds, in any order."""
        slides = np.all(self.system.tilt < 0)
        return bool(slides and len(guards) > 1 and event.what == CLOSES and not event.after.any())

    def _meets(self, M: np.ndarray, guards: list[Guard], shifts: dict[int, np.ndarray], time: float) -> bool:
        """Return whether another event takes place at the instant of one, but not in motions beside this one."""
        events = [(guard, shifts[guard.part]) for guard in guards[1:]]
        if time - self._last[0] <= _INSTANT * self.system.period:
            events += [(guard, self._last[1][guard.part]) for guard in guards[:1] if guard.part in self._last[1]]
        for guard, shift in events:
            at_event, later = guard.gradient @ M, guard.rate * shift
            terms = np.abs(at_event) + np.abs(later)
            if np.any(np.abs(at_event + later) > np.maximum(_ONE_INSTANT * terms, _NOTHING * guard.scale)):
                return True
        return False

    def _closing(self, before: Before, new: Segment) -> list[int]:
        """Return the contacts that yield and begin at an event by which one closes, that first."""
        r = before.event.unit
        if before.event.what != CLOSES or not np.isfinite(self.system.spring[r]):
            return []
        begun = (before.segment.state == OPEN) & presses(new.state) & np.isfinite(self.system.spring)
        return [r, *(c for c in np.flatnonzero(begun).tolist() if c != r)]

    def _closings(self, before: Before, new: Segment, closing: list[int]) -> np.ndarray:
        """Return the derivative after contacts that yield have begun at one instant, each by its own gap."""
        dynamics, k, ways = self.dynamics, self.dynamics.one, []
        for order in (closing, closing[::-1]):
            moved, flow, state = before.M, before.flow, before.segment.state.copy()
            for c in order:
                state[c] = new.state[c]
                after = dynamics.flow(state, before.segment.open_force)
                gradient, rate = dynamics.gap[c, :k], float(dynamics.gap[c] @ flow.X @ before.z)
                kick = ((after.X - flow.X) @ before.z)[:k]
                moved, flow = moved - np.multiply.outer(kick, gradient @ moved) / -rate, after
            ways.append(moved)
        if self._largest(ways[0] - ways[1]) > _ONE_INSTANT * self._largest(ways[0]):
            self._worsen(PassageStatus.COINCIDENT)
        return ways[0]

    def _check_still(self, new: Segment, M: np.ndarray) -> None:
        """Raise Untrusted if the derivative moves what is at rest now."""
        dynamics, u = self.dynamics, len(new.state)
        rigid = np.isinf(self.system.spring) & presses(new.state) & (np.arange(u) < self.system.contacts)
        stuck = dynamics.flow(new.state, new.open_force).stuck
        speed, k = dynamics.speed[:, : dynamics.one], dynamics.one
        still = np.vstack([speed[:u][rigid], speed[u:][stuck], dynamics.gap[rigid, :k]])
        self._reach = np.maximum(self._reach, np.abs(M).max(axis=1))
        if np.any(np.abs(still @ M).max(axis=1, initial=0.0) > _STILL * np.abs(still) @ self._reach):
            raise Untrusted

    def _check_idle(self, segment: Segment, M: np.ndarray) -> None:
        """Note contacts that touch without force and that motions beside this one open or hit: they have a kink."""
        idle, dynamics, k = np.flatnonzero(segment.state == TOUCHING), self.dynamics, self.dynamics.one
        if not len(idle):
            return
        # gaps and their rates, of which a contact with a force holds some
        carried = dynamics.begun(segment.state, presses(segment.state)) @ M
        rows = dynamics.gap[idle, :k], dynamics.speed[idle, :k]
        for functional, size in zip(rows, (1.0, self.system.omega), strict=True):
            opened = np.abs(functional @ carried).max(axis=1)
            if np.any(opened > _NOTHING * size * self.system.play[idle]):
                self._worsen(PassageStatus.GRAZING)
