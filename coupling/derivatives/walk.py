"""One passage of a motion: the course of a run, and with it the derivative of where it leads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Flow, ScaledDynamics
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.flow_table import FlowTable, table_of
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.impact import PLASTIC
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.derivatives.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.derivatives.passing import end_walk, walk_along
from vanedamp.coupling.derivatives.saltation import SIMULTANEOUS
from vanedamp.coupling.derivatives.walking import (
    COMPLETED,
    COUNTS,
    FLOW,
    GIVEN,
    KEEPS,
    KNOWN,
    LAW_OF,
    LOST,
    NEAR_CODE,
    NEAR_UNIT,
    NEXT,
    REACHED,
    SEEKS,
    SHORT,
    SMOOTH,
    STATUS,
    WANTS_FLOW,
    WANTS_ROOM,
)
from vanedamp.coupling.engine.backends import engine_run, reuse_subsystems
from vanedamp.coupling.engine.trace import COUNT, COURSE, Leg, Trace, leg_of
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import fitted
from vanedamp.coupling.response.segment import EventRun, SegmentEnd
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.coupling.system.system import System
from vanedamp.coupling.tangents.differences import NotSmooth, derivative

#: events per period after which a walk gives up
EVENTS_PER_PERIOD = 2000
_STATUSES = list(PassageStatus)


def run_from(frame: Frame, state: np.ndarray, periods: int, earlier: EventRun | None = None) -> EventRun:
    """Return the engine's run over periods that begins with a state (k,).

    earlier: a run that is read no more: it begins again if it is of the same system, or gives its subsystems.
    """
    system, start = frame.system, fitted(frame.system, frame.restart_of(state))
    if earlier is not None and earlier.whole is system and periods < len(earlier.records.peak):
        earlier.begin_from(start)
        earlier.max_events = EVENTS_PER_PERIOD * periods
        return earlier
    run = engine_run(system, start, new_records(system, periods, 0), False, EVENTS_PER_PERIOD * periods)
    reuse_subsystems(run, earlier)
    return run


class Before(NamedTuple):
    """A moment of a motion: its segment, the event that ends it, its flow, z (K,) there, and M (2N, k + P)."""

    segment: Leg
    event: SegmentEnd
    flow: Flow
    z: np.ndarray
    M: np.ndarray

    @property
    def u(self) -> np.ndarray:
        """The state (2N,) there."""
        return self.z[: self.flow.dynamics.one]


class WalkObserver(Protocol):
    """Measures a motion and its derivatives M (2N, k + P): by the start, in units of its sizes, then by numbers.

    nears: whether events that nearly happen are sought, too.
    """

    nears: bool

    def begin(self, unheld: np.ndarray) -> None:
        """Take the derivative (2N, k + P) of the given start, before sticking rows are stopped."""

    def segment(self, begun: Before, duration: float) -> None:
        """Take the motion over a duration, s, until the next event. begun: its start, with the derivative there."""

    def event(self, before: Before, new: Leg, M: np.ndarray, shift: np.ndarray) -> None:
        """Take an event, or a period's end. M: the derivative after it; shift: (k + P,) of its time, s."""

    def end(self, before: Before) -> None:
        """Take the end of the motion."""


