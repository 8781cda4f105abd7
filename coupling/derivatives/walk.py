"""One passage of a motion: the segments of a run, and with them the derivative of where they lead."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from vanedamp.coupling.derivatives.derivative import Before, Derivative, Guard, begins
from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.jump import Untrusted
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.derivatives.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.derivatives.start import Start
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import fitted
from vanedamp.coupling.response.segment import Event, EventRun, Segment, Walk

#: events per period after which a walk gives up: each is a step of Python
EVENTS_PER_PERIOD = 2000


def run_from(frame: Frame, state: np.ndarray, periods: int) -> EventRun:
    """Return the engine's run over periods that begins with a state (k,)."""
    system = frame.system
    start, records = fitted(system, frame.restart_of(state)), new_records(system, periods, 0)
    return engine_run(system, start, records, True, EVENTS_PER_PERIOD * periods)


class Watch(Protocol):
    """Measures a motion and its derivatives M (2N, k + P): by the start, in units of its sizes, then by numbers.

    nears: whether events that nearly happen are sought, too.
    """

    nears: bool

    def begin(self, unheld: np.ndarray) -> None:
        """Take the derivative (2N, k + P) of the start as it is given, before what sticks is stopped."""

    def segment(self, begun: Before, duration: float) -> None:
        """Take the motion over a duration, s, until the next event. begun: its start, with the derivative there."""

    def event(self, before: Before, new: Segment, M: np.ndarray, shift: np.ndarray) -> None:
        """Take an event, or a period's end. M: the derivative after it; shift: (k + P,) of its time, s."""

    def end(self, before: Before) -> None:
        """Take the end of the motion."""


class PassageWalk:
    """One passage from a state (k,), with its derivative or without, and by numbers of the scene if they are given.

    turns: (k, P) how numbers change the start; watch: is called with the course of every segment; given: as in Start;
    reached: state (k,) and derivatives (k, k) and (k, P) some part of a period, or periods, after the start, of a
    passage without its derivative only the state; None without a part, or if the engine has not come so far; short:
    whether the passage ends there, its own end unknown.
    """

    def __init__(
        self, dynamics: Dynamics, names: EventNames, state: np.ndarray, derivative: bool = True,
        numbers: Numbers | None = None, turns: np.ndarray | None = None, watch: Watch | None = None,
        given: bool = False, part: float = np.inf, short: bool = False,
    ) -> None:  # fmt: skip
        self._dynamics, self._names, self._whole = dynamics, names, derivative
        self._frame, self._numbers, self._watch, self._part, self._short = dynamics.frame, numbers, watch, part, short
        self._start = Start(dynamics, state, numbers, turns, given)
        self.derivative = Derivative(dynamics, self._start, numbers)
        self._crossings, self._clearance = list[Crossing](), (np.inf, "")
        self.reached: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def passage(self, run: EventRun, periods: int) -> Passage:
        """Walk a run to the end of the periods."""
        walk, k, made = Walk(run, periods), len(self._dynamics.scale), self.derivative
        state, derivative = np.full(k, np.nan), np.full((k, k), np.nan)
        by_number = np.full((k, 0 if self._numbers is None else len(self._numbers)), np.nan)
        with np.errstate(invalid="ignore"):  # a derivative that is not known is nan
            before = self._walked(walk)
            final = run.final() if walk.status is Status.OK and not self._short else None
            if self._short and self.reached is not None:
                state, derivative, by_number = self.reached
            elif before is None or final is None:
                made.worsen(PassageStatus.STOPPED)
            else:
                state = self._frame.state_of(final)
                if self._watch is not None:
                    self._watch.end(before)
                if self._whole:
                    derivative, by_number = made.end(before, state, periods)
        peaks = run.records.peak[:periods].copy()
        return Passage(
            state, derivative, tuple(self._crossings), self._clearance, made.status, peaks, by_number
        )  # fmt: skip

    def _walked(self, walk: Walk) -> Before | None:
        """Walk to the end. Returns the end of the last segment, None without any."""
        dynamics, part = self._dynamics, self._part * self._frame.system.period
        before: Before | None = None
        for segment in walk:
            assert segment.event is not None
            flow, u = dynamics.flow(segment.state, segment.open_force), dynamics.state(segment)
            M = self._next(walk, before, segment, flow, u)
            z = dynamics.extended(u, segment.time)
            if segment.start <= part <= segment.start + segment.duration:
                middle = self._followed(Before(segment, segment.event, flow, z, M), part - segment.start, None)
                self.reached = dynamics.to_state @ middle.u, *self.derivative.reached(middle, self._part)
                if self._short:
                    return middle
            if not self._whole:
                before = Before(segment, segment.event, flow, z, M)
                continue
            if self._watch is None or self._watch.nears:
                least, unit, what = flow.least(z, segment.duration, (segment.event.unit, segment.event.what))
                if least < self._clearance[0]:
                    self._clearance = least, self._names.possible(unit, what)
                self.derivative.neared(segment, least)
            before = self._followed(Before(segment, segment.event, flow, z, M), segment.duration, self._watch)
        return before

    def _followed(self, begun: Before, duration: float, watch: Watch | None) -> Before:
        """Return the motion a duration after the start of a segment, s."""
        series, one, numbers = begun.flow.series, len(begun.M), self._numbers
        Z = np.zeros((len(begun.z), begun.M.shape[1]))
        Z[:one] = begun.M
        if numbers is not None:
            series = derivative_of(begun.flow, numbers).series
            Z[one:, Z.shape[1] - len(numbers) :] = numbers.harmonics(self._dynamics, begun.segment.start)[:, one:].T
        course = series.course(begun.z, Z, duration, False)
        if watch is not None:
            watch.segment(begun, duration)
        return begun._replace(z=course.last, M=course.end[:one])

    def _next(self, walk: Walk, before: Before | None, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return the derivative as a segment begins, nan where it is unknown, and keep the event before it."""
        made, guards = self.derivative, list[Guard]()
        if before is not None and before.event.unit >= 0:
            guards = made.guards(before, segment) if self._whole else []
            name = self._names.event(before.flow.named, flow.named, before.event.struck)
            if name and (before.event.impulse.any() or not begins(segment)):
                speed = guards[0].rate if guards else _met(before.event)
                self._crossings.append(Crossing(segment.start, name, speed, before.event.loss))
        if not self._whole:
            return self._dynamics.from_state
        try:
            if before is None:
                M = made.begin(walk.start, segment, flow, u)
                if self._watch is not None:
                    self._watch.begin(self._start.unheld)
                return M
            M = made.after(before, segment, flow, u, guards)
        except Untrusted:
            made.worsen(PassageStatus.UNDETERMINED)
            M = np.full((len(u), len(made.shift)), np.nan)
        if before is not None and self._watch is not None:
            self._watch.event(before, segment, M, made.shift)
        return M


def _met(event: Event) -> float:
    """Return the speed, m/s, at which the contact meets whose event it is; nan without an impact of that."""
    met = event.before[event.struck == event.unit]
    return float(met[0]) if len(met) else np.nan
