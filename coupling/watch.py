"""Which event functions a state calls for, and the first of their roots."""

from __future__ import annotations

import math

from coupling.compiled import inlined, kernel
from coupling.complementarity import AT_HIGH, AT_LOW
from coupling.events import FORCE, POSITION, VELOCITY, bounds, evaluate, safe_step
from coupling.state import (
    AWAKE,
    CLOSED,
    CLOSES,
    EVALUATIONS,
    FLOW,
    LEAVING,
    OPEN,
    OPENS,
    RECLOSES,
    SEGMENTS,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
)

#: shortest step in periods: what a double can resolve within a period
RESOLUTION = 1e-15
#: what is left of a chatter, in periods, when it is completed by a plastic impact; a body at rest does not leave for
#: less. Relative displacement and speed are zero at its end either way: the motion of the structure is changed by no
#: more than the order of (2 pi CHATTER)^3 of it
CHATTER = 3e-7


@inlined
def next_event(rows, flows, st, ch):
    """Time to the next event and its channel, or to the period's end and -1."""
    s = st.counters[FLOW]
    left = max(rows.period - st.time[0], 0.0)
    shortest = RESOLUTION * rows.period
    eigenvalue, awake = flows.eigenvalue[s], st.awake[: st.counters[AWAKE]]
    count = _watch(rows, flows, st, ch, s, left)
    st.counters[SEGMENTS] += 1
    while True:
        k, tau = -1, left
        for i in range(count):
            if ch.safe[i] < tau:
                k, tau = i, ch.safe[i]
        if k < 0:
            return left, -1
        st.counters[EVALUATIONS] += 1
        f, slope, curvature, noise = evaluate(
            ch.order[k], ch.k0[k], ch.k1[k], ch.k2[k], ch.g[k], eigenvalue, awake, tau
        )
        step = advance_or_stop(f, slope, curvature, noise, ch.second[k], ch.third[k], left, shortest)
        if step <= 0.0:
            # what a double cannot tell from the segment's start happens at its start
            return (tau if tau > shortest else 0.0), k
        ch.safe[k] = tau + step


@kernel
def advance_or_stop(f, slope, curvature, noise, second, third, longest, shortest):
    """Safe step from a point of an event function; 0 where the function is at its root and falls."""
    if f <= noise:
        if slope < 0.0 or (slope <= second * shortest and curvature < 0.0):
            return 0.0
        f = 0.0
    step = safe_step(f, slope, curvature, second, third, longest)
    if step < shortest:
        return 0.0 if slope < 0.0 else shortest
    return step


@inlined
def _watch(rows, flows, st, ch, s, left):
    """Set up the event functions of the segment with their first safe steps. Returns how many."""
    count = 0
    for r in range(rows.friction_rows):
        state = st.state[r]
        if state == STICK or state == SPRUNG:
            for side in (AT_LOW, AT_HIGH):
                count = _watch_force(rows, flows, st, ch, s, r, side, rows.limit[r], count, left)
        elif state == SLIP_LEFT or state == SLIP_RIGHT:
            count = _watch_motion(rows, flows, st, ch, s, r, VELOCITY, float(state), 0, count, left)
    for r in range(rows.friction_rows, len(st.state)):
        state = st.state[r]
        if state == CLOSED or state == SPRUNG:
            count = _watch_force(rows, flows, st, ch, s, r, AT_LOW, 0.0, count, left)
        elif state == OPEN and not _surely_opens(rows, st, r):
            count = _watch_motion(rows, flows, st, ch, s, r, POSITION, 1.0, CLOSES, count, left)
        elif state == LEAVING:
            count = _watch_motion(rows, flows, st, ch, s, r, POSITION, -1.0, OPENS, count, left)
            count = _watch_spring(rows, flows, st, ch, s, r, count, left)
    return count


@inlined
def _surely_opens(rows, st, r):
    """Whether a gap can only widen in this segment: the body slides away from a wall that rides on its floor."""
    if not rows.rides[r]:
        return False
    if rows.before[r] < 0:
        return st.state[rows.after[r]] == SLIP_RIGHT
    return rows.after[r] < 0 and st.state[rows.before[r]] == SLIP_LEFT


