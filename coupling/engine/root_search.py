"""Guaranteed search for the first root of an event function.

Event functions are  k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t)  with Re lambda_j <= 0, and positive until the
event. Two that differ by the sign of their motion, as the gaps on both sides of a body, have one expansion. With the
exponentials at a point come all derivatives there, and bounds of the derivatives at all later times: the sums of
|g_j exp(lambda_j t)| |lambda_j|^p. The function stays above its Taylor polynomial less the bound of its remainder: a
step that ends before the first root of this lower polynomial provably holds no root. Steps are as long as a few radians
of the fastest motion, and where the remainder is round-off the polynomial's root is the function's. No event can be
missed, and none is found twice. A double root is approached at a geometric rate.

Modes that the excitation drives at their own frequency add terms in D(t) (line.subsystem_assembly), bounded over two
periods.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import POSITION, VELOCITY
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.exponentials import (
    exp_minus_line,
    exp_minus_one,
    is_long,
    long_minus_line,
    minus_one,
    secular,
    secular_bound,
    whole_vectors,
)
from vanedamp.coupling.numerics.tolerances import AT_ROOT, NEAR_ROOT, SUM_ROUND_OFF

#: evaluations in the search for one event, beyond which it is given up, and what it returns then. Ordinary ones take a
#: few; where a mode is a million times faster than the excitation, or a function stays at round-off, there is no end
MOST, ENDLESS = 1_000_000, -3
#: degree of the lower polynomial; its last coefficient is that of the bound
DEGREE = 10
_OVER_FACTORIAL = tuple(1.0 / math.factorial(p) for p in range(DEGREE + 1))

# entries of the sums over modes: derivatives up to the bound of order DEGREE, a bound of the second, sizes
_SECOND, _SIZE, _SUMS = DEGREE + 1, DEGREE + 2, DEGREE + 3

# a step that long, in units of (second bound / last bound)^(1 / (DEGREE - 2)), leaves out a few thousandths
_REACH = 3.6
# modes faster than this times the first, squared, are fast
_FAST = 4.0


@record
class Expansion(NamedTuple):
    """The expansion of an event function at a time, and room for it."""

    taylor: Annotated[np.ndarray, "2 degrees"]  # polynomials of its motion, and of that without fast modes
    amplitude: Annotated[np.ndarray, "m", complex]  # those of the exponentials at its time
    slow: Annotated[np.ndarray, "sums"]  # sums over the slow modes
    fast: Annotated[np.ndarray, "sums"]  # those over the fast ones
    more: Annotated[np.ndarray, "sums"]
    shifted: Annotated[np.ndarray, "degrees"]  # polynomial from another time on


def new_expansion(modes: int) -> Expansion:
    """Return room for the expansion of event functions of m modes."""
    return room(Expansion, {"m": modes, "degrees": DEGREE + 1, "sums": _SUMS})


@kernel
def add_secular(order, drive, driven, eigenvalue, t, period, taylor):
    """Add Re sum_j drive_j D_j(t) to the polynomials of `expand`.

    drive: (m,) of the modes from driven[h] to driven[h + 1], which harmonic h drives. Returns the round-off and a bound
    of the second derivative.
    """
    whole, slow, noise, second = taylor[0], taylor[1], 0.0, 0.0
    for h in range(len(driven) - 1):
        excitation = eigenvalue[h]
        first = exp_minus_one(excitation * t)
        for j in range(driven[h], driven[h + 1]):
            d, rate = drive[j], eigenvalue[j]
            growth, beyond = secular(rate, excitation, t)
            # derivatives by D' = lambda D + exp(i omega t)
            now, turn = d * growth, d * (1.0 + first)
            height, slope = now, rate * now + turn
            if order == POSITION:
                height, slope = d * beyond, rate * now + d * first
            noise += abs(height.real) + abs(height.imag) + abs(now.real) + abs(now.imag)
            for polynomial in (whole, slow):
                polynomial[0] += height.real
                polynomial[1] += slope.real
            now = rate * now + turn
            for p in range(2, DEGREE):
                turn *= excitation
                now = rate * now + turn
                for polynomial in (whole, slow):
                    polynomial[p] += now.real * _OVER_FACTORIAL[p]
            left_out = secular_bound(d, rate, excitation, period, DEGREE) * _OVER_FACTORIAL[DEGREE]
            for polynomial in (whole, slow):
                polynomial[DEGREE] += left_out
            second += secular_bound(d, rate, excitation, period, 2)
    return SUM_ROUND_OFF * noise, second


@inlined
def first_root_of_parabola(f, slope, curvature):
    """Return the smallest s >= 0 with f + slope s + curvature s^2/2 = 0 for f >= 0; inf if there is none."""
    if f == 0.0 and slope < 0.0:
        return 0.0
    square = slope * slope - 2.0 * curvature * f
    if curvature < 0.0:
        return (slope + math.sqrt(square)) / -curvature if slope >= 0.0 else 2.0 * f / (math.sqrt(square) - slope)
    if slope >= 0.0 or square < 0.0:
        return math.inf
    return 2.0 * f / (math.sqrt(square) - slope)


@inlined
def expand(order, k1, k2, g, eigenvalue, harmonics, count, t, work):
    """Set the Taylor polynomials of a motion from time t on, by powers of the time since, in `work`.

    The motion is k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t) of the first `count` modes: `harmonics` of them the
    harmonics and the modes that they drive, then others, both in order of their rates. Its remainder is no larger than
    the last coefficient times its power. The first polynomial is that of all modes; the second leaves out those much
    faster than the first mode: less sharp close to a root, but good for long steps far from it. Modes in another order
    are as well bounded, but steps may be shorter. What g holds of other modes is lost.
    Returns the round-off of the value, a bound of the second derivative, that of the slow modes (-1: all are), and the
    size of the fast modes.
    order POSITION: exponentials as exp(z) - 1 - z, so there is no motion at the start, and its rate is k1 exactly;
    VELOCITY: exp(z) - 1 with the constant slope k1; FORCE: exp(z) only.
    """
    value, noise, slope, amplitude = 0.0, 0.0, 0.0, g
    all_modes = whole_vectors(count, len(g))
    for j in range(count, all_modes):
        g[j] = 0.0  # of modes that were active before
    if t > 0.0:
        amplitude = work.amplitude
        if order != POSITION:
            value, noise, slope = _later(minus_one, g, eigenvalue, all_modes, t, amplitude)
        elif is_long(eigenvalue, harmonics, count, t):
            value, noise, slope = _later(long_minus_line, g, eigenvalue, all_modes, t, amplitude)
        else:
            value, noise, slope = _later(exp_minus_line, g, eigenvalue, all_modes, t, amplitude)
    limit = _FAST * _square(eigenvalue[0])
    low, high = (
        _first_fast(eigenvalue, 0, min(harmonics, count), limit), _first_fast(eigenvalue, harmonics, count, limit)
    )  # fmt: skip
    slow, fast, more = work.slow, work.fast, work.more
    apart = low < harmonics
    _add_up(amplitude, eigenvalue, 0, low if apart else high, slow)
    if apart:
        _add_up(amplitude, eigenvalue, harmonics, high, more)
        for p in range(_SUMS):
            slow[p] += more[p]
        _add_up(amplitude, eigenvalue, low, harmonics, fast)
        _add_up(amplitude, eigenvalue, high, all_modes, more)
        for p in range(_SUMS):
            fast[p] += more[p]
    elif high < count:
        _add_up(amplitude, eigenvalue, high, all_modes, fast)
    whole, quiet, all_slow = work.taylor[0], work.taylor[1], not apart and high >= count
    if order == POSITION:
        slow[2] += k2
        slow[_SECOND] += abs(k2)
    for p in range(DEGREE + 1):
        whole[p] = (slow[p] if all_slow else slow[p] + fast[p]) * _OVER_FACTORIAL[p]
    size = slow[_SIZE] if all_slow else slow[_SIZE] + fast[_SIZE]
    if order == POSITION:
        whole[0], whole[1] = value + t * (k1 + 0.5 * k2 * t), slope + k1 + k2 * t
        noise += abs(k1 * t) + abs(k2 * t * t)
    elif order == VELOCITY:
        whole[0], whole[1] = value + k1 * t, whole[1] + k1
        noise += abs(k1 * t)
    else:
        noise = size
    if all_slow:
        return SUM_ROUND_OFF * noise, slow[_SECOND], -1.0, 0.0
    for p in range(2, DEGREE + 1):
        quiet[p] = slow[p] * _OVER_FACTORIAL[p]
    quiet[0], quiet[1] = whole[0] - fast[0], whole[1] - fast[1]
    return SUM_ROUND_OFF * noise, slow[_SECOND] + fast[_SECOND], slow[_SECOND], fast[_SIZE]


@inlined
def _size(z):
    return abs(z.real) + abs(z.imag)


@inlined
def _square(z):
    return z.real * z.real + z.imag * z.imag


@inlined
def _first_fast(eigenvalue, low, high, limit):
    """Return the first mode from `low` to `high`, in order of their rates, whose squared rate is beyond the limit."""
    while low < high:
        middle = (low + high) // 2
        if _square(eigenvalue[middle]) > limit:
            high = middle
        else:
            low = middle + 1
    return low


@summing
def _later(term, g, eigenvalue, count, t, amplitude):
    """Set the amplitudes of the exponentials after a time t.

    term: a function of z and exp(z) - 1 of `numerics.exponentials`. Returns Re sum g term, the sum of its terms' sizes,
    and the rate of Re sum g (exp(z) - 1) less that at the start.
    """
    value, size, slope = 0.0, 0.0, 0.0
    for j in range(count):
        rate, start = eigenvalue[j], g[j]
        z = complex(rate.real * t, rate.imag * t)
        first = exp_minus_one(z)
        change, added = start * first, start * term(z, first)
        value += added.real
        size += abs(added.real) + abs(added.imag)
        slope += rate.real * change.real - rate.imag * change.imag
        amplitude[j] = start + change
    return value, size, slope


@summing
def _add_up(amplitude, eigenvalue, low, high, sums):
    """Set the sums of the exponentials' derivatives over the modes from `low` to `high`, and of their bounds."""
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    size, second, last = 0.0, 0.0, 0.0
    for j in range(low, high):
        rate, one = eigenvalue[j], amplitude[j]
        # derivatives of Re exp(lambda t) obey the recurrence of the characteristic polynomial
        twice, square = 2.0 * rate.real, _square(rate)
        d0, d1 = one.real, rate.real * one.real - rate.imag * one.imag
        d2 = twice * d1 - square * d0
        d3 = twice * d2 - square * d1
        d4 = twice * d3 - square * d2
        d5 = twice * d4 - square * d3
        d6 = twice * d5 - square * d4
        d7 = twice * d6 - square * d5
        d8 = twice * d7 - square * d6
        d9 = twice * d8 - square * d7
        c0, c1, c2, c3, c4 = c0 + d0, c1 + d1, c2 + d2, c3 + d3, c4 + d4
        c5, c6, c7, c8, c9 = c5 + d5, c6 + d6, c7 + d7, c8 + d8, c9 + d9
        modulus = _size(one)
        fourth = square * square
        size, second, last = size + modulus, second + modulus * square, last + modulus * (square * (fourth * fourth))
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = c0, c1, c2, c3, c4, c5
    sums[6], sums[7], sums[8], sums[9], sums[DEGREE] = c6, c7, c8, c9, last
    sums[_SECOND], sums[_SIZE] = second, size