class PassageWalk:
    """One passage from a state (k,), with its derivative or without, and by numbers of the scene if they are given.

    turns: (k, P) how numbers change the start; watch: is called with the course of every segment; given: whether the
    motion begins so whatever happens: then only numbers may make it kink there;
    reached: state (k,) and derivatives (k, k) and (k, P) some part of a period, or periods, after the start, of a
    passage without its derivative only the state; None without a part, or if the engine has not come so far; short:
    whether the passage ends there, its own end unknown.
    """

    def __init__(
        self, dynamics: ScaledDynamics, names: EventNames, state: np.ndarray, derivative: bool = True,
        numbers: Parameters | None = None, turns: np.ndarray | None = None, watch: WalkObserver | None = None,
        given: bool = False, part: float = np.inf, short: bool = False,
    ) -> None:  # fmt: skip
        self._dynamics, self._names, self._whole, self._state = dynamics, names, derivative, state
        self._frame, self._numbers, self._watch, self._part, self._short = dynamics.frame, numbers, watch, part, short
        self._turns, self._given = turns, given
        self._table = table_of(dynamics, numbers) if derivative else None
        self._crossings = list[Crossing]()
        self.reached: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        #: whether a chatter was completed, which the engine ends at the last flights of a millionth of a period
        self.completed = False

    def passage(self, run: EventRun, periods: int) -> Passage:
        """Walk a run to the end of the periods."""
        k, P = len(self._dynamics.scale), 0 if self._numbers is None else len(self._numbers)
        state, derivative, by_number = np.full(k, np.nan), np.full((k, k), np.nan), np.full((k, P), np.nan)
        made = _Made(self._table, self._state, self._turns, self._given, self._watch) if self._table else None
        if made is not None:
            made.until(self._part * self._frame.system.period, self._short)
        status, before = PassageStatus.OK, self._walked(run, periods, made)
        final = run.final() if run.status is Status.OK and not self._short else None
        if self._short and self.reached is not None:
            state, derivative, by_number = self.reached
        elif final is None or (made is not None and before is None):
            status = PassageStatus.STOPPED
        else:
            state = self._frame.state_of(final)
            if self._watch is not None and before is not None:
                self._watch.end(before)
            if made is not None and before is not None and end_walk(*made.records(run.trace), state, float(periods)):
                derivative, by_number = made.derivatives(before, periods)
        clearance = (np.inf, "")
        if made is not None:
            clearance = made.clearance(self._names)
            status = max(status, made.status, key=_STATUSES.index)
            self.completed = made.completed
        peaks = run.records.peak[:periods].copy()
        return Passage(state, derivative, tuple(self._crossings), clearance, status, peaks, by_number)

    def _walked(self, run: EventRun, periods: int, made: _Made | None) -> Before | None:
        """Walk to the end. Returns the end of the last segment, None without any."""
        done, before, began = 0, None, None
        for trace in run.course(periods, COURSE if made is None else made.segments):
            if made is not None:
                made.walk(trace)
            count = int(trace.at[COUNT]) if made is None else made.done
            flows = [self._flow(trace, i) for i in range(done, count)] if made is None else made.flows[done:count]
            if made is None and self._part <= periods:
                flows = flows[: self._part_of(trace, done, flows)]
            self._cross(trace, done, began, flows, made)
            began = flows[-1] if flows else began
            if made is None and self._short and self.reached is not None:
                return None
            if made is not None and count:
                for i in range(done, count) if self._watch is not None else ():
                    before = self._watched(trace, i, before, made)
                if self.reached is None and made.has_reached:
                    self.reached = made.reached(self._part)
                if before is None or self._watch is None:
                    before = made.before(trace, count - 1)
                if self._short and self.reached is not None:
                    return before
                made.turn()
            done = 1
        return before

    def _watched(self, trace: Trace, i: int, before: Before | None, made: _Made) -> Before:
        """Let the watch take event i and segment i. Returns the end of the segment."""
        begun, watch = made.begun(trace, i), self._watch
        assert watch is not None
        if before is None:
            watch.begin(made.unheld)
        else:
            watch.event(before, begun.segment, begun.M, made.shift(i))
        watch.segment(begun, begun.segment.duration)
        return made.before(trace, i)

    def _flow(self, trace: Trace, i: int) -> Flow:
        return self._dynamics.flow(trace.state[i], trace.open_force[i])

    def _cross(self, trace: Trace, done: int, old: Flow | None, flows: list[Flow], made: _Made | None) -> None:
        """Keep the events before segments from `done` on, in their flows, that are some by their names.

        old: the flow before these; None: there is none.
        """
        period, rows = self._frame.system.period, slice(done, done + len(flows))
        first = trace.first[done : done + len(flows) + 1].tolist()
        struck, before = trace.struck[: first[-1]].tolist(), trace.before[: first[-1]].tolist()
        times = (trace.period[rows] * period + trace.time[rows]).tolist()
        met = [np.nan] * len(flows) if made is None else made.met(rows)
        for i, (unit, loss, time, new) in enumerate(
            zip(trace.unit[rows].tolist(), trace.loss[rows].tolist(), times, flows, strict=True)
        ):
            hit, speed = struck[first[i] : first[i + 1]], met[i]
            name = "" if old is None or unit < 0 else self._names.event(old, new, hit)
            old = new
            if not name or (time <= SIMULTANEOUS * period and not trace.impulse[done + i].any()):
                continue
            if made is None and unit in hit:  # at which the contact meets whose event it is
                speed = before[first[i] + hit.index(unit)]
            self._crossings.append(Crossing(time, name, speed, loss))

    def _part_of(self, trace: Trace, done: int, flows: list[Flow]) -> int:
        """Keep the state at the part of a period that is wanted, if it lies in a segment from `done` on.

        Returns how many of them the passage has.
        """
        period, k = self._frame.system.period, len(self._dynamics.scale)
        for i, flow in enumerate(flows, done):
            leg = leg_of(trace, i, period)
            after = self._part * period - leg.start
            if 0.0 <= after <= leg.duration:
                z = self._dynamics.extended(self._dynamics.state(leg), leg.time)
                there = flow.series.course(z, np.zeros((len(z), 0)), after, False).last
                state = self._dynamics.to_state @ there[: self._dynamics.one]
                self.reached = state, np.full((k, k), np.nan), np.full((k, 0), np.nan)
                if self._short:
                    return i + 1 - done
        return len(flows)


