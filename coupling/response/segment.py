"""Segments: the motion of a run from event to event in the coordinates of its System, whichever engine runs.

Between two events contacts keep their states, and the motion is a sum of exponentials. With changes of the modes'
amplitudes c_j from the start on, g_j(t) = c_j (exp(rate_j t) - 1), and the same less its tangent, b_j(t), coordinates
and rates are

    q = q_0 + v_0 t + bend t^2/2 + Re sum_j shape_j b_j(t),    v = v_0 + bend t + Re sum_j rate_shape_j g_j(t),

and forces of units are  force + Re sum_j force_shape_j (c_j + g_j(t)),  each without cancellation from the start on.
A mode that a harmonic drives near its own frequency grows by drive_j times the secular function of both as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.numerics.codes import EVENTS, PERIOD
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.system import System

#: below this size, exp(z) - 1 - z and its quotient by z are computed by their series
_SMALL = 0.1


class SegmentEnd(NamedTuple):
    """End of a segment; u units.

    unit: number of the unit at which it happens, -1: the end of an excitation period, or the start of the run
    what: its code, CLOSES, OPENS, RECLOSES, PARTS, STOPS, AT_LOW or AT_HIGH (numerics.codes); 0 without a unit
    impulse: (2u,) N s on all rows, normals first; compression: (2u,) impulses of the first phase, of laws with two
    struck: (k,) units that an impact hits, rigid or not; before, after: (k,) m/s, speeds of their gaps
    loss: energy that impacts take, J
    reduced: whether restitutions had to be smaller by one factor, so that they bring none
    """

    unit: int
    what: int
    impulse: np.ndarray
    compression: np.ndarray
    struck: np.ndarray
    before: np.ndarray
    after: np.ndarray
    loss: float = 0.0
    reduced: bool = False


class Segment(NamedTuple):
    """The motion of a system with N coordinates and u units until the next event, in m modes.

    period, time: number of its excitation period, and its start within that, s; duration: s; event: at its end
    state: (u,) of the units (numerics.codes). A contact is OPEN, LEAVING (it has ended before its gap is open),
    TOUCHING (closed without a force of its own) or closed with a force: CLOSED, SPRUNG (a spring), or, where the engine
    sets its friction, STICK, SLIP_LEFT or SLIP_RIGHT. A friction element has the last three, or HELD (at rest, by the
    force of others)
    q, v, bend: (N,) coordinates, their rates and constant accelerations at its start; speed: the fastest in the scene,
    m/s, to which the round-off of others is relative
    rate: (m,) 1/s; amplitude: (m,) complex; shape, rate_shape: (N, m); force: (2u,) N; force_shape: (2u, m)
    drive, driver: (m,) growth of modes that a harmonic drives, 1/s, and the rate of that harmonic, 1/s; else 0
    open_force: (2u,) N, constant forces left undetermined by the laws between interdependent units, as the engine
    has chosen them; part of `force`
    """

    system: System
    period: int
    time: float
    state: np.ndarray
    q: np.ndarray
    v: np.ndarray
    bend: np.ndarray
    speed: float
    rate: np.ndarray
    amplitude: np.ndarray
    shape: np.ndarray
    rate_shape: np.ndarray
    force: np.ndarray
    force_shape: np.ndarray
    drive: np.ndarray
    driver: np.ndarray
    open_force: np.ndarray
    duration: float = np.nan
    event: SegmentEnd | None = None

    @property
    def start(self) -> float:
        """Its start, s since the run's."""
        return self.period * self.system.period + self.time

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates (N,) and their rates a time t after the start."""
        gain, beyond = self._growth(t)
        q = self.q + t * (self.v + 0.5 * t * self.bend) + (self.shape @ beyond).real
        return q, self.v + t * self.bend + (self.rate_shape @ gain).real

    def forces(self, t: float) -> np.ndarray:
        """Return the forces (2u,) of the units a time t after the start, N: normals, then slips."""
        forces: np.ndarray = self.force + (self.force_shape @ (self.amplitude + self._growth(t)[0])).real
        return forces

    def _growth(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the changes (m,) of the amplitudes after a time t, and the same less their tangents."""
        z = self.rate * t
        gain, beyond = self.amplitude * np.expm1(z), self.amplitude * beyond_line(z)
        if self.drive.any():
            # D(t) = t exp(turn) (1 + w), where 1 + w = (exp(d) - 1)/d
            turn = self.driver * t
            d = np.where(self.drive == 0.0, 0.0, z - turn)
            w = np.divide(beyond_line(d), d, out=np.zeros_like(d), where=d != 0.0)
            gain = gain + self.drive * t * (1.0 + w) * np.exp(turn)
            beyond = beyond + self.drive * t * (w + (1.0 + w) * np.expm1(turn))
        return gain, beyond


