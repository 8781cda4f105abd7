"""Exponentials without cancellation: exp(z) - 1, exp(z) - 1 - z, and the growth of a driven mode."""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.jit import inlined, kernel


@inlined
def exp_minus_one(z):
    """Return exp(z) - 1 of a complex number with full relative accuracy, Re z <= 0."""
    sine, cosine = math.sin(0.5 * z.imag), math.cos(0.5 * z.imag)
    turn = 2.0 * sine * sine
    if z.real == 0.0:
        return complex(-turn, 2.0 * sine * cosine)
    growth = math.expm1(z.real)
    return complex(growth * (1.0 - turn) - turn, (1.0 + growth) * 2.0 * sine * cosine)


@inlined
def exp_minus_line(z, first):
    """Return exp(z) - 1 - z given first = exp(z) - 1, with full relative accuracy."""
    x, y = z.real, z.imag
    if abs(x) + abs(y) > 0.25:
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