def periods_from(
    dynamics: ScaledDynamics, state: np.ndarray, periods: int, earlier: list[EventRun]
) -> Iterator[tuple[np.ndarray, np.ndarray, PassageStatus]]:
    """Yield the state (k,) at the end of every period of a motion, its derivative (k, k) by that at the period's start.

    And its defect, which ends the motion. One run passes all periods; earlier: as of `run_from`, and the one
    that is left. Derivatives are of a one-period passage, without a kink at the start.
    """
    frame = dynamics.frame
    made = _Made(table_of(dynamics, None), state, None, False, None)
    made.until(np.inf, False)
    run = run_from(frame, state, periods, *earlier)
    earlier[:], done = [run], 0

    def ended(state: np.ndarray) -> tuple[np.ndarray, np.ndarray, PassageStatus]:
        agrees = end_walk(*made.records(trace), state, float(done + 1))
        slopes = made.derivatives(made.before(trace, made.done - 1), done + 1)[0]
        return state, slopes if agrees else np.full_like(slopes, np.nan), made.status

    for part, trace in enumerate(run.course(periods, made.segments)):
        if part:
            made.turn()
        count = int(trace.at[COUNT])
        while True:
            of_period = made.done + int(np.searchsorted(trace.period[made.done : count], done, side="right"))
            trace.at[COUNT] = of_period
            made.walk(trace)
            trace.at[COUNT] = count
            if of_period == count:
                break
            there = frame.to_state @ np.concatenate([trace.q[of_period], trace.v[of_period]])
            yield ended(there)
            done += 1
            made.begin(there)
    final = run.final() if run.status is Status.OK else None
    if final is None:
        yield np.full(len(state), np.nan), np.full((len(state), len(state)), np.nan), PassageStatus.STOPPED
    else:
        yield ended(frame.state_of(final))


