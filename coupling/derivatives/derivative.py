"""The derivative of a passage by its start, event by event, from the equations of motion, apart from the engine's.

It is the product, in the order of time, of the propagators of segments and of the saltation matrices
of events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems, 2004, chapter 7). The engine decides everything: times, contact states, impulses. The derivative checks itself:
at every event the motion that its own flows predict must be the engine's, and coordinates at rest must stay so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow, presses
from vanedamp.coupling.derivatives.jump import Jump, Untrusted, impact
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.derivatives.start import Start
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.segment import Event, Segment

#: largest difference of the engine's motion and the own flows', relative to a coordinate's size, and that size
#: where it hardly moves, relative to its typical one
_AGREEMENT, _LEAST = 1e-8, 1e-4
#: difference of a speed after an impact and its law's, relative to the fastest there
_LAW = 1e-9
#: speed that an engine has taken from a row by no impulse, relative to the fastest, beyond round-off
_CAUGHT = 1e-11
#: largest motion of rows at rest by the derivative, relative to its terms
_STILL = 1e-7
#: an event is tangential if its function would come back from beyond zero within this fraction of its scale
_TANGENTIAL = 1e-12
#: what reaches its bound without a jump is the same on both sides but for this part of its terms: at forces, others
_CONTINUOUS, _ROUND_OFF = 1e-9, 1e-12
#: a derivative that does not matter; a difference by which shifts of events may differ that are one
_NOTHING, _ONE_INSTANT = 1e-9, 1e-6
#: times this close, relative to a period: of an event and the passage's start or end; of two events at one instant
_SIMULTANEOUS, _INSTANT = 1e-12, 1e-15
_FORCES = (codes.PARTS, codes.AT_LOW, codes.AT_HIGH)


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

    @property
    def u(self) -> np.ndarray:
        """The state (2N,) there."""
        return self.z[: self.flow.dynamics.one]


def begins(segment: Segment) -> bool:
    """Whether a segment begins as the passage does."""
    return segment.start <= _SIMULTANEOUS * segment.system.period


class Derivative:
    """The derivative M (2N, k) of u by the state at the start, in units of its sizes `scale` (k,).

    status: its defect so far, if any.
    """

    def __init__(self, dynamics: Dynamics, start: Start) -> None:
        self.dynamics, self.system, self._start, self._scale = dynamics, dynamics.system, start, dynamics.scale
        self.status, self._to_sizes = PassageStatus.OK, np.abs(dynamics.from_state)
        #: size of each coordinate so far, at least that by which it is compared, and largest derivative of each
        self._size = _LEAST * self._to_sizes @ self._scale
        self._reach = np.abs(dynamics.from_state * self._scale).max(axis=1)
        #: the last event that matters: its time, and how derivatives shift it (k,), by parts of the system
        self._last: tuple[float, dict[int, np.ndarray]] = (-np.inf, {})

    def worsen(self, status: PassageStatus) -> None:
        """Note that something is wrong."""
        order = list(PassageStatus)
        self.status = max(self.status, status, key=order.index)

    def begin(self, event: Event, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return M as the first segment begins. event: at time zero. Raises Untrusted."""
        self._check_idle(segment, self.dynamics.from_state * self._scale)
        M, status = self._start.derivative(event, segment, flow, u)
        self.worsen(status)
        return M * self._scale

    def after(self, before: Before, new: Segment, flow: Flow, u: np.ndarray, guards: list[Guard]) -> np.ndarray:
        """Return M after an event, or a period's end, as the motion continues from u (2N,). Raises Untrusted."""
        event, jump = before.event, np.eye(self.dynamics.one)
        if event.unit < 0:
            if not self._agrees(before.u, u):
                raise Untrusted
            return before.M
        jump[self.dynamics.rates, self.dynamics.rates], kick = self._jump(before, new, u)
        if begins(new):  # rows at rest or in touch to round-off: the passage begins with them so
            M = self.dynamics.begun(new.state, self._start.closed(new)) @ jump @ before.M
            if event.what in (codes.CLOSES, codes.OPENS, codes.RECLOSES):
                self.worsen(PassageStatus.GRAZING)
        else:
            M = self._saltation(before, new, flow, u, jump, kick, guards)
        self._check_still(new, M)
        self._check_idle(new, M)
        return M

    def end(self, before: Before, final: np.ndarray, time: float) -> np.ndarray:
        """Return the derivative (k, k) of the state at the end, `final` (k,), after a time, s."""
        dynamics = self.dynamics
        if not self._agrees(dynamics.from_state @ dynamics.to_state @ before.u, dynamics.from_state @ final):
            self.worsen(PassageStatus.UNDETERMINED)
            return np.full((len(final), len(final)), np.nan)
        if time - self._last[0] <= _SIMULTANEOUS * self.system.period:
            self.worsen(PassageStatus.COINCIDENT)  # an event at the very end
        return np.asarray(dynamics.to_state @ before.M / self._scale)

    def _agrees(self, predicted: np.ndarray, found: np.ndarray) -> bool:
        """Return whether two states u (2N,) are one."""
        # a body's place is slip plus structure, which may cancel
        size = self._to_sizes @ np.abs(self.dynamics.to_state @ found)
        half = len(size) // 2
        # a coordinate and its rate have one size, since either may pass through zero
        size[:half] = size[half:] = np.maximum(size[:half], size[half:])
        self._size = np.maximum(self._size, size)
        agree = np.abs(predicted - found) <= _AGREEMENT * self._size
        agree[self.dynamics.sliders] = agree[half + self.dynamics.sliders] = True
        return bool(agree.all())

    def guards(self, before: Before, new: Segment) -> list[Guard]:
        """Return the event functions that vanish at an event: its own first, then of others at the same time."""
        segment, event, system, u = before.segment, before.event, self.system, len(new.state)
        events = [(event.unit, event.what)]
        rigid = event.struck[np.isinf(system.spring[event.struck])]
        events += [(c, int(codes.CLOSES)) for c in rigid.tolist() if segment.state[c] == codes.OPEN and c != event.unit]
        if event.what == codes.STOPS:
            own = before.flow
            slides = (own.way != 0.0) & ~own.slips_held & own.rubs & (new.state != segment.state)
            still = np.abs(system.J[u:] @ new.v) <= _ROUND_OFF * segment.speed
            events += [(c, int(codes.STOPS)) for c in np.flatnonzero(slides & still).tolist() if c != event.unit]
        met = dict(zip(event.struck.tolist(), event.before.tolist(), strict=True))
        return [self._guard(before, r, what, met.get(r) if what == codes.CLOSES else None) for r, what in events]

    def _guard(self, before: Before, r: int, what: int, met: float | None) -> Guard:
        """Return an event function. met: its rate as the engine has it."""
        functional, scale = before.flow.function(r, what)
        slope = functional @ before.flow.X
        rate, bend = float(slope @ before.z), float(slope @ before.flow.X @ before.z)
        if not np.isfinite(scale):
            terms = float(np.abs(functional) @ np.abs(before.z))
            scale = before.segment.speed if what == codes.STOPS else terms
        gradient = functional[: self.dynamics.one]
        touched = np.flatnonzero(gradient)
        part = int(self.dynamics.part[touched[0] % len(self.dynamics.root)]) if len(touched) else -1
        return Guard(gradient, rate if met is None else met, bend, scale, part)

    def _jump(self, before: Before, new: Segment, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivative (N, N) of w after an event by w before, and the jump (N,) of w.

        Raises Untrusted where the engine's speeds do not follow from their laws.
        """
        dynamics, system, event = self.dynamics, self.system, before.event
        rates, root, u_before = dynamics.rates, dynamics.root, before.u
        follow = dynamics.followed(new.state)[rates, rates]
        at = lambda w: np.concatenate([u_before[dynamics.places], w])  # noqa: E731
        kick = event.impulse @ dynamics.rows
        left = follow @ (u_before[rates] + kick)
        jump = Jump(u_before[rates] / root, np.eye(len(root)))
        if event.impulse.any():
            jump = impact(system, jump.v, event, before.segment.speed)
            missed = np.abs(system.J[event.struck] @ jump.v - event.after)[np.isinf(system.spring[event.struck])]
            fastest = np.abs(np.concatenate([event.before, event.after])).max()
            if np.any(missed > _LAW * fastest + _ROUND_OFF * before.segment.speed):
                raise Untrusted
        derivative = follow @ (root[:, None] * jump.derivative / root)
        known = len(np.unique(event.struck)) == len(event.struck)
        known = known and self._agrees(at(follow @ (root * jump.v)), at(left))
        if np.any(np.abs(self.dynamics.rows @ (left - u[rates])) > _CAUGHT * new.speed):  # a chatter has been completed
            still = self._start.closed(new), np.abs(system.J @ new.v).reshape(2, -1) <= _ROUND_OFF * new.speed
            stuck = still[0] & still[1][1] & (system.friction > 0.0)
            held = follow @ dynamics.held(still[0] & still[1][0], stuck)[rates, rates]
            derivative, kick = held @ derivative, u[rates] - u_before[rates]
            known = known and self._agrees(at(held @ left), at(u[rates]))
        if not known or not self._agrees(at(u[rates]), u):
            raise Untrusted
        kick[dynamics.sliders] = (u - u_before)[rates][dynamics.sliders]
        return derivative, kick

    def _saltation(
        self, before: Before, new: Segment, flow: Flow, u: np.ndarray, jump: np.ndarray, jumped: np.ndarray,
        guards: list[Guard],
    ) -> np.ndarray:  # fmt: skip
        """Return the derivative after an event: jump M, and the effect of the event's shift in time.

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
        yields = np.isfinite(self.system.spring)
        if event.what == codes.CLOSES and yields[event.unit]:
            begun = np.flatnonzero((before.segment.state == codes.OPEN) & presses(new.state) & yields)
            if len(begun) > 1:
                moved = self._closings(before, new, sorted(begun.tolist(), key=lambda c: c != event.unit))
            # friction stops the slips of neighbours at once where this motion has none
            moved = dynamics.begun(new.state, presses(new.state)) @ moved
        if not matters:
            return moved
        if any(guard.tangential for guard in guards):
            self.worsen(PassageStatus.GRAZING)
        ends = event.what == codes.CLOSES and len(guards) > 1 and not event.after.any()
        if ends and np.all(self.system.tilt < 0):
            # sliders that come to rest at several contacts: nothing is left of gaps and speeds, in any order
            moved = dynamics.held(self._start.closed(new), np.zeros(len(new.state), bool)) @ jump @ M
        elif self._meets(M, guards, shifts, new.start):
            self.worsen(PassageStatus.COINCIDENT)
        if before.segment.open_force.any() and event.what in _FORCES:
            raise Untrusted  # of forces that the laws leave open the engine has chosen one
        self._last = new.start, shifts
        return moved

    def _largest(self, M: np.ndarray) -> float:
        """Return the largest entry of a derivative (2N, k) in units of the sizes of states."""
        return float(np.abs(self.dynamics.to_state @ M / self._scale[:, None]).max(initial=0.0))

    def _meets(self, M: np.ndarray, guards: list[Guard], shifts: dict[int, np.ndarray], time: float) -> bool:
        """Return whether another event takes place at the instant of one, but not in neighbouring motions."""
        events = [(guard, shifts[guard.part]) for guard in guards[1:]]
        if time - self._last[0] <= _INSTANT * self.system.period:
            events += [(guard, self._last[1][guard.part]) for guard in guards[:1] if guard.part in self._last[1]]
        for guard, shift in events:
            at_event, later = guard.gradient @ M, guard.rate * shift
            terms = np.abs(at_event) + np.abs(later)
            if np.any(np.abs(at_event + later) > np.maximum(_ONE_INSTANT * terms, _NOTHING * guard.scale)):
                return True
        return False

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
                moved, flow = moved + np.multiply.outer(kick / rate, gradient @ moved), after
            ways.append(moved)
        if self._largest(ways[0] - ways[1]) > _ONE_INSTANT * self._largest(ways[0]):
            self.worsen(PassageStatus.COINCIDENT)
        return ways[0]

    def _check_still(self, new: Segment, M: np.ndarray) -> None:
        """Raise Untrusted if the derivative moves coordinates at rest."""
        dynamics, u = self.dynamics, len(new.state)
        rigid = np.isinf(self.system.spring) & presses(new.state) & (np.arange(u) < self.system.contacts)
        stuck, k = dynamics.flow(new.state, new.open_force).stuck, dynamics.one
        still = np.vstack([dynamics.speed[:u][rigid], dynamics.speed[u:][stuck], dynamics.gap[rigid]])[:, :k]
        self._reach = np.maximum(self._reach, np.abs(M).max(axis=1))
        if np.any(np.abs(still @ M).max(axis=1, initial=0.0) > _STILL * np.abs(still) @ self._reach):
            raise Untrusted

    def _check_idle(self, segment: Segment, M: np.ndarray) -> None:
        """Note contacts that touch without force and that neighbouring motions open or hit: they have a kink."""
        idle, dynamics, k = np.flatnonzero(segment.state == codes.TOUCHING), self.dynamics, self.dynamics.one
        if not len(idle):
            return
        # gaps and their rates, of which a contact with a force holds some
        carried = dynamics.begun(segment.state, presses(segment.state)) @ M
        rows = dynamics.gap[idle, :k], dynamics.speed[idle, :k]
        for functional, size in zip(rows, (1.0, self.system.omega), strict=True):
            opened = np.abs(functional @ carried).max(axis=1)
            if np.any(opened > _NOTHING * size * self.system.play[idle]):
                self.worsen(PassageStatus.GRAZING)
