"""The event functions of planar bodies, and the first of their roots, with the guarantee of engine.root_search."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.plane.tolerances import AT_REST, DECIDED, DRIFT, FLAT
from vanedamp.coupling.engine.root_search import DEGREE, ENDLESS, MOST, expand, first_root_of_parabola, step_or_stop
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    BOUNDED,
    CLOSES,
    EVALUATIONS,
    EXPANDED,
    FLOW,
    FORCE,
    LEAVING,
    OPEN,
    OPENS,
    PARTS,
    POSITION,
    RECLOSES,
    ROOT,
    SEGMENTS,
    STICK,
    STOPS,
    TOUCHING,
    VELOCITY,
)
from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel
from vanedamp.coupling.numerics.tolerances import AT_START, RESOLUTION, SUM_ROUND_OFF
from vanedamp.coupling.system.unit_kinematics import has_friction, is_compliant, is_slip

#: exponent of the growth of modes until the period's end above which the search looks less far
_GROWN = 20.0
#: angle by which the fastest mode turns in the longest segment: the integrals over one follow every turn
_LONGEST = 3e4


@inlined
def next_event(system, flows, st, watched):
    """Time to the next event and its function, to the period's end and -1, or to a time without an event and -2.

    The last where modes grow so much until the period's end that bounds for all of it say nothing, or turn so often
    that Python would see no interrupt. ENDLESS if it finds none of them.
    """
    s = st.counters[FLOW]
    left, last = max(system.period - st.time[0], 0.0), -1
    if flows.growth[s] * left > _GROWN:
        left, last = 1.0 / flows.growth[s], -2
    if flows.fastest[s] * left > _LONGEST:
        left, last = _LONGEST / flows.fastest[s], -2
    shortest = RESOLUTION * system.period
    eigenvalue, modes = flows.eigenvalue[s], flows.modes[s]
    grows = math.exp(flows.growth[s] * left) if flows.growth[s] > 0.0 else 1.0
    count = _list_functions(system, flows, st, watched, s, grows)
    st.counters[SEGMENTS] += 1
    most = st.counters[EVALUATIONS] + MOST
    while True:
        k, tau = -1, left
        for i in range(count):
            if watched.no_root_before[i] < tau:
                k, tau = i, watched.no_root_before[i]
        if k < 0:
            return left, last
        if watched.status[k] == ROOT:
            return (tau if tau > shortest else 0.0), k
        if watched.status[k] == BOUNDED:
            tau = 0.0
        elif st.counters[EVALUATIONS] == most:
            return tau, ENDLESS
        else:
            st.counters[EVALUATIONS] += 1
        noise, second, calm, fast = expand(
            watched.order[k], watched.k1[k], watched.k2[k], watched.g[k], eigenvalue, len(system.frequency), modes, tau,
            watched.expansion,
        )  # fmt: skip
        if grows > 1.0:  # bounds of the derivatives hold for motions that decay
            second, calm = second * grows, -1.0
            watched.expansion.taylor[0, DEGREE] *= grows
        step, is_root, _ = step_or_stop(
            watched.expansion, 1.0, watched.k0[k], math.inf, max(noise, watched.noise[k]), second, calm, fast,
            system.period, shortest,
        )  # fmt: skip
        watched.status[k] = ROOT if is_root else EXPANDED
        watched.no_root_before[k] = tau + step if is_root else max(watched.no_root_before[k], tau + step)


@inlined
def _list_functions(system, flows, st, watched, s, grows):
    """Set up the event functions of the segment. Returns how many."""
    u, count = len(system.rest), ZERO
    for r in range(u):
        state = st.state[r]
        if r < system.contacts:
            if state == OPEN:
                count = _add(system, flows, st, watched, s, r, POSITION, CLOSES, 1.0, 0.0, grows, count)
            elif state == LEAVING:
                count = _add(system, flows, st, watched, s, r, POSITION, OPENS, -1.0, 0.0, grows, count)
                on_gap, on_rate = system.spring[r], system.dashpot[r]
                count = _add(system, flows, st, watched, s, r, POSITION, RECLOSES, on_gap, on_rate, grows, count)
            elif state == TOUCHING:
                if is_compliant(system, r):  # nothing presses it now
                    count = _add(system, flows, st, watched, s, r, POSITION, CLOSES, 1.0, 0.0, grows, count)
                    count = _add(system, flows, st, watched, s, r, POSITION, OPENS, -1.0, 0.0, grows, count)
            else:
                count = _add(system, flows, st, watched, s, r, FORCE, PARTS, 1.0, 0.0, grows, count)
        if state == STICK and has_friction(system, r):
            bound = system.friction[r]
            count = _add(system, flows, st, watched, s, r, FORCE, AT_HIGH, bound, -1.0, grows, count)
            count = _add(system, flows, st, watched, s, r, FORCE, AT_LOW, bound, 1.0, grows, count)
        if is_slip(state) and not flows.held[s, r] and has_friction(system, r):
            count = _add(system, flows, st, watched, s, r, VELOCITY, STOPS, 0.0, float(state), grows, count)
    return count


@kernel
def _add(system, flows, st, watched, s, r, order, event, on_normal, on_slip, grows, k):
    """Add an event function: a gap and its rate, a slip's speed, or forces of both rows, times these factors.

    Returns the number of functions so far. Those of forces far from their bounds are left out.
    """
    k0, k1, k2, noise = _polynomial(system, st, r, order, on_normal, on_slip)
    if st.state[r] == TOUCHING:  # as far as round-off of its gap may have it drift
        k0 += DRIFT * system.play[r]
    u = len(system.rest)
    # derivatives at the start, and bounds of them at all later times
    first, second, third, second_bound, third_bound, fourth_bound, swing = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    value = k0
    for j in range(flows.modes[s]):
        rate = flows.eigenvalue[s, j]
        if order == FORCE:
            g = on_normal * flows.force[s, r, j] + on_slip * flows.force[s, u + r, j]
        elif order == POSITION:
            g = flows.rows[s, r, j]
            if event != CLOSES:  # only the gap
                k1 += on_slip * (g * st.amplitude[j] * rate * rate).real
                g *= on_normal + on_slip * rate
        else:
            g = on_slip * flows.rows[s, u + r, j] * rate
        g *= st.amplitude[j]
        watched.g[k, j] = g
        fast = flows.size[s, j]
        bound = (abs(g.real) + abs(g.imag)) * fast
        if order == FORCE:
            value += g.real
            swing += abs(g.real) + abs(g.imag)
        now = g * rate
        if order != POSITION:
            first += now.real
        now *= rate
        bound *= fast
        second += now.real
        second_bound += bound
        third += (now * rate).real
        third_bound += bound * fast
        fourth_bound += bound * fast * fast
    if order == FORCE and k0 > swing * grows:
        return k
    first += k1
    second += k2 if order == POSITION else 0.0
    watched.unit[k], watched.order[k], watched.what[k], watched.status[k] = r, order, event, BOUNDED
    watched.k0[k], watched.k1[k], watched.k2[k], watched.no_root_before[k] = k0, k1, k2, 0.0
    watched.noise[k] = SUM_ROUND_OFF * (noise + swing)
    if _begins_at_zero(system, st, r, order, abs(on_normal), value, first, second_bound, noise + swing):
        watched.no_root_before[k] = _first_step(
            system.period, first, second, third, second_bound * grows + abs(k2), third_bound * grows,
            fourth_bound * grows,
        )  # fmt: skip
        watched.status[k] = EXPANDED
    elif value > watched.noise[k]:
        watched.no_root_before[k] = first_root_of_parabola(value, first, -second_bound * grows + min(k2, 0.0))
    return k + 1


@inlined
def _polynomial(system, st, r, order, on_normal, on_slip):
    """Return the coefficients of an event function's polynomial, and the sizes of the terms of the first."""
    u, size = len(system.rest), len(st.q)
    k0, k1, k2, noise = 0.0, 0.0, 0.0, 0.0
    if order == FORCE:
        k0 = on_normal * st.force[r] + on_slip * st.force[u + r] + system.limit[r]
        noise = abs(on_normal * st.force[r]) + abs(on_slip * st.force[u + r]) + system.limit[r]
        if is_compliant(system, r):  # its force is a small difference of displacements
            noise += abs(on_normal) * system.spring[r] * system.play[r]
    elif order == POSITION:
        k0, noise = on_normal * system.rest[r], abs(on_normal * system.rest[r])
        for i in range(size):
            term, speed = on_normal * system.J[r, i] * st.q[i], on_slip * system.J[r, i] * st.v[i]
            k0 += term + speed
            noise += abs(term) + abs(speed)
            k1 += system.J[r, i] * (on_normal * st.v[i] + on_slip * st.bend[i])
            k2 += on_normal * system.J[r, i] * st.bend[i]
    else:
        for i in range(size):
            term = on_slip * system.J[u + r, i] * st.v[i]
            k0 += term
            noise += abs(term)
            k1 += on_slip * system.J[u + r, i] * st.bend[i]
    return k0, k1, k2, noise


