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
from vanedamp.coupling.exact.section import _coordinates, record_start
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

# what an event leads to: the same contact states go on, they must be decided, or its impact has no solution
_STAYS, _DECIDE, _FAILED = range(3)

#: differences below this share of their terms are round-off
_EQUAL = 1e-14
#: modes whose acceleration is below this share of the largest sleep until the next impact
_ASLEEP = 1e-14


@entry
def advance(system, flows, st, ch, rec, work, periods, max_events):
    """Run until all periods are done or something is needed. Returns one of the codes above."""
    deciding = False
    while True:
        if deciding:
            # decided at one place only: that much code is compiled into the loop, as a call costs more than it does
            if not settle(system, st, rec, work):
                return UNDECIDED
            if not _within_walls(system, st):
                return ACCURACY_LOST
            deciding = False
        if st.counters[SEARCHING] == 1:
            s = _find_flow(flows, st.key)
            if s < 0:
                return NEEDS_FLOW
            _enter(system, flows, st, work, s)
            if stop_riders(system, flows, st):
                keep_released(st, work)
                deciding = True
                continue
            if st.counters[EVENTS] == 0 and st.counters[PERIOD] == 0:
                record_start(system, flows, st, rec, work)
        if st.counters[PERIOD] >= periods:
            return DONE
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if st.counters[LOGGED] + 2 * len(system.delassus) >= len(rec.log):
            return LOG_FULL
        tau, who = next_event(system, flows, st, ch)
        _amplitudes(flows, st, work, tau)
        account(system, flows, st, rec, work, tau)
        _move(system, flows, st, work, tau)
        if who < 0:
            carry(st, ch, tau)
            st.counters[PERIOD] += 1
            st.time[0] = 0.0
            for r in range(len(st.last_impact)):
                st.last_impact[r] -= system.period
            _phase(system, st)
            _wake(flows, st)
            record_start(system, flows, st, rec, work)
            align_gaps(system, st, work.coordinates)
            continue
        st.counters[EVENTS] += 1
        st.time[0] += tau
        _phase(system, st)
        outcome = _happen(system, flows, st, rec, work, ch.row[who], ch.order[who], ch.side[who])
        if outcome == _FAILED:
            return UNDECIDED
        deciding = outcome == _DECIDE
        if not deciding and not _within_walls(system, st):
            return ACCURACY_LOST


@entry
def begin(system, st, rec, work):
    """Decide the contact states of the initial state. Returns False if that fails."""
    n, hit = len(st.constant), False
    for r in range(system.friction_rows):
        if not rigid(system, r) and system.limit[r] > 0.0:
            st.state[r] = _stretched(system, st, r)
    for r in range(len(st.state)):
        work.forced[r] = 0
        if r >= system.friction_rows and st.displacement[r] <= SIMULTANEOUS * system.free_travel[r]:
            if not rigid(system, r) and st.displacement[r] < -SIMULTANEOUS * system.free_travel[r]:
                # pressed already: its impact belongs to the run before
                st.state[r] = SPRUNG if spring_force(system, st, r) > 0.0 else LEAVING
                continue
            _touch(system, st, work, r)
            if st.velocity[r] < 0.0 and rigid(system, r):
                hit = True
            elif st.velocity[r] < 0.0:
                begin_push(system, st, rec, r)
    if hit:
        if not collide(system, st, rec, work):
            return False
        _structure_jump(system, work)
        for i in range(n):
            st.coordinates[n + i] += work.jump[i]
    return settle(system, st, rec, work)


@inlined
def _stretched(system, st, r):
    """State of a Jenkins element with a given elongation: its spring holds, or it slides on at its bound."""
    at_bound = abs(system.spring[r] * st.displacement[r]) >= (1.0 - SIMULTANEOUS) * system.limit[r]
    if at_bound and st.displacement[r] * st.velocity[r] > 0.0:
        return SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
    return SPRUNG


@inlined
def _touch(system, st, work, r):
    """The gap of row r is zero, exactly, and so are those that close with it."""
    only(work, r)
    join(system, st, work)
    st.displacement[r] = 0.0
    measure_gaps(system, st)
    if rigid(system, r):
        close(system, st, work)


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
def _phase(system, st):
    for h in range(len(system.frequency)):
        angle = system.frequency[h] * st.time[0]
        st.amplitude[h] = complex(math.cos(angle), math.sin(angle))


