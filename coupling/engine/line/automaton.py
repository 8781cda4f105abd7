"""The compiled heart of the engine: a hybrid automaton that jumps from event to event.

Between two events the state flows exactly (line.subsystem_assembly); the next event is found with a guarantee
(line.event_functions); what happens there is decided by complementarity (line.contact_states); every joule is
accounted for (line.energy_balance). No segment is longer than an excitation period, so that the phase is exact at
every period's start, where the section of the response is recorded.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.amplitudes import amplitude_changes, real_sum, row_change
from vanedamp.coupling.engine.line.compliant_contacts import begin_contact, change_contact, spring_force
from vanedamp.coupling.engine.line.contact_states import (
    add_force,
    add_multiple,
    constant_loads,
    keep_released,
    resolve_contact_states,
    row_terms,
    stop_attached_bodies,
)
from vanedamp.coupling.engine.line.energy_balance import add_interval, end_segment, subtract_impact, subtract_step
from vanedamp.coupling.engine.line.event_functions import ENDLESS, carry_over_period, hop_speed, next_event
from vanedamp.coupling.engine.line.flow_assembly import code_of
from vanedamp.coupling.engine.line.gap_kinematics import (
    align_gaps,
    close_gaps,
    join_places,
    join_speeds,
    mark_only,
    measure_gaps,
    rigid,
    shift_slip,
)
from vanedamp.coupling.engine.line.impacts import all_in_flight, simultaneous_impacts, single_impact
from vanedamp.coupling.engine.line.recording import record_start, structure_state
from vanedamp.coupling.engine.line.sleeping import (
    may_sleep,
    show_sleepers,
    spend_on_friction,
    spend_on_impulses,
    wake_all,
)
from vanedamp.coupling.engine.line.tolerances import INACTIVE, OVERLAP
from vanedamp.coupling.engine.scenes import SLICE
from vanedamp.coupling.numerics.codes import (
    ACCURACY_LOST,
    ACTIVE,
    ASLEEP,
    BEGUN,
    CLOSED,
    CLOSED_ROWS,
    CLOSES,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    HELD,
    ILL_CONDITIONED,
    LEAVING,
    LOGGED,
    NEEDS_FLOW,
    NO_SOLUTION,
    OPEN,
    PAUSED,
    PERIOD,
    POSITION,
    RECLOSES,
    SEARCHING,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STATES_GO_ON,
    STATES_OPEN,
    STICK,
    TOUCHING,
    UNDECIDED,
    VELOCITY,
)
from vanedamp.coupling.numerics.compiler.jit import comparing, inlined, kernel, summing
from vanedamp.coupling.numerics.tolerances import AT_START, CANCELLED, SIMULTANEOUS
from vanedamp.coupling.response.records import FRICTION


@kernel
def advance(system, flows, st, watched, rec, scratch, periods, max_events):
    """Run until all periods are done or something is needed. Return the code (numerics.codes) of why it returns."""
    code = _go_on(system, flows, st, watched, rec, scratch, periods, max_events)
    if st.counters[ASLEEP] > 0:
        show_sleepers(system, flows, st)
    return code


@inlined
def _go_on(system, flows, st, watched, rec, scratch, periods, max_events):
    deciding, segments = False, 0
    while True:
        if deciding:
            # here only: its code is compiled into the loop, as a call costs more than it does
            if not resolve_contact_states(system, st, rec, scratch):
                return UNDECIDED
            if not _within_walls(system, st):
                return ACCURACY_LOST
            deciding = False
        if st.counters[SEARCHING] == 1:
            answer = _begin_flow(system, flows, st, rec, scratch)
            if answer == NEEDS_FLOW:
                return NEEDS_FLOW
            deciding = answer == STATES_OPEN
            if deciding:
                continue
        if st.counters[PERIOD] >= periods:
            return DONE
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if segments == SLICE or st.counters[LOGGED] + 2 * len(system.delassus) >= len(rec.log):
            return PAUSED
        segments += 1
        tau, event, side = next_event(system, flows, st, watched, rec)
        if event == ENDLESS:
            return ILL_CONDITIONED
        amplitude_changes(flows, st, scratch, tau)
        end_segment(system, flows, st, rec, scratch, tau)
        _advance_motion(system, flows, st, rec, scratch, tau)
        # the end of a period is no event: a row that has opened just before it still does
        if tau > (0.0 if event >= 0 else AT_START * system.period):
            _forget_released(st)
        if event < 0:
            _end_period(system, flows, st, watched, rec, scratch, tau)
            continue
        scratch.impulse[:] = 0.0
        st.counters[EVENTS] += 1
        st.time[0] += tau
        _set_phases(system, st)
        outcome = _handle_event(
            system, flows, st, rec, scratch, watched.row[event, side], watched.order[event],
            watched.meaning[event, side],
        )  # fmt: skip
        if outcome == NO_SOLUTION:
            return UNDECIDED
        deciding = outcome == STATES_OPEN
        if not deciding and not _within_walls(system, st):
            return ACCURACY_LOST


@inlined
def _begin_flow(system, flows, st, rec, scratch):
    """Begin the motion of the states as decided.

    Returns STATES_GO_ON, STATES_OPEN where they must be decided again, or NEEDS_FLOW.
    """
    s = _find_flow(flows, st.active_set)
    if st.counters[ASLEEP] > 0:
        if s == st.counters[FLOW]:
            spend_on_friction(system, flows, st, scratch)
        else:
            wake_all(system, flows, st, rec, scratch)
    if st.counters[BEGUN] == 1 and s == st.counters[FLOW] and _only_friction(system, flows, st):
        _change_amplitudes(system, flows, st, rec, scratch)
        _change_friction(system, flows, st, rec)
        st.counters[SEARCHING] = 0
        return STATES_GO_ON
    add_interval(system, flows, st, rec, scratch)
    st.counters[BEGUN] = 0
    if s < 0:
        return NEEDS_FLOW
    st.counters[BEGUN] = 1
    flows.used[s] = st.counters[EVENTS]
    _begin_subsystem(system, flows, st, scratch, s)
    if stop_attached_bodies(system, flows, st):
        keep_released(st, scratch)
        return STATES_OPEN
    if st.counters[EVENTS] == 0 and st.counters[PERIOD] == 0:
        record_start(system, flows, st, rec, scratch)
    return STATES_GO_ON


@inlined
def _only_friction(system, flows, st):
    """Whether nothing changes in a crowd in flight but friction, and speeds by impulses."""
    only = may_sleep(flows, st)
    for r in range(system.bodies, len(st.state)):
        only = only and st.applied_force[r] == st.included_force[r]
    return only


@kernel
def _change_friction(system, flows, st, rec):
    """Change the friction on bodies within the same subsystem."""
    s, n = st.counters[FLOW], system.modes
    for r in range(system.bodies):
        force = st.applied_force[r] - st.included_force[r]
        if force == 0.0:
            continue
        shift, column = 0.0, system.J[r]
        for i in range(n):
            static = flows.static[s, i, i] * column[i]
            if not flows.uncoupled[s]:
                static = 0.0
                for k in range(n):
                    static += flows.static[s, i, k] * column[k]
            st.constant[i] += force * static
            shift += system.response[i] * (force * static)
            for k in range(len(system.outputs)):
                st.offset[1 + k] += system.outputs[k, i] * (force * static)
        subtract_step(system, flows, st, rec, r, force, shift)
        _add_gains(flows.step_response[s, r], force, flows.driven[s, 0], flows.modes[s], st.amplitude, st.change)
        st.coordinate_acceleration[n + r] = flows.body_acceleration[s, r, r] * (
            system.weight[n + r] + st.applied_force[r] * column[n + r]
        )
        st.included_force[r] = st.applied_force[r]
    _set_free_accelerations(system, st)
    _activate_modes(flows, st)


@inlined
def _forget_released(st):
    for r in range(len(st.released)):
        st.released[r] = 0


@inlined
def _end_period(system, flows, st, watched, rec, scratch, tau):
    """Begin the next period after a segment of length tau, and record its start."""
    if st.counters[ASLEEP] > 0:
        st.time[0] += tau
        scratch.impulse[:] = 0.0
        wake_all(system, flows, st, rec, scratch)
    carry_over_period(system, st, watched, tau)
    add_interval(system, flows, st, rec, scratch)
    st.counters[PERIOD] += 1
    st.time[0] = 0.0
    for r in range(len(st.last_impact)):
        st.last_impact[r] -= system.period
    _set_phases(system, st)
    _select_active_modes(flows, st)
    record_start(system, flows, st, rec, scratch)
    align_gaps(system, st, scratch.coordinates)


@kernel
def begin(system, st, rec, scratch):
    """Decide the contact states of the initial state. Return False if that fails."""
    hit = False
    for r in range(system.friction_rows):
        if not rigid(system, r) and system.limit[r] > 0.0:
            st.state[r] = _jenkins_state(system, st, r)
    for r in range(len(st.state)):
        scratch.forced[r] = 0
        if r >= system.friction_rows and st.displacement[r] <= SIMULTANEOUS * system.play[r]:
            if not rigid(system, r) and st.displacement[r] < -SIMULTANEOUS * system.play[r]:
                # compressed from the start: its impact was before the run
                st.state[r] = SPRUNG if spring_force(system, st, r) > 0.0 else LEAVING
                continue
            _close_gap(system, st, scratch, r)
            if st.velocity[r] < 0.0 and rigid(system, r):
                hit = True
            elif st.velocity[r] < 0.0:
                begin_contact(system, st, rec, r)
    if hit:
        if not simultaneous_impacts(system, st, rec, scratch):
            return False
        _push_structure(system, st, scratch)
    return resolve_contact_states(system, st, rec, scratch)


@inlined
def _jenkins_state(system, st, r):
    """Return the state of a Jenkins element with its elongation: its spring holds, or it slides on at its bound."""
    at_bound = abs(system.spring[r] * st.displacement[r]) >= (1.0 - SIMULTANEOUS) * system.limit[r]
    if at_bound and st.displacement[r] * st.velocity[r] > 0.0:
        return SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
    return SPRUNG


@inlined
def _close_gap(system, st, scratch, r):
    """Set the gap of row r to zero exactly, and those that close with it."""
    mark_only(scratch, r)
    join_places(system, st, scratch)
    st.displacement[r] = 0.0
    measure_gaps(system, st)
    if rigid(system, r):
        close_gaps(system, st, scratch)


@kernel
def _find_flow(flows, active_set):
    """Return the index of the subsystem of these closed rows, -1 without."""
    code = code_of(active_set)
    for s in range(len(flows.modes)):
        same = flows.modes[s] > 0 and flows.code[s] == code
        for r in range(len(active_set)):
            if not same:
                break
            same = flows.active_set[s, r] == active_set[r]
        if same:
            return s
    return -1


@inlined
def _set_phases(system, st):
    """Set the phases of the harmonics exactly from the time."""
    for h in range(len(system.frequency)):
        angle = system.frequency[h] * st.time[0]
        st.amplitude[h] = complex(math.cos(angle), math.sin(angle))


@inlined
def _begin_subsystem(system, flows, st, scratch, s):
    """Begin subsystem s with the structure at st.coordinates and the row states as they are."""
    st.counters[FLOW], st.counters[SEARCHING] = s, 0
    for r in range(len(st.state)):
        st.included_force[r] = st.applied_force[r]
    _set_constants(system, flows, st, scratch, s)
    _set_amplitudes(system, flows, st, scratch, s)
    _set_free_accelerations(system, st)
    _set_constant_forces(system, flows, st, scratch, s)
    st.offset[0] = 0.0
    for i in range(len(st.constant)):
        st.offset[0] += system.response[i] * st.constant[i]
    for k in range(len(system.outputs)):
        st.offset[1 + k] = 0.0
        for i in range(len(st.constant)):
            st.offset[1 + k] += system.outputs[k, i] * st.constant[i]
    st.counters[ACTIVE] = flows.modes[s]
    _select_active_modes(flows, st)


@inlined
def _set_constants(system, flows, st, scratch, s):
    """Set the response to constant loads: displacements of structure and sprung bodies, accelerations of free ones."""
    n, b, y = len(st.constant), system.bodies, st.coordinates
    constant_loads(system, st, scratch)
    if flows.sprung[s]:
        _preload(system, flows, st, scratch, s, y)
    for i in range(n):
        st.constant[i] = 0.0
    for i in range(b):
        st.slip_constant[i] = 0.0
    loaded = False
    for i in range(n + b):
        loaded = loaded or scratch.loads[i] != 0.0
    if loaded and flows.uncoupled[s]:
        for i in range(n):
            st.constant[i] += flows.static[s, i, i] * scratch.loads[i]
    elif loaded:
        _add_product(flows.static[s], 0, scratch.loads, st.constant)
        if flows.sprung[s]:
            _add_product(flows.static[s], n, scratch.loads, st.slip_constant)
    if flows.tied[s]:
        _add_product(flows.constrained[s], 0, y, st.constant)
        if flows.sprung[s]:
            _add_product(flows.constrained[s], n, y, st.slip_constant)
    for i in range(b):
        st.coordinate_acceleration[n + i] = 0.0
        for k in range(b):
            st.coordinate_acceleration[n + i] += flows.body_acceleration[s, i, k] * scratch.loads[n + k]


@summing
def _add_product(matrix, first, x, total):
    """Add the rows of a matrix from `first` on, as many as `total` has, times x to it."""
    for i in range(len(total)):
        sum_ = 0.0
        for k in range(matrix.shape[1]):
            sum_ += matrix[first + i, k] * x[k]
        total[i] += sum_


@inlined
def _set_amplitudes(system, flows, st, scratch, s):
    """Set the amplitudes of the free modes from the motion, less its constant part and the excitation's."""
    b, e = system.bodies, len(system.frequency)
    _subtract_steady(flows.shape[s], st.amplitude, st.constant, e, st.coordinates, scratch.coordinates)
    _project(flows.project[s], flows.reach[s], scratch.coordinates, e, flows.modes[s], st.amplitude)
    if flows.sprung[s]:
        for i in range(b):
            scratch.slips[i], scratch.slips[b + i] = st.displacement[i], st.velocity[i]
            for h in range(e):
                scratch.slips[i] -= (flows.excited[s, i, h] * st.amplitude[h]).real
                scratch.slips[b + i] -= (flows.excited[s, b + i, h] * st.amplitude[h]).real
            scratch.slips[i] -= st.slip_constant[i]
        for j in range(e, flows.modes[s]):
            amplitude = st.amplitude[j]
            for i in range(2 * b):
                amplitude += flows.project_slip[s, j, i] * scratch.slips[i]
            st.amplitude[j] = amplitude
    for j in range(flows.modes[s], len(st.amplitude)):
        st.amplitude[j] = 0.0  # loops in whole vectors go beyond the modes