@inlined
def _begins_at_zero(system, st, r, order, factor, value, first, second_bound, noise):
    """Whether a function of a contact that has just been decided is zero at the start, and does not fall.

    factor: of its gap, if it has one.
    """
    if st.fresh[r] == 0:
        return False
    falls = first < -FLAT * second_bound * system.period
    zero = FLAT * noise
    if order == POSITION:
        falls = falls and first < -AT_REST * st.scale[0] * factor
        zero = DECIDED * (system.play[r] * factor)
    elif order == VELOCITY:
        zero = DECIDED * st.scale[0]
    return not falls and value <= zero


@inlined
def _first_step(period, first, second, third, second_bound, third_bound, fourth_bound):
    """A safe step of a function that begins at zero: by the first of its derivatives that is not round-off.

    By the contacts' decision it rises.
    """
    omega, step = 2.0 * math.pi / period, AT_START * period
    if first > FLAT * second_bound / omega:
        step = first / second_bound if second_bound > 0.0 else period
    elif second > FLAT * max(third_bound / omega, second_bound):
        step = 1.5 * second / third_bound if third_bound > 0.0 else period
    elif third > 0.0 and second > -FLAT * max(third_bound / omega, second_bound):
        step = 2.0 * third / fourth_bound if fourth_bound > 0.0 else period
    return max(step, AT_START * period)
