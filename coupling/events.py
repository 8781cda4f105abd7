"""Guaranteed search for the first root of an event function.

Event functions are  k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t)  with Re lambda_j <= 0, and positive until the
event. Their second and third derivatives are bounded over all later times by sums of |g_j| |lambda_j|^k, so from the
function and its slope follows a step that provably holds no root. Steps by the bound converge to the root from before
it, quadratically like Newton's method where the function falls, and at a geometric rate at a double root: no event can
be missed, and none is found twice.
"""

from __future__ import annotations

import math

from coupling.compiled import inlined

# how often the exponentials of a function are differentiated: what is left of exp(z) at t = 0
POSITION, VELOCITY, FORCE = 2, 1, 0


# round-off of a sum, relative to the sum of its terms' sizes
_ROUND_OFF = 4.0 * 2.0**-52


@inlined
def exp_minus_one(z):
    """exp(z) - 1 of a complex number with full relative accuracy, Re z <= 0."""
    sine, cosine = math.sin(0.5 * z.imag), math.cos(0.5 * z.imag)
    turn = 2.0 * sine * sine
    if z.real == 0.0:
        return complex(-turn, 2.0 * sine * cosine)
    growth = math.expm1(z.real)
    return complex(growth * (1.0 - turn) - turn, (1.0 + growth) * 2.0 * sine * cosine)


@inlined
def exp_minus_line(z, first):
    """exp(z) - 1 - z given first = exp(z) - 1, with full relative accuracy."""
    x, y = z.real, z.imag
    if abs(x) + abs(y) > 0.25:
        return first - z
    # Taylor series of 1 - cos y, sin y - y and e^x - 1 - x; what is left out is below 1e-16 of them
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


@inlined
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


@inlined
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
        speed = rate * amplitude
        z = rate * t
        first = exp_minus_one(z)
        change = speed * first
        whole = speed + change
        curvature += rate.real * whole.real - rate.imag * whole.imag
        if order == POSITION:
            part = amplitude * exp_minus_line(z, first)
            slope += change.real
        else:
            part = amplitude * (first if order == VELOCITY else first + 1.0)
            slope += whole.real
        value += part.real
        noise += abs(part.real) + abs(part.imag)
    return value, slope, curvature, _ROUND_OFF * noise


@inlined
def bounds(order, k2, g, eigenvalue, awake):
    """Bounds of the second and third derivative of an event function over all later times."""
    second = abs(k2) if order == POSITION else 0.0
    third = 0.0
    for a in range(len(awake)):
        j = awake[a]
        rate, amplitude = eigenvalue[j], g[j]
        square = rate.real * rate.real + rate.imag * rate.imag
        size = math.sqrt(amplitude.real * amplitude.real + amplitude.imag * amplitude.imag) * square
        second += size
        third += size * math.sqrt(square)
    return second, third