@inlined
def _value(a, sign, f, h):
    """Return the lower polynomial of f + sign (motion - its value) at h."""
    h2 = h * h
    h4 = h2 * h2
    h8 = h4 * h4
    low = a[1] * h + (a[2] + a[3] * h) * h2
    middle = (a[4] + a[5] * h) + (a[6] + a[7] * h) * h2
    return f + (sign * (low + middle * h4 + (a[8] + a[9] * h) * h8) - a[10] * (h2 * h8))


@inlined
def _slope(a, sign, h):
    """Return the slope of that polynomial at h."""
    h2 = h * h
    h4 = h2 * h2
    low = (a[1] + 2.0 * a[2] * h) + (3.0 * a[3] + 4.0 * a[4] * h) * h2
    high = (5.0 * a[5] + 6.0 * a[6] * h) + (7.0 * a[7] + 8.0 * a[8] * h) * h2
    return sign * (low + (high + 9.0 * a[9] * h4) * h4) - 10.0 * a[10] * (h * h4 * h4)


@inlined
def shift(a, sign, h, shifted):
    """Set the coefficients of the lower polynomial of sign motion from h on, by powers of the time since.

    The last one stays a bound. Returns its value at h less that at 0.
    """
    for p in range(DEGREE):
        shifted[p] = sign * a[p]
    shifted[0], shifted[DEGREE] = 0.0, -a[DEGREE]
    for low in range(DEGREE):
        for p in range(DEGREE - 1, low - 1, -1):
            shifted[p] += h * shifted[p + 1]
    shifted[DEGREE] = a[DEGREE]
    return shifted[0]


