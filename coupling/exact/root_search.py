"""Guaranteed search for the first root of an event function.

Event functions are  k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t)  with Re lambda_j <= 0, and positive until the
event. With the exponentials at a point come all derivatives there, and bounds of the derivatives at all later times:
the sums of |g_j exp(lambda_j t)| |lambda_j|^p. The function stays above its Taylor polynomial less the bound of its
remainder: a step that ends before the first root of this lower polynomial provably holds no root. Steps are as long as
a few radians of the fastest motion, and where the remainder is round-off the polynomial's root is the function's. No
event can be missed, and none is found twice. A double root is approached at a geometric rate.

Modes that the excitation drives at their own frequency add terms in D(t) (exact.subsystem_assembly), bounded over two
periods.
"""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.codes import FORCE, POSITION, VELOCITY
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular, secular_bound
from vanedamp.coupling.numerics.jit import inlined, kernel

#: degree of the lower polynomial; its last coefficient is that of the bound
DEGREE = 10
_OVER_FACTORIAL = tuple(1.0 / math.factorial(p) for p in range(DEGREE + 1))

# round-off of a sum, relative to the sum of its terms' sizes
_ROUND_OFF = 4.0 * 2.0**-52
# a step that long, in units of (second bound / last bound)^(1 / (DEGREE - 2)), leaves out a few thousandths
_REACH = 3.0
# modes faster than this times the first, squared, are fast
_FAST = 4.0
# Newton's iteration: a correction below this share leaves an error of its square
_CONVERGED = 1e-8


@kernel
def add_secular(order, drive, driven, eigenvalue, t, period, lower):
    """Add Re sum_j drive_j D_j(t) to the lower polynomials of `expand`.

    drive: (m,) of the modes from driven[h] to driven[h + 1], which harmonic h drives. Returns the round-off and a bound
    of the second derivative.
    """
    whole, slow, noise, second = lower[0], lower[1], 0.0, 0.0
    for h in range(len(driven) - 1):
        excitation = eigenvalue[h]
        first = exp_minus_one(excitation * t)
        for j in range(driven[h], driven[h + 1]):
            d, rate = drive[j], eigenvalue[j]
            growth, beyond = secular(rate, excitation, t)
            # derivatives by D' = lambda D + exp(i omega t)
            now, turn = d * growth, d * (1.0 + first)
            part, slope = now, rate * now + turn
            if order == POSITION:
                part, slope = d * beyond, rate * now + d * first
            noise += abs(part.real) + abs(part.imag) + abs(now.real) + abs(now.imag)
            for polynomial in (whole, slow):
                polynomial[0] += part.real
                polynomial[1] += slope.real
            now = rate * now + turn
            for p in range(2, DEGREE):
                turn *= excitation
                now = rate * now + turn
                for polynomial in (whole, slow):
                    polynomial[p] += now.real * _OVER_FACTORIAL[p]
            left_out = secular_bound(d, rate, excitation, period, DEGREE) * _OVER_FACTORIAL[DEGREE]
            for polynomial in (whole, slow):
                polynomial[DEGREE] -= left_out
            second += secular_bound(d, rate, excitation, period, 2)
    return _ROUND_OFF * noise, second


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
def expand(order, k0, k1, k2, g, eigenvalue, count, t, lower):
    """Set the lower polynomials (2, DEGREE + 1) of an event function from time t on, by powers of the time since.

    The first is that of all modes; in the second, those much faster than the first mode count as if they were at their
    lowest all the time: less sharp close to a root, but good for long steps far from it.
    Returns the round-off of the value, a bound of the second derivative, and that of the slow modes (-1: all are).
    order POSITION: exponentials as exp(z) - 1 - z, so that k0 and k1 are value and slope at zero exactly; VELOCITY:
    exp(z) - 1 with k0 the value and k1 the constant slope; FORCE: exp(z), k0 only.
    """
    value, slope, noise = k0, k1, abs(k0)
    whole, slow = lower[0], lower[1]
    for p in range(2, DEGREE + 1):
        whole[p], slow[p] = 0.0, 0.0
    second, last, fast_value, fast_slope, fast_second, fast_last = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    limit = _FAST * (eigenvalue[0].real * eigenvalue[0].real + eigenvalue[0].imag * eigenvalue[0].imag)
    if order == POSITION:
        value += t * (k1 + 0.5 * k2 * t)
        slope += k2 * t
        noise += abs(k1 * t) + abs(k2 * t * t)
        slow[2], second = k2, abs(k2)
    elif order == VELOCITY:
        value += k1 * t
        noise += abs(k1 * t)
    for j in range(count):
        rate, amplitude = eigenvalue[j], g[j]
        x, y, u, v = rate.real, rate.imag, amplitude.real, amplitude.imag
        if t > 0.0:
            z = complex(x * t, y * t)
            first = exp_minus_one(z)
            du, dv = u * first.real - v * first.imag, u * first.imag + v * first.real
            if order == POSITION:
                line = exp_minus_line(z, first)
                part, other = u * line.real - v * line.imag, u * line.imag + v * line.real
                slope += x * du - y * dv
            elif order == VELOCITY:
                part, other = du, dv
            else:
                part, other = u + du, v + dv
            value += part
            noise += abs(part) + abs(other)
            u += du
            v += dv
        elif order == FORCE:
            value += u
            noise += abs(u) + abs(v)
        # derivatives of Re exp(lambda t) obey the recurrence of the characteristic polynomial
        twice, square = 2.0 * x, x * x + y * y
        before, now = u, x * u - y * v
        if order != POSITION:
            slope += now
        size = (abs(u) + abs(v)) * square
        if square <= limit:
            for p in range(2, DEGREE):
                before, now = now, twice * now - square * before
                slow[p] += now
            second += size
            last += size * (square * square) * (square * square)
        else:
            fast_value += u + abs(u) + abs(v)
            fast_slope += now
            for p in range(2, DEGREE):
                before, now = now, twice * now - square * before
                whole[p] += now
            fast_second += size
            fast_last += size * (square * square) * (square * square)
    slow[DEGREE], whole[DEGREE] = -last, -fast_last
    for p in range(2, DEGREE + 1):
        slow[p] *= _OVER_FACTORIAL[p]
        whole[p] = slow[p] + whole[p] * _OVER_FACTORIAL[p]
    whole[0], whole[1] = value, slope
    slow[0], slow[1] = value - fast_value, slope - fast_slope
    return _ROUND_OFF * noise, second + fast_second, second if fast_second > 0.0 else -1.0


