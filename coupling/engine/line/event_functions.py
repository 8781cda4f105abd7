"""Set up the event functions of a state and find the first of their roots."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.line.gap_kinematics import measure_gaps
from vanedamp.coupling.engine.line.sleeping import bounded_step, falls_asleep, first_to_wake, may_sleep, sleeps, wake
from vanedamp.coupling.engine.line.tolerances import ADHESION, RECLOSING
from vanedamp.coupling.engine.root_search import ENDLESS, MOST, add_secular, expand, step_or_stop
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    AT_HIGH,
    AT_LOW,
    BOUNDED,
    CARRIED,
    CLOSED,
    CLOSES,
    EVALUATIONS,
    EXPANDED,
    FLOW,
    FORCE,
    LEAVING,
    OPEN,
    OPENS,
    POSITION,
    RECLOSES,
    ROOT,
    SEGMENTS,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    STOPS,
    VELOCITY,
)
from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import secular_bound
from vanedamp.coupling.numerics.tolerances import AT_START, CHATTER, RESOLUTION

#: in periods: functions without a root at a period's start are left out from here on, at the price of exponentials
_AHEAD = 0.02


@inlined
def next_event(system, flows, st, watched, rec):
    """Return the time to the next event, its event function and its side, or to the period's end and -1.

    ENDLESS instead of -1 if it finds neither. Results beyond the period's end are kept for the next segment
    (`carry_over_period`).
    """
    s = st.counters[FLOW]
    driven = _is_driven(flows, s)
    left = max(system.period - st.time[0], 0.0)
    shortest = RESOLUTION * system.period
    taylor, count, woken, listed = watched.expansion.taylor, ZERO, ZERO, False
    st.counters[SEGMENTS] += 1
    most = st.counters[EVALUATIONS] + MOST
    while True:
        if not listed:
            count, listed = _list_functions(system, flows, st, watched, s, woken, count), True
        k, tau, longest = -1, left, system.period
        for i in range(count):
            first = watched.no_root_before[i]
            if first < tau:
                k, tau = i, first
            if watched.status[i] == ROOT:
                longest = min(longest, first)
        body, first = first_to_wake(st)
        if body >= 0 and first - st.time[0] <= tau:
            woken, listed = st.asleep[body], False
            wake(system, flows, st, rec, body)
            measure_gaps(system, st)
            continue
        if k < 0:
            st.counters[CARRIED] = count
            return left, -1, 0
        if watched.status[k] == ROOT:
            st.counters[CARRIED] = 0
            # a root that a double cannot separate from the segment's start is at its start
            return (tau if tau > shortest else 0.0), k, watched.side[k]
        if watched.status[k] == BOUNDED:
            tau = 0.0  # where exponentials cost nothing
        elif st.counters[EVALUATIONS] == most:
            return tau, ENDLESS, 0
        else:
            st.counters[EVALUATIONS] += 1
        noise, second, calm, fast = expand(
            watched.order[k], watched.k1[k], watched.k2[k], watched.g[k], flows.eigenvalue[s],
            flows.driven[s, flows.driven.shape[1] - 1], st.counters[ACTIVE], tau, watched.expansion,
        )  # fmt: skip
        if driven:
            more, bound = add_secular(
                watched.order[k], watched.drive[k], flows.driven[s], flows.eigenvalue[s], tau, system.period,
                taylor,
            )  # fmt: skip
            noise, second = noise + more, second + bound
            calm = calm + bound if calm >= 0.0 else calm
        longest = max(longest - tau, shortest)
        # the side that the motion approaches first: the other one is evaluated until then
        two = watched.sides[k] == 2
        side = 1 if two and taylor[0, 1] > 0.0 else 0
        step, is_root, clear = step_or_stop(
            watched.expansion, 1.0 - 2.0 * side, watched.k0[k, side], watched.k0[k, 1 - side] if two else math.inf,
            max(noise, watched.noise[k]), second, calm, fast, longest, shortest,
        )  # fmt: skip
        if two and not clear:
            other, root, _ = step_or_stop(
                watched.expansion, 2.0 * side - 1.0, watched.k0[k, 1 - side], math.inf, max(noise, watched.noise[k]),
                second, calm, fast, step, shortest,
            )  # fmt: skip
            if other < step:
                step, is_root, side = other, root, 1 - side
        watched.side[k] = side
        watched.status[k] = ROOT if is_root else EXPANDED
        watched.no_root_before[k] = tau + step if is_root else max(watched.no_root_before[k], tau + step)


@inlined
def carry_over_period(system, st, watched, tau):
    """Keep the results on the event functions over the end of a period, tau from the segment's start."""
    for k in range(st.counters[CARRIED]):
        left = max(watched.no_root_before[k] - tau, 0.0)
        watched.no_root_before[k] = left
        if watched.status[k] == EXPANDED and left < _AHEAD * system.period:
            watched.status[k] = BOUNDED