@inlined
def _bounds(a, sign, f, h):
    """Return bounds of the polynomial with f for its constant term on [0, h], apart from its values at both ends.

    They are the least and the largest of its other coefficients in Bernstein's basis on [0, h] (Farouki 2012): sums of
    its terms at h by Pascal's triangle. The remainder, of the last power, is in none of them.
    """
    h2 = h * h
    h3, h4 = h2 * h, h2 * h2
    h5, h6, h7, h8 = h4 * h, h4 * h2, h4 * h3, h4 * h4
    b1, b2, b3 = sign * a[1] * h * (1 / 10), sign * a[2] * h2 * (1 / 45), sign * a[3] * h3 * (1 / 120)
    b4, b5, b6 = sign * a[4] * h4 * (1 / 210), sign * a[5] * h5 * (1 / 252), sign * a[6] * h6 * (1 / 210)
    b7, b8, b9 = sign * a[7] * h7 * (1 / 120), sign * a[8] * h8 * (1 / 45), sign * a[9] * (h8 * h) * (1 / 10)
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = b1 + f, b2 + b1, b3 + b2, b4 + b3, b5 + b4, b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b2, b3, b4, b5, b6, b7, b8, b9 = b2 + b1, b3 + b2, b4 + b3, b5 + b4, b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b3, b4, b5, b6, b7, b8, b9 = b3 + b2, b4 + b3, b5 + b4, b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b4, b5, b6, b7, b8, b9 = b4 + b3, b5 + b4, b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b5, b6, b7, b8, b9 = b5 + b4, b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b6, b7, b8, b9 = b6 + b5, b7 + b6, b8 + b7, b9 + b8
    b7, b8, b9 = b7 + b6, b8 + b7, b9 + b8
    b8, b9 = b8 + b7, b9 + b8
    b9 = b9 + b8
    least = min(min(min(b1, b2), min(b3, b4)), min(min(b5, b6), min(min(b7, b8), b9)))
    return least, max(max(max(b1, b2), max(b3, b4)), max(max(b5, b6), max(max(b7, b8), b9)))


