"""Integrals of a segment by forms of the amplitudes (antiderivatives), and its peaks. Records as in either engine.

With c the amplitudes at the start of an interval and c + d at its end, the difference of a quadratic form Q is
d Q (2 c + d), which does not cancel. d is `change` of the state, 2 c + d `total` of the scratch space, by real and
imaginary parts.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.engine.peaks import highest
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    CALM,
    DIFFERENCE,
    FREE_MOMENTUM_MAP,
    HARMONIC_MAP,
    MEAN_MAP,
    MOMENTUM_MAP,
    PERIOD,
    SINGLE,
    WORK_MAP,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import exp_minus_one, secular, secular_bound
from vanedamp.coupling.numerics.tolerances import LAST_TERM, PIECE, SLOW
from vanedamp.coupling.response.records import CONTACT, EXCITATION, MOST_PIECES, VISCOUS

#: Gauss's rule on [-1, 1]: its error for a product of modes over a time 1/rate is below 1e-17
_NODES, _WEIGHTS = (tuple(part.tolist()) for part in np.polynomial.legendre.leggauss(8))
#: terms of the series for products with driven modes: the remainder is below 1e-16
_TERMS = 11


@inlined
def add_segment(system, flows, st, rec, scratch, s, period, tau, constant, grows):
    """Add slow pairs of modes, the constant part of the response, and the peak; grows: as in peaks.highest."""
    rec.square[period] += constant * constant * tau
    deflected = len(rec.swing) > 0
    if deflected:
        rec.swing[period, 2] += constant * tau
    for i in range(flows.slow_count[s]):
        if flows.slow[s, i, 2] == CALM:
            square, mean = _calm_integrals(flows, st, s, i, tau, constant)
            rec.square[period] += square
            if deflected:
                rec.swing[period, 2] += mean
            break
        _add_slow_pair(flows, st, rec, s, period, i, tau, constant)
    response = flows.response[s]
    if deflected:
        swing = rec.swing[period]
        _extremes(system, flows, st, scratch, s, response, tau, constant, grows, swing)
        rec.peak[period] = max(rec.peak[period], max(swing[0], -swing[1]))
    else:
        top = rec.peak[period]
        rec.peak[period] = highest(system, flows, st, scratch, s, response, tau, constant, grows, top, 0.0)
    if period >= rec.counted[0]:
        if rec.outputs.shape[1] > 0:
            _add_outputs(system, flows, st, rec, scratch, s, period, tau, grows)
        if rec.course.shape[0] > 0 and tau > 0.0:
            _note_course(system, flows, st, rec, scratch, s, period, tau, grows)


@kernel
def _highest(system, flows, st, scratch, s, response, tau, constant, grows, peak, side):
    """As `highest`, for all but the response itself."""
    return highest(system, flows, st, scratch, s, response, tau, constant, grows, peak, side)


@kernel
def _extremes(system, flows, st, scratch, s, response, tau, constant, grows, swing):
    """Record the largest and the smallest value of a functional in the segment."""
    for k in range(2):
        side = 1.0 - 2.0 * k
        swing[k] = side * _highest(system, flows, st, scratch, s, response, tau, constant, grows, side * swing[k], side)


@kernel
def _add_outputs(system, flows, st, rec, scratch, s, period, tau, grows):
    """Record largest values of the further outputs, or where bodies deflect the structure their swing and integral."""
    deflected, count = len(rec.swing) > 0, st.counters[ACTIVE]
    if deflected:
        _integrate_amplitudes(flows, st, scratch, s, tau, count)
    for k in range(rec.outputs.shape[1]):
        row, constant, output = flows.outputs[s, k], st.offset[1 + k], rec.outputs[period, k]
        if deflected:
            _extremes(system, flows, st, scratch, s, row, tau, constant, grows, output)
            output[2] += constant * tau + _real_part(row, scratch.total, count)
        else:
            output[0] = _highest(system, flows, st, scratch, s, row, tau, constant, grows, output[0], 0.0)


@kernel
def _note_course(system, flows, st, rec, scratch, s, period, tau, grows):
    """Write down the further outputs and their derivatives at the ends of pieces of the segment.

    A polynomial of degree 7 that has them at both ends of a piece of length h differs by at most (bound of the eighth
    derivative) h^8/(2^8 8!): the pieces keep this below PIECE of the outputs' size.
    """
    outputs, value, count, size, eighth = flows.outputs[s], scratch.wave, st.counters[ACTIVE], 0.0, 0.0
    for j in range(count):
        rate, c, reach = flows.eigenvalue[s, j], st.amplitude[j], 0.0
        for k in range(len(outputs)):
            reach += abs(outputs[k, j].real) + abs(outputs[k, j].imag)
        term, square = reach * (abs(c.real) + abs(c.imag)), rate.real * rate.real + rate.imag * rate.imag
        size += term
        eighth += term * square * square * square * square
        for h in range(flows.driven.shape[1] - 1):
            if flows.driven[s, h] <= j < flows.driven[s, h + 1]:
                drive = reach * flows.load[s, j] * st.amplitude[h]
                eighth += secular_bound(drive, rate, flows.eigenvalue[s, h], system.period, 8)
    most = 1 + int(tau / system.period * MOST_PIECES)
    wanted = tau * (grows * eighth / (PIECE * 10321920.0 * size)) ** 0.125 if size > 0.0 else 1.0
    pieces = max(math.ceil(wanted), 1) if wanted < most else most
    for i in range(pieces + 1):
        if i == 0 or i == pieces:
            for j in range(count):
                value[j] = st.amplitude[j] + (scratch.gain[j] if i > 0 else 0.0)
        else:
            _amplitudes_at(flows, st, s, i * tau / pieces, value, count)
        _note_outputs(flows, st, rec, s, value, count, period, tau / pieces if i < pieces else 0.0)


@kernel
def _note_outputs(flows, st, rec, s, value, count, period, ahead):
    """Write a row of the course, of amplitudes which are lost, and the time to the next row of the segment."""
    row, outputs = rec.course[rec.noted[0]], flows.outputs[s]
    rec.noted[0] += 1
    row[0], row[1] = period, ahead
    for d in range(4):
        entries = row[2 + d * len(outputs) :]
        for k in range(len(outputs)):
            total = st.offset[1 + k] if d == 0 else 0.0
            for j in range(count):
                total += outputs[k, j].real * value[j].real - outputs[k, j].imag * value[j].imag
            entries[k] = total
        for h in range(flows.driven.shape[1] - 1):  # c' = rate c + load phase
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                value[j] = flows.eigenvalue[s, j] * value[j] + flows.load[s, j] * value[h]
        for j in range(count):
            if not flows.driven[s, 0] <= j < flows.driven[s, flows.driven.shape[1] - 1]:
                value[j] *= flows.eigenvalue[s, j]


@kernel
def _integrate_amplitudes(flows, st, scratch, s, tau, count):
    """Set scratch.total to the integrals of the amplitudes over [0, tau], by real and imaginary parts in turns."""
    total = scratch.total
    for j in range(count):
        rate = flows.eigenvalue[s, j]
        slow = abs(rate) * tau < SLOW
        integral = st.amplitude[j] * _slow_integral(rate, tau) if slow else scratch.gain[j] / rate
        total[2 * j], total[2 * j + 1] = integral.real, integral.imag
    for h in range(flows.driven.shape[1] - 1):
        phase = complex(total[2 * h], total[2 * h + 1])
        for j in range(flows.driven[s, h], flows.driven[s, h + 1]):  # c' = rate c + load phase
            integral = (scratch.gain[j] - flows.load[s, j] * phase) / flows.eigenvalue[s, j]
            total[2 * j], total[2 * j + 1] = integral.real, integral.imag


@summing
def _real_part(row, parts, count):
    """Return the real part of a functional of complex numbers by their real and imaginary parts."""
    total = 0.0
    for j in range(count):
        total += row[j].real * parts[2 * j] - row[j].imag * parts[2 * j + 1]
    return total


@inlined
def add_forms(system, flows, st, rec, scratch, s, period, count):
    """Add energies, harmonic, mean square and momentum of the active modes, by their forms."""
    change, total = st.change, scratch.total
    if flows.uncoupled[s]:
        st.ledger[VISCOUS] += _uncoupled_form(flows.loss[s], change, total, len(system.frequency), count)
    else:
        st.ledger[VISCOUS] += quadratic_form(flows.loss[s], change, total, count)
    rec.square[period] += quadratic_form(flows.square[s], change, total, count)
    if flows.damped[s]:
        st.ledger[CONTACT] += quadratic_form(flows.dashpot[s], change, total, count)
    _linear_forms(system, flows, st, rec, scratch, s, period, count)


@summing
def quadratic_form(form, change, total, count):
    """Return change Q total for `count` complex numbers by their real and imaginary parts; Q (., .) is symmetric."""
    result = 0.0
    for j in range(count):
        row, other = form[2 * j], form[2 * j + 1]
        dr, di, tr, ti = change[2 * j], change[2 * j + 1], total[2 * j], total[2 * j + 1]
        on_total, on_change, other_total, other_change = 0.0, 0.0, 0.0, 0.0
        for k in range(2 * j):
            on_total += row[k] * total[k]
            on_change += row[k] * change[k]
            other_total += other[k] * total[k]
            other_change += other[k] * change[k]
        at = 2 * j
        on_total += row[at] * tr + row[at + 1] * ti
        other_total += other[at] * tr + other[at + 1] * ti
        result += (dr * on_total + di * other_total) + (tr * on_change + ti * other_change)
    return result


@summing
def _uncoupled_form(form, change, total, harmonics, count):
    """Return the same where numbers behind the harmonics' are coupled to themselves and to those only."""
    result, first, last = 0.0, 2 * harmonics, 2 * count
    for i in range(first):
        on_total, on_change = 0.0, 0.0
        for k in range(first, last):
            on_total += form[i, k] * total[k]
            on_change += form[i, k] * change[k]
        result += change[i] * on_total + total[i] * on_change
        for k in range(first):
            result += change[i] * form[i, k] * total[k]
    for k in range(first, last, 2):
        dr, di, tr, ti = change[k], change[k + 1], total[k], total[k + 1]
        result += dr * (form[k, k] * tr + form[k, k + 1] * ti) + di * (form[k + 1, k] * tr + form[k + 1, k + 1] * ti)
    return result


