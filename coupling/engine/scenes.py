"""Runs in one compiled call: of one scene, or of many that differ in numbers, in turn.

A scene begins with its start (engine.columns), and its motion continues until a number of periods. A linear subsystem
that its structure has met before is filled here: only a new one needs Python. Of many scenes each is judged and
measured here too, by the functions that do so after a single run (response.steadiness, response.figures).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.trace import next_leg, noted
from vanedamp.coupling.numerics.codes import (
    DONE,
    EVENTS,
    LOGGED,
    LONGER,
    NEEDS_FLOW,
    OUTSIDE,
    PAUSED,
    PERIOD,
    UNDECIDED,
)
from vanedamp.coupling.numerics.compiler.jit import kernel
from vanedamp.coupling.numerics.compiler.record import record_with, room
from vanedamp.coupling.quantities.sums import SUMS
from vanedamp.coupling.response.figures import FigureInputs, measure
from vanedamp.coupling.response.records import MOST_PIECES
from vanedamp.coupling.response.steadiness import LOOK, judged, known_after, run_ends
from vanedamp.coupling.system.linear_modes import LinearModes, LinearParts
from vanedamp.coupling.system.transient import TransientInputs, begin_transient, run_length

#: segments after which an engine returns, so that Python empties the log and sees interrupts; after which a job does
SLICE, _SEGMENTS = 4096, 8 * 4096
#: rows that the course of a run takes at most until its engine returns
COURSE_ROOM = 2 * (SLICE + 1) + MOST_PIECES

# numbers of a job: scenes, 0 for one that the caller judges; the present one; its next step; its periods,
# those left out and the longest run; the code that ends it; segments since Python has seen it; with which states
# scenes begin; the number of the last scene that has left one for the next, from 1, 0: none; whether Python keeps the
# log
COUNT, PLACE, STAGE, GOAL, DROPPED, MOST, CODE, SEGMENTS, LINKED, LEFT, LOGS = range(11)
#: the next step of a scene: it begins, continues, or leaves its state in its columns
BEGINS, RUNS, LEAVES = range(3)
#: scenes begin with their own states, each with what the one before has left, or with states of other runs that fit
OWN, LINKS, GIVEN = range(3)
#: of planar bodies: largest tilt, rad, time off the floor, s, impacts on walls, what a tilt neglects (System)
TILT, LIFTED, WALLS, NEGLECTED = range(4)


@record_with(free_axes=3)
class BatchArrays(NamedTuple):
    """Input of a call, and results of k scenes."""

    at: Annotated[np.ndarray, "numbers", int]
    codes: Annotated[np.ndarray, "k", int]  # of numerics.codes; 0: the scene has not run, OUTSIDE: it is not to
    kinds: Annotated[np.ndarray, "k", int]  # classes of motion (response.figures)
    sums: Annotated[np.ndarray, "k sums"]
    peaks: Annotated[np.ndarray, "periods"]  # room to judge a run
    plane: Annotated[np.ndarray, "4 k b"]  # of planar bodies: TILT, LIFTED, WALLS, NEGLECTED


def new_job(scenes: int = 0, periods: int = 0, linked: int = OWN, logs: bool = False, bodies: int = 0) -> BatchArrays:
    """Return the job of many scenes, of at most so many periods; or of one run that the caller judges.

    bodies: of the plane, whose results are to be kept.
    """
    job = room(BatchArrays, {"numbers": 11, "k": scenes, "sums": len(SUMS), "periods": periods, "b": bodies})
    job.at[COUNT], job.at[LINKED], job.at[LOGS] = scenes, linked, logs
    return job


#: records of runs that the caller judges
UNJUDGED = tuple(
    room(kind, dict.fromkeys("bceknmNsu", 0))
    for kind in (TransientInputs, LinearParts, LinearParts, LinearModes, LinearModes, FigureInputs)
)


#: a call is to continue a job
ON = np.int64(0)


@kernel
def take_scene(take, job, columns, base, flows, setup, measured):
    """Set the scenes' differences to the numbers of one that begins, by `take`. Returns False if all have run."""
    at = job.at
    if at[COUNT] > 0 and at[PLACE] < at[COUNT] and at[STAGE] == BEGINS:
        take(columns, base, flows, setup, measured, at[PLACE], at[LINKED])
    return at[COUNT] == 0 or at[PLACE] < at[COUNT]