@summing
def _subtract_steady(shape, phase, constant, harmonics, y, rest):
    """Set the rest of y = (p, p') without its constant part and the excitation's."""
    n = len(constant)
    for i in range(n):
        rest[i], rest[n + i] = y[i] - constant[i], y[n + i]
    for h in range(harmonics):
        c = phase[h]
        for i in range(2 * n):
            rest[i] -= shape[h, i].real * c.real - shape[h, i].imag * c.imag


@summing
def _project(project, reach, y, first, last, amplitude):
    """Set the amplitudes of the modes from `first` to `last` that (p, p') = y has."""
    n = len(y) // 2
    for j in range(first, last):
        x, turned = 0.0, 0.0
        for i in range(reach[j, 0], reach[j, 1]):
            of_place, of_speed = project[j, i], project[j, n + i]
            x += of_place.real * y[i] + of_speed.real * y[n + i]
            turned += of_place.imag * y[i] + of_speed.imag * y[n + i]
        amplitude[j] = complex(x, turned)


@kernel
def _preload(system, flows, st, scratch, s, y):
    """Add the forces that closed springs have at p = 0 and xi = 0: of a wall's gap, an anchor, bodies that stick."""
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            offset = 0.0
            if r < system.friction_rows:
                offset = st.displacement[r]
                for i in range(len(st.constant)):
                    offset -= system.J[r, i] * y[i]
            else:
                offset = system.rest[r]
                for b in range(system.bodies):
                    if flows.attached[s, b]:
                        offset += system.J[r, system.modes + b] * st.displacement[b]
            add_force(system, scratch, r, -system.spring[r] * offset)


