"""The compiled heart of the engine: a hybrid automaton that jumps from event to event.

Between two events the state flows exactly (coupling.flow); the next event is found with a guarantee (coupling.events);
at the event velocities jump by Newton's law, and which rows close, stick or slip next follows from the complementarity
problem on accelerations (coupling.complementarity). No segment is longer than an excitation period, so that the phase
is exact at every period's start, where the section of the response is recorded.

The functions work on plain arrays (numba); everything that a scene means is decided in coupling.engine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coupling.compiled import kernel
from coupling.complementarity import AT_HIGH, AT_LOW, DEPENDENT, FREE, solve_box
from coupling.events import (
    FORCE,
    POSITION,
    VELOCITY,
    bounds,
    evaluate,
    exp_minus_line,
    exp_minus_one,
    safe_step,
)

# what advance() returns
DONE, NEEDS_FLOW, LOG_FULL, EVENT_BUDGET, ACCURACY_LOST, UNDECIDED = 0, 1, 2, 3, 4, 5

# state of a friction row: sliding with a known direction is +1 or -1
SLIP_LEFT, COAST, SLIP_RIGHT, STICK, HELD = -1, 0, 1, 2, 3
# state of a contact row; TOUCHING: closed, but another row carries its force
OPEN, CLOSED, TOUCHING = 0, 1, 2

# counters
PERIOD, FLOW, SEARCHING, LOGGED, EVENTS, IMPACTS, EVALUATIONS, SEGMENTS, WAKING = range(9)
# kinds in the log
IMPACT, STICKS, SLIPS, DETACHES, RESTS = range(5)
# ledger
EXCITATION, VISCOUS, FRICTION, IMPACT_LOSS, CONTACT, STORED = range(6)

#: shortest step in periods: what a double can resolve within a period
_RESOLUTION = 1e-15
#: rebounds shorter than this, in periods, end a chatter
_CHATTER = 3e-10
#: modes whose acceleration is below this share of the largest sleep until the next impact
_ASLEEP = 1e-14
#: gaps closed to this share of the free travel are closed at the same instant
_SIMULTANEOUS = 1e-12


class State(NamedTuple):
    """Everything that changes during a run. r rows, m complex modes, k channels, n modes, b bodies."""

    counters: np.ndarray  # (9,) int
    time: np.ndarray  # (1,) within the period, s
    key: np.ndarray  # (2,) closed friction rows and contacts, bit masks
    amplitude: np.ndarray  # (m,) complex modal amplitudes at the segment's start
    awake: np.ndarray  # (m,) indices of the modes that are awake; how many: counters[WAKING]
    coordinates: np.ndarray  # (2n,) structure's p and p' where a new subsystem begins
    constant: np.ndarray  # (n,) constant part of p
    displacement: np.ndarray  # (r,) of each row at the segment's start, m
    velocity: np.ndarray  # (r,)
    drift: np.ndarray  # (r,) constant acceleration of each row's free bodies
    body_drift: np.ndarray  # (b,)
    held: np.ndarray  # (r,) constant force of rows that are not closed
    level: np.ndarray  # (r,) constant part of a closed row's force
    state: np.ndarray  # (r,) int
    released: np.ndarray  # (r,) whether the row opened or began to slip at the segment's start, force at its bound
    ledger: np.ndarray  # (6,) J
    settling: np.ndarray  # (r,) rebound speed below which an impact ends a chatter


class Channels(NamedTuple):
    """The event functions watched in a segment."""

    row: np.ndarray
    order: np.ndarray
    side: np.ndarray
    k0: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    second: np.ndarray
    third: np.ndarray
    safe: np.ndarray  # time up to which no root can lie
    g: np.ndarray  # (k, m)


class Records(NamedTuple):
    """What a run leaves behind. One entry a period unless said otherwise."""

    peak: np.ndarray  # largest |x|
    harmonic: np.ndarray  # complex integral of x exp(-i omega t), m s
    square: np.ndarray  # integral of x^2
    momentum: np.ndarray  # complex integral of the bodies' momentum times exp(-i omega t), N s^2
    impacts: np.ndarray
    section: np.ndarray  # (periods + 1, 3 + 2 b): x, x', bodies' momentum, slips, slip velocities at the period's start
    ledger: np.ndarray  # (periods + 1, 6) cumulative
    samples: np.ndarray  # (periods * s, 1 + b): x and the slips, s equidistant samples a period
    log: np.ndarray  # (capacity, 7): time, kind, row, 0, velocity before, after, impulse


@kernel
def advance(rows, flows, st, ch, rec, periods, max_events):
    """Run until all periods are done or something is needed. Returns one of the codes above."""
    while True:
        if st.counters[SEARCHING] == 1:
            s = _find_flow(flows, st.key)
            if s < 0:
                return NEEDS_FLOW
            _enter(rows, flows, st, s)
        if st.counters[PERIOD] >= periods:
            return DONE
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if st.counters[LOGGED] + len(rows.delassus) >= len(rec.log):
            return LOG_FULL
        tau, who = _next_event(rows, flows, st, ch)
        _account(rows, flows, st, rec, tau)
        _move(rows, flows, st, tau)
        if who < 0:
            _begin_period(rows, flows, st, rec)
            continue
        st.counters[EVENTS] += 1
        st.time[0] += tau
        _phase(rows, st)
        if not _happen(rows, flows, st, rec, ch.row[who], ch.order[who], ch.side[who]):
            return UNDECIDED
        if not _within_walls(rows, st):
            return ACCURACY_LOST


@kernel
def begin(rows, flows, st, rec):
    """Decide the contact states of the initial state. Returns False if the pivots run out."""
    r = rows.friction_rows
    hit = False
    for c in range(r, len(st.displacement)):
        if st.displacement[c] <= _SIMULTANEOUS * rows.gap[c - r]:
            st.displacement[c] = 0.0
            hit = hit or st.velocity[c] < 0.0
    if hit:
        jump = np.zeros(len(st.constant))
        if not _collide(rows, st, rec, jump):
            return False
        st.coordinates[len(jump) :] += jump
    forced = np.zeros(len(st.displacement), np.int64)
    return _settle(rows, st, rec, forced)


@kernel
def record_section(rows, flows, st, rec):
    """Section and ledger at the start of a period."""
    s, n, b = st.counters[FLOW], len(st.constant), len(rows.mass)
    entry = rec.section[st.counters[PERIOD]]
    y = _coordinates(flows, st, s, n)
    entry[0] = (rows.table * st.amplitude[0]).real
    entry[1] = (1j * rows.omega * rows.table * st.amplitude[0]).real
    for i in range(n):
        entry[0] += rows.response[i] * y[i]
        entry[1] += rows.response[i] * y[n + i]
    entry[2] = 0.0
    for i in range(b):
        entry[2] += rows.mass[i] * _body_velocity(rows, st, y, i)
    entry[3 : 3 + b] = st.displacement[:b]
    entry[3 + b : 3 + 2 * b] = st.velocity[:b]
    st.ledger[STORED] = stored_energy(rows, y, st)
    rec.ledger[st.counters[PERIOD]] = st.ledger


@kernel
def _body_velocity(rows, st, y, b):
    velocity = st.velocity[b]
    for i in range(len(st.constant)):
        velocity += rows.floor[b, i] * y[len(st.constant) + i]
    return velocity


@kernel
def stored_energy(rows, y, st):
    """Kinetic and elastic energy of the structure, kinetic energy and height of the bodies, J."""
    n = len(st.constant)
    energy = 0.0
    for i in range(n):
        energy += 0.5 * (y[n + i] * y[n + i] + rows.stiffness[i] * y[i] * y[i])
    for b in range(len(rows.mass)):
        velocity, height = _body_velocity(rows, st, y, b), st.displacement[b]
        for i in range(n):
            height += rows.floor[b, i] * y[i]
        energy += 0.5 * rows.mass[b] * velocity * velocity - rows.weight[b] * height
    return energy


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
def _coordinates(flows, st, s, n):
    """(p, p') at the segment's start."""
    y = np.zeros(2 * n)
    y[:n] = st.constant
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        for i in range(2 * n):
            y[i] += (flows.shape[s, i, j] * st.amplitude[j]).real
    return y


@kernel
def _enter(rows, flows, st, s):
    """Begin subsystem s with the structure at st.coordinates and the row states as they are."""
    n, r, b = len(st.constant), len(st.state), len(rows.mass)
    st.counters[FLOW], st.counters[SEARCHING] = s, 0
    on_structure, on_bodies = _constant_loads(rows, st)
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += flows.static[s, i, k] * on_structure[k] + flows.held[s, i, k] * st.coordinates[k]
        for k in range(b):
            total += flows.static[s, i, n + k] * on_bodies[k]
        st.constant[i] = total
    for i in range(b):
        st.body_drift[i] = 0.0
        for k in range(b):
            st.body_drift[i] += flows.body_acceleration[s, i, k] * on_bodies[k]
    level = np.zeros(r)
    for i in range(r):
        st.drift[i] = 0.0
        for k in range(b):
            st.drift[i] += rows.bodies[i, k] * st.body_drift[k]
            level[i] += rows.bodies[i, k] * on_bodies[k] / rows.mass[k]
        for k in range(n):
            level[i] += rows.structure[i, k] * (on_structure[k] - rows.stiffness[k] * st.constant[k])
    for i in range(r):
        st.level[i] = 0.0
        for k in range(r):
            st.level[i] -= flows.closed_inverse[s, i, k] * level[k]
    _phase(rows, st)
    rest = np.empty(2 * n)
    for i in range(2 * n):
        rest[i] = st.coordinates[i] - (flows.shape[s, i, 0] * st.amplitude[0]).real
        if i < n:
            rest[i] -= st.constant[i]
    for j in range(1, flows.modes[s]):
        total = 0.0j
        for i in range(2 * n):
            total += flows.project[s, j, i] * rest[i]
        st.amplitude[j] = total
    _wake(flows, st, s)


@kernel
def _wake(flows, st, s):
    """Put modes to sleep whose acceleration is negligible beside the largest."""
    largest = 0.0
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
    st.counters[WAKING] = count


@kernel
def _acceleration(flows, st, s, j):
    rate = flows.eigenvalue[s, j]
    c = st.amplitude[j]
    return (abs(c.real) + abs(c.imag)) * flows.size[s, j] * (rate.real * rate.real + rate.imag * rate.imag)


@kernel
def _constant_loads(rows, st):
    """Constant loads on structure and bodies: weight, sliding friction, forces of rows that others hold."""
    on_structure, on_bodies = np.zeros(len(st.constant)), rows.weight.copy()
    for i in range(len(st.state)):
        if st.held[i] != 0.0:
            for k in range(len(on_structure)):
                on_structure[k] += rows.structure[i, k] * st.held[i]
            for k in range(len(on_bodies)):
                on_bodies[k] += rows.bodies[i, k] * st.held[i]
    return on_structure, on_bodies


@kernel
def _next_event(rows, flows, st, ch):
    """Time to the next event and its channel, or to the period's end and -1."""
    s = st.counters[FLOW]
    left = max(rows.period - st.time[0], 0.0)
    shortest = _RESOLUTION * rows.period
    eigenvalue, awake = flows.eigenvalue[s], st.awake[: st.counters[WAKING]]
    count = _watch(rows, flows, st, ch, s, left)
    while True:
        k = -1
        tau = left
        for i in range(count):
            if ch.safe[i] < tau:
                k, tau = i, ch.safe[i]
        if k < 0:
            st.counters[SEGMENTS] += 1
            return left, -1
        st.counters[EVALUATIONS] += 1
        f, slope, curvature, noise = evaluate(
            ch.order[k], ch.k0[k], ch.k1[k], ch.k2[k], ch.g[k], eigenvalue, awake, tau
        )
        step = _step(f, slope, curvature, noise, ch.second[k], ch.third[k], left, shortest)
        if step <= 0.0:
            st.counters[SEGMENTS] += 1
            return tau, k
        ch.safe[k] = tau + step


@kernel
def _step(f, slope, curvature, noise, second, third, left, shortest):
    """Safe step from a point of an event function; 0 where the function is at its root and falls."""
    if f <= noise:
        if slope < 0.0 or (slope <= second * shortest and curvature < 0.0):
            return 0.0
        f = 0.0
    step = safe_step(f, slope, curvature, second, third, left)
    if step < shortest:
        if slope < 0.0:
            return 0.0
        step = shortest
    return step


@kernel
def _watch(rows, flows, st, ch, s, left):
    """Set up the event functions of the segment with their first safe steps. Returns how many."""
    count = 0
    friction = rows.friction_rows
    for r in range(friction):
        state = st.state[r]
        if state == STICK:
            for side in (AT_LOW, AT_HIGH):
                count = _watch_force(rows, flows, st, ch, s, r, side, rows.limit[r], count, left)
        elif state in (SLIP_LEFT, SLIP_RIGHT):
            count = _watch_motion(rows, flows, st, ch, s, r, VELOCITY, float(state), count, left)
    for r in range(friction, len(st.state)):
        if st.state[r] == CLOSED:
            count = _watch_force(rows, flows, st, ch, s, r, AT_LOW, 0.0, count, left)
        elif st.state[r] == OPEN and not _surely_opens(rows, st, r):
            count = _watch_motion(rows, flows, st, ch, s, r, POSITION, 1.0, count, left)
    return count


@kernel
def _surely_opens(rows, st, r):
    """Whether a gap can only widen in this segment: the body slides away from a wall that rides on its floor."""
    body = -1
    for b in range(len(rows.mass)):
        if rows.bodies[r, b] != 0.0:
            if body >= 0:
                return False
            body = b
    if st.state[body] not in (SLIP_LEFT, SLIP_RIGHT) or st.state[body] * rows.bodies[r, body] < 0.0:
        return False
    for i in range(len(st.constant)):  # noqa: SIM110 (numba compiles no generator)
        if rows.structure[r, i] != rows.bodies[r, body] * rows.structure[body, i]:
            return False
    return True


@kernel
def _watch_motion(rows, flows, st, ch, s, r, order, sign, k, left):
    """Watch a gap (POSITION) or the speed of a slip (VELOCITY) of row r for its first root."""
    ch.row[k], ch.order[k], ch.side[k] = r, order, 0
    slope, curvature, jerk, snap = 0.0, st.drift[r], 0.0, 0.0
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        g = sign * flows.motion[s, r, j] * st.amplitude[j]
        second = g * rate * rate
        curvature += sign * second.real
        jerk += sign * (second * rate).real
        ch.g[k, j] = g if order == POSITION else g * rate
        snap += (abs(second.real) + abs(second.imag)) * (rate.real * rate.real + rate.imag * rate.imag)
    if order == POSITION:
        f, slope, fall = st.displacement[r], st.velocity[r], curvature
        ch.k0[k], ch.k1[k], ch.k2[k] = f, slope, st.drift[r]
    else:
        f, slope, fall = sign * st.velocity[r], sign * curvature, sign * jerk
        ch.k0[k], ch.k1[k], ch.k2[k] = f, sign * st.drift[r], 0.0
    eigenvalue, awake = flows.eigenvalue[s], st.awake[: st.counters[WAKING]]
    ch.second[k], ch.third[k] = bounds(order, ch.k2[k], ch.g[k], eigenvalue, awake)
    shortest = _RESOLUTION * rows.period
    if st.released[r]:
        # the force was at its bound: the row starts from rest with vanishing acceleration, and its jerk decides
        if order == POSITION:
            ch.safe[k] = 2.0 * jerk / snap if snap > 0.0 else left
        else:
            ch.safe[k] = 1.5 * fall / ch.third[k] if ch.third[k] > 0.0 else left
        ch.safe[k] = max(ch.safe[k], 1e3 * shortest)
    else:
        noise = 4e-16 * abs(f)
        ch.safe[k] = _step(f, slope, fall, noise, ch.second[k], ch.third[k], left, shortest)
    return k + 1


@kernel
def _watch_force(rows, flows, st, ch, s, r, side, limit, k, left):
    """Watch the force of a closed row for reaching its low (AT_LOW) or high (AT_HIGH) bound."""
    ch.row[k], ch.order[k], ch.side[k] = r, FORCE, side
    sign = 1.0 if side == AT_LOW else -1.0
    f, slope, curvature, swing = sign * st.level[r] + limit, 0.0, 0.0, 0.0
    ch.k0[k], ch.k1[k], ch.k2[k] = f, 0.0, 0.0
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        g = sign * flows.force[s, r, j] * st.amplitude[j]
        ch.g[k, j] = g
        f += g.real
        slope += (g * rate).real
        curvature += (g * rate * rate).real
        swing += math.hypot(g.real, g.imag)
    if ch.k0[k] > swing:
        return k  # the force never comes near its bound: nothing to watch
    eigenvalue, awake = flows.eigenvalue[s], st.awake[: st.counters[WAKING]]
    ch.second[k], ch.third[k] = bounds(FORCE, 0.0, ch.g[k], eigenvalue, awake)
    noise = 1e-15 * (abs(ch.k0[k]) + swing)
    ch.safe[k] = _step(f, slope, curvature, noise, ch.second[k], ch.third[k], left, _RESOLUTION * rows.period)
    return k + 1


@kernel
def _move(rows, flows, st, tau):
    """Carry rows and amplitudes over tau."""
    s, count = st.counters[FLOW], st.counters[WAKING]
    first, line = np.empty(count, np.complex128), np.empty(count, np.complex128)
    for a in range(count):
        z = flows.eigenvalue[s, st.awake[a]] * tau
        first[a] = exp_minus_one(z)
        line[a] = exp_minus_line(z, first[a])
    for r in range(len(st.state)):
        at_rest = st.state[r] == TOUCHING or st.state[r] == CLOSED
        if at_rest if r >= rows.friction_rows else st.state[r] >= STICK:
            continue
        shift, speed = tau * (st.velocity[r] + 0.5 * st.drift[r] * tau), st.drift[r] * tau
        for a in range(count):
            j = st.awake[a]
            g = flows.motion[s, r, j] * st.amplitude[j]
            shift += (g * line[a]).real
            speed += (g * flows.eigenvalue[s, j] * first[a]).real
        if r < rows.friction_rows:
            st.ledger[FRICTION] -= st.held[r] * shift
        st.displacement[r] += shift
        st.velocity[r] += speed
    for a in range(count):
        st.amplitude[st.awake[a]] *= 1.0 + first[a]
    for r in range(len(st.released)):
        st.released[r] = False


@kernel
def _begin_period(rows, flows, st, rec):
    st.counters[PERIOD] += 1
    st.time[0] = 0.0
    _phase(rows, st)
    _wake(flows, st, st.counters[FLOW])
    record_section(rows, flows, st, rec)


@kernel
def _within_walls(rows, st):
    """Whether round-off has kept every body inside its cavity."""
    r = rows.friction_rows
    for c in range(r, len(st.displacement)):  # noqa: SIM110 (numba compiles no generator)
        if not st.displacement[c] >= -1e-9 * rows.gap[c - r]:
            return False
    return True


@kernel
def _happen(rows, flows, st, rec, r, order, side):
    """The event of row r: jump of velocities, new states. Returns False if it cannot be decided."""
    s, n = st.counters[FLOW], len(st.constant)
    forced = np.zeros(len(st.state), np.int64)
    if order == POSITION:
        st.displacement[r] = 0.0
        jump = np.zeros(n)
        if not _collide(rows, st, rec, jump):
            return False
        if n > 0:
            y = _coordinates(flows, st, s, n)
            y[n:] += jump
            st.coordinates[:] = y
        return _settle(rows, st, rec, forced)
    if order == VELOCITY:
        st.velocity[r] = 0.0
    else:
        forced[r] = side
    st.coordinates[:] = _coordinates(flows, st, s, n)
    return _settle(rows, st, rec, forced)


@kernel
def _collide(rows, st, rec, jump):
    """Newton's impact law at all touching contacts at once: v+ + k v- >= 0 and P >= 0 complement each other.

    Impulses act on structure (jump of p', returned) and bodies; friction is free of impulses. An impact whose rebound
    would end a chatter is plastic.
    """
    friction, n = rows.friction_rows, len(st.constant)
    touching = _touching(rows, st)
    k = len(touching)
    a_matrix, before = np.empty((k, k)), np.empty(k)
    for p in range(k):
        before[p] = st.velocity[touching[p]]
        for q in range(k):
            a_matrix[p, q] = rows.delassus[touching[p], touching[q]]
    restitution = np.empty(k)
    for p in range(k):
        restitution[p] = rows.restitution[touching[p] - friction]
        if before[p] < 0.0 and -before[p] * restitution[p] < st.settling[touching[p]]:
            restitution[p] = 0.0
    impulse, after, state = np.zeros(k), np.zeros(k), np.zeros(k, np.int64)
    # a contact that separates already may not be driven together: its law starts from zero
    target = before + restitution * np.minimum(before, 0.0)
    low, high, free = np.zeros(k), np.full(k, np.inf), np.zeros(k, np.int64)
    if not solve_box(a_matrix, target, low, high, free, impulse, after, state):
        return False
    for r in range(len(st.velocity)):
        change, size = 0.0, 0.0
        for p in range(k):
            part = rows.delassus[r, touching[p]] * impulse[p]
            change += part
            size += abs(part)
        if abs(change) > 1e-13 * size:
            st.velocity[r] += change
    for p in range(k):
        r = touching[p]
        st.displacement[r] = 0.0
        if impulse[p] > 0.0 or state[p] == DEPENDENT:
            st.velocity[r] = -restitution[p] * before[p] if before[p] < 0.0 else 0.0
        st.ledger[IMPACT_LOSS] -= 0.5 * impulse[p] * (before[p] + st.velocity[r])
        for i in range(n):
            jump[i] += rows.structure[r, i] * impulse[p]
        if before[p] < 0.0:
            st.counters[IMPACTS] += 1
            rec.impacts[st.counters[PERIOD]] += 1
            _log(rows, st, rec, IMPACT, r, before[p], st.velocity[r], impulse[p])
    return True


@kernel
def _touching(rows, st):
    friction = rows.friction_rows
    count = 0
    found = np.empty(len(st.state) - friction, np.int64)
    for r in range(friction, len(st.state)):
        near = st.displacement[r] <= _SIMULTANEOUS * rows.gap[r - friction]
        if st.displacement[r] == 0.0 or (near and st.velocity[r] < 0.0):
            found[count] = r
            count += 1
    return found[:count]


@kernel
def _log(rows, st, rec, kind, r, before, after, impulse):
    entry = rec.log[st.counters[LOGGED]]
    st.counters[LOGGED] += 1
    entry[0] = st.counters[PERIOD] * rows.period + st.time[0]
    entry[1], entry[2], entry[3], entry[4], entry[5], entry[6] = kind, r, 0.0, before, after, impulse


@kernel
def _settle(rows, st, rec, forced):
    """States of all rows from velocities and, where these vanish, from the complementarity problem on accelerations.

    forced: AT_LOW or AT_HIGH for a row whose force has just reached that bound and leaves it.
    """
    friction = rows.friction_rows
    old = st.state.copy()
    open_rows = np.empty(len(st.state), np.int64)
    k = 0
    for r in range(len(st.state)):
        st.released[r] = False
        st.held[r] = 0.0
        if r < friction:
            if rows.limit[r] > 0.0 and st.velocity[r] == 0.0:
                continue
            st.state[r] = COAST
            if rows.limit[r] > 0.0:
                st.state[r] = SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
                st.held[r] = -st.state[r] * rows.limit[r]
        else:
            st.state[r] = OPEN
            if st.displacement[r] == 0.0 and st.velocity[r] == 0.0:
                open_rows[k] = r
                k += 1
    for r in range(friction):
        if rows.limit[r] > 0.0 and st.velocity[r] == 0.0:
            open_rows[k] = r
            k += 1
    if k > 0 and not _decide(rows, st, open_rows[:k], forced):
        return False
    _update_chatter(rows, st)
    st.key[0], st.key[1] = 0, 0
    for r in range(len(st.state)):
        if r < friction and st.state[r] == STICK:
            st.key[0] |= 1 << r
        elif r >= friction and st.state[r] == CLOSED:
            st.key[1] |= 1 << (r - friction)
    _log_changes(rows, st, rec, old)
    st.counters[SEARCHING] = 1
    return True


@kernel
def _decide(rows, st, rest, forced):
    """Solve for the rows at rest: which are closed, stick, slip or open."""
    friction, k = rows.friction_rows, len(rest)
    free_acceleration = _free_acceleration(rows, st)
    a_matrix, b = np.empty((k, k)), np.empty(k)
    low, high, leaves = np.empty(k), np.empty(k), np.zeros(k, np.int64)
    for p in range(k):
        r = rest[p]
        b[p] = free_acceleration[r]
        low[p], high[p] = (-rows.limit[r], rows.limit[r]) if r < friction else (0.0, np.inf)
        leaves[p] = forced[r]
        for q in range(k):
            a_matrix[p, q] = rows.delassus[r, rest[q]]
    force, acceleration, state = np.zeros(k), np.zeros(k), np.zeros(k, np.int64)
    if not solve_box(a_matrix, b, low, high, leaves, force, acceleration, state):
        return False
    for p in range(k):
        r = rest[p]
        st.released[r] = leaves[p] != 0 and state[p] != DEPENDENT
        if r >= friction:
            st.state[r] = CLOSED if state[p] == FREE else TOUCHING if state[p] == DEPENDENT else OPEN
        elif state[p] == FREE:
            st.state[r] = STICK
        elif state[p] == DEPENDENT:
            st.state[r], st.held[r] = HELD, force[p]
        else:
            st.state[r] = SLIP_RIGHT if state[p] == AT_LOW else SLIP_LEFT
            st.held[r] = force[p]
        if state[p] == DEPENDENT:
            st.held[r] = force[p]
    return True


@kernel
def _free_acceleration(rows, st):
    """Acceleration of each row under the known forces, with no row closed, at st.coordinates."""
    n, b = len(st.constant), len(rows.mass)
    on_structure, on_bodies = _constant_loads(rows, st)
    phase = st.amplitude[0]
    p_acceleration = np.empty(n)
    for i in range(n):
        total = on_structure[i] + (rows.force[i] * phase).real - rows.stiffness[i] * st.coordinates[i]
        if rows.proportional:
            total -= rows.damping[i, i] * st.coordinates[n + i]
        else:
            for k in range(n):
                total -= rows.damping[i, k] * st.coordinates[n + k]
        p_acceleration[i] = total
    acceleration = np.zeros(len(st.state))
    for r in range(len(acceleration)):
        for i in range(n):
            acceleration[r] += rows.structure[r, i] * p_acceleration[i]
        for i in range(b):
            acceleration[r] += rows.bodies[r, i] * (on_bodies[i] + (rows.inertia[i] * phase).real) / rows.mass[i]
    return acceleration


@kernel
def _update_chatter(rows, st):
    """Rebound speed below which the next impact of a contact ends a chatter: its flight is too short to matter."""
    acceleration = _free_acceleration(rows, st)
    for r in range(rows.friction_rows, len(st.state)):
        st.settling[r] = max(0.0, -acceleration[r]) * 0.5 * _CHATTER * rows.period


@kernel
def _log_changes(rows, st, rec, old):
    friction = rows.friction_rows
    for r in range(len(st.state)):
        was, now = old[r], st.state[r]
        if r < friction:
            if now >= STICK > was:
                _log(rows, st, rec, STICKS, r, 0.0, 0.0, 0.0)
            elif was >= STICK > now:
                _log(rows, st, rec, SLIPS, r, 0.0, st.velocity[r], 0.0)
        elif now != OPEN and was == OPEN:
            _log(rows, st, rec, RESTS, r, 0.0, 0.0, 0.0)
        elif now == OPEN and was != OPEN:
            _log(rows, st, rec, DETACHES, r, 0.0, st.velocity[r], 0.0)


@kernel
def _account(rows, flows, st, rec, tau):
    """Energy, harmonic, mean square, momentum and peak of the segment [0, tau], by closed-form integrals."""
    s, count = st.counters[FLOW], st.counters[WAKING]
    period = st.counters[PERIOD]
    first = np.empty(count, np.complex128)
    for a in range(count):
        first[a] = exp_minus_one(flows.eigenvalue[s, st.awake[a]] * tau)
    st.ledger[EXCITATION] += _work(rows, flows, st, s, first, tau)
    st.ledger[VISCOUS] += _viscous(flows, st, s, first, tau)
    constant = 0.0
    for i in range(len(st.constant)):
        constant += rows.response[i] * st.constant[i]
    rec.harmonic[period] += _harmonic(flows.response[s], flows.eigenvalue[s], st, first, tau, constant, 0.0)
    rec.square[period] += _square(flows, st, s, first, tau, constant)
    rec.momentum[period] += _momentum(rows, flows, st, s, first, tau)
    rec.peak[period] = _peak(flows, st, s, tau, constant, rec.peak[period])
    if rec.samples.shape[0] > 0:
        _sample(rows, flows, st, rec, s, tau, constant)


@kernel
def _integral(rate, last, tau):
    """Integral of exp(rate t) over [0, tau], given last = exp(rate tau) - 1."""
    z = rate * tau
    if abs(z.real) + abs(z.imag) < 1e-5:
        return tau * (1.0 + z * (0.5 + z / 6.0))
    return last / rate


@kernel
def _product(x, y):
    """exp(u + v) - 1 from x = exp(u) - 1 and y = exp(v) - 1."""
    return x * y + x + y


@kernel
def _work(rows, flows, st, s, first, tau):
    """Work of the harmonic loads, whose amplitude is that of the sine: Im exp(i omega t)."""
    rate0, phase = flows.eigenvalue[s, 0], st.amplitude[0]
    total = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        c = flows.work[s, j] * st.amplitude[j]
        forward = phase * c * _integral(rate + rate0, _product(first[a], first[0]), tau)
        back = phase.conjugate() * c * _integral(rate - rate0, _product(first[a], first[0].conjugate()), tau)
        total += 0.5 * (forward.imag - back.imag)
    for b in range(len(rows.mass)):
        if rows.inertia[b] != 0.0:
            speed = _free_speed(rows, flows, st, s, b)
            i0, i1 = _line_integrals(rate0, first[0], tau)
            total += -rows.inertia[b].imag * (phase * (speed * i0 + st.body_drift[b] * i1)).imag
    return total


@kernel
def _free_speed(rows, flows, st, s, b):
    """Constant part of a free body's velocity at the segment's start; 0 for a body that rides on the structure."""
    if flows.body_acceleration[s, b, b] == 0.0:
        return 0.0
    speed = st.velocity[b]
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        speed -= (flows.motion[s, b, j] * flows.eigenvalue[s, j] * st.amplitude[j]).real
    return speed


@kernel
def _line_integrals(rate, last, tau):
    """Integrals of exp(rate t) and of t exp(rate t) over [0, tau]."""
    i0 = _integral(rate, last, tau)
    z = rate * tau
    if abs(z.real) + abs(z.imag) < 1e-2:
        return i0, tau * tau * (0.5 + z / 3.0 + z * z / 8.0 + z * z * z / 30.0 + z * z * z * z / 144.0)
    return i0, (tau * (last + 1.0) - i0) / rate


@kernel
def _viscous(flows, st, s, first, tau):
    """Energy lost in the structure's dampers: integral of p' D p'."""
    total = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        for b in range(a + 1):
            k = st.awake[b]
            if flows.uncoupled[s] and k != j and k != 0:
                continue
            rate_j, rate_k = flows.eigenvalue[s, j], flows.eigenvalue[s, k]
            both = st.amplitude[j] * st.amplitude[k] * flows.loss[s, j, k]
            mixed = st.amplitude[j] * st.amplitude[k].conjugate() * flows.loss_conjugate[s, j, k]
            conjugate = first[b].conjugate()
            part = (
                both * _integral(rate_j + rate_k, _product(first[a], first[b]), tau)
                + mixed * _integral(rate_j + rate_k.conjugate(), _product(first[a], conjugate), tau)
            ).real
            total += 0.5 * part if j == k else part
    return total


@kernel
def _harmonic(row, eigenvalue, st, first, tau, constant, drift):
    """Integral over the segment of (constant + drift t + Re sum row_j c_j exp(lambda_j t)) exp(-i omega t)."""
    back, turn = st.amplitude[0].conjugate(), first[0].conjugate()
    i0, i1 = _line_integrals(-eigenvalue[0], turn, tau)
    total = constant * i0 + drift * i1
    for a in range(len(first)):
        j = st.awake[a]
        c = row[j] * st.amplitude[j]
        if c == 0.0:
            continue
        total += 0.5 * c * _integral(eigenvalue[j] - eigenvalue[0], _product(first[a], turn), tau)
        rate = eigenvalue[j].conjugate()
        total += 0.5 * c.conjugate() * _integral(rate - eigenvalue[0], _product(first[a].conjugate(), turn), tau)
    return back * total


@kernel
def _square(flows, st, s, first, tau, constant):
    """Integral of the squared response; pairs of modes below 1e-9 of the largest are left out."""
    largest = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        largest = max(largest, abs(flows.response[s, j] * st.amplitude[j]))
    total = constant * constant * tau
    for a in range(len(first)):
        j = st.awake[a]
        cj, rate_j = flows.response[s, j] * st.amplitude[j], flows.eigenvalue[s, j]
        if abs(cj) <= 1e-9 * largest:
            continue
        total += 2.0 * constant * (cj * _integral(rate_j, first[a], tau)).real
        for b in range(a + 1):
            k = st.awake[b]
            ck, rate_k = flows.response[s, k] * st.amplitude[k], flows.eigenvalue[s, k]
            if abs(ck) <= 1e-9 * largest:
                continue
            part = (
                cj * ck * _integral(rate_j + rate_k, _product(first[a], first[b]), tau)
                + cj * ck.conjugate()
                * _integral(rate_j + rate_k.conjugate(), _product(first[a], first[b].conjugate()), tau)
            ).real  # fmt: skip
            total += 0.5 * part if j == k else part
    return total


@kernel
def _momentum(rows, flows, st, s, first, tau):
    """Integral of the bodies' momentum times exp(-i omega t)."""
    total = 0.0j
    row = np.zeros(flows.body.shape[2], np.complex128)
    for b in range(len(rows.mass)):
        for a in range(len(first)):
            j = st.awake[a]
            row[j] = flows.body[s, b, j] * flows.eigenvalue[s, j]
        speed = _free_speed(rows, flows, st, s, b)
        total += rows.mass[b] * _harmonic(row, flows.eigenvalue[s], st, first, tau, speed, st.body_drift[b])
    return total


@kernel
def _response_at(flows, st, s, t, constant):
    """Response, its slope and curvature at t."""
    x, v, w = constant, 0.0, 0.0
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        part = flows.response[s, j] * st.amplitude[j] * (exp_minus_one(rate * t) + 1.0)
        x += part.real
        part *= rate
        v += part.real
        w += (part * rate).real
    return x, v, w


@kernel
def _peak(flows, st, s, tau, constant, peak):
    """Largest |response| on [0, tau] and before.

    Between points of a grid the response differs from its cubic Hermite interpolant by at most (bound of the fourth
    derivative) h^4/384: the grid keeps this below 1e-3 of the response, and each maximum found is polished by Newton.
    """
    fourth, size = 0.0, abs(constant)
    for a in range(st.counters[WAKING]):
        j = st.awake[a]
        part = abs(flows.response[s, j] * st.amplitude[j])
        rate = flows.eigenvalue[s, j]
        square = rate.real * rate.real + rate.imag * rate.imag
        fourth += part * square * square
        size += part
    if size <= peak or tau <= 0.0:
        return peak
    step = tau if fourth == 0.0 else min(tau, (0.384 * size / fourth) ** 0.25)
    pieces = min(math.ceil(tau / step), 4096)
    x0, v0, w0 = _response_at(flows, st, s, 0.0, constant)
    peak = max(peak, abs(x0))
    h = tau / pieces
    for i in range(pieces):
        x1, v1, w1 = _response_at(flows, st, s, (i + 1) * h, constant)
        peak = max(peak, abs(x1))
        if v0 * v1 < 0.0 and max(abs(x0) + abs(v0) * h, abs(x1) + abs(v1) * h) > peak:
            lo, hi = i * h, (i + 1) * h
            t, x, v, w = lo + h * v0 / (v0 - v1), x0, v0, w0
            for _ in range(8):
                x, v, w = _response_at(flows, st, s, t, constant)
                if v * v0 > 0.0:
                    lo = t
                else:
                    hi = t
                better = t - v / w if w != 0.0 else lo
                if not lo < better < hi:
                    better = 0.5 * (lo + hi)
                if abs(better - t) < 1e-8 * h:
                    break
                t = better
            peak = max(peak, abs(x))
        x0, v0, w0 = x1, v1, w1
    return peak


@kernel
def _sample(rows, flows, st, rec, s, tau, constant):
    """Response and slips at the equidistant sampling times within [time, time + tau)."""
    each = len(rec.samples) // (len(rec.section) - 1)
    start = st.time[0]
    begin = math.ceil(start / rows.period * each - 1e-12)
    for i in range(max(begin, 0), each):
        t = i * rows.period / each - start
        if t >= tau:
            break
        t = max(t, 0.0)
        entry = rec.samples[st.counters[PERIOD] * each + i]
        entry[0] = _response_at(flows, st, s, t, constant)[0]
        for r in range(rows.friction_rows):
            shift = t * (st.velocity[r] + 0.5 * st.drift[r] * t)
            for a in range(st.counters[WAKING]):
                j = st.awake[a]
                z = flows.eigenvalue[s, j] * t
                shift += (flows.motion[s, r, j] * st.amplitude[j] * exp_minus_line(z, exp_minus_one(z))).real
            entry[1 + r] = st.displacement[r] + shift