@inlined
def _watch_motion(rows, flows, st, ch, s, r, order, sign, what, k, left):
    """Watch a gap (POSITION) or the speed of a slip (VELOCITY) of row r, times its sign, for its first root."""
    ch.row[k], ch.order[k], ch.side[k] = r, order, what
    curvature, jerk, snap = sign * st.drift[r], 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        g = sign * flows.motion[s, r, j] * st.amplitude[j]
        second = g * rate * rate
        curvature += second.real
        jerk += (second * rate).real
        ch.g[k, j] = g if order == POSITION else g * rate
        snap += (abs(second.real) + abs(second.imag)) * (rate.real * rate.real + rate.imag * rate.imag)
    if order == POSITION:
        f, slope, fall = sign * st.displacement[r], sign * st.velocity[r], curvature
        ch.k1[k], ch.k2[k] = slope, sign * st.drift[r]
        st.settling[r] = max(0.0, -curvature) * 0.5 * CHATTER * rows.period
    else:
        f, slope, fall = sign * st.velocity[r], curvature, jerk
        ch.k1[k], ch.k2[k] = sign * st.drift[r], 0.0
    ch.k0[k] = f
    awake = st.awake[: st.counters[AWAKE]]
    ch.second[k], ch.third[k] = bounds(order, ch.k2[k], ch.g[k], flows.eigenvalue[s], awake)
    shortest = RESOLUTION * rows.period
    if st.released[r] != 0:
        # the force was at its bound: the row starts from rest with vanishing acceleration, and its jerk decides
        quick = 2.0 * jerk / snap if order == POSITION else 1.5 * fall / ch.third[k]
        ch.safe[k] = max(quick if quick == quick else left, 1e3 * shortest)
    else:
        noise = 4e-16 * abs(f)
        ch.safe[k] = advance_or_stop(f, slope, fall, noise, ch.second[k], ch.third[k], left, shortest)
    return k + 1


@kernel
def longest_hop(rows, flows, st, r):
    """Speed (m/s) with which a contact at rest would leave for a flight of CHATTER, from its force now."""
    s = st.counters[FLOW]
    force = st.level[r]
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        force += (flows.force[s, r, j] * st.amplitude[j]).real
    return max(0.0, force) * rows.delassus[r, r] * 0.5 * CHATTER * rows.period


@kernel
def _watch_spring(rows, flows, st, ch, s, r, k, left):
    """Watch a compliant contact that has ended for the spring's wish to push again: spring gap + dashpot rate > 0."""
    spring, dashpot = rows.spring[r], rows.dashpot[r]
    ch.row[k], ch.order[k], ch.side[k] = r, POSITION, RECLOSES
    acceleration, curvature = st.drift[r], spring * st.drift[r]
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        g = flows.motion[s, r, j] * st.amplitude[j]
        ch.g[k, j] = (spring + dashpot * rate) * g
        acceleration += (rate * rate * g).real
        curvature += (rate * rate * ch.g[k, j]).real
    ch.k0[k] = spring * st.displacement[r] + dashpot * st.velocity[r]
    ch.k1[k] = spring * st.velocity[r] + dashpot * acceleration
    ch.k2[k] = spring * st.drift[r]
    awake = st.awake[: st.counters[AWAKE]]
    ch.second[k], ch.third[k] = bounds(POSITION, ch.k2[k], ch.g[k], flows.eigenvalue[s], awake)
    # the contact ended at zero force
    noise = 1e-15 * (abs(spring * st.displacement[r]) + abs(dashpot * st.velocity[r]))
    shortest = RESOLUTION * rows.period
    ch.safe[k] = advance_or_stop(ch.k0[k], ch.k1[k], curvature, noise, ch.second[k], ch.third[k], left, shortest)
    return k + 1


@inlined
def _watch_force(rows, flows, st, ch, s, r, side, limit, k, left):
    """Watch the force of a closed row for reaching its low (AT_LOW) or high (AT_HIGH) bound."""
    sign = 1.0 if side == AT_LOW else -1.0
    constant = sign * st.level[r] + limit
    f, slope, curvature, swing = constant, 0.0, 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        g = sign * flows.force[s, r, j] * st.amplitude[j]
        ch.g[k, j] = g
        f += g.real
        slope += (g * rate).real
        curvature += (g * rate * rate).real
        swing += math.hypot(g.real, g.imag)
    if constant > swing:
        return k  # the force never comes near its bound: nothing to watch
    ch.row[k], ch.order[k], ch.side[k] = r, FORCE, side
    ch.k0[k], ch.k1[k], ch.k2[k] = constant, 0.0, 0.0
    awake = st.awake[: st.counters[AWAKE]]
    ch.second[k], ch.third[k] = bounds(FORCE, 0.0, ch.g[k], flows.eigenvalue[s], awake)
    noise = 1e-15 * (abs(constant) + swing)
    shortest = RESOLUTION * rows.period
    if st.released[r] == -side:
        ch.safe[k] = max(2.9 * curvature / ch.third[k], 1e3 * shortest)
    else:
        ch.safe[k] = advance_or_stop(f, slope, curvature, noise, ch.second[k], ch.third[k], left, shortest)
    return k + 1