@inlined
def _list_functions(system, flows, st, watched, s, woken, count):
    """Set up the event functions of the segment, or add those of the activated body. Return their number.

    woken: the first contact of that body, 0 without one.
    """
    tired = woken == 0 and may_sleep(flows, st)
    r, end, contact, last = ZERO, system.friction_rows, system.friction_rows, len(st.state)
    if woken > 0:
        r, contact, last = system.right_body[woken], woken, woken + 2
        end = r + 1
    while r < end:
        state = st.state[r]
        if tired and r < system.bodies:
            watched.stop[r] = -1
            if st.asleep[r] != 0:
                r += 1
                continue
        if state == STICK or state == SPRUNG:
            count = _add_force_bounds(system, flows, st, watched, s, r, system.limit[r], True, count)
        elif state == SLIP_LEFT or state == SLIP_RIGHT:
            if tired and r < system.bodies:
                watched.stop[r] = count
            count = _add_motion(system, flows, st, watched, s, r, VELOCITY, float(state), STOPS, False, count)
        r += 1
    r = contact
    while r < last:
        state = st.state[r]
        if tired and sleeps(system, st, r):
            r += 1
        elif state == CLOSED or state == SPRUNG:
            count = _add_force_bounds(system, flows, st, watched, s, r, 0.0, False, count)
        elif state == OPEN and not _surely_opens(system, st, r):
            both = _both_sides_open(system, st, r)
            count = _add_motion(system, flows, st, watched, s, r, POSITION, 1.0, CLOSES, both, count)
            if tired and falls_asleep(system, flows, st, watched, r, count - 1):
                count -= 1
            r += both
        elif state == LEAVING:
            count = _add_motion(system, flows, st, watched, s, r, POSITION, -1.0, OPENS, False, count)
            count = _add_reclosing(system, flows, st, watched, s, r, count)
        r += 1
    return count


@inlined
def _both_sides_open(system, st, r):
    """Whether gap r and the next one are those on both sides of a body, and both can close."""
    after = r + 1
    if after == len(st.state) or st.state[after] != OPEN or system.left_body[r] >= 0 or system.right_body[after] >= 0:
        return False
    if not (system.moves_with_floor[r] and system.moves_with_floor[after]):
        return False
    body = system.right_body[r]
    if body < 0 or system.left_body[after] != body or st.released[r] != 0 or st.released[after] != 0:
        return False
    return not _surely_opens(system, st, after)


@inlined
def _surely_opens(system, st, r):
    """Whether a gap can only widen in this segment: the body slides away from a wall that moves with its floor."""
    if not system.moves_with_floor[r]:
        return False
    if system.left_body[r] < 0:
        return st.state[system.right_body[r]] == SLIP_RIGHT
    return system.right_body[r] < 0 and st.state[system.left_body[r]] == SLIP_LEFT