@kernel
def _set_free_accelerations(system, st):
    """Set the constant parts of the rows' accelerations, by the free bodies."""
    n, b = system.modes, system.bodies
    for r in range(len(st.state)):
        st.free_acceleration[r], size = 0.0, 0.0
        for body in (r if r < b else system.left_body[r], system.right_body[r]):
            if body >= 0:
                term = system.J[r, n + body] * st.coordinate_acceleration[n + body]
                st.free_acceleration[r] += term
                size += abs(term)
        if abs(st.free_acceleration[r]) <= CANCELLED * size:
            st.free_acceleration[r] = 0.0  # bodies that fall together


@kernel
def _set_constant_forces(system, flows, st, scratch, s):
    """Set the constant parts of the closed rows' forces."""
    n, b, r_count, sprung, rigid_closed = len(st.constant), system.bodies, len(st.state), flows.sprung[s], False
    for r in range(r_count):
        st.constant_force[r] = 0.0
        if sprung and st.state[r] == SPRUNG:
            force = real_sum(flows.force[s, r], st.amplitude, flows.modes[s])
            st.constant_force[r] = spring_force(system, st, r) - force
        rigid_closed = rigid_closed or flows.closed_inverse[s, r, r] != 0.0
    if not rigid_closed:
        return
    if sprung:
        constant_loads(system, st, scratch)  # without the preload: springs are in the constant forces
    for i in range(n):
        scratch.loads[i] -= system.stiffness[i] * st.constant[i]
    for i in range(n, n + b):
        scratch.loads[i] /= system.mass[i]
    for r in range(r_count):
        scratch.acceleration[r], scratch.jerk[r] = row_terms(system.J[r], scratch.loads, scratch.loads)
        if sprung:
            for k in range(r_count):
                scratch.acceleration[r] += system.delassus[r, k] * st.constant_force[k]
                scratch.jerk[r] += abs(system.delassus[r, k] * st.constant_force[k])
    for r in range(r_count):
        if flows.closed_inverse[s, r, r] == 0.0:
            continue
        force, size = 0.0, 0.0
        for k in range(r_count):
            force -= flows.closed_inverse[s, r, k] * scratch.acceleration[k]
            size += abs(flows.closed_inverse[s, r, k]) * scratch.jerk[k]
        st.constant_force[r] = force if abs(force) > CANCELLED * size else 0.0


