"""Bodies that sleep: so far from any event that nothing elsewhere can bring them to one for a while.

Each is single in its cavity and slips or coasts. Until it wakes, its event functions keep half of their values, by the
bounds of their second derivatives; what events elsewhere may change is spent from that half. An impulse P on row q
moves row k by at most P (|W| t + a_k b_q t^2/2) within t: W, of Delassus's matrix, is the rate at the start, and
a_k b_q bounds the second derivative, a sum over the modes (Cauchy and Schwarz; `stir` of Flows). So an event in a crowd
costs as much as nearby bodies.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.amplitudes import real_sum
from vanedamp.coupling.engine.line.gap_kinematics import measure_gaps, shift_slip
from vanedamp.coupling.engine.root_search import first_root_of_parabola
from vanedamp.coupling.numerics.codes import ACTIVE, ASLEEP, CLOSED_ROWS, FLOW, OPEN, PERIOD
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.response.records import FRICTION
from vanedamp.coupling.system.line_system import LineSystem

#: bodies times modes from which on bodies sleep, and the shortest sleep, in periods over bodies: others cost time
CROWD, _DOZE = 100, 0.25

#: of an inactive body: when it is activated, and since when it is inactive, s in the period; its position, the lower
#: word of that, and its speed then, the structure's parts of both; the rest of its margins, m and m/s
UNTIL, SINCE, PLACE, LOW, SPEED, PART, RATE, MARGIN, SPEED_MARGIN = range(9)
SLEEP = 9


def in_crowd(system: LineSystem) -> int:
    """Return how many bodies may sleep: all in a crowd, or none."""
    return system.bodies if system.bodies * system.modes >= CROWD else 0


@inlined
def may_sleep(flows, st):
    """Whether bodies may sleep: there are many, and no row is closed."""
    return flows.step.shape[1] > 0 and st.counters[CLOSED_ROWS] == 0


@inlined
def sleeps(system, st, r):
    """Whether contact r is the first one of a body that sleeps."""
    body = system.right_body[r]
    return body >= 0 and st.asleep[body] == r


@inlined
def bounded_step(value, slope, bound):
    """Return the time without a root of a function whose second derivative is at least -bound."""
    if value > 0.0 or (value == 0.0 and slope > 0.0):
        return first_root_of_parabola(value, slope, -bound)
    return 0.0


@inlined
def falls_asleep(system, flows, st, watched, r, k):
    """Let the body of contact r sleep, whose gap is event function k, if it is single and that pays. Return whether."""
    first = _first_contact(system, st, r)
    if first < 0 or st.released[system.right_body[first]] != 0:
        return False
    b = system.right_body[first]
    margin, speed_margin, stop = 0.5 * watched.k0[k, 0], math.inf, watched.stop[b]
    if watched.sides[k] == 1 and stop < 0:  # it may turn round and meet the other wall
        return False
    time = bounded_step(margin, watched.k1[k], watched.bound[k] - watched.k2[k])
    if watched.sides[k] == 2:
        other = 0.5 * watched.k0[k, 1]
        time = min(time, bounded_step(other, -watched.k1[k], watched.bound[k] + watched.k2[k]))
        margin = min(margin, other)
    if stop >= 0:
        speed_margin = 0.5 * watched.k0[stop, 0]
        time = min(time, bounded_step(speed_margin, watched.slope[stop], watched.bound[stop]))
    if time * system.bodies < _DOZE * system.period:
        return False
    body = st.sleepers[b]
    body[UNTIL], body[SINCE] = st.time[0] + time, st.time[0]
    body[PLACE], body[LOW], body[SPEED] = st.displacement[b], st.low_word[b], st.velocity[b]
    body[PART], body[RATE] = _of_structure(system, flows, st, b)
    body[MARGIN], body[SPEED_MARGIN] = margin, speed_margin
    st.asleep[b] = first
    st.counters[ASLEEP] += 1
    return True


@inlined
def _first_contact(system, st, r):
    """Return the first contact of the body of contact r if single, open to walls that move with it; else -1."""
    first = r if system.left_body[r] < 0 else r - 1
    if first < system.friction_rows or first + 1 == len(st.state):
        return -1
    body = system.right_body[first]
    if body < 0 or system.left_body[first] >= 0 or system.left_body[first + 1] != body:
        return -1
    walls = system.right_body[first + 1] < 0 and system.moves_with_floor[first] and system.moves_with_floor[first + 1]
    both_open = st.state[first] == OPEN and st.state[first + 1] == OPEN
    return first if walls and both_open else -1


@inlined
def _of_structure(system, flows, st, b):
    """Return the structure's part of a body's slip, m, and of its rate, m/s."""
    position = real_sum(flows.motion[st.counters[FLOW], b], st.amplitude, st.counters[ACTIVE])
    for i in range(len(st.constant)):
        position += system.J[b, i] * st.constant[i]
    return position, _rate(flows, st, b)


@inlined
def _rate(flows, st, b):
    return real_sum(flows.velocity[st.counters[FLOW], b], st.amplitude, st.counters[ACTIVE])


@inlined
def first_to_wake(st):
    """Return the body that wakes first, and when, s in the period; -1 and inf if none sleeps."""
    first, time = -1, math.inf
    if st.counters[ASLEEP] > 0:
        for b in range(len(st.asleep)):
            if st.asleep[b] != 0 and st.sleepers[b, UNTIL] < time:
                first, time = b, st.sleepers[b, UNTIL]
    return first, time


@inlined
def free_speed(flows, st, b):
    """Return the speed of a free body without the structure's part, m/s."""
    if st.asleep[b] != 0:
        body = st.sleepers[b]
        return (body[SPEED] - body[RATE]) + st.free_acceleration[b] * (st.time[0] - body[SINCE])
    return st.velocity[b] - _rate(flows, st, b)