def beyond_line(z: np.ndarray) -> np.ndarray:
    """Return exp(z) - 1 - z without cancellation."""
    small = np.abs(z) < _SMALL
    w = np.where(small, z, 0.0)
    series = np.zeros_like(w)
    for k in range(12, 1, -1):
        series = (series + 1.0) * w / k
    return np.where(small, series * w, np.expm1(z) - z)


class Begun(NamedTuple):
    """State of a run when its segment began: time in the period, s; chunks of its log; energy lost in impacts, J.

    reduced: impacts so far whose restitutions were smaller.
    """

    time: float = 0.0
    chunks: int = 0
    loss: float = 0.0
    reduced: int = 0


#: the same before the start
START = Begun()


class EventRun(Run, Protocol):
    """A run of an engine, with its motion between events. It must keep its events, and ends at `max_events`."""

    whole: System
    records: Records
    max_events: int
    #: the course of a run that has one, and how it has ended (engine.trace)
    trace: Any
    status: Status

    def course(self, periods: int, segments: int = ...) -> Iterator[Any]:
        """Run to the end of `periods` from the start. Yield the course whenever it is full, and at the end."""

    def begin_from(self, start: RestartState) -> None:
        """Let the run begin, or begin again, from a start."""

    @property
    def counters(self) -> np.ndarray:
        """Counters (numerics.codes)."""

    def segment(self) -> Segment:
        """Return the motion from the present state on, which has been set up; its end is open."""

    def event(self) -> tuple[float, SegmentEnd]:
        """Return the last event and the time since the last `segment`, s; before the first, the start of the run."""

    def reuse(self, earlier: Any) -> None:
        """Reuse what an earlier run of the same engine has computed, as far as its system is the same."""


def no_event(system: System) -> SegmentEnd:
    """Return the end of an excitation period, at which nothing happens."""
    none, nobody = np.zeros(len(system.J)), np.zeros(0)
    return SegmentEnd(-1, 0, none, none, nobody.astype(int), nobody, nobody)


class Walk:
    """A run from segment to segment, to the end of `periods`.

    start: events at time zero, once the first segment is known; status: how the walk ended.
    """

    start: SegmentEnd

    def __init__(self, run: EventRun, periods: int) -> None:
        self.run, self.status = run, Status.OK
        self._periods, self._budget = periods, run.max_events

    def __iter__(self) -> Iterator[Segment]:
        """Yield segments with their ends."""
        run, counters, ready = self.run, self.run.counters, False
        while counters[PERIOD] < self._periods:
            done = int(counters[PERIOD])
            if not ready:  # as far as the segment has been set up
                self.status = self._advance(done, 0)
                if self.status is not Status.EVENT_BUDGET:
                    return
            if not hasattr(self, "start"):
                self.start = run.event()[1]
            segment = run.segment()
            self.status = self._advance(done, 1)
            ready = self.status is Status.EVENT_BUDGET and counters[EVENTS] <= self._budget
            if ready:
                duration, event = run.event()
            elif self.status is Status.OK:
                duration, event = segment.system.period - segment.time, no_event(segment.system)
            else:
                return
            self.status = Status.OK
            yield segment._replace(duration=duration, event=event)

    def _advance(self, done: int, events: int) -> Status:
        """Advance by a number of events within the period that follows those done."""
        self.run.max_events = int(self.run.counters[EVENTS]) + events
        return self.run.advance_to(done + 1)