@inlined
def _select_active_modes(flows, st):
    """Make modes inactive whose acceleration is negligible relative to the largest, none that the excitation drives.

    Modes are in order of their rates: the first counters[ACTIVE] of them are active.
    """
    s, e = st.counters[FLOW], flows.driven.shape[1] - 1
    largest = _largest_acceleration(flows, st, s, st.counters[ACTIVE])
    last, count = flows.driven[s, e], flows.driven[s, e]
    for j in range(last, st.counters[ACTIVE]):
        c = st.amplitude[j]
        if (abs(c.real) + abs(c.imag)) * flows.acceleration[s, j] > INACTIVE * largest:
            count = j + 1
        else:
            st.amplitude[j] = 0.0
    st.counters[ACTIVE] = count


@inlined
def _activate_modes(flows, st):
    """Activate the modes that an impulse has set in motion. None becomes inactive within its interval."""
    s = st.counters[FLOW]
    largest, count = _largest_acceleration(flows, st, s, flows.modes[s]), flows.modes[s]
    while count > st.counters[ACTIVE]:
        c = st.amplitude[count - 1]
        if (abs(c.real) + abs(c.imag)) * flows.acceleration[s, count - 1] > INACTIVE * largest:
            break
        count -= 1
        st.amplitude[count] = 0.0
        st.change[2 * count], st.change[2 * count + 1] = 0.0, 0.0
    st.counters[ACTIVE] = count