@kernel
def _bring(system, flows, st, b):
    """Update an inactive body. Return its slip since it became inactive, m."""
    body, time = st.sleepers[b], st.time[0] - st.sleepers[b, SINCE]
    position, rate = _of_structure(system, flows, st, b)
    free, bend = body[SPEED] - body[RATE], st.free_acceleration[b]
    shift = (position - body[PART]) + time * (free + 0.5 * bend * time)
    st.displacement[b], st.low_word[b], st.velocity[b] = body[PLACE], body[LOW], (free + bend * time) + rate
    shift_slip(st, b, shift)
    return shift


@kernel
def wake(system, flows, st, rec, b):
    """Let a body wake, with the friction of the time that it slept; its gaps are to be measured."""
    shift = _bring(system, flows, st, b)
    st.ledger[FRICTION] -= st.applied_force[b] * shift
    if rec.worn.shape[1] > 0:
        rec.worn[st.counters[PERIOD], b] += abs(st.applied_force[b] * shift)
    st.asleep[b] = 0
    st.counters[ASLEEP] -= 1


@kernel
def wake_all(system, flows, st, rec, scratch):
    """Let all bodies wake. The impulses of an event (scratch.impulse) are not in the amplitudes yet."""
    for b in range(system.bodies):
        if st.asleep[b] != 0:
            _wake_struck(system, flows, st, rec, scratch, b)
    measure_gaps(system, st)


@kernel
def _wake_struck(system, flows, st, rec, scratch, b):
    """Let a body wake with the impulses of an event, which are not in the amplitudes yet."""
    wake(system, flows, st, rec, b)
    for r in range(len(st.state)):
        st.velocity[b] += system.delassus[b, r] * scratch.impulse[r]


@kernel
def show_sleepers(system, flows, st):
    """Set displacements and velocities of inactive bodies, which stay inactive."""
    for b in range(system.bodies):
        if st.asleep[b] != 0:
            _bring(system, flows, st, b)
    measure_gaps(system, st)


@kernel
def spend_on_impulses(system, flows, st, rec, scratch):
    """Spend the margins of sleeping bodies on the impulses of an event, which are not in the amplitudes yet.

    A body that has spent them wakes: the impulse may stop it.
    """
    for r in range(len(st.state)):
        impulse = abs(scratch.impulse[r])
        for b in range(system.bodies if impulse > 0.0 else 0):
            if st.asleep[b] != 0:
                body, once, again, time = _reached(system, flows, st, r, b)
                body[SPEED_MARGIN] -= impulse * (once + again)
                body[MARGIN] -= impulse * time * (once + 0.5 * again)
    for b in range(system.bodies):
        if st.asleep[b] != 0 and min(st.sleepers[b, MARGIN], st.sleepers[b, SPEED_MARGIN]) <= 0.0:
            _wake_struck(system, flows, st, rec, scratch, b)
    measure_gaps(system, st)


@kernel
def spend_on_friction(system, flows, st, scratch):
    """Spend the margins of sleeping bodies on friction that has changed: one that has spent them wakes at once."""
    for r in range(system.friction_rows):
        force = 2.0 * system.limit[r] if scratch.old_state[r] != st.state[r] else 0.0
        for b in range(system.bodies if force > 0.0 else 0):
            if st.asleep[b] != 0:
                body, once, again, time = _reached(system, flows, st, r, b)
                body[SPEED_MARGIN] -= force * time * (once + 0.5 * again)
                body[MARGIN] -= force * time * time * (0.5 * once + again * (1 / 6))
                if min(body[MARGIN], body[SPEED_MARGIN]) <= 0.0:
                    body[UNTIL] = st.time[0]


@inlined
def _reached(system, flows, st, r, b):
    """Return a sleeping body, |W| and a_b b_r t of row r for it, and the time t for which it would still sleep, s."""
    s, body = st.counters[FLOW], st.sleepers[b]
    time = max(body[UNTIL] - st.time[0], 0.0)
    return body, abs(system.delassus[b, r]), flows.stir[s, b, 0] * flows.stir[s, r, 1] * time, time