@inlined
def _step_by_parabola(a, sign, f, h):
    """Return a step of at most h without root, with positive coefficients after the second taken as zero."""
    h2 = h * h
    h4 = h2 * h2
    c3, c4, c5, c6 = min(sign * a[3], 0.0), min(sign * a[4], 0.0), min(sign * a[5], 0.0), min(sign * a[6], 0.0)
    c7, c8, c9 = min(sign * a[7], 0.0), min(sign * a[8], 0.0), min(sign * a[9], 0.0)
    lowest = (c3 * h + (c4 + c5 * h) * h2) + ((c6 + c7 * h) + (c8 + c9 * h) * h2) * h4 - a[10] * (h4 * h4)
    return min(h, first_root_of_parabola(f, sign * a[1], 2.0 * (sign * a[2] + lowest)))


@kernel
def step_or_stop(expansion, sign, k0, k0_far, noise, second, calm, fast, longest, shortest):
    """Return a safe step from a point of an event function k0 + sign motion, and whether its root is at the end.

    The third value returned: whether k0_far - sign motion has no root on the step either; False is not known.
    expansion, noise, second, calm, fast: of the motion, as set and returned by `expand`.
    """
    whole, slow = expansion.taylor[0], expansion.taylor[1]
    noise += SUM_ROUND_OFF * abs(k0)
    f, slope, bend = k0 + sign * whole[0], sign * whole[1], sign * whole[2]
    if f <= noise:
        if slope < 0.0 or (slope <= second * shortest and bend < 0.0):
            return 0.0, True, False
        f = 0.0
    longest = max(longest, shortest)
    far = 0.0
    if calm >= 0.0:
        above = k0 + sign * slow[0] - fast
        if above > noise:
            far, _, _ = safe_step(slow, sign, above, 0.0, 0.0, calm, longest)
            if far >= longest:
                return far, False, False
    step, is_root, clear = safe_step(whole, sign, f, max(k0_far - sign * whole[0], 0.0), noise, second, longest)
    if far > step:
        return far, False, False
    if calm >= 0.0 and far == 0.0 and not is_root and shortest < step < longest:
        # the slow motion has left the fast one behind by then
        above = k0 + sign * slow[0] - fast + shift(slow, sign, step, expansion.shifted)
        if above > noise:
            far, _, _ = safe_step(expansion.shifted, 1.0, above, 0.0, 0.0, calm, longest - step)
            return step + far, False, False
    if step < shortest:
        falls = slope < 0.0 and f <= 2.0 * shortest * (second * shortest - slope)
        return (0.0, True, False) if falls else (shortest, False, False)
    return step, is_root, clear