@inlined
def _largest_acceleration(flows, st, s, count):
    """Return the largest acceleration of the first `count` modes, and set the bound of their speeds."""
    largest, st.largest_speed[0] = _largest(st.amplitude, flows.acceleration[s], flows.speed[s], count)
    return largest


@comparing
def _largest(amplitude, acceleration, speed, count):
    largest, fastest = 0.0, 0.0
    for j in range(count):
        size = abs(amplitude[j].real) + abs(amplitude[j].imag)
        largest = max(largest, size * acceleration[j])
        fastest = max(fastest, size * speed[j])
    return largest, fastest


@inlined
def _advance_motion(system, flows, st, rec, scratch, tau):
    """Advance rows and amplitudes by tau."""
    s, count, friction = st.counters[FLOW], st.counters[ACTIVE], system.friction_rows
    wears = rec.worn.shape[1] > 0
    for r in range(len(st.state)):
        state = st.state[r]
        if (r >= friction and (system.moves_with_floor[r] or state == CLOSED or state == TOUCHING)) or (
            r < friction and (state == STICK or state == HELD)
        ):
            continue
        if r < system.bodies and st.asleep[r] != 0:
            continue
        shift, speed = row_change(flows.motion[s, r], flows.velocity[s, r], scratch.bend, scratch.gain, count)
        shift += tau * (st.velocity[r] + 0.5 * st.free_acceleration[r] * tau)
        speed += st.free_acceleration[r] * tau
        st.velocity[r] += speed
        if r < friction:
            st.ledger[FRICTION] -= st.applied_force[r] * shift
            if wears:
                rec.worn[st.counters[PERIOD], r] += abs(st.applied_force[r] * shift)
        if r >= friction or rigid(system, r) or state == SPRUNG:  # a Jenkins element slides with its spring as it is
            shift_slip(st, r, shift)
    if flows.sprung[s]:
        _add_contact_impulses(system, flows, st, scratch, tau)
    if st.counters[CLOSED_ROWS] > 0:
        _stay_together(system, st, scratch)
    measure_gaps(system, st)
    _add_gains(scratch.gain, 1.0, 0, count, st.amplitude, st.change)