@inlined
def _linear_forms(system, flows, st, rec, scratch, s, period, count):
    """Add harmonic, momentum, mean and work of the loads, by their linear maps of the amplitudes."""
    linear, change, total, mean = flows.linear[s], st.change, scratch.total, 0.0
    for j in range(count):
        mean += linear[j, MEAN_MAP] * change[2 * j] + linear[j, MEAN_MAP + 1] * change[2 * j + 1]
    # mode 0: phase x + i y, with the sums and changes of both factors as in quadratic_form
    turned, both = complex(change[0], -change[1]), complex(total[0], -total[1])
    new, old = _mapped(linear, HARMONIC_MAP, change, total, count)
    harmonic = both * new + turned * old
    new, old = _mapped(linear, MOMENTUM_MAP, change, total, count)
    rec.momentum[period] += 0.5 * (both * new + turned * old)
    # integral of exp(-i omega t)
    flat = complex(0.0, 1.0 / system.omega) * turned
    rec.harmonic[period] += 0.5 * harmonic + st.offset[0] * flat
    rec.square[period] += st.offset[0] * mean
    if len(rec.swing) > 0:
        rec.swing[period, 2] += 0.5 * mean
    for h in range(len(system.frequency)):
        new, old = _mapped(linear, WORK_MAP + 4 * h, change, total, count)
        x, y = 2 * h, 2 * h + 1
        st.ledger[EXCITATION] += 0.5 * (
            total[x] * new.real + total[y] * new.imag + change[x] * old.real + change[y] * old.imag
        )