@inlined
def _add_motion(system, flows, st, watched, s, r, order, sign, meaning, both, k):
    """Add the gap (POSITION) or the speed of a slip (VELOCITY) of row r, times its sign; both: and the next gap."""
    if order == POSITION:
        value, slope, watched.k2[k] = sign * st.displacement[r], sign * st.velocity[r], sign * st.free_acceleration[r]
    else:
        value, slope, watched.k2[k] = sign * st.velocity[r], sign * st.free_acceleration[r], 0.0
    watched.k0[k, 0], watched.k1[k] = value, slope
    functional = flows.velocity[s, r] if order == VELOCITY else flows.motion[s, r]
    first, curvature, bound = _set_motion(
        functional, st.amplitude, flows.eigenvalue[s], sign, watched.g[k], st.counters[ACTIVE]
    )
    if order == VELOCITY:
        slope, curvature = slope + first, 0.0
    curvature += watched.k2[k]
    if _is_driven(flows, s):
        on_motion, on_velocity = (0.0, sign) if order == VELOCITY else (sign, 0.0)
        first, second, largest, _ = _add_drive(system, flows, st, watched, s, r, on_motion, on_velocity, 0.0, k)
        if order == VELOCITY:
            slope += first
        curvature += second
        bound += largest
    if meaning == CLOSES or meaning == OPENS:
        st.capture_speed[r] = max(0.0, -curvature) * 0.5 * CHATTER * system.period
    watched.slope[k], watched.bound[k] = slope, bound
    sides = 1
    if both:
        sides, watched.k0[k, 1] = 2, st.displacement[r + 1]
        st.capture_speed[r + 1] = max(0.0, curvature) * 0.5 * CHATTER * system.period
    if _begin_function(st, watched, r, order, meaning, sides, k):
        watched.no_root_before[k] = bounded_step(value, slope, bound - watched.k2[k])
        if both:
            watched.row[k, 1], watched.meaning[k, 1] = r + 1, CLOSES
            other = bounded_step(watched.k0[k, 1], -slope, bound + watched.k2[k])
            watched.no_root_before[k] = min(watched.no_root_before[k], other)
    if _is_driven(flows, s):
        watched.no_root_before[k] = min(watched.no_root_before[k], 2.0 * system.period)  # as far as the bounds hold
    if st.released[r] != 0:
        _skip_root_at_start(system, flows, st, watched, s, r, order, sign, k)
    return k + 1


@summing
def _set_motion(functional, amplitude, eigenvalue, sign, g, count):
    """Set the amplitudes of a motion's exponentials. Return its first two derivatives and a bound of the second."""
    first, second, bound = 0.0, 0.0, 0.0
    for j in range(count):
        rate, term = eigenvalue[j], sign * (functional[j] * amplitude[j])
        g[j] = term
        once = rate * term
        first += once.real
        second += rate.real * once.real - rate.imag * once.imag
        bound += (abs(once.real) + abs(once.imag)) * (abs(rate.real) + abs(rate.imag))
    return first, second, bound


@inlined
def _is_driven(flows, s):
    """Whether the excitation drives modes of subsystem s."""
    e = flows.driven.shape[1] - 1
    return flows.driven[s, e] > e


@inlined
def _add_drive(system, flows, st, watched, s, r, on_motion, on_velocity, on_force, k):
    """Set the growth of the driven modes in event function k (`_set_growth`)."""
    return _set_growth(
        flows.eigenvalue[s], flows.motion[s, r], flows.velocity[s, r], flows.force[s, r], on_motion, on_velocity,
        on_force, flows.driven[s], flows.load[s], st.amplitude, system.period, watched.drive[k],
    )  # fmt: skip


@kernel
def _set_growth(
    eigenvalue, motion, velocity, force, on_motion, on_velocity, on_force, driven, load, phase, period, drive
):
    """Set the growth of driven modes in an event function: a row's motion, velocity and force times these factors.

    Returns its first two derivatives at the segment's start, and bounds of the second and third.
    """
    first, second, second_bound, third_bound = 0.0, 0.0, 0.0, 0.0
    for h in range(len(driven) - 1):
        excitation = eigenvalue[h]
        for j in range(driven[h], driven[h + 1]):
            rate = eigenvalue[j]
            term = (on_motion * motion[j] + on_velocity * velocity[j] + on_force * force[j]) * load[j] * phase[h]
            drive[j] = term
            first += term.real
            second += (term * (rate + excitation)).real
            second_bound += secular_bound(term, rate, excitation, period, 2)
            third_bound += secular_bound(term, rate, excitation, period, 3)
    return first, second, second_bound, third_bound