@summing
def _add_gains(gain, factor, first, last, amplitude, change):
    """Add gains times a factor to the amplitudes of the modes from `first` to `last`, and to their changes."""
    for j in range(first, last):
        x, y = factor * gain[j].real, factor * gain[j].imag
        amplitude[j] += complex(x, y)
        change[2 * j] += x
        change[2 * j + 1] += y


@inlined
def _stay_together(system, st, scratch):
    """Keep bodies that move as one exactly together."""
    closed = False
    for r in range(system.friction_rows, len(st.state)):
        scratch.touching[r] = rigid(system, r) and st.state[r] != OPEN
        closed = closed or scratch.touching[r]
    if closed:
        join_places(system, st, scratch)
        join_speeds(system, st, scratch)


@kernel
def _add_contact_impulses(system, flows, st, scratch, tau):
    """Add the segment to the impulses of compliant contacts."""
    s = st.counters[FLOW]
    for r in range(system.friction_rows, len(st.state)):
        if st.state[r] == SPRUNG:
            st.contact_impulse[r] += st.constant_force[r] * tau
            for j in range(st.counters[ACTIVE]):
                st.contact_impulse[r] += (flows.impulse[s, r, j] * scratch.gain[j]).real


@inlined
def _within_walls(system, st):
    """Whether round-off has kept every body inside its cavity."""
    friction = system.friction_rows
    for r in range(friction, len(st.state)):
        pressed = st.state[r] == SPRUNG or st.state[r] == LEAVING
        if not pressed and not st.displacement[r] >= -OVERLAP * system.play[r]:
            return False
    return True


