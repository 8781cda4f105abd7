"""The compiled heart of the engine: a hybrid automaton that jumps from event to event.

Between two events the state flows exactly (exact.subsystem_assembly); the next event is found with a guarantee
(exact.event_functions); what happens there is decided by complementarity (exact.contact_states); every joule is
accounted for (exact.energy_balance). No segment is longer than an excitation period, so that the phase is exact at
every period's start, where the section of the response is recorded.
"""

from __future__ import annotations

import math

from vanedamp.coupling.exact.compliant_contacts import begin_push, change_push, spring_force
from vanedamp.coupling.exact.contact_states import add_force, constant_loads, keep_released, settle, stop_riders
from vanedamp.coupling.exact.energy_balance import account
from vanedamp.coupling.exact.event_functions import carry, longest_hop, next_event
from vanedamp.coupling.exact.gap_kinematics import (
    SIMULTANEOUS,
    align_gaps,
    close,
    join,
    join_speeds,
    measure_gaps,
    only,
    rigid,
    shift_slip,
)
from vanedamp.coupling.exact.impacts import all_move, bounce, collide
from vanedamp.coupling.exact.root_search import POSITION, VELOCITY
from vanedamp.coupling.exact.section import _coordinates, record_section
from vanedamp.coupling.exact.state import (
    AWAKE,
    CLOSED,
    CLOSED_ROWS,
    CLOSES,
    EVENTS,
    FLOW,
    HELD,
    LEAVING,
    LOGGED,
    OPEN,
    PERIOD,
    RECLOSES,
    SEARCHING,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular
from vanedamp.coupling.numerics.jit import entry, inlined, kernel
from vanedamp.coupling.response.records import FRICTION

# what advance() returns, and ILL_CONDITIONED: the flow that it needs cannot be had
DONE, NEEDS_FLOW, LOG_FULL, EVENT_BUDGET, ACCURACY_LOST, UNDECIDED, ILL_CONDITIONED = range(7)

#: differences below this share of their terms are round-off
_EQUAL = 1e-14
#: modes whose acceleration is below this share of the largest sleep until the next impact
_ASLEEP = 1e-14


@entry
def advance(rows, flows, st, ch, rec, work, periods, max_events):
    """Run until all periods are done or something is needed. Returns one of the codes above."""
    while True:
        if st.counters[SEARCHING] == 1:
            s = _find_flow(flows, st.key)
            if s < 0:
                return NEEDS_FLOW
            _enter(rows, flows, st, work, s)
            if stop_riders(rows, flows, st):
                keep_released(st, work)
                if not settle(rows, st, rec, work):
                    return UNDECIDED
                continue
            if st.counters[EVENTS] == 0 and st.counters[PERIOD] == 0:
                record_section(rows, flows, st, rec, work)
        if st.counters[PERIOD] >= periods:
            return DONE
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if st.counters[LOGGED] + 2 * len(rows.delassus) >= len(rec.log):
            return LOG_FULL
        tau, who = next_event(rows, flows, st, ch)
        _amplitudes(flows, st, work, tau)
        account(rows, flows, st, rec, work, tau)
        _move(rows, flows, st, work, tau)
        if who < 0:
            carry(st, ch, tau)
            st.counters[PERIOD] += 1
            st.time[0] = 0.0
            for r in range(len(st.last_impact)):
                st.last_impact[r] -= rows.period
            _phase(rows, st)
            _wake(flows, st)
            record_section(rows, flows, st, rec, work)
            align_gaps(rows, st, work.coordinates)
            continue
        st.counters[EVENTS] += 1
        st.time[0] += tau
        _phase(rows, st)
        if not _happen(rows, flows, st, rec, work, ch.row[who], ch.order[who], ch.side[who]):
            return UNDECIDED
        if not _within_walls(rows, st):
            return ACCURACY_LOST


@entry
def begin(rows, st, rec, work):
    """Decide the contact states of the initial state. Returns False if that fails."""
    n, hit = len(st.constant), False
    for r in range(rows.friction_rows):
        if not rigid(rows, r) and rows.limit[r] > 0.0:
            st.state[r] = _stretched(rows, st, r)
    for r in range(len(st.state)):
        work.forced[r] = 0
        if r >= rows.friction_rows and st.displacement[r] <= SIMULTANEOUS * rows.gap[r - rows.friction_rows]:
            if not rigid(rows, r) and st.displacement[r] < -SIMULTANEOUS * rows.gap[r - rows.friction_rows]:
                # pressed already: its impact belongs to the run before
                st.state[r] = SPRUNG if spring_force(rows, st, r) > 0.0 else LEAVING
                continue
            _touch(rows, st, work, r)
            if st.velocity[r] < 0.0 and rigid(rows, r):
                hit = True
            elif st.velocity[r] < 0.0:
                begin_push(rows, st, rec, r)
    if hit:
        if not collide(rows, st, rec, work):
            return False
        _structure_jump(rows, work)
        for i in range(n):
            st.coordinates[n + i] += work.jump[i]
    return settle(rows, st, rec, work)


@inlined
def _stretched(rows, st, r):
    """State of a Jenkins element with a given elongation: its spring holds, or it slides on at its bound."""
    at_bound = abs(rows.spring[r] * st.displacement[r]) >= (1.0 - SIMULTANEOUS) * rows.limit[r]
    if at_bound and st.displacement[r] * st.velocity[r] > 0.0:
        return SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
    return SPRUNG


@inlined
def _touch(rows, st, work, r):
    """The gap of row r is zero, exactly, and so are those that close with it."""
    only(work, r)
    join(rows, st, work)
    st.displacement[r] = 0.0
    measure_gaps(rows, st)
    if rigid(rows, r):
        close(rows, st, work)


@kernel
def _find_flow(flows, key):
    for s in range(len(flows.modes)):
        same = flows.modes[s] > 0
        for r in range(len(key)):
            if not same:
                break
            same = flows.key[s, r] == key[r]
        if same:
            return s
    return -1


@inlined
def _phase(rows, st):
    angle = rows.omega * st.time[0]
    st.amplitude[0] = complex(math.cos(angle), math.sin(angle))


@kernel
def _enter(rows, flows, st, work, s):
    """Begin subsystem s with the structure at st.coordinates and the row states as they are."""
    n, b, y = len(st.constant), len(rows.mass), st.coordinates
    st.counters[FLOW], st.counters[SEARCHING] = s, 0
    sprung = flows.sprung[s]
    constant_loads(rows, st, work)
    if sprung:
        _preload(rows, flows, st, work, s, y)
    for i in range(n + b if sprung else n):
        total = 0.0
        for k in range(n):
            total += flows.static[s, i, k] * work.on_structure[k] + flows.held[s, i, k] * y[k]
        for k in range(b):
            total += flows.static[s, i, n + k] * work.on_bodies[k]
        if i < n:
            st.constant[i] = total
        else:
            st.slip_constant[i - n] = total
    for i in range(b):
        st.body_drift[i] = 0.0
        for k in range(b):
            st.body_drift[i] += flows.body_acceleration[s, i, k] * work.on_bodies[k]
    _phase(rows, st)
    for i in range(2 * n):
        work.coordinates[i] = y[i] - (flows.shape[s, i, 0] * st.amplitude[0]).real
        if i < n:
            work.coordinates[i] -= st.constant[i]
    if sprung:
        for i in range(b):
            turn = st.amplitude[0]
            work.slips[i] = st.displacement[i] - (flows.excited[s, i] * turn).real - st.slip_constant[i]
            work.slips[b + i] = st.velocity[i] - (flows.excited[s, b + i] * turn).real
    for j in range(1, flows.modes[s]):
        total = 0.0j
        for i in range(2 * n):
            total += flows.project[s, j, i] * work.coordinates[i]
        if sprung:
            for i in range(2 * b):
                total += flows.project_slip[s, j, i] * work.slips[i]
        st.amplitude[j] = total
    _constant_forces(rows, flows, st, work, s)
    _wake(flows, st)


@kernel
def _preload(rows, flows, st, work, s, y):
    """Add the forces that closed springs have at p = 0 and xi = 0: of a wall's gap, an anchor, bodies that stick."""
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            offset = 0.0
            if r < rows.friction_rows:
                offset = st.displacement[r]
                for i in range(len(st.constant)):
                    offset -= rows.structure[r, i] * y[i]
            else:
                if rows.before[r] < 0 or rows.after[r] < 0:
                    offset = 0.5 * rows.gap[r - rows.friction_rows]
                for b in range(len(rows.mass)):
                    if flows.attached[s, b]:
                        offset += rows.bodies[r, b] * st.displacement[b]
            add_force(rows, work, r, -rows.spring[r] * offset)


@kernel
def _constant_forces(rows, flows, st, work, s):
    """Constant parts of the rows' accelerations and of the closed rows' forces."""
    n, b, r_count = len(st.constant), len(rows.mass), len(st.state)
    sprung = flows.sprung[s]
    if sprung:
        constant_loads(rows, st, work)  # without the preload: springs are in the levels
    for r in range(r_count):
        st.drift[r], st.level[r] = 0.0, 0.0
        if sprung and st.state[r] == SPRUNG:
            st.level[r] = spring_force(rows, st, r)
            for j in range(flows.modes[s]):
                st.level[r] -= (flows.force[s, r, j] * st.amplitude[j]).real
        size = 0.0
        for k in range(b):
            part = rows.bodies[r, k] * st.body_drift[k]
            st.drift[r] += part
            size += abs(part)
        if abs(st.drift[r]) <= _EQUAL * size:
            st.drift[r] = 0.0  # bodies that fall together
    for r in range(r_count):
        work.acceleration[r], work.jerk[r] = 0.0, 0.0
        for k in range(b):
            part = rows.bodies[r, k] * work.on_bodies[k] / rows.mass[k]
            work.acceleration[r] += part
            work.jerk[r] += abs(part)
        for k in range(n):
            part = rows.structure[r, k] * (work.on_structure[k] - rows.stiffness[k] * st.constant[k])
            work.acceleration[r] += part
            work.jerk[r] += abs(part)
        if sprung:
            for k in range(r_count):
                work.acceleration[r] += rows.delassus[r, k] * st.level[k]
                work.jerk[r] += abs(rows.delassus[r, k] * st.level[k])
    for r in range(r_count):
        if flows.closed_inverse[s, r, r] == 0.0:
            continue
        level, size = 0.0, 0.0
        for k in range(r_count):
            level -= flows.closed_inverse[s, r, k] * work.acceleration[k]
            size += abs(flows.closed_inverse[s, r, k]) * work.jerk[k]
        st.level[r] = level if abs(level) > _EQUAL * size else 0.0


@inlined
def _wake(flows, st):
    """Put modes to sleep whose acceleration is negligible beside the largest, but none that the excitation drives."""
    s, largest, fastest = st.counters[FLOW], 0.0, 0.0
    for j in range(flows.modes[s]):
        c = st.amplitude[j]
        size = abs(c.real) + abs(c.imag)
        largest = max(largest, size * flows.acceleration[s, j])
        fastest = max(fastest, size * flows.speed[s, j])
    st.fastest[0] = fastest
    st.awake[0] = 0
    count = 1
    for j in range(1, flows.modes[s]):
        c = st.amplitude[j]
        if j <= flows.driven[s] or (abs(c.real) + abs(c.imag)) * flows.acceleration[s, j] > _ASLEEP * largest:
            st.awake[count] = j
            count += 1
        else:
            st.amplitude[j] = 0.0
    st.counters[AWAKE] = count


@inlined
def _amplitudes(flows, st, work, tau):
    """Changes of the awake modes' amplitudes over the segment."""
    s = st.counters[FLOW]
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        z = flows.eigenvalue[s, j] * tau
        first = exp_minus_one(z)
        work.gain[a] = st.amplitude[j] * first
        work.bend[a] = st.amplitude[j] * exp_minus_line(z, first)
    if flows.driven[s] > 0:
        load = flows.load[s, : flows.driven[s] + 1]
        _grow(flows.eigenvalue[s], load, st.amplitude[0], work.gain, work.bend, tau)


@kernel
def _grow(eigenvalue, load, phase, gain, bend, tau):
    """What the excitation adds to the modes that it drives: the first ones, always awake."""
    for j in range(1, len(load)):
        growth, beyond = secular(eigenvalue[j], eigenvalue[0], tau)
        gain[j] += load[j] * phase * growth
        bend[j] += load[j] * phase * beyond


@inlined
def _move(rows, flows, st, work, tau):
    """Carry rows and amplitudes over tau."""
    s, count, friction = st.counters[FLOW], st.counters[AWAKE], rows.friction_rows
    for r in range(len(st.state)):
        state = st.state[r]
        if (r >= friction and (rows.rides[r] or state == CLOSED or state == TOUCHING)) or (
            r < friction and (state == STICK or state == HELD)
        ):
            continue
        shift, speed = tau * (st.velocity[r] + 0.5 * st.drift[r] * tau), st.drift[r] * tau
        for a in range(count):
            j = st.awake[a]
            shift += (flows.motion[s, r, j] * work.bend[a]).real
            speed += (flows.velocity[s, r, j] * work.gain[a]).real
        st.velocity[r] += speed
        if r < friction:
            st.ledger[FRICTION] -= st.held[r] * shift
        if r >= friction or rigid(rows, r) or state == SPRUNG:  # a Jenkins element slides with its spring as it is
            shift_slip(st, r, shift)
    if flows.sprung[s]:
        _push(rows, flows, st, work, tau)
    if st.counters[CLOSED_ROWS] > 0:
        _stay_together(rows, st, work)
    measure_gaps(rows, st)
    for a in range(count):
        st.amplitude[st.awake[a]] += work.gain[a]
    if tau > 0.0:
        for r in range(len(st.released)):
            st.released[r] = 0


@inlined
def _stay_together(rows, st, work):
    """Bodies that move as one keep to each other exactly."""
    closed = False
    for r in range(rows.friction_rows, len(st.state)):
        work.shut[r] = rigid(rows, r) and st.state[r] != OPEN
        closed = closed or work.shut[r]
    if closed:
        join(rows, st, work)
        join_speeds(rows, st, work)


@kernel
def _push(rows, flows, st, work, tau):
    """Add up the impulses of compliant contacts."""
    s = st.counters[FLOW]
    for r in range(rows.friction_rows, len(st.state)):
        if st.state[r] == SPRUNG:
            st.push[r] += st.level[r] * tau
            for a in range(st.counters[AWAKE]):
                st.push[r] += (flows.impulse[s, r, st.awake[a]] * work.gain[a]).real


@inlined
def _within_walls(rows, st):
    """Whether round-off has kept every body inside its cavity."""
    friction = rows.friction_rows
    for r in range(friction, len(st.state)):
        pressed = st.state[r] == SPRUNG or st.state[r] == LEAVING
        if not pressed and not st.displacement[r] >= -1e-9 * rows.gap[r - friction]:
            return False
    return True


@inlined
def _happen(rows, flows, st, rec, work, r, order, side):
    """The event of row r: jump of velocities, new states. Returns False if it cannot be decided."""
    n = len(st.constant)
    if order == POSITION and side == CLOSES and bounce(rows, st, rec, work, r):
        _kick(flows, st, work)
        return True
    keep_released(st, work)
    if order == POSITION and side != RECLOSES:
        # a gap that closes while it still widens, to round-off, is a touch without speed
        if side == CLOSES and st.velocity[r] > 0.0:
            st.velocity[r] = 0.0
            only(work, r)
            join_speeds(rows, st, work)
        _touch(rows, st, work, r)
    if order == POSITION and side == CLOSES and rigid(rows, r):
        for i in range(rows.friction_rows, len(st.state)):
            if st.state[i] == CLOSED:
                st.settling[i] = longest_hop(rows, flows, st, i)
            elif st.state[i] == TOUCHING:
                st.settling[i] = 0.0
        if not collide(rows, st, rec, work):
            return False
        if all_move(rows, st):
            _kick(flows, st, work)
            return True
        _coordinates(flows, st, st.coordinates)
        _structure_jump(rows, work)
        for i in range(n):
            st.coordinates[n + i] += work.jump[i]
        return settle(rows, st, rec, work)
    if order == VELOCITY:
        st.velocity[r] = 0.0
    elif r < rows.friction_rows or rigid(rows, r):
        work.forced[r] = side
    elif side != CLOSES:
        change_push(rows, st, rec, work, r, side)
    elif st.velocity[r] < 0.0:
        begin_push(rows, st, rec, r)
    _coordinates(flows, st, st.coordinates)
    if side == CLOSES:
        align_gaps(rows, st, st.coordinates)  # a motion in step with the excitation may touch at every period's start
    return settle(rows, st, rec, work)


@inlined
def _kick(flows, st, work):
    """Impulses on the rows, within the same subsystem."""
    s = st.counters[FLOW]
    for r in range(len(st.state)):
        if work.impulse[r] != 0.0:
            for j in range(1, flows.modes[s]):
                st.amplitude[j] += flows.kick[s, r, j] * work.impulse[r]
    _wake(flows, st)


@kernel
def _structure_jump(rows, work):
    """Jump of the structure's modal velocities under the impulses."""
    for i in range(len(work.jump)):
        work.jump[i] = 0.0
        for r in range(len(work.impulse)):
            work.jump[i] += rows.structure[r, i] * work.impulse[r]
