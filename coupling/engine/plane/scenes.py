"""Runs of planar bodies in one compiled call (engine.scenes)."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.known import add_known
from vanedamp.coupling.engine.plane.automaton import advance, begin
from vanedamp.coupling.engine.plane.flow_assembly import fill, is_in_states
from vanedamp.coupling.engine.plane.tracing import note_event, note_segment
from vanedamp.coupling.engine.scenes import ON, PLACE, copy, run_scene, take_numbers, take_scene
from vanedamp.coupling.numerics.codes import DONE, LEAVING, OPEN, SLIP_RIGHT, STICK
from vanedamp.coupling.numerics.compiler.jit import ZERO, entry, kernel, strict
from vanedamp.coupling.numerics.compiler.record import changed
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS
from vanedamp.coupling.system.unit_kinematics import elongation, gap, is_compliant


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
        system = changed(changed(system, "moment", columns.moment[k]), "speed", columns.speed[k])
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
    """Fill the flow of the states (engine.known.add_known)."""
    return add_known(is_in_states, fill, system, subsystems, st.state, flows, assembly)


@kernel
def _take_numbers(columns, base, flows, setup, measured, k, linked):
    """Set the scenes' differences (engine.scenes.take_numbers); friction, limits and rests enter flows, too."""
    same = copy(base.rest, columns.rest[k])
    same = copy(base.friction, columns.friction[k]) and same
    same = copy(base.limit, columns.limit[k]) and same
    take_numbers(columns, base, flows, setup, measured, k, linked, same, ZERO)


@kernel
def _is_outside(system, st, columns, k, linked, left):
    """Return whether scene k begins beyond a wall or a stop: Python moves or rejects it.

    left: the number of the scene that has left the state of a linked one; while there is none, Python says how
    a scene begins.
    """
    if linked and k > 0 and left == 0:
        return True
    for r in range(system.contacts):
        if linked and (k == 0 or (is_compliant(system, r) and columns.play[k, r] == columns.play[left - 1, r])):
            continue
        if gap(system, r, st.q) - min(system.rest[r], 0.0) < -SIMULTANEOUS * system.play[r]:  # as response.restart
            return True
    return False


@kernel
def _leave(system, flows, st, scratch, columns, k):
    """Let scene k begin with the present state."""
    for i in range(system.modes):
        columns.displacement[k, i], columns.velocity[k, i] = system.scale * st.q[i], system.scale * st.v[i]
    for b in range(system.bodies):
        x = system.along[b]
        columns.slip[k, b], columns.slip_velocity[k, b] = _relative(system.floor[b], st, x)
        columns.lift[k, b], columns.lift_velocity[k, b], columns.tilt[k, b], columns.tilt_rate[k, b] = (
            0.0,
            0.0,
            0.0,
            0.0,
        )
        if system.tilt[b] >= 0:
            columns.lift[k, b], columns.lift_velocity[k, b] = _relative(system.rise[b], st, x + 1)
            columns.tilt[k, b], columns.tilt_rate[k, b] = _relative(system.turn[b], st, x + 2)
    columns.elongation[k, :] = 0.0
    for r in range(len(st.state)):
        if system.slider[r] >= 0:
            columns.elongation[k, _place_of(system, r)] = elongation(system, system.slider[r], st.q)


@kernel
def _relative(carrier, st, x):
    """Return position and rate of coordinate x relative to its carrier (N,)."""
    position, rate = st.q[x], st.v[x]
    for i in range(len(carrier)):
        position -= carrier[i] * st.q[i]
        rate -= carrier[i] * st.v[i]
    return position, rate


@strict
def _place_of(system, r):
    """Return the place of the elongation of a unit with a slider (System.drawn)."""
    return len(system.casing) + system.slider[r] if r < system.contacts else system.body[r]


@strict
def _set_start(system, st, watched, columns, k):
    """Set the state at time zero to the start of scene k.

    A spring that is compressed pushes, or lags behind the body that leaves it.
    """
    n, size, sliders = system.modes, len(st.q), len(system.tangential)
    for array in (
        st.time, st.q, st.v, st.rate, st.scale, st.pushed, st.lost, st.ledger, st.change, st.offset, st.bend, st.force,
        st.prestress,
    ):  # fmt: skip
        array[:] = 0.0
    st.counters[:], st.fresh[:], st.amplitude[:], watched.status[:] = 0, 0, 0.0, 0
    st.other[:], st.known[:], st.last_impact[:] = OPEN, OPEN, -math.inf
    for i in range(n):
        st.q[i] = columns.displacement[k, i] / system.scale
        st.v[i] = columns.velocity[k, i] / system.scale
    for b in range(system.bodies):
        x = system.along[b]
        _place(system.floor[b], st, n, x, columns.slip[k, b], columns.slip_velocity[k, b])
        if system.tilt[b] >= 0:
            _place(system.rise[b], st, n, x + 1, columns.lift[k, b], columns.lift_velocity[k, b])
            _place(system.turn[b], st, n, x + 2, columns.tilt[k, b], columns.tilt_rate[k, b])
    for r in range(len(st.state)):
        j = system.slider[r]
        if j >= 0:
            st.q[size - sliders + j] = elongation(system, j, st.q) - columns.elongation[k, _place_of(system, r)]
    for r in range(len(st.state)):
        shift, speed = system.rest[r], 0.0
        for i in range(size):
            shift += system.J[r, i] * st.q[i]
            speed += system.J[r, i] * st.v[i]
        st.state[r] = OPEN
        if system.spring[r] < math.inf and shift < -SIMULTANEOUS * system.play[r]:
            pushes = system.spring[r] * shift + system.dashpot[r] * speed < 0.0
            st.state[r] = SLIP_RIGHT if pushes else LEAVING
            if system.slider[r] >= 0:
                st.state[r] = STICK


@strict
def _place(carrier, st, n, x, position, rate):
    """Set coordinate x from its position and rate relative to its carrier, in n modes."""
    for i in range(n):
        position += carrier[i] * st.q[i]
        rate += carrier[i] * st.v[i]
    st.q[x], st.v[x] = position, rate