@inlined
def _mapped(linear, first, change, total, count):
    """Return the map of two numbers in four columns from `first` of the changes, and of the sums, each x + i y."""
    on_x, on_y, old_x, old_y = 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        row, dr, di, tr, ti = linear[j], change[2 * j], change[2 * j + 1], total[2 * j], total[2 * j + 1]
        on_x += row[first] * dr + row[first + 1] * di
        on_y += row[first + 2] * dr + row[first + 3] * di
        old_x += row[first] * tr + row[first + 1] * ti
        old_y += row[first + 2] * tr + row[first + 3] * ti
    return complex(on_x, on_y), complex(old_x, old_y)


@inlined
def turning_back(speed, drift, rate, gain, bend, tau):
    """Return the integral of (speed + drift t) exp(-i rate t) over [0, tau]; gain, bend: changes of exp(i rate t)."""
    integral = speed * (complex(0.0, 1.0 / rate) * gain.conjugate())
    if drift != 0.0:
        # that of t exp(-i rate t) is ((z - 1) (e^z - 1) + z)/(i rate)^2, z = -i rate tau
        integral += drift / (rate * rate) * (bend.conjugate() + complex(0.0, rate * tau) * gain.conjugate())
    return integral


@summing
def free_momentum(linear, amplitude, count):
    """Return the momentum of the free bodies in the modes."""
    total = 0.0
    for j in range(count):
        row, c = linear[j], amplitude[j]
        total += row[FREE_MOMENTUM_MAP] * c.real + row[FREE_MOMENTUM_MAP + 1] * c.imag
    return total


