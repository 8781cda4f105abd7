"""The course of a run, written down in compiled code: segments, and the events between them.

Event i stands before segment i, event 0 before time zero. A run whose course is full stops, and continues once what has
been read is given away (`turned`).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    DONE,
    EVENT_BUDGET,
    EVENTS,
    LOGGED,
    NEEDS_FLOW,
    PAUSED,
    PERIOD,
    REDUCED,
    TRACED,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.response.records import IMPACT_LOSS
from vanedamp.coupling.response.segment import SegmentEnd
from vanedamp.coupling.system.system import System

#: segments that are kept at once
COURSE = 256

# numbers of a course: segments, and contacts struck in the events so far; whether the present segment has begun, or is
# written down; whether the start is; the goal of the present call, and whether it has gone; reduced impacts as the
# segment began
COUNT, STRUCK, READY, STARTED, GOAL, BUDGET, CALLED, SINCE = range(8)
_NO, _BEGUN, _NOTED = range(3)


@record_with(free_axes=2)
class Trace(NamedTuple):
    """Segments (s) and events (m = s + 1) of a run, as in response.segment; contacts struck (h) in turn."""

    at: Annotated[np.ndarray, "numbers", int]
    since: Annotated[np.ndarray, "2"]  # time and energy lost in impacts as the present segment began
    rows: np.ndarray  # (u,) int: of sliders, the row of LineSystem that each unit is
    fastest: np.ndarray  # (1,) least speed of the scene
    period: Annotated[np.ndarray, "s", int]
    time: Annotated[np.ndarray, "s"]
    duration: Annotated[np.ndarray, "s"]
    speed: Annotated[np.ndarray, "s"]
    state: Annotated[np.ndarray, "s u", int]
    q: Annotated[np.ndarray, "s N"]
    v: Annotated[np.ndarray, "s N"]
    open_force: Annotated[np.ndarray, "s 2u"]
    unit: Annotated[np.ndarray, "m", int]
    what: Annotated[np.ndarray, "m", int]
    impulse: Annotated[np.ndarray, "m 2u"]
    compression: Annotated[np.ndarray, "m 2u"]
    loss: Annotated[np.ndarray, "m"]
    reduced: Annotated[np.ndarray, "m", int]
    first: Annotated[np.ndarray, "m1", int]  # of the contacts struck in each event; behind the last their number
    struck: Annotated[np.ndarray, "h", int]
    before: Annotated[np.ndarray, "h"]
    after: Annotated[np.ndarray, "h"]


def _of_sizes(sizes: dict[str, int], rows: np.ndarray, fastest: float) -> Trace:
    return room(Trace, {"numbers": 8} | sizes, rows=rows, fastest=np.array([fastest]))


#: of runs whose course is not wanted
UNTRACED = _of_sizes(dict.fromkeys(("s", "m", "m1", "u", "N", "h"), 0), np.zeros(0, int), 0.0)


def new_trace(system: System, rows: np.ndarray, entries: int, segments: int) -> Trace:
    """Return an empty course of so many segments. rows: as there; entries: of the run's log."""
    sizes = {"s": segments, "m": segments + 1, "m1": segments + 2, "h": entries + 4 * segments}
    return _of_sizes(sizes | {"u": len(system.rest), "N": len(system.mass)}, rows, system.speed)


def clear(trace: Trace) -> None:
    """Make a course ready for another run."""
    trace.at[:], trace.since[:], trace.first[0] = 0, 0.0, 0


class Leg(NamedTuple):
    """A segment of a course, and the event that ends it, as in response.segment. length: of a period, s."""

    length: float
    period: int
    time: float
    duration: float
    speed: float
    state: np.ndarray
    q: np.ndarray
    v: np.ndarray
    open_force: np.ndarray
    event: SegmentEnd

    @property
    def start(self) -> float:
        """Its start, s since the run's."""
        return self.period * self.length + self.time


