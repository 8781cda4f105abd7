"""The derivative of a passage by its start, event by event, from the equations of motion.

It is the product, in the order of time, of the propagators of segments and of the saltation matrices
of events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems, 2004, chapter 7). The engine decides everything: times, contact states, impulses. The derivative checks itself:
at every event the motion that its own flows predict must be the engine's, and coordinates at rest must stay so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.constraints import Affine, Constraints
from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.jump import Untrusted, impact, scaled
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.derivatives.start import Start
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.segment import Event, Segment
from vanedamp.coupling.system.unit_laws import EVENTS, contacts_of, presses

#: largest difference of the engine's motion and the own flows', relative to a coordinate's size, and that size
#: where it hardly moves, relative to its typical one
_AGREEMENT, _LEAST = 1e-8, 1e-4
#: difference of a speed after an impact and its law's, relative to the fastest there
_LAW = 1e-9
#: speed that an engine has taken from a row by no impulse, relative to the fastest, beyond round-off
_CAUGHT = 1e-11
#: derivative by a number, relative to number and coordinate, to which round-off is relative at least
_LEAST_TURN = 1e-2
#: largest motion of rows at rest by the derivative, relative to its terms
_STILL = 1e-6
#: an event is tangential if its function would come back from beyond zero within this fraction of its scale
TANGENTIAL = 1e-12
#: what reaches its bound without a jump is the same on both sides but for this part of its terms: at forces, others
_CONTINUOUS, _ROUND_OFF = 1e-9, 1e-12
#: a derivative that does not matter; a difference by which shifts of events may differ that are one
_NOTHING, _ONE_INSTANT = 1e-9, 1e-6
#: flights of a chatter whose order does not matter: times the period, and their speeds, relative to the fastest
_LAST_FLIGHT, _LAST_SPEED = 1e-6, 1e-3
#: times this close, relative to a period: of an event and the passage's start or end; of two events at one instant
_SIMULTANEOUS, _INSTANT = 1e-12, 1e-15


class Guard(NamedTuple):
    """An event function right before its event: functional (2N,) of u, its rate and second derivative in time, scale.

    own: (P,) derivatives by numbers of the scene, where the motion stays; part: number of the part of the system that
    it belongs to (Dynamics.part); flight: time since the unit last took part in an event, s.
    """

    gradient: np.ndarray
    own: np.ndarray
    rate: float
    bend: float
    scale: float
    part: int
    flight: float

    def along(self, M: np.ndarray) -> np.ndarray:
        """Return its derivative (k + P,) along with that of the motion, M (2N, k + P)."""
        found = self.gradient @ M
        found[M.shape[1] - len(self.own) :] += self.own
        return np.asarray(found)

    @property
    def tangential(self) -> bool:
        """Whether it vanishes, to round-off, only to come back."""
        comes_back = self.rate <= 0.0 <= self.bend
        # the last flights of a chatter are as steep as the first ones for their height
        height = min(self.scale, 0.5 * abs(self.bend) * self.flight**2)
        return comes_back and self.rate**2 <= 2.0 * TANGENTIAL * height * abs(self.bend)


class Before(NamedTuple):
    """The moment before an event: the segment that it ends, its flow, z (K,) there, and M (2N, k + P)."""

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
    """The derivative M (2N, k + P) of u by the state at the start, in units of its sizes `scale` (k,), and by numbers.

    status: its defect so far, if any; completed: whether a chatter was, which the engine ends at the last flights of a
    millionth of a period: what these do is left out; shift: (k + P,) of the last event in time, s.
    """

    def __init__(self, dynamics: Dynamics, start: Start, numbers: Numbers | None = None) -> None:
        self.dynamics, self.system, self._start, self._scale = dynamics, dynamics.system, start, dynamics.scale
        self.numbers, self._constraints = numbers, Constraints(dynamics, numbers)
        self.status, self.completed, self._to_sizes = PassageStatus.OK, False, np.abs(dynamics.from_state)
        #: size of each coordinate so far, at least that by which it is compared, and largest derivatives of each: by
        #: the start, and by each number
        self._size = _LEAST * self._to_sizes @ self._scale
        self._reach = self._largest_of(np.hstack([dynamics.from_state * self._scale, self._none]))
        #: the last event that matters: its time, and how derivatives shift it (k + P,), by parts of the system
        self._last: tuple[float, dict[int, np.ndarray]] = (-np.inf, {})
        self.shift = np.zeros(len(self._scale) + self._none.shape[1])
        #: (u,) when each unit last took part in an event, s
        self._took_part = np.full(len(self.system.rest), -np.inf)

    @property
    def _none(self) -> np.ndarray:
        return np.zeros((self.dynamics.one, 0 if self.numbers is None else len(self.numbers)))

    def worsen(self, status: PassageStatus) -> None:
        """Note that something is wrong."""
        order = list(PassageStatus)
        self.status = max(self.status, status, key=order.index)

    def begin(self, event: Event, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return M as the first segment begins. event: at time zero. Raises Untrusted."""
        z = self.dynamics.extended(u, segment.time)
        M, own, status = self._start.derivative(event, segment, flow, z)
        self.worsen(status)
        self._check_idle(segment, np.hstack([self.dynamics.from_state * self._scale, own]), z)
        return np.hstack([M * self._scale, own])

    def after(self, before: Before, new: Segment, flow: Flow, u: np.ndarray, guards: list[Guard]) -> np.ndarray:
        """Return M after an event, or a period's end, as the motion continues from u (2N,). Raises Untrusted."""
        event = before.event
        self.shift = np.zeros_like(self.shift)
        if event.unit < 0:
            if not self._agrees(before.u, u):
                raise Untrusted
            return before.M
        z = self.dynamics.extended(u, new.time)
        jump, kick = self._jump(before, new, z)
        if begins(new):  # rows at rest or in touch to round-off: the passage begins with them so
            M = self._constraints.begun(new.state, self._start.closed(new), z)(jump(before.M))
            # a gap that round-off has opened closes at once, without speed
            met = abs(float(self.dynamics.speed[event.unit] @ before.z))
            rests = np.isinf(self.system.spring[event.unit]) and met <= _ROUND_OFF * before.segment.speed
            if EVENTS[event.what].order == codes.POSITION and not rests:
                self.worsen(PassageStatus.GRAZING)
        else:
            M = self._saltation(before, new, flow, z, jump, kick, guards)
        M = self._still(new, M, z)
        self._check_idle(new, M, z)
        self._took_part[before.segment.state != new.state] = new.start
        self._took_part[[event.unit, *event.struck]] = new.start
        return M

    def neared(self, segment: Segment, least: float) -> None:
        """Note an event that did not happen in a segment, by a margin that would make it tangential if it did."""
        if least <= TANGENTIAL and segment.duration > _LAST_FLIGHT * self.system.period:
            self.worsen(PassageStatus.GRAZING)

    def end(self, before: Before, final: np.ndarray, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of the state at the end of periods, `final` (k,): by the start (k, k), by numbers (k, P).

        The end moves with the length of a period.
        """
        dynamics, k, period = self.dynamics, len(final), self.system.period
        if not self._agrees(dynamics.from_state @ dynamics.to_state @ before.u, dynamics.from_state @ final):
            self.worsen(PassageStatus.UNDETERMINED)
            return np.full((k, k), np.nan), np.full((k, self._none.shape[1]), np.nan)
        if periods * period - self._last[0] <= _SIMULTANEOUS * period:
            self.worsen(PassageStatus.COINCIDENT)  # an event at the very end
        self._check_idle(before.segment, before.M, before.z)
        return self.reached(before, periods)

    def reached(self, before: Before, periods: float) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of the state after some periods: by the start (k, k), by numbers (k, P)."""
        dynamics, k = self.dynamics, len(self._scale)
        by_state = dynamics.to_state @ before.M[:, :k] / self._scale
        if self.numbers is None:
            return by_state, np.zeros((k, 0))
        of, rate = self.numbers.parts, (before.flow.X @ before.z)[: dynamics.one]
        by_number = dynamics.to_state @ (before.M[:, k:] + np.multiply.outer(rate, periods * of.period))
        return by_state, (by_number + (of.to_state @ before.u).T) / self.numbers.size

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
        if EVENTS[event.what].order == codes.VELOCITY:
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
            scale = before.segment.speed if EVENTS[what].order == codes.VELOCITY else terms
        gradient, own = functional[: self.dynamics.one], np.zeros(0)
        if self.numbers is not None:
            time = before.segment.start + before.segment.duration
            own = derivative_of(before.flow, self.numbers).function(r, what) @ before.z
            own = own + self.numbers.harmonics(self.dynamics, time) @ functional
        touched = np.flatnonzero(gradient)
        part = int(self.dynamics.part[touched[0] % len(self.dynamics.root)]) if len(touched) else -1
        flight = before.segment.start + before.segment.duration - self._took_part[r]
        return Guard(gradient, own, rate if met is None else met, bend, scale, part, flight)

    def _jump(self, before: Before, new: Segment, z: np.ndarray) -> tuple[Affine, np.ndarray]:
        """Return the derivative of u after an event by u before, at one time, and the jump (N,) of w; z: (K,) after.

        Raises Untrusted where the engine's speeds do not follow from their laws.
        """
        dynamics, system, event, rates = self.dynamics, self.system, before.event, self.dynamics.rates
        root, u, u_before = dynamics.root, z[: dynamics.one], before.u
        at = lambda w: np.concatenate([u_before[dynamics.places], w])  # noqa: E731
        kick, struck = event.impulse @ dynamics.rows, Affine(np.eye(len(root)), self._none[rates])
        w = u_before[rates]
        if event.impulse.any():
            jump = impact(system, w / root, event, before.segment.speed, self.numbers)
            missed = np.abs(system.J[event.struck] @ jump.v - event.after)[np.isinf(system.spring[event.struck])]
            fastest = np.abs(np.concatenate([event.before, event.after])).max()
            if np.any(missed > _LAW * fastest + _ROUND_OFF * before.segment.speed):
                raise Untrusted
            # after a plastic impact a small restitution adds bounces that end at once, whose sum is nothing to first
            # order; not so where the contact opens
            plastic = event.struck[np.isinf(system.spring[event.struck]) & (system.restitution[event.struck] == 0.0)]
            opens = plastic[~presses(new.state[plastic]) & (new.state[plastic] != codes.TOUCHING)]
            if self.numbers is not None and self.numbers.parts.restitution[:, opens].any():
                raise Untrusted
            struck, w = scaled(dynamics, jump, w, self.numbers), root * jump.v
        follow = self._constraints.followed(new.state, np.concatenate([at(w), z[dynamics.one :]])).part(rates)
        derivative, left = struck.then(follow), follow.matrix @ (u_before[rates] + kick)
        known = len(np.unique(event.struck)) == len(event.struck)
        known = known and self._agrees(at(follow.matrix @ w), at(left))
        if np.any(np.abs(self.dynamics.rows @ (left - u[rates])) > _CAUGHT * new.speed):  # a chatter has been completed
            self.completed = True
            still = self._start.closed(new), np.abs(system.J @ new.v).reshape(2, -1) <= _ROUND_OFF * new.speed
            stuck = still[0] & still[1][1] & (system.friction > 0.0)
            held = self._constraints.held(still[0] & still[1][0], stuck, z).part(rates)
            held = held.then(self._constraints.followed(new.state, z).part(rates))
            derivative, kick = derivative.then(held), u[rates] - u_before[rates]
            known = known and self._agrees(at(held.matrix @ left), at(u[rates]))
        if not known or not self._agrees(at(u[rates]), u):
            raise Untrusted
        kick[dynamics.sliders] = (u - u_before)[rates][dynamics.sliders]
        whole = Affine(np.eye(dynamics.one), self._none)
        whole.matrix[rates, rates], whole.own[rates] = derivative
        return whole, kick

    def _saltation(
        self, before: Before, new: Segment, flow: Flow, z: np.ndarray, jump: Affine, jumped: np.ndarray,
        guards: list[Guard],
    ) -> np.ndarray:  # fmt: skip
        """Return the derivative after an event: jump M, and the effect of the event's shift in time.

        z: (K,) after; jumped: (N,) of w. Parts of the system that do not feel each other have their own events.
        """
        dynamics, event, M, k = self.dynamics, before.event, before.M, self.dynamics.one
        rate = (before.flow.X @ before.z)[:k]
        rate_after = (flow.X @ z)[:k]
        kick = rate_after - jump.matrix @ rate
        of_force = EVENTS[event.what].order == codes.FORCE
        round_off = _CONTINUOUS if of_force else _ROUND_OFF
        kick[np.abs(kick) <= round_off * (np.abs(rate_after) + np.abs(jump.matrix) @ np.abs(rate))] = 0.0
        if event.impulse.any():
            kick[dynamics.places] = dynamics.rate * jumped
        parts = {guard.part: guard for guard in guards[::-1]}  # the first of each
        others = [part for part in parts if part != guards[0].part]
        owner = np.tile(np.where(np.isin(dynamics.part, others), dynamics.part, guards[0].part), 2)
        shifts = {part: -each.along(M) / (each.rate or np.inf) for part, each in parts.items()}
        self.shift = shifts[guards[0].part]
        unmoved = jump(M)
        moved = unmoved
        for part, shift in shifts.items():
            moved = moved - np.multiply.outer(np.where(owner == part, kick, 0.0), shift)
        matters = event.impulse.any() or self._largest(moved - unmoved) > _NOTHING * max(self._largest(M), 1.0)
        yields = np.isfinite(self.system.spring)
        if event.what == codes.CLOSES and yields[event.unit]:
            begun = np.flatnonzero((before.segment.state == codes.OPEN) & presses(new.state) & yields)
            if len(begun) > 1:
                moved = self._closings(before, new, sorted(begun.tolist(), key=lambda c: c != event.unit))
            # friction stops the slips of neighbours at once where this motion has none
            moved = self._constraints.begun(new.state, presses(new.state), z)(moved)
        if not matters:
            return moved
        if any(guard.tangential for guard in guards):
            self.worsen(PassageStatus.GRAZING)
        closed = self._start.closed(new)
        rests = event.what == codes.CLOSES and len(guards) > 1
        rests = rests and (not event.after.any() or bool(closed[event.struck].all()))
        # sliders come to rest at several contacts in any order, and a chatter ends in any
        free = (rests and bool(np.all(self.system.tilt < 0))) or self._last_flights(before, guards)
        apart = np.zeros(M.shape[1], bool) if free else self._apart(M, guards, shifts, new.start)
        if apart[self._start.counts].any():
            self.worsen(PassageStatus.COINCIDENT)
        if rests and (free or apart.any()):  # nothing is left of gaps and speeds
            moved = self._constraints.held(closed, np.zeros(len(new.state), bool), z)(unmoved)
        if before.segment.open_force.any() and of_force:
            raise Untrusted  # of forces that the laws leave open the engine has chosen one
        self._last = new.start, shifts
        return moved

    def _largest(self, M: np.ndarray) -> float:
        """Return the largest entry of a derivative (2N, k + P) in units of the sizes of states."""
        return float(np.abs(self.dynamics.to_state @ M / self._scale[:, None]).max(initial=0.0))

    def _last_flights(self, before: Before, guards: list[Guard]) -> bool:
        """Return whether contacts that meet end flights of a chatter that the engine leaves out."""
        flight, speed = _LAST_FLIGHT * self.system.period, _LAST_SPEED * before.segment.speed
        last = len(guards) > 1 and all(each.flight <= flight and abs(each.rate) <= speed for each in guards)
        self.completed |= last
        return last

    def _apart(self, M: np.ndarray, guards: list[Guard], shifts: dict[int, np.ndarray], time: float) -> np.ndarray:
        """Return of which neighbouring motions (k + P,) another event at the instant of one takes place apart."""
        apart, events = np.zeros(M.shape[1], bool), [(guard, shifts[guard.part]) for guard in guards[1:]]
        if time - self._last[0] <= _INSTANT * self.system.period:
            events += [(guard, self._last[1][guard.part]) for guard in guards[:1] if guard.part in self._last[1]]
        for guard, shift in events:
            at_event, later = guard.along(M), guard.rate * shift
            terms = np.abs(at_event) + np.abs(later)
            apart |= np.abs(at_event + later) > np.maximum(_ONE_INSTANT * terms, _NOTHING * guard.scale)
        return apart

    def _closings(self, before: Before, new: Segment, closing: list[int]) -> np.ndarray:
        """Return the derivative after contacts that yield have begun at one instant, each by its own gap."""
        dynamics, k, ways = self.dynamics, self.dynamics.one, []
        for order in (closing, closing[::-1]):
            moved, flow, state = before.M, before.flow, before.segment.state.copy()
            for c in order:
                state[c] = new.state[c]
                after = dynamics.flow(state, before.segment.open_force)
                rate = float(dynamics.gap[c] @ flow.X @ before.z)
                kick = ((after.X - flow.X) @ before.z)[:k]
                closes = dynamics.gap[c, :k] @ moved + self._own("gap", np.array([c]), before.z)[0]
                moved, flow = moved + np.multiply.outer(kick / rate, closes), after
            ways.append(moved)
        if self._largest(ways[0] - ways[1]) > _ONE_INSTANT * self._largest(ways[0]):
            self.worsen(PassageStatus.COINCIDENT)
        return ways[0]

    def _own(self, of_what: str, rows: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return what numbers change in some functionals (m,), "gap" or "speed", at z (K,): (m, k + P)."""
        found = np.zeros((len(rows), len(self.shift)))
        if self.numbers is not None:
            found[:, len(self._scale) :] = (getattr(self.numbers.parts, of_what)[:, rows] @ z).T
        return found

    def _largest_of(self, M: np.ndarray) -> np.ndarray:
        """Return the largest entries (2N, 1 + P) of a derivative: by the start, and by each number."""
        k = len(self._scale)
        return np.column_stack([np.abs(M[:, :k]).max(axis=1), np.abs(M[:, k:])])

    def _still(self, new: Segment, M: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the derivative without what moves rows at rest. Raises Untrusted if that is more than round-off.

        Round-off is relative to the largest derivatives so far: after a chatter has amplified these, it may be as large
        as the derivative is now.
        """
        dynamics, u = self.dynamics, len(new.state)
        closed = np.isinf(self.system.spring) & presses(new.state) & contacts_of(self.system)
        rigid, k = np.flatnonzero(closed), dynamics.one
        stuck = u + np.flatnonzero(dynamics.flow(new.state, new.open_force).stuck)
        speeds = np.concatenate([rigid, stuck])
        still = np.vstack([dynamics.speed[speeds], dynamics.gap[rigid]])[:, :k]
        own = np.vstack([self._own("speed", speeds, z), self._own("gap", rigid, z)])
        self._reach = np.maximum(self._reach, self._largest_of(M))
        # a number that hardly moves anything leaves round-off of the coordinates' sizes
        self._reach[:, 1:] = np.maximum(self._reach[:, 1:], _LEAST_TURN * self._size[:, None])
        terms = np.abs(still) @ self._reach + self._largest_of(own)
        left = self._largest_of(still @ M + own)
        if np.any(left > _STILL * terms):
            raise Untrusted
        if np.any(left > _STILL * (np.abs(still) @ self._largest_of(M) + self._largest_of(own))):
            return self._constraints.begun(new.state, closed, z)(M)
        return M

    def _check_idle(self, segment: Segment, M: np.ndarray, z: np.ndarray) -> None:
        """Note contacts that touch without force and that neighbouring motions open or hit: they have a kink."""
        idle, dynamics, k = np.flatnonzero(segment.state == codes.TOUCHING), self.dynamics, self.dynamics.one
        if not len(idle):
            return
        # gaps and their rates, of which a contact with a force holds some
        carried = self._constraints.begun(segment.state, presses(segment.state), z)(M)
        for what, size in (("gap", 1.0), ("speed", self.system.omega)):
            functional = getattr(dynamics, what)[idle, :k]
            opened = np.abs(functional @ carried + self._own(what, idle, z))[:, self._start.counts]
            opened = opened.max(axis=1, initial=0.0)
            if np.any(opened > _NOTHING * size * self.system.play[idle]):
                self.worsen(PassageStatus.GRAZING)
