"""The compiled heart of the engine: a hybrid automaton that jumps from event to event.

Between two events the state flows exactly (coupling.flow); the next event is found with a guarantee (coupling.watch);
what happens there is decided by complementarity (coupling.contact); every joule is accounted for (coupling.ledger).
No segment is longer than an excitation period, so that the phase is exact at every period's start, where the section
of the response is recorded.
"""

from __future__ import annotations

import math

from coupling.compiled import kernel
from coupling.contact import SIMULTANEOUS, all_move, collide, constant_loads, settle, stop_riders
from coupling.events import POSITION, VELOCITY, exp_minus_line, exp_minus_one
from coupling.ledger import account
from coupling.state import (
    AWAKE,
    EVENTS,
    FLOW,
    FRICTION,
    LOGGED,
    OPEN,
    PERIOD,
    SEARCHING,
    STICK,
    STORED,
)
from coupling.watch import next_event

# what advance() returns
DONE, NEEDS_FLOW, LOG_FULL, EVENT_BUDGET, ACCURACY_LOST, UNDECIDED = range(6)

#: modes whose acceleration is below this share of the largest sleep until the next impact
_ASLEEP = 1e-14


@kernel
def advance(rows, flows, st, ch, rec, work, periods, max_events):
    """Run until all periods are done or something is needed. Returns one of the codes above."""
    while True:
        if st.counters[SEARCHING] == 1:
            s = _find_flow(flows, st.key)
            if s < 0:
                return NEEDS_FLOW
            _enter(rows, flows, st, work, s)
            if stop_riders(rows, flows, st):
                _keep_released(st, work)
                if not settle(rows, st, rec, work):
                    return UNDECIDED
                continue
        if st.counters[PERIOD] >= periods:
            return DONE
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if st.counters[LOGGED] + 2 * len(rows.delassus) >= len(rec.log):
            return LOG_FULL
        tau, who = next_event(rows, flows, st, ch)
        _exponentials(flows, st, work, tau)
        account(rows, flows, st, rec, work, tau)
        _move(rows, flows, st, work, tau)
        if who < 0:
            st.counters[PERIOD] += 1
            st.time[0] = 0.0
            for r in range(len(st.last_impact)):
                st.last_impact[r] -= rows.period
            _phase(rows, st)
            _wake(flows, st)
            record_section(rows, flows, st, rec, work)
            continue
        st.counters[EVENTS] += 1
        st.time[0] += tau
        _phase(rows, st)
        if not _happen(rows, flows, st, rec, work, ch.row[who], ch.order[who], ch.side[who]):
            return UNDECIDED
        if not _within_walls(rows, st):
            return ACCURACY_LOST


@kernel
def begin(rows, st, rec, work):
    """Decide the contact states of the initial state. Returns False if that fails."""
    n, hit = len(st.constant), False
    for r in range(len(st.state)):
        work.forced[r] = 0
        if r >= rows.friction_rows and st.displacement[r] <= SIMULTANEOUS * rows.gap[r - rows.friction_rows]:
            st.displacement[r] = 0.0
            hit = hit or st.velocity[r] < 0.0
    if hit:
        if not collide(rows, st, rec, work):
            return False
        _structure_jump(rows, work)
        for i in range(n):
            st.coordinates[n + i] += work.jump[i]
    return settle(rows, st, rec, work)


@kernel
def record_section(rows, flows, st, rec, work):
    """Section and ledger at the start of a period."""
    n, b = len(st.constant), len(rows.mass)
    entry, y = rec.section[st.counters[PERIOD]], work.coordinates
    _coordinates(flows, st, y)
    entry[0] = (rows.table * st.amplitude[0]).real
    entry[1] = (1j * rows.omega * rows.table * st.amplitude[0]).real
    for i in range(n):
        entry[0] += rows.response[i] * y[i]
        entry[1] += rows.response[i] * y[n + i]
    momentum, energy = 0.0, 0.0
    for i in range(n):
        energy += 0.5 * (y[n + i] * y[n + i] + rows.stiffness[i] * y[i] * y[i])
    for k in range(b):
        velocity, height = st.velocity[k], st.displacement[k]
        for i in range(n):
            velocity += rows.floor[k, i] * y[n + i]
            height += rows.floor[k, i] * y[i]
        momentum += rows.mass[k] * velocity
        energy += 0.5 * rows.mass[k] * velocity * velocity - rows.weight[k] * height
        entry[3 + k], entry[3 + b + k] = st.displacement[k], st.velocity[k]
    entry[2] = momentum
    st.ledger[STORED] = energy
    for i in range(len(st.ledger)):
        rec.ledger[st.counters[PERIOD], i] = st.ledger[i]


@kernel
def _find_flow(flows, key):
    for s in range(len(flows.modes)):
        if flows.modes[s] > 0 and flows.key[s, 0] == key[0] and flows.key[s, 1] == key[1]:
            return s
    return -1


@kernel
def _phase(rows, st):
    angle = rows.omega * st.time[0]
    st.amplitude[0] = complex(math.cos(angle), math.sin(angle))


@kernel
def _coordinates(flows, st, y):
    """(p, p') at the segment's start."""
    s, n = st.counters[FLOW], len(st.constant)
    for i in range(2 * n):
        y[i] = st.constant[i] if i < n else 0.0
        for a in range(st.counters[AWAKE]):
            j = st.awake[a]
            y[i] += (flows.shape[s, i, j] * st.amplitude[j]).real