def leg_of(trace: Trace, i: int, length: float) -> Leg:
    """Return segment i. length: of a period, s."""
    e, struck = i + 1, slice(int(trace.first[i + 1]), int(trace.first[i + 2]))
    event = SegmentEnd(
        int(trace.unit[e]), int(trace.what[e]), trace.impulse[e].copy(), trace.compression[e].copy(),
        trace.struck[struck].copy(), trace.before[struck].copy(), trace.after[struck].copy(), float(trace.loss[e]),
        bool(trace.reduced[e]),
    )  # fmt: skip
    state, q, v, open_force = (array[i].copy() for array in (trace.state, trace.q, trace.v, trace.open_force))
    time, duration, speed = float(trace.time[i]), float(trace.duration[i]), float(trace.speed[i])
    return Leg(length, int(trace.period[i]), time, duration, speed, state, q, v, open_force, event)


def turned(trace: Trace) -> None:
    """Drop what has been read: all but the last segment and its events, now the first."""
    at, last = trace.at, int(trace.at[COUNT]) - 1
    first, end = int(trace.first[last]), int(trace.first[last + 2])
    for name in ("period", "time", "duration", "speed", "state", "q", "v", "open_force"):
        array = getattr(trace, name)
        array[0] = array[last]
    for name in ("unit", "what", "impulse", "compression", "loss", "reduced"):
        array = getattr(trace, name)
        array[:2] = array[last : last + 2].copy()
    for name in ("struck", "before", "after"):
        array = getattr(trace, name)
        array[: end - first] = array[first:end].copy()
    trace.first[:3] = trace.first[last : last + 3] - first
    at[COUNT], at[STRUCK] = 1, end - first


@kernel
def next_leg(note_segment, system, flows, st, watched, scratch, trace):
    """Return to which period and how many events a run is to go on, one segment further."""
    at, counters = trace.at, st.counters
    if at[READY] == _BEGUN:
        trace.period[at[COUNT]], trace.time[at[COUNT]] = counters[PERIOD], st.time[0]
        note_segment(system, flows, st, watched, scratch, trace, at[COUNT])
        trace.since[0], trace.since[1] = st.time[0], st.ledger[IMPACT_LOSS]
        at[SINCE], at[READY], counters[LOGGED] = counters[REDUCED], _NOTED, 0
    if at[CALLED] == 0:
        at[GOAL], at[CALLED] = counters[PERIOD] + 1, 1
        at[BUDGET] = counters[EVENTS] + (1 if at[READY] == _NOTED else 0)
    return at[GOAL], at[BUDGET]


@kernel
def noted(note_event, system, st, watched, rec, scratch, trace, code, goal, max_events, on):
    """Write down a run's code. Returns why it is to return, or `on`."""
    at, counters = trace.at, st.counters
    if code == NEEDS_FLOW:
        return code
    if code == PAUSED:
        return on
    at[CALLED] = 0
    if at[READY] != _NOTED:
        if code != EVENT_BUDGET:
            return code
        if at[STARTED] == 0:
            _note(note_event, system, st, watched, rec, scratch, trace, 0, False)
            at[STARTED] = 1
        at[READY] = _BEGUN
        return on
    i = at[COUNT]
    if code == EVENT_BUDGET and counters[EVENTS] <= max_events:
        _note(note_event, system, st, watched, rec, scratch, trace, i + 1, True)
        at[READY] = _BEGUN
    elif code == DONE:
        trace.duration[i], trace.unit[i + 1], trace.what[i + 1] = system.period - trace.time[i], -1, 0
        trace.impulse[i + 1, :], trace.compression[i + 1, :] = 0.0, 0.0
        trace.loss[i + 1], trace.reduced[i + 1], trace.first[i + 2] = 0.0, 0, at[STRUCK]
        at[READY] = _NO
    else:
        return code
    at[COUNT] += 1
    if counters[PERIOD] >= goal:
        return DONE
    full = at[COUNT] == len(trace.time) or at[STRUCK] + len(rec.log) > len(trace.struck)
    return TRACED if full else on


@inlined
def _note(note_event, system, st, watched, rec, scratch, trace, e, ends):
    """Write down event e; ends: whether it ends a segment."""
    trace.unit[e], trace.what[e] = -1, 0
    trace.impulse[e, :], trace.compression[e, :] = 0.0, 0.0
    trace.loss[e] = st.ledger[IMPACT_LOSS] - trace.since[1]
    trace.reduced[e] = 1 if st.counters[REDUCED] > trace.at[SINCE] else 0
    trace.first[e] = trace.at[STRUCK]
    note_event(system, st, watched, rec, scratch, trace, e, ends)
    trace.first[e + 1] = trace.at[STRUCK]