@inlined
def _add_slow_pair(flows, st, rec, s, period, i, tau, constant):
    """Add a pair of modes whose product hardly changes, by series of its integral."""
    j, k, kind, _ = flows.slow[s, i]
    if kind == SINGLE:
        twice = (flows.slow_square[s, i] * st.amplitude[j] * _slow_integral(flows.eigenvalue[s, j], tau)).real
        rec.square[period] += constant * twice
        if len(rec.swing) > 0:
            rec.swing[period, 2] += 0.5 * twice
        return
    product = slow_product(flows, st, s, i, tau)
    st.ledger[VISCOUS] += (flows.slow_loss[s, i] * product).real
    st.ledger[CONTACT] += (flows.slow_dashpot[s, i] * product).real
    rec.square[period] += (flows.slow_square[s, i] * product).real
    if kind == DIFFERENCE and k < flows.driven[s, 0]:
        st.ledger[EXCITATION] += 0.5 * (flows.work[s, k, j] * product).real
    if kind == DIFFERENCE and k == 0:
        rec.harmonic[period] += 0.5 * flows.response[s, j] * product
        rec.momentum[period] += 0.5 * flows.momentum[s, j] * product


@inlined
def slow_product(flows, st, s, i, tau):
    """Return the integral of the product of a pair of modes that hardly changes, by series."""
    j, k, kind, h = flows.slow[s, i]
    c, rate = st.amplitude[j], flows.eigenvalue[s, j]
    other, rate_other = st.amplitude[k], flows.eigenvalue[s, k]
    if kind == DIFFERENCE:
        other, rate_other = other.conjugate(), rate_other.conjugate()
    if h >= 0:
        # in a frame that turns with the harmonic
        excitation, phase = flows.eigenvalue[s, h], st.amplitude[h]
        return tau * _driven_integral(
            c, (rate - excitation) * tau, flows.load[s, j] * phase * tau,
            other, (rate_other + excitation) * tau, (flows.load[s, k] * phase).conjugate() * tau,
        )  # fmt: skip
    return c * other * _slow_integral(rate + rate_other, tau)