@inlined
def _handle_event(system, flows, st, rec, scratch, r, order, meaning):
    """Apply the event of row r, a jump of velocities or a change at a row.

    Returns STATES_GO_ON, STATES_OPEN where contact states must be decided again, or NO_SOLUTION.
    """
    closes = order == POSITION and meaning == CLOSES
    collided = closes and single_impact(system, st, rec, scratch, r)
    if order == POSITION and meaning != RECLOSES and not collided:
        # a gap that closes while it still widens, to round-off, is a touch without speed
        if closes and st.velocity[r] > 0.0:
            st.velocity[r] = 0.0
            mark_only(scratch, r)
            join_speeds(system, st, scratch)
        _close_gap(system, st, scratch, r)
        if closes and rigid(system, r):
            _set_capture_speeds(system, flows, st)
            if not simultaneous_impacts(system, st, rec, scratch):
                return NO_SOLUTION
            collided = True
    if collided and st.counters[ASLEEP] > 0:
        spend_on_impulses(system, flows, st, rec, scratch)
    if collided and all_in_flight(system, st):
        _change_amplitudes(system, flows, st, rec, scratch)
        return STATES_GO_ON
    keep_released(st, scratch)
    if collided:
        structure_state(flows, st, st.coordinates)
        _push_structure(system, st, scratch)
        return STATES_OPEN
    if order == VELOCITY:
        st.velocity[r] = 0.0
    elif r < system.friction_rows or rigid(system, r):
        scratch.forced[r] = meaning
    elif meaning != CLOSES:
        change_contact(system, st, rec, scratch, r, meaning)
    elif st.velocity[r] < 0.0:
        begin_contact(system, st, rec, r)
    structure_state(flows, st, st.coordinates)
    if meaning == CLOSES:
        align_gaps(system, st, st.coordinates)  # a steady motion may touch at every period's start
    return STATES_OPEN


@inlined
def _set_capture_speeds(system, flows, st):
    """Set the capture speeds of contacts that are closed."""
    for r in range(system.friction_rows, len(st.state)):
        if st.state[r] == CLOSED:
            st.capture_speed[r] = hop_speed(system, flows, st, r)
        elif st.state[r] == TOUCHING:
            st.capture_speed[r] = 0.0


@inlined
def _change_amplitudes(system, flows, st, rec, scratch):
    """Apply the impulses of the rows to the amplitudes, within the same subsystem."""
    s = st.counters[FLOW]
    for r in range(len(st.state)):
        impulse = scratch.impulse[r]
        if impulse != 0.0:
            subtract_impact(system, flows, st, rec, r, impulse)
            _add_gains(
                flows.impulse_response[s, r], impulse, flows.driven[s, 0], flows.modes[s], st.amplitude, st.change
            )
    _activate_modes(flows, st)


@inlined
def _push_structure(system, st, scratch):
    """Add the impulses to the structure's modal velocities in st.coordinates."""
    for r in range(len(scratch.impulse)):
        if scratch.impulse[r] != 0.0:
            add_multiple(system.J[r], scratch.impulse[r], st.coordinates[len(st.constant) :])