@kernel
def _enter(rows, flows, st, work, s):
    """Begin subsystem s with the structure at st.coordinates and the row states as they are."""
    n, b, y = len(st.constant), len(rows.mass), st.coordinates
    st.counters[FLOW], st.counters[SEARCHING] = s, 0
    constant_loads(rows, st, work)
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += flows.static[s, i, k] * work.on_structure[k] + flows.held[s, i, k] * y[k]
        for k in range(b):
            total += flows.static[s, i, n + k] * work.on_bodies[k]
        st.constant[i] = total
    for i in range(b):
        st.body_drift[i] = 0.0
        for k in range(b):
            st.body_drift[i] += flows.body_acceleration[s, i, k] * work.on_bodies[k]
    _constant_forces(rows, flows, st, work, s)
    _phase(rows, st)
    for i in range(2 * n):
        work.coordinates[i] = y[i] - (flows.shape[s, i, 0] * st.amplitude[0]).real
        if i < n:
            work.coordinates[i] -= st.constant[i]
    for j in range(1, flows.modes[s]):
        total = 0.0j
        for i in range(2 * n):
            total += flows.project[s, j, i] * work.coordinates[i]
        st.amplitude[j] = total
    _wake(flows, st)


@kernel
def _constant_forces(rows, flows, st, work, s):
    """Constant parts of the rows' accelerations and of the closed rows' forces."""
    n, b, r_count = len(st.constant), len(rows.mass), len(st.state)
    for r in range(r_count):
        st.drift[r], work.acceleration[r] = 0.0, 0.0
        for k in range(b):
            st.drift[r] += rows.bodies[r, k] * st.body_drift[k]
            work.acceleration[r] += rows.bodies[r, k] * work.on_bodies[k] / rows.mass[k]
        for k in range(n):
            work.acceleration[r] += rows.structure[r, k] * (work.on_structure[k] - rows.stiffness[k] * st.constant[k])
    for r in range(r_count):
        st.level[r] = 0.0
        for k in range(r_count):
            st.level[r] -= flows.closed_inverse[s, r, k] * work.acceleration[k]


@kernel
def _wake(flows, st):
    """Put modes to sleep whose acceleration is negligible beside the largest."""
    s, largest = st.counters[FLOW], 0.0
    for j in range(flows.modes[s]):
        largest = max(largest, _acceleration(flows, st, s, j))
    st.awake[0] = 0
    count = 1
    for j in range(1, flows.modes[s]):
        if _acceleration(flows, st, s, j) > _ASLEEP * largest:
            st.awake[count] = j
            count += 1
        else:
            st.amplitude[j] = 0.0
    st.counters[AWAKE] = count


@kernel
def _acceleration(flows, st, s, j):
    rate, c = flows.eigenvalue[s, j], st.amplitude[j]
    return (abs(c.real) + abs(c.imag)) * flows.size[s, j] * (rate.real * rate.real + rate.imag * rate.imag)


@kernel
def _exponentials(flows, st, work, tau):
    """The awake modes' exponentials over the segment."""
    s = st.counters[FLOW]
    for a in range(st.counters[AWAKE]):
        z = flows.eigenvalue[s, st.awake[a]] * tau
        work.first[a] = exp_minus_one(z)
        work.line[a] = exp_minus_line(z, work.first[a])


@kernel
def _move(rows, flows, st, work, tau):
    """Carry rows and amplitudes over tau."""
    s, count = st.counters[FLOW], st.counters[AWAKE]
    for r in range(len(st.state)):
        friction = r < rows.friction_rows
        if st.state[r] >= STICK if friction else st.state[r] != OPEN:
            continue
        shift, speed = tau * (st.velocity[r] + 0.5 * st.drift[r] * tau), st.drift[r] * tau
        for a in range(count):
            j = st.awake[a]
            g = flows.motion[s, r, j] * st.amplitude[j]
            shift += (g * work.line[a]).real
            speed += (g * flows.eigenvalue[s, j] * work.first[a]).real
        if friction:
            st.ledger[FRICTION] -= st.held[r] * shift
        st.displacement[r] += shift
        st.velocity[r] += speed
    for a in range(count):
        st.amplitude[st.awake[a]] *= 1.0 + work.first[a]
    if tau > 0.0:
        for r in range(len(st.released)):
            st.released[r] = 0


@kernel
def _within_walls(rows, st):
    """Whether round-off has kept every body inside its cavity."""
    friction = rows.friction_rows
    for r in range(friction, len(st.state)):  # noqa: SIM110 (numba compiles no generator)
        if not st.displacement[r] >= -1e-9 * rows.gap[r - friction]:
            return False
    return True


@kernel
def _happen(rows, flows, st, rec, work, r, order, side):
    """The event of row r: jump of velocities, new states. Returns False if it cannot be decided."""
    n = len(st.constant)
    _keep_released(st, work)
    if order == POSITION:
        # a gap that closes while it still widens, to round-off, is a touch without speed
        st.displacement[r], st.velocity[r] = 0.0, min(st.velocity[r], 0.0)
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
    else:
        work.forced[r] = side
    _coordinates(flows, st, st.coordinates)
    return settle(rows, st, rec, work)


@kernel
def _keep_released(st, work):
    """Rows that let go at this instant are not caught again by what else happens in it."""
    for r in range(len(st.state)):
        work.forced[r] = st.released[r]


@kernel
def _kick(flows, st, work):
    """Impulses on the rows, within the same subsystem."""
    s = st.counters[FLOW]
    for r in range(len(st.state)):
        if work.impulse[r] > 0.0:
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