@inlined
def _value_and_slope(a, h):
    value, slope = a[DEGREE], 0.0
    for p in range(DEGREE - 1, -1, -1):
        slope = slope * h + value
        value = value * h + a[p]
    return value, slope


@inlined
def _stays_above(a, f, h):
    """Whether the polynomial with f for its constant term has no root on [0, h), given that it is not negative at h.

    It is the chord from 0 to h less s (h - s) times its second divided difference over 0, h and s, which must not
    exceed f/h^2: exact for parabolas.
    """
    total = 0.0
    for p in range(DEGREE, 1, -1):
        total = total * h + (a[p] * (p - 1.0) if a[p] > 0.0 else a[p])
    return total * h * h <= f


@inlined
def _step_by_parabola(a, f, h):
    """Return a step of at most h without root, with positive coefficients after the second taken as zero."""
    lowest = 0.0
    for p in range(DEGREE, 2, -1):
        lowest = (lowest + min(a[p], 0.0)) * h
    return min(h, first_root_of_parabola(f, a[1], 2.0 * (a[2] + lowest)))


@kernel
def safe_step(a, f, noise, second, longest):
    """Return a step without root from the start of a lower polynomial of value f >= 0, and whether a root follows.

    A root follows at the end of the step if the remainder of the polynomial there is below the round-off.
    """
    if f + longest * (a[1] - 0.5 * second * longest) > 0.0:
        return longest, False
    reach = longest
    if a[DEGREE] < 0.0:
        eighth = second * _OVER_FACTORIAL[DEGREE] / -a[DEGREE]
        reach = min(longest, _REACH * math.sqrt(math.sqrt(math.sqrt(eighth))))
    end, _ = _value_and_slope(a, reach)
    if end >= 0.0 and (_stays_above(a, f, reach) or _step_by_parabola(a, f, reach) >= reach):
        return reach, False
    root = min(reach, first_root_of_parabola(f, a[1], 2.0 * a[2]))
    for _ in range(8):
        if root <= 0.0:
            break
        value, slope = _value_and_slope(a, root)
        value += f - a[0]
        if slope >= 0.0:
            break
        change = -value / slope
        better = root + change
        if not 0.0 < better <= reach:
            break
        root = better
        if abs(change) < _CONVERGED * root:
            left_out = -a[DEGREE]
            for _ in range(DEGREE):
                left_out *= root
            if left_out <= noise and _stays_above(a, f, root):
                return root, True
            break
        if abs(change) < 1e-3 * root:
            left_out = -a[DEGREE]
            for _ in range(DEGREE):
                left_out *= root
            if left_out > noise:
                break
    # short of the lower polynomial's root: from there the function's own is seen
    h = root * (1.0 - 1e-5)
    value, _ = _value_and_slope(a, h)
    if value + f - a[0] >= 0.0 and _stays_above(a, f, h):
        return h, False
    # the best of the parabolas below it: over the rest of the reach, and beyond its own minimum
    best, h = 0.0, reach
    if a[1] < 0.0 < a[2] and -2.0 * a[1] < a[2] * reach:
        best = _step_by_parabola(a, f, -2.0 * a[1] / a[2])
    for _ in range(12):
        if h <= best:
            break
        best = max(best, _step_by_parabola(a, f, h))
        h *= 0.5
    return best, False