@inlined
def _begin_function(st, watched, r, order, meaning, sides, k):
    """Begin event function k. Return False where results on it have been carried over: they are kept."""
    same = watched.row[k, 0] == r and watched.order[k] == order and watched.meaning[k, 0] == meaning
    if k < st.counters[CARRIED] and same and watched.sides[k] == sides:
        return False
    watched.row[k, 0], watched.order[k], watched.meaning[k, 0], watched.sides[k] = r, order, meaning, sides
    watched.noise[k], watched.status[k], watched.no_root_before[k] = 0.0, BOUNDED, 0.0
    return True


@kernel
def _skip_root_at_start(system, flows, st, watched, s, r, order, sign, k):
    """Set the first safe step of a row whose force was at its bound: at rest without acceleration, its jerk decides."""
    jerk, snap = 0.0, 0.0
    for j in range(st.counters[ACTIVE]):
        rate, g = flows.eigenvalue[s, j], sign * flows.motion[s, r, j] * st.amplitude[j]
        square = rate.real * rate.real + rate.imag * rate.imag
        second = g * rate * rate
        jerk += (second * rate).real
        snap += (abs(second.real) + abs(second.imag)) * square
    for h in range(len(flows.driven[s]) - 1):
        excitation = flows.eigenvalue[s, h]
        for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
            rate, drive = flows.eigenvalue[s, j], sign * flows.motion[s, r, j] * flows.load[s, j] * st.amplitude[h]
            jerk += (drive * (rate * rate + rate * excitation + excitation * excitation)).real
            snap += secular_bound(drive, rate, excitation, system.period, 4)
    quick = (2.0 if order == POSITION else 1.5) * jerk / snap
    quick = max(quick if quick == quick else system.period, AT_START * system.period)
    watched.no_root_before[k], watched.status[k] = quick, EXPANDED


@kernel
def hop_speed(system, flows, st, r):
    """Return the speed (m/s) with which a contact at rest would leave for a flight of CHATTER, from its force now."""
    s = st.counters[FLOW]
    force = st.constant_force[r]
    for j in range(st.counters[ACTIVE]):
        force += (flows.force[s, r, j] * st.amplitude[j]).real
    return max(0.0, force) * system.delassus[r, r] * 0.5 * CHATTER * system.period


@kernel
def _add_reclosing(system, flows, st, watched, s, r, k):
    """Add the spring force that a compliant contact that has ended would have: it closes again where that pushes."""
    spring, dashpot = system.spring[r], system.dashpot[r]
    watched.row[k, 0], watched.order[k], watched.meaning[k, 0], watched.sides[k] = r, POSITION, RECLOSES, 1
    watched.status[k], watched.no_root_before[k] = BOUNDED, 0.0
    acceleration = st.free_acceleration[r]
    for j in range(st.counters[ACTIVE]):
        velocity = flows.velocity[s, r, j] * st.amplitude[j]
        watched.g[k, j] = spring * flows.motion[s, r, j] * st.amplitude[j] + dashpot * velocity
        acceleration += (flows.eigenvalue[s, j] * velocity).real
    watched.k0[k, 0] = spring * st.displacement[r] + dashpot * st.velocity[r]
    watched.k1[k] = spring * st.velocity[r] + dashpot * acceleration
    watched.k2[k] = spring * st.free_acceleration[r]
    if _is_driven(flows, s):
        # the row's velocity includes its growth already, its acceleration has not
        acceleration, _, _, _ = _add_drive(system, flows, st, watched, s, r, 0.0, 1.0, 0.0, k)
        watched.k1[k] += dashpot * acceleration
        _add_drive(system, flows, st, watched, s, r, spring, dashpot, 0.0, k)
    # the contact ended at zero force
    watched.noise[k] = RECLOSING * (abs(spring * st.displacement[r]) + abs(dashpot * st.velocity[r]))
    return k + 1


