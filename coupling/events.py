"""Guaranteed search for the first root of an event function.

Event functions are  k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t)  with Re lambda_j <= 0, and positive until the
event. Their second and third derivatives are bounded over all later times by sums of |g_j| |lambda_j|^k, so from the
function and its slope follows a step that provably holds no root. Steps by the bound converge to the root from before
it, quadratically like Newton's method where the function falls, and at a geometric rate at a double root: no event can
be missed, and none is found twice.
"""

from __future__ import annotations

import math

import numpy as np

from coupling.compiled import kernel

# how often the exponentials of a function are differentiated: what is left of exp(z) at t = 0
POSITION, VELOCITY, FORCE = 2, 1, 0


@kernel
def exp_minus_one(z):
    """exp(z) - 1 of a complex number with full relative accuracy, Re z <= 0."""
    growth = math.expm1(z.real)
    sine, cosine = math.sin(0.5 * z.imag), math.cos(0.5 * z.imag)
    turn = 2.0 * sine * sine
    return complex(growth * (1.0 - turn) - turn, (1.0 + growth) * 2.0 * sine * cosine)


@kernel
def exp_minus_line(z, first):
    """exp(z) - 1 - z given first = exp(z) - 1, with full relative accuracy."""
    if abs(z.real) + abs(z.imag) > 0.25:
        return first - z
    # Taylor series by Horner, 12 terms: z^13/15! < 1e-20 at |z| = 0.25
    total = 1.0 + z / 14.0
    for k in range(13, 2, -1):
        total = 1.0 + total * z / k
    return 0.5 * z * z * total


@kernel
def first_root_of_parabola(f, slope, curvature):
    """Smallest s >= 0 with f + slope s + curvature s^2/2 = 0 for f >= 0; inf if there is none."""
    if f == 0.0 and slope < 0.0:
        return 0.0
    square = slope * slope - 2.0 * curvature * f
    if curvature < 0.0:
        return (slope + math.sqrt(square)) / -curvature if slope >= 0.0 else 2.0 * f / (math.sqrt(square) - slope)
    if slope >= 0.0 or square < 0.0:
        return math.inf
    return 2.0 * f / (math.sqrt(square) - slope)


@kernel
def safe_step(f, slope, curvature, second, third, longest):
    """A step without root: f >= 0, its slope and curvature here, bounds of |f''| and |f'''| from here on."""
    if third == 0.0:
        return first_root_of_parabola(f, slope, curvature)
    step = first_root_of_parabola(f, slope, -second)
    if slope >= 0.0 and curvature > 0.0:
        # f >= curvature s^2/2 - third s^3/6 > 0 on this side of 3 curvature/third
        step = max(step, 2.99 * curvature / third)
    if step >= longest:
        return step
    trial = 4.0 * step
    for _ in range(3):
        trial = min(trial, longest)
        # the curvature stays above this on [0, trial]
        lowest = max(curvature - third * trial, -second)
        found = min(first_root_of_parabola(f, slope, lowest), trial)
        if found <= step:
            break
        step = found
        trial = 1.5 * found
    return step


@kernel
def evaluate(order, k0, k1, k2, g, eigenvalue, awake, t):
    """Value, slope, curvature and round-off of an event function at time t.

    order POSITION: exponentials as exp(z) - 1 - z, so that k0 and k1 are value and slope at zero exactly; VELOCITY:
    exp(z) - 1 with k0 the value and k1 the constant slope; FORCE: exp(z), k0 alone.
    """
    value, slope, curvature = k0, k1, k2
    noise = abs(k0)
    if order == POSITION:
        value += t * (k1 + 0.5 * k2 * t)
        slope += k2 * t
        noise += abs(k1 * t) + abs(k2 * t * t)
    elif order == VELOCITY:
        value += k1 * t
        noise += abs(k1 * t)
    for a in range(len(awake)):
        j = awake[a]
        rate, amplitude = eigenvalue[j], g[j]
        z = rate * t
        first = exp_minus_one(z)
        whole = rate * amplitude * (first + 1.0)
        if order == POSITION:
            part = amplitude * exp_minus_line(z, first)
            value += part.real
            slope += (rate * amplitude * first).real
            curvature += (rate * whole).real
        else:
            part = amplitude * (first if order == VELOCITY else first + 1.0)
            value += part.real
            slope += whole.real
            curvature += (rate * whole).real
        noise += abs(part.real) + abs(part.imag)
    return value, slope, curvature, 4.0 * np.finfo(np.float64).eps * noise


@kernel
def bounds(order, k2, g, eigenvalue, awake):
    """Bounds of the second and third derivative of an event function over all later times."""
    second = abs(k2) if order == POSITION else 0.0
    third = 0.0
    for a in range(len(awake)):
        j = awake[a]
        rate = math.hypot(eigenvalue[j].real, eigenvalue[j].imag)
        size = math.hypot(g[j].real, g[j].imag) * rate * rate
        second += size
        third += size * rate
    return second, third
