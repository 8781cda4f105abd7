"""The largest response of a segment: a grid finds its maxima with a guarantee, Newton's method refines them."""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.codes import ACTIVE
from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import exp_minus_one, secular, secular_bound, whole_vectors
from vanedamp.coupling.numerics.tolerances import PEAK

#: grids of peaks, by steps of an eighth of a period, half of that, and so on, whose factors are stored
GRIDS = 5


@kernel
def set_grid_factors(flows, s, m, period):
    """Set the factors of the modes of a flow over a step of each grid."""
    step = 0.125 * period
    for level in range(GRIDS):
        for j in range(m):
            flows.grid_factor[s, level, j] = exp_minus_one(flows.eigenvalue[s, j] * step) + 1.0
        step *= 0.5


@inlined
def highest(system, flows, st, scratch, s, response, tau, constant, grows, peak, side):
    """Return the largest |response| on [0, tau] and before; side 1: of the response, -1: of its negative.

    response: functional (m,) of the amplitudes; constant: its constant part; grows: factor by which a mode may grow
    within tau, 1 for those that decay.

    Between points of a grid the response differs from its cubic Hermite interpolant by at most (bound of the fourth
    derivative) h^4/384: the grid keeps this below 1e-3 of the response, and each maximum found is refined by Newton.
    Where interpolant and bound stay below the peak so far there is nothing to find.
    """
    count = whole_vectors(st.counters[ACTIVE], len(st.amplitude))
    x0, v0, x1, v1, size, fourth = _ends(response, flows.eigenvalue[s], st.amplitude, scratch.gain, scratch.wave, count)
    x0, x1, size, fourth = constant + x0, constant + x1, abs(constant) + size * grows, fourth * grows
    e = flows.driven.shape[1] - 1
    if flows.driven[s, e] > e:
        more = _set_drive(
            flows.eigenvalue[s], response, flows.driven[s], flows.load[s], st.amplitude, scratch.gain, system.period,
            scratch.drive,
        )  # fmt: skip
        v0, v1, size, fourth = v0 + more[0], v1 + more[1], size + more[2] * tau, fourth + more[3]
    if size <= peak or tau <= 0.0:
        return peak
    peak = max(peak, _height(x0, side), _height(x1, side))
    if not may_exceed(peak, side, x0, v0, x1, v1, tau, fourth):
        return peak
    h, level = 0.125 * system.period, ZERO
    while level < GRIDS and fourth * min(h, tau) ** 4 > 0.384 * size:
        h, level = 0.5 * h, level + 1
    if level < GRIDS:
        turns, pieces = flows.grid_factor[s, level], math.ceil(tau / h)
    else:
        turns, pieces = scratch.step_factor, min(math.ceil(tau * math.sqrt(math.sqrt(fourth / (0.384 * size)))), 4096)
        h = tau / pieces
        for j in range(count):
            turns[j] = exp_minus_one(flows.eigenvalue[s, j] * h) + 1.0
    return _search_grid(
        flows.eigenvalue[s, :count], scratch.wave, scratch.ahead, turns, flows.driven[s], scratch.drive, scratch.growth,
        constant, x0, v0, x1, v1, tau, h, pieces, fourth, peak, side,
    )  # fmt: skip


@summing
def _ends(response, eigenvalue, amplitude, gain, waves, count):
    """Set each mode's part of the response. Return response and speed of the modes at both ends, and bounds.

    The bounds are those of the response and of its fourth derivative.
    """
    x0, v0, x1, v1, size, fourth = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        rate, wave = eigenvalue[j], response[j] * amplitude[j]
        waves[j] = wave
        square = rate.real * rate.real + rate.imag * rate.imag
        modulus = math.sqrt(wave.real * wave.real + wave.imag * wave.imag)
        fourth += modulus * (square * square)
        size += modulus
        x0 += wave.real
        v0 += rate.real * wave.real - rate.imag * wave.imag
        wave += response[j] * gain[j]
        x1 += wave.real
        v1 += rate.real * wave.real - rate.imag * wave.imag
    return x0, v0, x1, v1, size, fourth


@kernel
def _set_drive(eigenvalue, response, driven, load, phase, change, period, drive):
    """Set the part of the response in the growth of driven modes, drive, 1/s.

    Returns its terms in the speed at both ends and in the bounds of the response, by time, and fourth derivative.
    """
    v0, v1, size, fourth = 0.0, 0.0, 0.0, 0.0
    for h in range(len(driven) - 1):
        for j in range(driven[h], driven[h + 1]):
            drive[j] = response[j] * load[j] * phase[h]
            v0 += drive[j].real
            v1 += (response[j] * load[j] * (phase[h] + change[h])).real
            size += abs(drive[j].real) + abs(drive[j].imag)
            fourth += secular_bound(drive[j], eigenvalue[j], eigenvalue[h], period, 4)
    return v0, v1, size, fourth