@kernel
def safe_step(a, sign, f, far, noise, second, longest):
    """Return a step without root of f + sign (motion - its value), f >= 0, whether a root follows, and of the other.

    a: Taylor polynomial of the motion (`expand`). A root follows at the end of the step if the remainder of the
    polynomial there is below the round-off. The third value returned: whether far - sign (motion - its value), far >= 0
    and rising, has no root on the step either; False is not known.
    """
    slope = sign * a[1]
    if f + longest * (slope - 0.5 * second * longest) > 0.0:
        return longest, False, False
    reach, top = longest, f + far - noise if slope < 0.0 else 0.0
    if a[DEGREE] > 0.0:
        reach = min(longest, _REACH * eighth_root_of_ratio(second * _OVER_FACTORIAL[DEGREE], a[DEGREE]))
    positive, clear = _without_root(a, sign, f, reach, noise, top)
    if positive:
        return reach, False, clear
    root, sharp = _root_of_polynomial(a, sign, f, reach, noise)
    if sharp:
        least, most = _bounds(a, sign, f, root)
        if least > noise:
            return root, True, most <= top
    # short of the lower polynomial's root: from there the function's own is seen
    h = root * (1.0 - 0.1 * NEAR_ROOT)
    positive, clear = _without_root(a, sign, f, h, noise, top)
    if positive:
        return h, False, clear
    # the best of the parabolas below it: over the rest of the reach, and beyond its own minimum. Where they come down
    # to round-off it may touch zero
    best, h, f = 0.0, reach, max(f - noise, 0.0)
    if slope < 0.0 < sign * a[2] and -2.0 * slope < sign * a[2] * reach:
        best = _step_by_parabola(a, sign, f, -2.0 * a[1] / a[2])
    for _ in range(12):
        if h <= best:
            break
        best = max(best, _step_by_parabola(a, sign, f, h))
        h *= 0.5
    return best, False, False


@inlined
def _root_of_polynomial(a, sign, f, reach, noise):
    """Return the lower polynomial's first root on [0, reach], and whether it is the function's; otherwise about it."""
    root = min(reach, first_root_of_parabola(f, sign * a[1], 2.0 * sign * a[2]))
    for _ in range(8):
        if root <= 0.0:
            break
        falls = _slope(a, sign, root)
        if falls >= 0.0:
            break
        change = -_value(a, sign, f, root) / falls
        better = root + change
        if not 0.0 < better <= reach:
            break
        root = better
        if abs(change) < NEAR_ROOT * root:
            if _remainder(a, root) > noise:
                break
            if abs(change) < AT_ROOT * root:
                return root, True
    return root, False


@inlined
def eighth_root_of_ratio(x, y):
    """Return (x/y)^(1/8) of positive numbers to 7 percent, without a division or a root.

    The bits of doubles are their logarithms, linear between powers of two.
    """
    eighth = (np.float64(x).view(np.int64) - np.float64(y).view(np.int64)) >> 3
    return np.int64(eighth + (1023 << 52)).view(np.float64)


@inlined
def _without_root(a, sign, f, h, noise, top):
    """Return whether the lower polynomial is positive on [0, h], and whether the motion provably stays below the top.

    noise: where the polynomial's bounds are below it, nothing is known.
    """
    end = _value(a, sign, f, h)
    if end < 0.0:
        return False, False
    least, most = _bounds(a, sign, f, h)
    return least > noise, max(most, end + 2.0 * _remainder(a, h)) <= top


@inlined
def _remainder(a, h):
    """Return the bound of the polynomial's remainder at h."""
    h2 = h * h
    h4 = h2 * h2
    return a[DEGREE] * (h4 * h4 * h2)