@inlined
def _enter(system, flows, st, work, s):
    """Begin subsystem s with the structure at st.coordinates and the row states as they are."""
    n, b, e, y = len(st.constant), system.bodies, len(system.frequency), st.coordinates
    st.counters[FLOW], st.counters[SEARCHING] = s, 0
    sprung = flows.sprung[s]
    constant_loads(system, st, work)
    if sprung:
        _preload(system, flows, st, work, s, y)
    for i in range(n + b if sprung else n):
        total = 0.0
        for k in range(n + b):
            total += flows.static[s, i, k] * work.loads[k]
        for k in range(n):
            total += flows.held[s, i, k] * y[k]
        if i < n:
            st.constant[i] = total
        else:
            st.slip_constant[i - n] = total
    for i in range(b):
        st.drifts[n + i] = 0.0
        for k in range(b):
            st.drifts[n + i] += flows.body_acceleration[s, i, k] * work.loads[n + k]
    _phase(system, st)
    for i in range(2 * n):
        work.coordinates[i] = y[i]
        for h in range(e):
            work.coordinates[i] -= (flows.shape[s, i, h] * st.amplitude[h]).real
        if i < n:
            work.coordinates[i] -= st.constant[i]
    if sprung:
        for i in range(b):
            work.slips[i], work.slips[b + i] = st.displacement[i], st.velocity[i]
            for h in range(e):
                work.slips[i] -= (flows.excited[s, i, h] * st.amplitude[h]).real
                work.slips[b + i] -= (flows.excited[s, b + i, h] * st.amplitude[h]).real
            work.slips[i] -= st.slip_constant[i]
    for j in range(e, flows.modes[s]):
        total = 0.0j
        for i in range(2 * n):
            total += flows.project[s, j, i] * work.coordinates[i]
        if sprung:
            for i in range(2 * b):
                total += flows.project_slip[s, j, i] * work.slips[i]
        st.amplitude[j] = total
    _constant_forces(system, flows, st, work, s)
    _wake(flows, st)


@kernel
def _preload(system, flows, st, work, s, y):
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
            add_force(system, work, r, -system.spring[r] * offset)


@kernel
def _constant_forces(system, flows, st, work, s):
    """Constant parts of the rows' accelerations and of the closed rows' forces."""
    n, b, r_count = len(st.constant), system.bodies, len(st.state)
    sprung = flows.sprung[s]
    if sprung:
        constant_loads(system, st, work)  # without the preload: springs are in the levels
    for r in range(r_count):
        st.drift[r], st.level[r] = 0.0, 0.0
        if sprung and st.state[r] == SPRUNG:
            st.level[r] = spring_force(system, st, r)
            for j in range(flows.modes[s]):
                st.level[r] -= (flows.force[s, r, j] * st.amplitude[j]).real
        size = 0.0
        for i in range(n + b):
            part = system.J[r, i] * st.drifts[i]
            st.drift[r] += part
            size += abs(part)
        if abs(st.drift[r]) <= _EQUAL * size:
            st.drift[r] = 0.0  # bodies that fall together
    for i in range(n):
        work.loads[i] -= system.stiffness[i] * st.constant[i]
    for i in range(n, n + b):
        work.loads[i] /= system.mass[i]
    for r in range(r_count):
        work.acceleration[r], work.jerk[r] = 0.0, 0.0
        for i in range(n + b):
            part = system.J[r, i] * work.loads[i]
            work.acceleration[r] += part
            work.jerk[r] += abs(part)
        if sprung:
            for k in range(r_count):
                work.acceleration[r] += system.delassus[r, k] * st.level[k]
                work.jerk[r] += abs(system.delassus[r, k] * st.level[k])
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
    s, e, largest, fastest = st.counters[FLOW], flows.driven.shape[1] - 1, 0.0, 0.0
    for j in range(flows.modes[s]):
        c = st.amplitude[j]
        size = abs(c.real) + abs(c.imag)
        largest = max(largest, size * flows.acceleration[s, j])
        fastest = max(fastest, size * flows.speed[s, j])
    st.fastest[0] = fastest
    for h in range(e):
        st.awake[h] = h
    count, last = e, flows.driven[s, e]
    for j in range(e, flows.modes[s]):
        c = st.amplitude[j]
        if j < last or (abs(c.real) + abs(c.imag)) * flows.acceleration[s, j] > _ASLEEP * largest:
            st.awake[count] = j
            count += 1
        else:
            st.amplitude[j] = 0.0
    st.counters[AWAKE] = count


@inlined
def _amplitudes(flows, st, work, tau):
    """Changes of the awake modes' amplitudes over the segment."""
    s, e = st.counters[FLOW], flows.driven.shape[1] - 1
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        z = flows.eigenvalue[s, j] * tau
        first = exp_minus_one(z)
        work.gain[a] = st.amplitude[j] * first
        work.bend[a] = st.amplitude[j] * exp_minus_line(z, first)
    if flows.driven[s, e] > e:
        _grow(flows.eigenvalue[s], flows.driven[s], flows.load[s], st.amplitude, work.gain, work.bend, tau)