class _Made:
    """The derivative of a passage as made in compiled code, with data that Python finds.

    flows: of the segments of the present course.
    """

    def __init__(
        self, table: FlowTable, state: np.ndarray, turns: np.ndarray | None, given: bool, watch: WalkObserver | None
    ) -> None:
        self._table, self._dynamics, self._numbers = table, table.dynamics, table.numbers
        self.flows = list[Flow]()
        k, keeps = len(state), watch is not None
        self._walk = walk = table.walking(keeps)
        walk.at[:], walk.turns[:] = 0, 0.0
        walk.at[COUNTS], walk.at[GIVEN] = (k, 1) if given else (0, 0)
        walk.at[SEEKS], walk.at[KEEPS] = watch is None or watch.nears, keeps
        if turns is not None:
            walk.turns[:] = turns
        self.begin(state)

    def begin(self, state: np.ndarray) -> None:
        """Begin a passage with the next segment of the course, in a state (k,)."""
        walk = self._walk
        walk.shifted[:], walk.shift[:], walk.reach[:] = 0, 0.0, 0.0
        walk.at[FLOW] = walk.at[LAW_OF] = -1
        walk.at[STATUS], walk.at[COMPLETED], walk.at[LOST], walk.at[SMOOTH] = 0, 0, 0, 1
        walk.given[:], walk.last[0], walk.took_part[:], walk.clearance[0] = state, -np.inf, -np.inf, np.inf
        walk.size[:], walk.reach[:, 0] = self._table.least, self._table.reach

    @property
    def segments(self) -> int:
        """Segments of a course there is room for."""
        return self._table.segments

    def until(self, time: float, short: bool) -> None:
        """Keep the state at a time after the start, s; short: and end there."""
        self._walk.part[0], self._walk.at[SHORT] = time, short

    def records(self, trace: Trace) -> tuple[object, ...]:
        """Return the records for compiled functions."""
        return self._table.equations, self._table.turns, self._table.stack, trace, self._walk, self._table.room

    def walk(self, trace: Trace) -> None:
        """Continue to the present end of a course."""
        walk = self._walk
        while True:
            outcome = walk_along(*self.records(trace))
            # others may replace them later
            self.flows += [self._table.flows[index] for index in walk.flows[len(self.flows) : walk.at[NEXT]]]
            if outcome == KNOWN:
                return
            if outcome == WANTS_FLOW:
                self._table.add(walk.wanted, walk.wanted_force)
            elif outcome == WANTS_ROOM:
                raise MemoryError("room of derivatives")
            else:
                e = int(walk.at[NEXT])
                walk.at[LAW_OF] = e
                walk.at[SMOOTH] = _set_slopes(self._dynamics.system, trace, e, walk.law)

    def turn(self) -> None:
        """Continue a course from its last segment."""
        self._walk.at[NEXT], self._walk.at[LAW_OF], self.flows = 1, -1, self.flows[-1:]

    @property
    def done(self) -> int:
        """Segments of the course that have been passed, with the one in which the passage ends."""
        at = self._walk.at
        return int(at[NEXT])

    def met(self, rows: slice) -> list[float]:
        """Return the rates of the event functions of some events."""
        rates: list[float] = self._walk.met[rows].tolist()
        return rates

    def shift(self, i: int) -> np.ndarray:
        """Return how event i moves in time, (C,) s."""
        return self._walk.shifts[i].copy()

    @property
    def unheld(self) -> np.ndarray:
        """Derivative (2N, C) of the start as it is given."""
        return self._walk.unheld.copy()

    def begun(self, trace: Trace, i: int) -> Before:
        """Return the start of segment i."""
        leg = leg_of(trace, i, self._dynamics.system.period)
        z = self._dynamics.extended(self._dynamics.state(leg), leg.time)
        return Before(leg, leg.event, self.flows[i], z, self._walk.begins[i].copy())

    def before(self, trace: Trace, i: int) -> Before:
        """Return the end of segment i, of those that are not kept the last."""
        leg, walk, one = leg_of(trace, i, self._dynamics.system.period), self._walk, self._dynamics.one
        keeps = walk.at[KEEPS]
        z, M = (walk.z_ends[i], walk.ends[i]) if keeps else (walk.z, walk.end[:one])
        return Before(leg, leg.event, self.flows[i], z.copy(), M.copy())

    @property
    def has_reached(self) -> bool:
        """Whether the part that is wanted has been passed."""
        return bool(self._walk.at[REACHED])

    def reached(self, part: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return state (k,) and derivatives (k, k), (k, P) at that part, in periods."""
        walk, one = self._walk, self._dynamics.one
        flow = self.flows[int(walk.at[REACHED]) - 1]
        state = self._dynamics.to_state @ walk.z_reached[:one]
        return state, *self._after(flow, walk.z_reached, walk.reached[:one], part)

    def derivatives(self, before: Before, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (k, k), (k, P) of the state at the end of periods."""
        return self._after(before.flow, before.z, before.M, periods)

    def _after(self, flow: Flow, z: np.ndarray, M: np.ndarray, periods: float) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of the state after some periods: by the start (k, k), by numbers (k, P).

        The end moves with the length of a period.
        """
        dynamics, k, one = self._dynamics, len(self._dynamics.scale), self._dynamics.one
        by_state = dynamics.to_state @ M[:, :k] / dynamics.scale
        if self._numbers is None:
            return by_state, np.zeros((k, 0))
        of, rate = self._numbers.parts, (flow.X @ z)[:one]
        by_number = dynamics.to_state @ (M[:, k:] + np.multiply.outer(rate, periods * of.period))
        return by_state, (by_number + (of.to_state @ z[:one]).T) / self._numbers.size

    def clearance(self, names: EventNames) -> tuple[float, str]:
        """Return the smallest distance to an event that did not happen, and its name."""
        walk = self._walk
        least = float(walk.clearance[0])
        if not np.isfinite(least):
            return np.inf, ""
        return least, names.possible(int(walk.at[NEAR_UNIT]), int(walk.at[NEAR_CODE]))

    @property
    def status(self) -> PassageStatus:
        """Its defect, if any."""
        return _STATUSES[int(self._walk.at[STATUS])]

    @property
    def completed(self) -> bool:
        """Whether a chatter was completed."""
        return bool(self._walk.at[COMPLETED])


def _set_slopes(system: System, trace: Trace, e: int, law: np.ndarray) -> bool:
    """Set restitutions in an event, and their derivatives by speed and by coefficient. Returns if there are any."""
    row = slice(trace.first[e], trace.first[e + 1])
    struck, before, after = trace.struck[row], trace.before[row], trace.after[row]
    bounces = np.abs(after) > PLASTIC * np.abs(np.concatenate([before, after])).max(initial=0.0)
    units, approach = struck[bounces], -before[bounces]
    coefficient, now = system.restitution, restitutions_at(system, units, approach)

    def of_coefficient(factor: float) -> np.ndarray:
        return restitutions_at(system._replace(restitution=coefficient * factor), units, approach)

    try:
        by_speed = derivative(lambda factor: restitutions_at(system, units, approach * factor), 1.0, 1.0, now)
        by_coefficient = derivative(of_coefficient, 1.0, 1.0, now)
    except NotSmooth:
        return False
    law[0, units], law[1, units] = now, by_speed / np.where(approach == 0.0, 1.0, approach)
    law[2, units] = by_coefficient / np.where(coefficient[units] == 0.0, 1.0, coefficient[units])
    return True