@kernel
def run_scene(
    begin, advance, fill_known, start, is_outside, leave, note_segment, note_event, job, columns, system, subsystems,
    flows, st, watched, rec, scratch, assembly, setup, loose, held, free, stuck, measured, trace, goal, max_events,
):  # fmt: skip
    """Continue the present scene by the functions of its engine; `goal` periods of one that the caller judges.

    Returns why Python is to go on (numerics.codes), or ON where this is to be called again.
    """
    at = job.at
    k, code = at[PLACE], at[CODE]
    if at[STAGE] == LEAVES:
        leave(system, flows, st, scratch, columns, k)
        return DONE
    if at[STAGE] == BEGINS:
        used = st.counters[PERIOD]
        flows.used[:] = 0
        start(system, st, watched, columns, k)
        _clear(rec, used)
        if at[COUNT] > 0:
            refused = job.codes[k] == OUTSIDE
            if refused or (at[LINKED] != GIVEN and is_outside(system, st, columns, k, at[LINKED], at[LEFT])):
                return OUTSIDE
            begin_transient(setup, loose, held, free, stuck)
            at[DROPPED], at[GOAL], at[MOST] = run_length(setup, free, stuck)
            rec.counted[0] = at[DROPPED]
            if setup.auto:
                at[MOST], at[GOAL], rec.counted[0] = at[GOAL], min(LOOK, at[GOAL]), 0
        at[STAGE] = RUNS
        code = DONE if begin(system, st, rec, scratch) else UNDECIDED
        at[CODE] = code
    if code == DONE:
        traced, until, events = len(trace.time) > 0, goal if at[COUNT] == 0 else at[GOAL], max_events
        if traced:
            until, events = next_leg(note_segment, system, flows, st, watched, scratch, trace)
        last = until
        if len(rec.course) > 0:  # which Python empties
            if len(rec.course) - rec.noted[0] < COURSE_ROOM:
                return PAUSED
            until = min(until, st.counters[PERIOD] + 1)
        code = advance(system, flows, st, watched, rec, scratch, until, events)
        if code == NEEDS_FLOW:
            code = fill_known(system, subsystems, st, flows, assembly)
            if code == DONE:
                return ON
        if traced:
            return noted(note_event, system, st, watched, rec, scratch, trace, code, goal, max_events, ON)
        if code == DONE and until < last:
            return ON
    if at[COUNT] == 0 or code == NEEDS_FLOW:
        return code
    if code == PAUSED:
        if at[LOGS]:
            return PAUSED
        st.counters[LOGGED] = 0
        at[SEGMENTS] += SLICE
    elif _end(job, setup, free, stuck, measured, rec, st.counters[PERIOD], code):
        links = at[LINKED] == LINKS
        if code == DONE:
            leave(system, flows, st, scratch, columns, k + links)
            at[LEFT] = k + 1
        elif links:  # a run that broke off within a period leaves the state that it began with
            repeat(columns, k)
        at[PLACE], at[STAGE], at[CODE] = k + 1, BEGINS, DONE
        at[SEGMENTS] += st.counters[EVENTS] + st.counters[PERIOD]
    if at[SEGMENTS] >= _SEGMENTS:
        at[SEGMENTS] = 0
        return PAUSED
    return ON