@kernel
def _grow(eigenvalue, driven, load, phase, gain, bend, tau):
    """What the harmonics add to the modes that they drive: the first ones, always awake."""
    for h in range(len(driven) - 1):
        for j in range(driven[h], driven[h + 1]):
            growth, beyond = secular(eigenvalue[j], eigenvalue[h], tau)
            gain[j] += load[j] * phase[h] * growth
            bend[j] += load[j] * phase[h] * beyond


@inlined
def _move(system, flows, st, work, tau):
    """Carry rows and amplitudes over tau."""
    s, count, friction = st.counters[FLOW], st.counters[AWAKE], system.friction_rows
    for r in range(len(st.state)):
        state = st.state[r]
        if (r >= friction and (system.moves_with_floor[r] or state == CLOSED or state == TOUCHING)) or (
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
        if r >= friction or rigid(system, r) or state == SPRUNG:  # a Jenkins element slides with its spring as it is
            shift_slip(st, r, shift)
    if flows.sprung[s]:
        _push(system, flows, st, work, tau)
    if st.counters[CLOSED_ROWS] > 0:
        _stay_together(system, st, work)
    measure_gaps(system, st)
    for a in range(count):
        st.amplitude[st.awake[a]] += work.gain[a]
    if tau > 0.0:
        for r in range(len(st.released)):
            st.released[r] = 0


@inlined
def _stay_together(system, st, work):
    """Bodies that move as one keep to each other exactly."""
    closed = False
    for r in range(system.friction_rows, len(st.state)):
        work.shut[r] = rigid(system, r) and st.state[r] != OPEN
        closed = closed or work.shut[r]
    if closed:
        join(system, st, work)
        join_speeds(system, st, work)


@kernel
def _push(system, flows, st, work, tau):
    """Add up the impulses of compliant contacts."""
    s = st.counters[FLOW]
    for r in range(system.friction_rows, len(st.state)):
        if st.state[r] == SPRUNG:
            st.push[r] += st.level[r] * tau
            for a in range(st.counters[AWAKE]):
                st.push[r] += (flows.impulse[s, r, st.awake[a]] * work.gain[a]).real


@inlined
def _within_walls(system, st):
    """Whether round-off has kept every body inside its cavity."""
    friction = system.friction_rows
    for r in range(friction, len(st.state)):
        pressed = st.state[r] == SPRUNG or st.state[r] == LEAVING
        if not pressed and not st.displacement[r] >= -1e-9 * system.free_travel[r]:
            return False
    return True


@inlined
def _happen(system, flows, st, rec, work, r, order, side):
    """The event of row r: jump of velocities. Returns whether contact states must be decided anew, or _FAILED."""
    n = len(st.constant)
    if order == POSITION and side == CLOSES and bounce(system, st, rec, work, r):
        _kick(flows, st, work)
        return _STAYS
    keep_released(st, work)
    if order == POSITION and side != RECLOSES:
        # a gap that closes while it still widens, to round-off, is a touch without speed
        if side == CLOSES and st.velocity[r] > 0.0:
            st.velocity[r] = 0.0
            only(work, r)
            join_speeds(system, st, work)
        _touch(system, st, work, r)
    if order == POSITION and side == CLOSES and rigid(system, r):
        for i in range(system.friction_rows, len(st.state)):
            if st.state[i] == CLOSED:
                st.settling[i] = longest_hop(system, flows, st, i)
            elif st.state[i] == TOUCHING:
                st.settling[i] = 0.0
        if not collide(system, st, rec, work):
            return _FAILED
        if all_move(system, st):
            _kick(flows, st, work)
            return _STAYS
        _coordinates(flows, st, st.coordinates)
        _structure_jump(system, work)
        for i in range(n):
            st.coordinates[n + i] += work.jump[i]
        return _DECIDE
    if order == VELOCITY:
        st.velocity[r] = 0.0
    elif r < system.friction_rows or rigid(system, r):
        work.forced[r] = side
    elif side != CLOSES:
        change_push(system, st, rec, work, r, side)
    elif st.velocity[r] < 0.0:
        begin_push(system, st, rec, r)
    _coordinates(flows, st, st.coordinates)
    if side == CLOSES:
        align_gaps(system, st, st.coordinates)  # a motion in step with the excitation may touch at every period's start
    return _DECIDE


@inlined
def _kick(flows, st, work):
    """Impulses on the rows, within the same subsystem."""
    s = st.counters[FLOW]
    for r in range(len(st.state)):
        if work.impulse[r] != 0.0:
            for j in range(flows.driven[s, 0], flows.modes[s]):
                st.amplitude[j] += flows.kick[s, r, j] * work.impulse[r]
    _wake(flows, st)


@inlined
def _structure_jump(system, work):
    """Jump of the structure's modal velocities under the impulses."""
    for i in range(len(work.jump)):
        work.jump[i] = 0.0
        for r in range(len(work.impulse)):
            work.jump[i] += system.J[r, i] * work.impulse[r]
