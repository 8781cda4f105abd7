"""Runs of sliders in one compiled call (engine.scenes)."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.known import add_known
from vanedamp.coupling.engine.line.automaton import advance, begin
from vanedamp.coupling.engine.line.flow_assembly import fill, is_closed_as
from vanedamp.coupling.engine.line.gap_kinematics import rigid
from vanedamp.coupling.engine.line.recording import structure_state
from vanedamp.coupling.engine.line.tracing import note_event, note_segment
from vanedamp.coupling.engine.scenes import ON, PLACE, run_scene, take_numbers, take_scene
from vanedamp.coupling.numerics.codes import COAST, DONE, OPEN
from vanedamp.coupling.numerics.compiler.jit import entry, kernel, strict
from vanedamp.coupling.numerics.compiler.record import changed
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS


@entry
def run(
    job, columns, base, subsystems, flows, st, watched, rec, scratch, assembly, setup, loose, held, free, stuck,
    measured, trace, goal, max_events,
):  # fmt: skip
    """Run a scene to the end of `goal` periods, or all scenes of a job.

    Returns the code (numerics.codes) of why it returns.
    """
    while take_scene(_take_numbers, job, columns, base, flows, setup, measured):
        k = job.at[PLACE]
        system = changed(changed(base, "omega", columns.omega[k]), "period", columns.period[k])
        code = run_scene(
            begin, advance, _fill_known, _set_start, _is_outside, _leave, note_segment, note_event, job, columns,
            system, subsystems, flows, st, watched, rec, scratch, assembly, setup, loose, held, free, stuck, measured,
            trace, goal, max_events,
        )  # fmt: skip
        if code != ON:
            return code
    return DONE


@kernel
def _fill_known(system, subsystems, st, flows, assembly):
    """Fill the flow of the closed rows (engine.known.add_known)."""
    return add_known(is_closed_as, fill, system, subsystems, st.active_set, flows, assembly)


@kernel
def _take_numbers(columns, base, flows, setup, measured, k, linked):
    """Set the scenes' differences (engine.scenes.take_numbers)."""
    take_numbers(columns, base, flows, setup, measured, k, linked, True, base.friction_rows)


@kernel
def _is_outside(system, st, columns, k, linked, left):
    """Return whether scene k begins beyond a wall or a stop: Python moves or rejects it.

    left: the number of the scene that has left the state of a linked one; while there is none, Python says how
    a scene begins.
    """
    if linked and k > 0 and left == 0:
        return True
    for r in range(system.friction_rows, len(st.state)):
        least = 0.0
        if linked:
            if k == 0 or (not rigid(system, r) and columns.play[k, r] == columns.play[left - 1, r]):
                continue
            if system.left_body[r] >= 0 or system.right_body[r] >= 0:
                least = -SIMULTANEOUS * system.play[r]
        if st.displacement[r] < least:
            return True
    return False


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


@strict
def _set_start(system, st, watched, columns, k):
    """Set the state at time zero to the start of scene k: rows from slips and the structure's motion."""
    n, b, e, friction = system.modes, system.bodies, len(system.frequency), system.friction_rows
    slip, slip_velocity = columns.slip[k], columns.slip_velocity[k]
    for array in (
        st.change, st.low_word, st.contact_impulse, st.ledger, st.applied_force, st.capture_speed, st.time,
        st.largest_speed, st.offset, st.constant, st.slip_constant, st.constant_force, st.free_acceleration,
        st.coordinate_acceleration,
    ):  # fmt: skip
        array[:] = 0.0
    st.counters[:], st.released[:], st.active_set[:], watched.status[:], st.asleep[:] = 0, 0, False, 0, 0
    st.last_impact[:] = -math.inf
    for j in range(len(st.amplitude)):
        st.amplitude[j] = 1.0 if j < e else 0.0
    for i in range(n):
        st.coordinates[i] = columns.displacement[k, i] / system.scale
        st.coordinates[n + i] = columns.velocity[k, i] / system.scale
    p, p_rate = st.coordinates[:n], st.coordinates[n:]
    for r in range(len(st.state)):
        st.state[r] = COAST if r < friction else OPEN
        gap, moved, speed, terms = system.rest[r], 0.0, 0.0, 0.0
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
            gap += system.J[r, n + body] * slip[body]
            moved += system.J[r, n + body] * on_floor
            speed += system.J[r, n + body] * (slip_velocity[body] + rate)
        st.displacement[r], st.velocity[r] = gap + moved, speed
        if r < b:  # relative to the floor, so that a body at relative rest is known to be so
            st.displacement[r], st.velocity[r] = slip[r], slip_velocity[r]
        elif r < friction and not rigid(system, r):
            # an element slides at its limit
            most = system.limit[r] / system.spring[r]
            st.displacement[r] = min(max(columns.elongation[k, r - b], -most), most)
