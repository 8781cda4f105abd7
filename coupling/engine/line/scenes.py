"""Runs of sliders in one compiled call: of one scene, or of many that differ in numbers, one after the other.

A scene begins with its start (columns), and its motion goes on until a number of periods (line.automaton). A linear
subsystem that its structure has met before is filled here; only a new one needs Python.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.line.automaton import advance, begin
from vanedamp.coupling.engine.line.flow_assembly import add_known
from vanedamp.coupling.engine.line.gap_kinematics import rigid
from vanedamp.coupling.numerics.codes import COAST, DONE, NEEDS_FLOW, OPEN, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import entry, strict
from vanedamp.coupling.numerics.compiler.record import changed

# numbers of a job: the place of its scene in the columns, and what comes next with it
PLACE, STAGE = range(2)
JOB = 2
#: stages of a scene
BEGINS, RUNS = range(2)


@entry
def run(job, columns, base, subsystems, flows, st, watched, rec, scratch, assembly, goal, max_events):
    """Run a scene to the end of `goal` periods. Return the code (numerics.codes) of why it returns."""
    k = job[PLACE]
    system = changed(changed(base, "omega", columns.omega[k]), "period", columns.period[k])
    if job[STAGE] == BEGINS:
        _set_start(system, st, watched, columns, k)
        job[STAGE] = RUNS
        if not begin(system, st, rec, scratch):
            return UNDECIDED
    while True:
        code = advance(system, flows, st, watched, rec, scratch, goal, max_events)
        if code == NEEDS_FLOW:
            code = add_known(system, subsystems, st.active_set, flows, assembly)
            if code == DONE:
                continue
        return code


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
        place, moved, speed = system.rest[r], 0.0, 0.0
        for i in range(n):
            moved += system.J[r, i] * p[i]
            speed += system.J[r, i] * p_rate[i]
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
            st.displacement[r] = columns.elongation[k, r - b]