@kernel
def take_numbers(columns, base, flows, setup, measured, k, linked, same, first):
    """Set the scenes' differences to the numbers of scene k; flows of other forces are to be filled again.

    first: row of the first contact, which is the first unit; same: whether an engine's own numbers that enter flows
    are those that were.
    """
    same = copy(base.frequency, columns.frequency[k]) and same
    copy(base.rest, columns.rest[k])
    same = copy(base.play, columns.play[k]) and same
    copy(base.limit, columns.limit[k])
    copy(base.restitution, columns.restitution[k])
    for h in range(base.load.shape[0]):
        setup.frequency[h], measured.frequency[h] = base.frequency[h], base.frequency[h]
        for i in range(base.load.shape[1]):
            load = columns.load[k, h, i]
            same = same and base.load[h, i] == load
            base.load[h, i], setup.load[h, i], measured.load[h, i] = load, load, load
    if not same:
        flows.modes[:] = 0
    setup.clock[0], setup.clock[1] = columns.omega[k], columns.period[k]
    measured.clock[0], measured.clock[1] = columns.omega[k], columns.period[k]
    for i in range(0 if linked else base.modes):
        setup.q[i] = columns.displacement[k, i] / base.scale
        setup.v[i] = columns.velocity[k, i] / base.scale
    copy(measured.holds, columns.holds[k])
    for u in range(len(base.rest) - first):
        measured.rest[u], measured.play[u] = base.rest[first + u], base.play[first + u]


@kernel
def repeat(columns, k):
    """Let the scene after scene k begin as that."""
    for array in (
        columns.displacement, columns.velocity, columns.slip, columns.slip_velocity, columns.elongation, columns.lift,
        columns.lift_velocity, columns.tilt, columns.tilt_rate,
    ):  # fmt: skip
        for i in range(array.shape[1]):
            array[k + 1, i] = array[k, i]


@kernel
def _end(job, setup, free, stuck, measured, rec, done, code):
    """Judge and measure the present scene, which has ended with a code. Returns False where it is to be longer."""
    at, confidence = job.at, math.nan
    if code == DONE and setup.auto:
        code, at[DROPPED], confidence = known_after(setup, free, stuck, rec, done, job.peaks[:done])
        if code != DONE and done < at[MOST]:
            at[GOAL] = min(done + LOOK, at[MOST])
            return False
    elif code == DONE:
        steady, rate, confidence = judged(setup, free, stuck, rec, at[DROPPED], done, job.peaks[: done - at[DROPPED]])
        code = run_ends(steady, rate, at[DROPPED], done, at[MOST])
        if code == LONGER:
            at[DROPPED], at[GOAL], rec.counted[0] = done, 2 * done, done
            return False
    k, first = at[PLACE], min(at[DROPPED], max(done - 1, 0))
    job.codes[k] = code
    job.kinds[k] = measure(measured, rec, first, done, confidence, job.sums[k])
    for b in range(job.plane.shape[2]):
        job.plane[:NEGLECTED, k, b] = 0.0
        for i in range(first, done):
            job.plane[TILT, k, b] = max(job.plane[TILT, k, b], rec.tilt[i, b])
            job.plane[LIFTED, k, b] += rec.lifted[i, b]
            job.plane[WALLS, k, b] += rec.walls[i, b]
    return True


@kernel
def copy(target, other):
    """Set numbers to others. Returns whether they were the same."""
    same = True
    for i in range(len(target)):
        same = same and target[i] == other[i]
        target[i] = other[i]
    return same


@kernel
def _clear(rec, done):
    """Empty the records of a run of so many periods."""
    last = min(done + 2, len(rec.peak))
    rec.peak[:last], rec.square[:last], rec.collided[:last], rec.impacts[:last] = 0.0, 0.0, 0.0, 0
    rec.harmonic[:last], rec.momentum[:last] = 0.0, 0.0
    rec.section[0, :], rec.ledger[0, :], rec.parts[0, :], rec.noted[0] = 0.0, 0.0, 0.0, 0
    if rec.worn.shape[1] > 0:
        rec.worn[:last], rec.struck[:last], rec.hits[:last] = 0.0, 0.0, 0.0
    rec.tilt[:last], rec.lifted[:last], rec.walls[:last] = 0.0, 0.0, 0
    if rec.outputs.shape[1] > 0:
        rec.outputs[:last, :, 0], rec.outputs[:last, :, 1], rec.outputs[:last, :, 2] = -math.inf, math.inf, 0.0
    for i in range(min(last, len(rec.swing))):
        rec.swing[i, 0], rec.swing[i, 1], rec.swing[i, 2] = -math.inf, math.inf, 0.0