@inlined
def _search_grid(
    rates, waves, ahead, turns, driven, drives, growths, constant, x0, v0, x1, v1, tau, h, pieces, fourth, peak, side
):
    """Return the largest height of the response on a grid of steps of length h, the last one shorter, and before."""
    e = len(driven) - 1
    for k in range(e):
        for j in range(driven[k], driven[k + 1]):
            growths[j], _ = secular(rates[j], rates[k], h)
    end, end_slope = x1, v1
    for i in range(pieces):
        if i == pieces - 1:
            x1, v1, h = end, end_slope, tau - i * h
        else:
            x1, v1 = _next_point(rates, waves, ahead, turns, constant)
            for k in range(e):
                for j in range(driven[k], driven[k + 1]):
                    ahead[j] += drives[j] * growths[j]
                    x1 += (drives[j] * growths[j]).real
                    v1 += (drives[j] * (rates[j] * growths[j] + turns[k])).real
            peak = max(peak, _height(x1, side))
        if v0 * v1 < 0.0 and may_exceed(peak, side, x0, v0, x1, v1, h, fourth):
            top = _extremum(rates, waves, driven, drives, constant, x0, v0, x1, v1, h)
            peak = max(peak, _height(top, side))
        x0, v0 = x1, v1
        waves, ahead = ahead, waves
        for k in range(e):
            for j in range(driven[k], driven[k + 1]):
                drives[j] *= turns[k]
    return peak


@summing
def _next_point(rates, waves, ahead, turns, constant):
    """Set the modes' parts of the response a step of the grid ahead. Return response and speed there."""
    x, v = constant, 0.0
    for j in range(len(rates)):
        wave, rate = waves[j] * turns[j], rates[j]
        ahead[j] = wave
        x += wave.real
        v += rate.real * wave.real - rate.imag * wave.imag
    return x, v


@inlined
def _height(x, side):
    """Return |x|; side 1: x, -1: -x."""
    return abs(x) if side == 0.0 else side * x


@inlined
def may_exceed(peak, side, x0, v0, x1, v1, h, fourth):
    """Whether the height of x may exceed peak within [0, h]: cubic interpolant of the ends and bound of its error."""
    room = peak - fourth * h * h * h * h * (1 / 384)
    # the interpolant's basis functions of the slopes stay below 4/27 h
    rise = max(x0, x1) + (4 / 27) * h * (max(v0, 0.0) + max(-v1, 0.0))
    fall = min(x0, x1) + (4 / 27) * h * (min(v0, 0.0) + min(-v1, 0.0))
    return (side >= 0.0 and rise > room) or (side <= 0.0 and -fall > room)


@kernel
def _extremum(rates, waves, driven, drives, constant, x0, v0, x1, v1, h):
    """Return x where its slope vanishes within [0, h], v0 and v1 of opposite sign: Newton from the interpolant."""
    # slope v0 + b u + c u^2, u = t/h; the root on [0, 1] by the formula that does not cancel
    b = 6.0 * (x1 - x0) / h - 4.0 * v0 - 2.0 * v1
    c = 3.0 * (v0 + v1) - 6.0 * (x1 - x0) / h
    root = math.sqrt(max(b * b - 4.0 * c * v0, 0.0))
    lo, hi = 0.0, h
    t = (
        h * (-2.0 * v0 / (b + math.copysign(root, b)))
        if b * v0 < 0.0
        else h * (-b - math.copysign(root, v0)) / (2.0 * c)
    )
    if not lo < t < hi:
        t = h * v0 / (v0 - v1)
    x = x0
    for _ in range(8):
        x, v, w, third, fourth, fifth, sixth = _derivatives(rates, waves, constant, t)
        for k in range(len(driven) - 1):
            excitation = rates[k]
            for j in range(driven[k], driven[k + 1]):
                rate = rates[j]
                growth, _ = secular(rate, excitation, t)
                term, turn = drives[j] * growth, drives[j] * (1.0 + exp_minus_one(excitation * t))
                x += term.real
                term, turn = rate * term + turn, excitation * turn
                v += term.real
                term, turn = rate * term + turn, excitation * turn
                w += term.real
                term, turn = rate * term + turn, excitation * turn
                third += term.real
                term, turn = rate * term + turn, excitation * turn
                fourth += term.real
                term = rate * term + turn
                fifth += term.real
                sixth += secular_bound(drives[j], rate, excitation, 2.0 * math.pi / rates[0].imag, 6)
        if v * v0 > 0.0:
            lo = t
        else:
            hi = t
        step = -v / w if w != 0.0 else math.inf
        for _ in range(2):
            slope = v + step * (w + step * (third / 2 + step * (fourth / 6 + step * fifth / 24)))
            step -= slope / (w + step * (third + step * (fourth / 2 + step * fifth / 6)))
        if lo <= t + step <= hi:
            top = x + step * (v + step * (w / 2 + step * (third / 6 + step * (fourth / 24 + step * fifth / 120))))
            square = step * step
            # x has no slope there: a step that is wrong by its square root leaves its digits
            if sixth * square * square * square < PEAK * abs(top):
                return top
            t += step
        else:
            t = 0.5 * (lo + hi)
    return x


@summing
def _derivatives(rates, waves, constant, t):
    """Return the response of the modes and its derivatives after a time t, and a bound of the sixth.

    By the recurrence of the modes' characteristic polynomials.
    """
    x, v, w, third, fourth, fifth, sixth = constant, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(rates)):
        rate, wave = rates[j], waves[j]
        term = wave + wave * exp_minus_one(rate * t)
        twice, square = 2.0 * rate.real, rate.real * rate.real + rate.imag * rate.imag
        d0, d1 = term.real, rate.real * term.real - rate.imag * term.imag
        d2 = twice * d1 - square * d0
        d3 = twice * d2 - square * d1
        d4 = twice * d3 - square * d2
        x, v, w, third, fourth = x + d0, v + d1, w + d2, third + d3, fourth + d4
        fifth += twice * d4 - square * d3
        sixth += (abs(term.real) + abs(term.imag)) * (square * square * square)
    return x, v, w, third, fourth, fifth, sixth