@kernel
def _calm_integrals(flows, st, s, first, tau, constant):
    """Return the integrals of (constant + x)^2 - constant^2 and x over [0, tau], x of modes with |rate tau| < 0.005.

    By Taylor series: a slow mode that crosses quickly swings out to speed / frequency, and in products of amplitudes
    its place would be lost.
    """
    x0, x1, x2, x3, x4, x5, x6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, flows.slow_count[s]):
        j = flows.slow[s, i, 0]
        z, term = flows.eigenvalue[s, j] * tau, flows.response[s, j] * st.amplitude[j]
        x0 += term.real
        term *= z
        x1 += term.real
        term *= z * (1 / 2)
        x2 += term.real
        term *= z * (1 / 3)
        x3 += term.real
        term *= z * (1 / 4)
        x4 += term.real
        term *= z * (1 / 5)
        x5 += term.real
        term *= z * (1 / 6)
        x6 += term.real
    series, total, mean = (x0, x1, x2, x3, x4, x5, x6), 0.0, 0.0
    for i in range(7):
        mean += series[i] / (i + 1.0)
        total += 2.0 * constant * series[i] / (i + 1.0)
        for k in range(7):
            total += series[i] * series[k] / (i + k + 1.0)
    return total * tau, mean * tau


@inlined
def _slow_integral(rate, tau):
    """Return the integral of exp(rate t) over [0, tau] for |rate tau| < 0.01."""
    z = rate * tau
    if z == 0.0:
        return complex(tau, 0.0)
    series = 1.0 + z * (1 / 4) * (1.0 + z * (1 / 5) * (1.0 + z * (1 / 6)))
    return tau * (1.0 + z * (1 / 2) * (1.0 + z * (1 / 3) * series))


@kernel
def _driven_integral(c, decay, drive, other, other_decay, other_drive):
    """Return the integral of c d over [0, 1], c' = decay c + drive and alike for the other, d."""
    # coefficients of the Taylor series
    product = c * other
    total = product
    for n in range(1, _TERMS):
        product = (decay + other_decay) * product + drive * other + c * other_drive
        c, other = decay * c, other_decay * other
        if n == 1:
            c, other = c + drive, other + other_drive
        scale = 1.0 / n
        product, c, other = scale * product, scale * c, scale * other
        total += product * (1.0 / (n + 1.0))
        if n > 2 and abs(product.real) + abs(product.imag) <= LAST_TERM * (abs(total.real) + abs(total.imag)):
            break
    return total


@kernel
def points_of(flows, st, s, tau):
    """Return at how many points of the segment modes that nearly coalesce are integrated."""
    fastest = 0.0
    for j in range(st.counters[ACTIVE]):
        fastest = max(fastest, abs(flows.eigenvalue[s, j]))
    return len(_NODES) * max(math.ceil(tau * fastest), 1)


@kernel
def at_point(system, flows, st, rec, scratch, s, tau, i, points):
    """Set the amplitudes (scratch.wave) at point i of the segment, and add its squared response. Return its weight.

    Amplitudes of modes that nearly coalesce are large and cancel: states lose their digits once by that, forms of
    amplitudes twice.
    """
    rule, count, value, x, calm = len(_NODES), st.counters[ACTIVE], scratch.wave, 0.0, 0.0
    width = tau * rule / points
    t, weight = (i // rule + 0.5 + 0.5 * _NODES[i % rule]) * width, 0.5 * width * _WEIGHTS[i % rule]
    _amplitudes_at(flows, st, s, t, value, count)
    for j in range(count):
        term = (flows.response[s, j] * value[j]).real
        x += term
        # add_segment has the square of calm modes
        calm += term if 2.0 * abs(flows.eigenvalue[s, j]) * system.period < SLOW else 0.0
    rec.square[st.counters[PERIOD]] += weight * (x * x - calm * calm)
    return weight


@kernel
def _amplitudes_at(flows, st, s, t, value, count):
    """Set the amplitudes at a time t of the segment."""
    for j in range(count):
        value[j] = st.amplitude[j] * (1.0 + exp_minus_one(flows.eigenvalue[s, j] * t))
    for h in range(flows.driven.shape[1] - 1):
        for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
            growth, _ = secular(flows.eigenvalue[s, j], flows.eigenvalue[s, h], t)
            value[j] += flows.load[s, j] * st.amplitude[h] * growth
