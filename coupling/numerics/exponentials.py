"""Exponentials without cancellation: exp(z) - 1, exp(z) - 1 - z, and the growth of a driven mode.

They have no branch and call nothing, so that a loop over modes takes several at once. Polynomials of sine and cosine:
fdlibm (Sun Microsystems, 1993); the reductions' error is below the round-off of z itself.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import inlined, kernel

# a sum with it has no digits behind the point left: it rounds to the nearest whole number
_TO_WHOLE = 1.5 * 2.0**52
# pi/2 and ln 2 in parts: their products with numbers of up to 23 digits are exact
_HALF_PI = tuple(float.fromhex(part) for part in ("0x1.921fb54p+0", "0x1.10b46118p-30", "0x1.313198a2e0370p-61"))
_LN_2 = tuple(float.fromhex(part) for part in ("0x1.62e42feep-1", "0x1.a39ef35793c76p-33"))
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
# exp(z) - 1 - z cancels below
_LONG = 0.25
# e^x is 0 or inf to doubles beyond
_LEAST, _MOST = -708.0, 709.0

#: modes that a processor takes at once
_LANES = 8


@inlined
def _power_of_two(k):
    """Return 2^k of a whole number k from -1022 to 1023, by its bits."""
    # with 2^52 + 1023 added, the last bits of the sum are those of the exponent
    return np.int64(np.float64(k + (2.0**52 + 1023.0)).view(np.int64) << 52).view(np.float64)


@inlined
def exp_minus_one(z):
    """Return exp(z) - 1 of a complex number with full relative accuracy."""
    # half the angle, as a multiple of pi/2 and a rest
    half = 0.5 * z.imag
    turns = (half * (2.0 / math.pi) + _TO_WHOLE) - _TO_WHOLE
    rest = ((half - turns * _HALF_PI[0]) - turns * _HALF_PI[1]) - turns * _HALF_PI[2]
    u = rest * rest
    w = u * u
    s = (_S1 + u * _S2) + w * ((_S3 + u * _S4) + w * (_S5 + u * _S6))
    s = rest + rest * (u * s)
    c = (_C1 + u * _C2) + w * ((_C3 + u * _C4) + w * (_C5 + u * _C6))
    top = 1.0 - 0.5 * u
    c = top + (((1.0 - top) - 0.5 * u) + w * c)
    quarter = turns - 4.0 * ((0.25 * turns + _TO_WHOLE) - _TO_WHOLE)  # -2 to 2
    odd = abs(quarter) == 1.0
    sine, cosine = (c if odd else s), (s if odd else c)
    sine = -sine if quarter < 0.0 or quarter == 2.0 else sine
    cosine = -cosine if quarter > 0.0 or quarter == -2.0 else cosine
    turn = 2.0 * sine * sine
    # e^x - 1 = 2^k (e^r - 1) + (2^k - 1)
    x = min(max(z.real, _LEAST), _MOST)
    k = (x * (1.0 / math.log(2.0)) + _TO_WHOLE) - _TO_WHOLE
    r = (x - k * _LN_2[0]) - k * _LN_2[1]
    u = r * r
    w = u * u
    tail = ((1 / 6 + r * (1 / 24)) + u * (1 / 120 + r * (1 / 720))) + w * (
        ((1 / 5040 + r * (1 / 40320)) + u * (1 / 362880 + r * (1 / 3628800)))
        + w * (1 / 39916800 + r * (1 / 479001600) + u * (1 / 6227020800))
    )
    scale = _power_of_two(k)
    growth = scale * (r + u * (0.5 + r * tail)) + (scale - 1.0)
    return complex(growth * (1.0 - turn) - turn, (1.0 + growth) * 2.0 * sine * cosine)


@inlined
def exp_minus_line(z, first):
    """Return exp(z) - 1 - z given first = exp(z) - 1, with full relative accuracy."""
    x, y = z.real, z.imag
    if abs(x) + abs(y) > _LONG:
        return first - z
    # Taylor series of 1 - cos y, sin y - y and e^x - 1 - x; the remainder is below 1e-16 of them
    u = y * y
    sine = 1.0 - u * (1 / 72) * (1.0 - u * (1 / 110) * (1.0 - u * (1 / 156)))
    sine = -(1 / 6) * y * u * (1.0 - u * (1 / 20) * (1.0 - u * (1 / 42) * sine))
    if x == 0.0:
        return complex(first.real, sine)
    versine = 1.0 - u * (1 / 56) * (1.0 - u * (1 / 90) * (1.0 - u * (1 / 132)))
    versine = 0.5 * u * (1.0 - u * (1 / 12) * (1.0 - u * (1 / 30) * versine))
    line = 1.0 + x * (1 / 8) * (1.0 + x * (1 / 9) * (1.0 + x * (1 / 10) * (1.0 + x * (1 / 11) * (1.0 + x * (1 / 12)))))
    line = 1.0 + x * (1 / 4) * (1.0 + x * (1 / 5) * (1.0 + x * (1 / 6) * (1.0 + x * (1 / 7) * line)))
    line = 0.5 * x * x * (1.0 + x * (1 / 3) * line)
    growth = x + line
    return complex(line - (1.0 + growth) * versine, sine + growth * (y + sine))


@inlined
def long_minus_line(z, first):
    """As `exp_minus_line`, where that does not cancel (`is_long`)."""
    return complex(first.real - z.real, first.imag - z.imag)


@inlined
def minus_one(z, first):
    """Return exp(z) - 1 given it: for callers that take one of these functions."""
    return first


@inlined
def is_long(eigenvalue, harmonics, count, t):
    """Whether exp(z) - 1 - z cancels for none of these modes over a time.

    harmonics: the first ones, which are no slower than the very first; the others are in order of their rates.
    """
    first, other = eigenvalue[0], eigenvalue[min(harmonics, count - 1)]
    return t * min(abs(first.real) + abs(first.imag), abs(other.real) + abs(other.imag)) > _LONG


@inlined
def whole_vectors(count, length):
    """Return the count of modes rounded up to whole vectors, within the arrays' length; the rest is zero.

    Turns that fill no vector are made one by one, and take as long as many vectors. Few modes stay few.
    """
    return count if count <= _LANES else min((count + _LANES - 1) // _LANES * _LANES, length)


@kernel
def secular(rate, excitation, t):
    """Return the growth D(t) = (exp(excitation t) - exp(rate t))/(excitation - rate) of a driven mode, and D(t) - t."""
    # D = t exp(excitation t) (1 + w), 1 + w = (exp(z) - 1)/z; |z| < 0.02: the remainder of the series is below 1e-16
    z = (rate - excitation) * t
    w = 1.0 + z * (1 / 4) * (1.0 + z * (1 / 5) * (1.0 + z * (1 / 6) * (1.0 + z * (1 / 7))))
    w = z * (1 / 2) * (1.0 + z * (1 / 3) * w)
    first = exp_minus_one(excitation * t)
    return t * (1.0 + first) * (1.0 + w), t * (first * (1.0 + w) + w)


@kernel
def secular_bound(drive, rate, excitation, period, p):
    """Return a bound of derivative p of drive D(t) over two periods: a step ends before the end of the next one."""
    fastest = math.sqrt(max(rate.real * rate.real + rate.imag * rate.imag, excitation.imag * excitation.imag))
    size = abs(drive.real) + abs(drive.imag)
    for _ in range(p - 1):
        size *= fastest
    return size * (p + 2.0 * fastest * period)