@inlined
def _add_force_bounds(system, flows, st, watched, s, r, limit, both, k):
    """Add the distance of a closed row's force from its low bound -limit, and from its high one if it has both.

    Bounds that the force never comes near are not watched.
    """
    swing, value, slope, bound = _set_force(
        flows.force[s, r], st.amplitude, flows.eigenvalue[s], watched.g[k], st.counters[ACTIVE]
    )
    low, high, driven = limit + st.constant_force[r], limit - st.constant_force[r], _is_driven(flows, s)
    # a force that grows is always watched
    near_low, near_high = driven or low <= swing, both and (driven or high <= swing)
    if near_low and near_high and st.released[r] == 0:
        return _add_force(system, flows, st, watched, s, r, AT_LOW, 2, low, high, value, slope, bound, k)
    if near_low:
        k = _add_force(system, flows, st, watched, s, r, AT_LOW, 1, low, high, value, slope, bound, k)
        if near_high:
            for j in range(st.counters[ACTIVE]):
                watched.g[k, j] = watched.g[k - 1, j]
    if near_high:
        for j in range(st.counters[ACTIVE]):
            watched.g[k, j] = -watched.g[k, j]
        k = _add_force(system, flows, st, watched, s, r, AT_HIGH, 1, high, low, -value, -slope, bound, k)
    return k


@summing
def _set_force(functional, amplitude, eigenvalue, g, count):
    """Set the amplitudes of a force's exponentials. Return its swing, value, slope and a bound of its curvature."""
    swing, value, slope, bound = 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        rate, term = eigenvalue[j], functional[j] * amplitude[j]
        g[j] = term
        size = math.sqrt(term.real * term.real + term.imag * term.imag)
        swing += size
        value += term.real
        slope += rate.real * term.real - rate.imag * term.imag
        bound += size * (rate.real * rate.real + rate.imag * rate.imag)
    return swing, value, slope, bound


@kernel
def _add_force(system, flows, st, watched, s, r, side, sides, near, far, value, slope, bound, k):
    """Add the distance `near` + motion of a row's force from a bound, and `far` - motion from the other of two."""
    curvature, third, sign = 0.0, 0.0, 1.0 if side == AT_LOW else -1.0
    if _is_driven(flows, s):
        first, curvature, second_bound, third = _add_drive(system, flows, st, watched, s, r, 0.0, 0.0, sign, k)
        slope += first
        bound += second_bound
    if st.state[r] == SPRUNG and r >= system.friction_rows:
        # bodies that touch without force, as in a free flight side by side, are not parted by round-off
        near += ADHESION * system.spring[r] * system.play[r]
    watched.k0[k, 0], watched.k0[k, 1], watched.k1[k], watched.k2[k] = near, far, 0.0, 0.0
    if _begin_function(st, watched, r, FORCE, side, sides, k):
        watched.no_root_before[k] = bounded_step(near + value, slope, bound)
        if sides == 2:
            watched.row[k, 1], watched.meaning[k, 1] = r, AT_HIGH
            other = bounded_step(far - value, -slope, bound)
            watched.no_root_before[k] = min(watched.no_root_before[k], other)
    if _is_driven(flows, s):
        watched.no_root_before[k] = min(watched.no_root_before[k], 2.0 * system.period)  # as far as the bounds hold
    if st.released[r] == -side:
        for j in range(st.counters[ACTIVE]):
            rate = flows.eigenvalue[s, j]
            second = watched.g[k, j] * rate * rate
            curvature += second.real
            third += (abs(second.real) + abs(second.imag)) * abs(rate)
        quick = 2.9 * curvature / third if third > 0.0 else system.period
        watched.no_root_before[k] = max(quick, AT_START * system.period)
        watched.status[k] = EXPANDED
    return k + 1
