"""Events that nearly happen: the least minimum of the margins of events that were possible in a segment."""

from __future__ import annotations

import math

from vanedamp.coupling.derivatives.matrices import dot, matrix, unit, vector
from vanedamp.coupling.derivatives.series import follow
from vanedamp.coupling.numerics.compiler.jit import ZERO, counting

#: points of a period, and of one turn of the fastest motion, between which least margins are sought
_LOOKS, _TURN = 32, 12
#: most points where it is sought; relative round-off of a slope; steps of Newton's method, and their last size
_POINTS, _ROUND_OFF, _STEPS, _SMALL = 240, 1e-9, 8, 1e-12


@counting
def least_margin(room, eq, flows, walk, f, z, duration, who, code):
    """Return the least margin in a motion from z (K,) over a duration, s, of the events possible in flow f but one.

    That is event `code` of unit `who`. Beside it which it is, -1: none. Relative to its scale, where the margin turns
    inside the segment by more than round-off: minima between points are found by their slopes.
    """
    count, size = flows.counts[f, 2], len(z)
    if duration <= 0.0 or count == 0:
        return math.inf, -1
    step = min(eq.period / _LOOKS, 2.0 * math.pi / _TURN / (flows.fastest[f] if flows.fastest[f] > 0.0 else 1.0))
    steps = min(max(math.ceil(duration / step), 2), _POINTS)
    step = duration / steps
    motion, row, cell, share = _motion(room, flows, walk, f, z, step, steps), -1, -1, 0.0
    lowest, largest = math.inf, vector(room, size)
    for p in range(steps + 1):
        for i in range(size):
            largest[i] = max(largest[i], abs(motion[p, i]))
    for m in range(count):
        if flows.possible[f, m, 0] == who and flows.possible[f, m, 1] == code:
            continue
        functional, slopes, noise = flows.margin[f, m], flows.slope[f, m], 0.0
        for i in range(size):
            noise += abs(slopes[i]) * largest[i]
        noise *= _ROUND_OFF
        side, before = 0, 0.0  # without a sign of its own, that of the point before
        for p in range(steps + 1):
            slope = dot(slopes, motion[p])
            if slope > noise and side < 0:
                one = min(before, 0.0)
                ahead = one / (one - slope)
                value = dot(functional, motion[p - 1]) + 0.5 * one * ahead * step
                if value < lowest:
                    row, cell, share, lowest = m, p - 1, ahead, value
            if abs(slope) > noise:
                side = 1 if slope > 0.0 else -1
            before = slope
    if row < 0:
        return math.inf, -1
    return max(_minimum(room, flows, walk, f, row, motion[cell], share, step), 0.0), row


@counting
def _motion(room, flows, walk, f, z, step, steps):
    """Return the motion (n + 1, K) from z at points a step apart."""
    size = len(z)
    power, states, start = unit(room, size), matrix(room, steps + 1, size), vector(room, size)
    follow(room, flows, f, size, start, power, step, walk.terms, walk.of_terms)
    for i in range(size):
        states[0, i] = z[i]
    for p in range(1, steps + 1):
        for i in range(size):
            states[p, i] = dot(power[i], states[p - 1])
    return states


@counting
def _minimum(room, flows, walk, f, row, z, share, step):
    """Return the minimum of margin `row` about a fraction of a step after z, by Newton's method."""
    at, low, high, now, bends = share * step, 0.0, step, vector(room, len(z)), vector(room, len(z))
    slopes, nothing = flows.slope[f, row], matrix(room, len(z), ZERO)
    for n in range(flows.counts[f, 0]):
        bends[flows.column[f, n]] += slopes[flows.row[f, n]] * flows.x[f, n]
    for _ in range(_STEPS):
        for i in range(len(z)):
            now[i] = z[i]
        follow(room, flows, f, ZERO, now, nothing, at, walk.terms, walk.of_terms)
        tilt, bend = dot(slopes, now), dot(bends, now)
        if tilt < 0.0:
            low = at
        else:
            high = at
        move = at - tilt / bend if bend > 0.0 else low
        if abs(move - at) <= _SMALL * step:
            break
        at = move if low < move < high else 0.5 * (low + high)
    return dot(flows.margin[f, row], now)
