"""Runs of sliders in one compiled call: of one scene, or of many that differ in numbers, one after the other.

A scene begins with its start (line.columns), and its motion goes on until a number of periods (line.automaton). A
linear subsystem that its structure has met before is filled here: only a new one needs Python. Of many scenes each is
judged and measured here too, by the functions that do so after a single run (response.steadiness, response.figures).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.line.automaton import SLICE, advance, begin
from vanedamp.coupling.engine.line.flow_assembly import add_known
from vanedamp.coupling.engine.line.gap_kinematics import rigid
from vanedamp.coupling.engine.line.recording import structure_state
from vanedamp.coupling.numerics.codes import (
    COAST,
    DONE,
    EVENTS,
    LOGGED,
    LONGER,
    NEEDS_FLOW,
    OPEN,
    OUTSIDE,
    PAUSED,
    PERIOD,
    UNDECIDED,
)
from vanedamp.coupling.numerics.compiler.jit import entry, kernel, strict
from vanedamp.coupling.numerics.compiler.record import changed, record_with, room
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS
from vanedamp.coupling.quantities.sums import SUMS
from vanedamp.coupling.response.figures import Measured, measure
from vanedamp.coupling.response.steadiness import LOOK, judged, known_after, run_ends
from vanedamp.coupling.system.linear_modes import LinearModes, LinearParts
from vanedamp.coupling.system.transient import Setup, begin_transient, run_length

#: segments of motion after which Python sees interrupts: some 0.1 s
_SEGMENTS = 8 * SLICE

# numbers of a job: scenes, 0 for one that the caller judges; the present one; what comes next with it; its periods,
# those left out and the longest run; the code that ends it; segments since Python has seen it; with which states
# scenes begin; the number of the last scene that has left one for the next, from 1, 0: none; whether Python keeps the
# log
COUNT, PLACE, STAGE, GOAL, DROPPED, MOST, CODE, SEGMENTS, LINKED, LEFT, LOGS = range(11)
#: what comes next with a scene: it begins, goes on, or leaves its state in its columns
BEGINS, RUNS, LEAVES = range(3)
#: scenes begin with their own states, each with what the one before has left, or with states of other runs that fit
OWN, LINKS, GIVEN = range(3)


@record_with(free_axes=2)
class Job(NamedTuple):
    """What is asked of a call, and the results of k scenes."""

    at: Annotated[np.ndarray, "numbers", int]
    codes: Annotated[np.ndarray, "k", int]  # of numerics.codes; 0: the scene has not run, OUTSIDE: it is not to
    kinds: Annotated[np.ndarray, "k", int]  # classes of motion (response.figures)
    sums: Annotated[np.ndarray, "k sums"]
    peaks: Annotated[np.ndarray, "periods"]  # room to judge a run


def new_job(scenes: int = 0, periods: int = 0, linked: int = OWN, logs: bool = False) -> Job:
    """Return the job of many scenes, of at most so many periods; or of one run that the caller judges."""
    job = room(Job, {"numbers": 11, "k": scenes, "sums": len(SUMS), "periods": periods})
    job.at[COUNT], job.at[LINKED], job.at[LOGS] = scenes, linked, logs
    return job


#: records of runs that the caller judges
UNJUDGED = tuple(
    room(kind, dict.fromkeys("bceknmNsu", 0))
    for kind in (Setup, LinearParts, LinearParts, LinearModes, LinearModes, Measured)
)


@entry
def run(
    job, columns, base, subsystems, flows, st, watched, rec, scratch, assembly, setup, loose, held, free, stuck,
    measured, goal, max_events,
):  # fmt: skip
    """Run a scene to the end of `goal` periods, or all scenes of a job.

    Returns the code (numerics.codes) of why it returns.
    """
    while True:
        at = job.at
        k, begins = at[PLACE], at[STAGE] == BEGINS
        if at[COUNT] > 0:
            if k == at[COUNT]:
                return DONE
            if begins:
                _take_numbers(columns, base, flows, setup, measured, k, at[LINKED])
            goal = at[GOAL]
        system = changed(changed(base, "omega", columns.omega[k]), "period", columns.period[k])
        if at[STAGE] == LEAVES:
            _leave(system, flows, st, scratch, columns, k)
            return DONE
        code = at[CODE]
        if begins:
            used = st.counters[PERIOD]
            flows.used[:] = 0
            _set_start(system, st, watched, columns, k)
            if at[COUNT] > 0:
                _clear(rec, used)
                refused = job.codes[k] == OUTSIDE
                if refused or (at[LINKED] != GIVEN and _is_outside(system, st, columns, k, at[LINKED], at[LEFT])):
                    return OUTSIDE
                begin_transient(setup, loose, held, free, stuck)
                at[DROPPED], at[GOAL], at[MOST] = run_length(setup, free, stuck)
                rec.counted[0] = at[DROPPED]
                if setup.auto:
                    at[MOST], at[GOAL], rec.counted[0] = at[GOAL], min(LOOK, at[GOAL]), 0
                goal = at[GOAL]
            at[STAGE] = RUNS
            code = DONE if begin(system, st, rec, scratch) else UNDECIDED
            at[CODE] = code
        if code == DONE:
            code = advance(system, flows, st, watched, rec, scratch, goal, max_events)
            if code == NEEDS_FLOW:
                code = add_known(system, subsystems, st.active_set, flows, assembly)
                if code == DONE:
                    continue
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
                _leave(system, flows, st, scratch, columns, k + links)
                at[LEFT] = k + 1
            elif links:  # a run that broke off within a period leaves the state that it began with
                _repeat(columns, k)
            at[PLACE], at[STAGE], at[CODE] = k + 1, BEGINS, DONE
            at[SEGMENTS] += st.counters[EVENTS] + st.counters[PERIOD]
        if at[SEGMENTS] >= _SEGMENTS:
            at[SEGMENTS] = 0
            return PAUSED


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
    return True


@kernel
def _take_numbers(columns, base, flows, setup, measured, k, linked):
    """Set what differs between scenes to the numbers of scene k; flows of other excitations are to be filled again."""
    same = _copy(base.frequency, columns.frequency[k])
    same = _copy(base.free_travel, columns.free_travel[k]) and same
    _copy(base.rest, columns.rest[k])
    _copy(base.limit, columns.limit[k])
    _copy(base.restitution, columns.restitution[k])
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
    for b in range(base.bodies):
        measured.holds[b] = base.limit[b]
    for u in range(len(base.rest) - base.friction_rows):
        measured.rest[u], measured.play[u] = base.rest[base.friction_rows + u], base.free_travel[base.friction_rows + u]


@kernel
def _copy(own, other):
    """Set numbers to others. Returns whether they were the same."""
    same = True
    for i in range(len(own)):
        same = same and own[i] == other[i]
        own[i] = other[i]
    return same


@kernel
def _is_outside(system, st, columns, k, linked, left):
    """Return whether scene k begins beyond a wall or a stop: it is to be moved, or refused, by Python.

    left: the number of the scene that has left the state of a linked one; as long as there is none, Python says how
    a scene begins.
    """
    if linked and k > 0 and left == 0:
        return True
    for r in range(system.friction_rows, len(st.state)):
        least = 0.0
        if linked:
            if k == 0 or (not rigid(system, r) and columns.free_travel[k, r] == columns.free_travel[left - 1, r]):
                continue
            if system.left_body[r] >= 0 or system.right_body[r] >= 0:
                least = -SIMULTANEOUS * system.free_travel[r]
        if st.displacement[r] < least:
            return True
    return False


@kernel
def _clear(rec, done):
    """Empty the records of a run of so many periods."""
    last = min(done + 2, len(rec.peak))
    rec.peak[:last], rec.square[:last], rec.collided[:last], rec.impacts[:last] = 0.0, 0.0, 0.0, 0
    rec.harmonic[:last], rec.momentum[:last] = 0.0, 0.0
    rec.section[0, :], rec.ledger[0, :], rec.parts[0, :] = 0.0, 0.0, 0.0
    if rec.worn.shape[1] > 0:
        rec.worn[:last], rec.struck[:last], rec.hits[:last] = 0.0, 0.0, 0.0
    if rec.outputs.shape[1] > 0:
        rec.outputs[:last, :, 0], rec.outputs[:last, :, 1], rec.outputs[:last, :, 2] = -math.inf, math.inf, 0.0
    for i in range(min(last, len(rec.swing))):
        rec.swing[i, 0], rec.swing[i, 1], rec.swing[i, 2] = -math.inf, math.inf, 0.0


@kernel
def _leave(system, flows, st, scratch, columns, k):
    """Let scene k begin with the present state."""
    n, b, y = system.modes, system.bodies, scratch.coordinates
    structure_state(flows, st, y)
    for i in range(n):
        columns.displacement[k, i], columns.velocity[k, i] = system.scale * y[i], system.scale * y[n + i]
    for body in range(b):
        columns.slip[k, body], columns.slip_velocity[k, body] = st.displacement[body], st.velocity[body]
    for r in range(b, system.friction_rows):
        columns.elongation[k, r - b] = 0.0 if rigid(system, r) else st.displacement[r]


@kernel
def _repeat(columns, k):
    """Let the scene after scene k begin as that."""
    for part in (columns.displacement, columns.velocity, columns.slip, columns.slip_velocity, columns.elongation):
        for i in range(part.shape[1]):
            part[k + 1, i] = part[k, i]


@strict
def _set_start(system, st, watched, columns, k):
    """Set the state at time zero to the start of scene k: rows from slips and the structure's motion."""
    n, b, e, friction = system.modes, system.bodies, len(system.frequency), system.friction_rows
    slip, slip_velocity = columns.slip[k], columns.slip_velocity[k]
    for part in (
        st.change, st.low_word, st.contact_impulse, st.ledger, st.applied_force, st.capture_speed, st.time,
        st.largest_speed, st.offset, st.constant, st.slip_constant, st.constant_force, st.free_acceleration,
        st.coordinate_acceleration,
    ):  # fmt: skip
        part[:] = 0.0
    st.counters[:], st.released[:], st.active_set[:], watched.status[:] = 0, 0, False, 0
    st.last_impact[:] = -math.inf
    for j in range(len(st.amplitude)):
        st.amplitude[j] = 1.0 if j < e else 0.0
    for i in range(n):
        st.coordinates[i] = columns.displacement[k, i] / system.scale
        st.coordinates[n + i] = columns.velocity[k, i] / system.scale
    p, p_rate = st.coordinates[:n], st.coordinates[n:]
    for r in range(len(st.state)):
        st.state[r] = COAST if r < friction else OPEN
        place, moved, speed, terms = system.rest[r], 0.0, 0.0, 0.0
        for i in range(n):
            moved += system.J[r, i] * p[i]
            speed += system.J[r, i] * p_rate[i]
            terms += abs(system.J[r, i] * p_rate[i])
        st.largest_speed[0] = max(st.largest_speed[0], terms)  # a body at rest in its cavity meets no wall by round-off
        for body in range(b):
            on_floor, rate = 0.0, 0.0
            for i in range(n):
                on_floor += system.floor[body, i] * p[i]
                rate += system.floor[body, i] * p_rate[i]
            place += system.J[r, n + body] * slip[body]
            moved += system.J[r, n + body] * on_floor
            speed += system.J[r, n + body] * (slip_velocity[body] + rate)
        st.displacement[r], st.velocity[r] = place + moved, speed
        if r < b:  # relative to the floor, so that a body at relative rest is known to be so
            st.displacement[r], st.velocity[r] = slip[r], slip_velocity[r]
        elif r < friction and not rigid(system, r):
            # an element slides at its limit
            most = system.limit[r] / system.spring[r]
            st.displacement[r] = min(max(columns.elongation[k, r - b], -most), most)
