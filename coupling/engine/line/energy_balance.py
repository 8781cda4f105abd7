"""The energy balance of a segment, and its harmonics, mean square, momentum, peak and samples, all in closed form."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.line.peaks import highest
from vanedamp.coupling.engine.line.tolerances import LAST_TERM, SAMPLE
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    CALM,
    DIFFERENCE,
    FLOW,
    FREE_MOMENTUM_MAP,
    HARMONIC_MAP,
    MEAN_MAP,
    MOMENTUM_MAP,
    PERIOD,
    SINGLE,
    WORK_MAP,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular
from vanedamp.coupling.response.records import CONTACT, EXCITATION, VISCOUS

#: terms of the series for products with driven modes: the remainder is below 1e-16
_TERMS = 11


@inlined
def account(system, flows, st, rec, scratch, tau):
    """Add what the segment [0, tau] has of its own: slow pairs of modes, parabolas of the bodies, the peak, samples."""
    s, period, constant = st.counters[FLOW], st.counters[PERIOD], st.offset[0]
    rec.square[period] += constant * constant * tau
    deflected = len(rec.swing) > 0
    if deflected:
        rec.swing[period, 2] += constant * tau
    if system.bodies > 0:
        _free_bodies(system, flows, st, rec, scratch, s, period, tau)
    for i in range(flows.slow_count[s]):
        if flows.slow[s, i, 2] == CALM:
            square, mean = _calm_integrals(flows, st, s, i, tau, constant)
            rec.square[period] += square
            if deflected:
                rec.swing[period, 2] += mean
            break
        _slow_pair(flows, st, rec, s, period, i, tau, constant)
    if deflected:
        _extremes(system, flows, st, rec, scratch, s, period, tau, constant)
    else:
        rec.peak[period] = highest(system, flows, st, scratch, s, tau, constant, rec.peak[period], 0.0)
    if rec.samples.shape[0] > 0:
        _sample(system, flows, st, rec, s, tau, constant)


@kernel
def _extremes(system, flows, st, rec, scratch, s, period, tau, constant):
    """Record the largest and the smallest response of the segment."""
    swing = rec.swing[period]
    for k in range(2):
        side = 1.0 - 2.0 * k
        top = highest(system, flows, st, scratch, s, tau, constant, side * swing[k], side)
        swing[k] = side * top
        rec.peak[period] = max(rec.peak[period], top)


@inlined
def account_spell(system, flows, st, rec, scratch):
    """Add energies, harmonic, mean square and momentum of the modes since the spell began, and begin the next one.

    A spell is a time in one subsystem and one period. Each integral is a form of the amplitudes at its end minus that
    at its start, without the jumps of the form at impacts in between (`account_impact`). With c the amplitudes at the
    start, c + d at the end, the difference of a quadratic form Q is d Q (2 c + d): it does not cancel.
    """
    s, period, count, e = st.counters[FLOW], st.counters[PERIOD], st.counters[ACTIVE], len(system.frequency)
    change, total = st.change, scratch.total
    for j in range(count):
        total[2 * j] = 2.0 * st.amplitude[j].real - change[2 * j]
        total[2 * j + 1] = 2.0 * st.amplitude[j].imag - change[2 * j + 1]
    if flows.uncoupled[s]:
        st.ledger[VISCOUS] += _uncoupled_form(flows.loss[s], change, total, e, count)
    else:
        st.ledger[VISCOUS] += _quadratic_form(flows.loss[s], change, total, count)
    rec.square[period] += _quadratic_form(flows.square[s], change, total, count)
    if flows.damped[s]:
        st.ledger[CONTACT] += _quadratic_form(flows.dashpot[s], change, total, count)
    _linear_forms(system, flows, st, rec, scratch, s, period, count)
    for i in range(2 * count):
        change[i] = 0.0


@summing
def _quadratic_form(form, change, total, count):
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
def account_impact(system, flows, st, rec, r, impulse):
    """Take the jump of all forms at an impulse on row r (N s) out of the spell, before the amplitudes jump."""
    s, period, e = st.counters[FLOW], st.counters[PERIOD], len(system.frequency)
    kick, maps, back = flows.kick[s, r], flows.kick_maps[s, r], st.amplitude[0].conjugate()
    loss, square, contact = _kicks(kick, st.amplitude, flows.impulse_response[s, r], impulse, flows.modes[s])
    st.ledger[VISCOUS] -= impulse * loss
    st.ledger[CONTACT] -= impulse * contact
    rec.square[period] -= impulse * (square + st.offset[0] * maps[MEAN_MAP // 2])
    if len(rec.swing) > 0:
        rec.swing[period, 2] -= 0.5 * impulse * maps[MEAN_MAP // 2]
    rec.harmonic[period] -= impulse * (back * complex(maps[HARMONIC_MAP // 2], maps[HARMONIC_MAP // 2 + 1]))
    rec.momentum[period] -= impulse * (back * complex(maps[MOMENTUM_MAP // 2], maps[MOMENTUM_MAP // 2 + 1]))
    for h in range(e):
        phase = st.amplitude[h]
        work = phase.real * maps[WORK_MAP // 2 + 2 * h] + phase.imag * maps[WORK_MAP // 2 + 2 * h + 1]
        st.ledger[EXCITATION] -= impulse * work


@summing
def _kicks(kick, amplitude, response, impulse, count):
    """Return the jumps of the three quadratic forms at an impulse, by its size."""
    loss, square, contact = 0.0, 0.0, 0.0
    for j in range(count):
        tr = 2.0 * amplitude[j].real + impulse * response[j].real
        ti = 2.0 * amplitude[j].imag + impulse * response[j].imag
        loss += kick[0, 2 * j] * tr + kick[0, 2 * j + 1] * ti
        square += kick[1, 2 * j] * tr + kick[1, 2 * j + 1] * ti
        contact += kick[2, 2 * j] * tr + kick[2, 2 * j + 1] * ti
    return loss, square, contact


@inlined
def _linear_forms(system, flows, st, rec, scratch, s, period, count):
    """Add harmonic, momentum, mean and work of the loads, by their linear maps of the amplitudes."""
    linear, change, total, mean = flows.linear[s], st.change, scratch.total, 0.0
    for j in range(count):
        mean += linear[j, MEAN_MAP] * change[2 * j] + linear[j, MEAN_MAP + 1] * change[2 * j + 1]
    # mode 0: phase x + i y, with the sums and changes of both factors as in _quadratic_form
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
    """Return the map of two numbers in four columns from `first` of the changes, and that of the sums, each x + i y."""
    on_x, on_y, old_x, old_y = 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        row, dr, di, tr, ti = linear[j], change[2 * j], change[2 * j + 1], total[2 * j], total[2 * j + 1]
        on_x += row[first] * dr + row[first + 1] * di
        on_y += row[first + 2] * dr + row[first + 3] * di
        old_x += row[first] * tr + row[first + 1] * ti
        old_y += row[first + 2] * tr + row[first + 3] * ti
    return complex(on_x, on_y), complex(old_x, old_y)


@inlined
def _free_bodies(system, flows, st, rec, scratch, s, period, tau):
    """Add momentum and work of the polynomial part of the bodies' motion."""
    n, drift = system.modes, 0.0
    speed = -_free_momentum(flows.linear[s], st.amplitude, st.counters[ACTIVE])
    for b in range(system.bodies):
        drift += system.mass[n + b] * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += system.mass[n + b] * st.velocity[b]
    for h in range(len(system.frequency)):
        rate = system.frequency[h]
        flat = complex(0.0, 1.0 / rate) * scratch.gain[h].conjugate()
        momentum = speed * flat
        if drift != 0.0:
            # integral of t exp(-i omega t) = ((z - 1) (e^z - 1) + z)/(i omega)^2, z = -i omega tau
            slope = scratch.bend[h].conjugate() + complex(0.0, rate * tau) * scratch.gain[h].conjugate()
            momentum += drift / (rate * rate) * slope
        if h == 0:
            rec.momentum[period] += momentum
        if system.alike:
            load = system.load[h, n] / system.mass[n]
            st.ledger[EXCITATION] += load.real * momentum.real + load.imag * momentum.imag
        else:
            st.ledger[EXCITATION] += _work_on_bodies(system, flows, st, scratch, s, h, tau, flat)


@summing
def _free_momentum(linear, amplitude, count):
    """Return the momentum of the free bodies in the modes."""
    total = 0.0
    for j in range(count):
        row, c = linear[j], amplitude[j]
        total += row[FREE_MOMENTUM_MAP] * c.real + row[FREE_MOMENTUM_MAP + 1] * c.imag
    return total


@kernel
def _work_on_bodies(system, flows, st, scratch, s, h, tau, flat):
    """Return the work of the base on the polynomial part of the bodies' motion, in cavities of several directions."""
    n, speed, drift, rate = system.modes, 0.0j, 0.0j, system.frequency[h]
    for b in range(system.bodies):
        load = system.load[h, n + b].conjugate()
        drift += load * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            own = st.velocity[b]
            for j in range(st.counters[ACTIVE]):
                own -= (flows.velocity[s, b, j] * st.amplitude[j]).real
            speed += load * own
    # integral of t exp(-i omega t), as in _free_bodies
    slope = scratch.bend[h].conjugate() + complex(0.0, rate * tau) * scratch.gain[h].conjugate()
    return (speed * flat + drift / (rate * rate) * slope).real


@inlined
def _slow_pair(flows, st, rec, s, period, i, tau, constant):
    """Add a pair of modes whose product hardly changes, by series of its integral."""
    j, k, kind, h = flows.slow[s, i]
    c, rate = st.amplitude[j], flows.eigenvalue[s, j]
    if kind == SINGLE:
        twice = (flows.slow_square[s, i] * c * _slow_integral(rate, tau)).real
        rec.square[period] += constant * twice
        if len(rec.swing) > 0:
            rec.swing[period, 2] += 0.5 * twice
        return
    other, rate_other = st.amplitude[k], flows.eigenvalue[s, k]
    if kind == DIFFERENCE:
        other, rate_other = other.conjugate(), rate_other.conjugate()
    if h >= 0:
        # in a frame that turns with the harmonic
        excitation, phase = flows.eigenvalue[s, h], st.amplitude[h]
        product = tau * _driven_integral(
            c, (rate - excitation) * tau, flows.load[s, j] * phase * tau,
            other, (rate_other + excitation) * tau, (flows.load[s, k] * phase).conjugate() * tau,
        )  # fmt: skip
    else:
        product = c * other * _slow_integral(rate + rate_other, tau)
    st.ledger[VISCOUS] += (flows.slow_loss[s, i] * product).real
    st.ledger[CONTACT] += (flows.slow_dashpot[s, i] * product).real
    rec.square[period] += (flows.slow_square[s, i] * product).real
    if kind == DIFFERENCE and k < flows.driven[s, 0]:
        st.ledger[EXCITATION] += 0.5 * (flows.work[s, k, j] * product).real
    if kind == DIFFERENCE and k == 0:
        rec.harmonic[period] += 0.5 * flows.response[s, j] * product
        rec.momentum[period] += 0.5 * flows.momentum[s, j] * product


@kernel
def _calm_integrals(flows, st, s, first, tau, constant):
    """Return the integrals of (constant + x)^2 - constant^2 and x over [0, tau], x of modes with |rate tau| < 0.005.

    By Taylor series: a slow mode that crosses quickly swings out to speed / frequency, and in products of amplitudes
    its place would be lost.
    """
    x0, x1, x2, x3, x4, x5, x6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, flows.slow_count[s]):
        j = flows.slow[s, i, 0]
        z, part = flows.eigenvalue[s, j] * tau, flows.response[s, j] * st.amplitude[j]
        x0 += part.real
        part *= z
        x1 += part.real
        part *= z * (1 / 2)
        x2 += part.real
        part *= z * (1 / 3)
        x3 += part.real
        part *= z * (1 / 4)
        x4 += part.real
        part *= z * (1 / 5)
        x5 += part.real
        part *= z * (1 / 6)
        x6 += part.real
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
        part = 1.0 / n
        product, c, other = part * product, part * c, part * other
        total += product * (1.0 / (n + 1.0))
        if n > 2 and abs(product.real) + abs(product.imag) <= LAST_TERM * (abs(total.real) + abs(total.imag)):
            break
    return total


@kernel
def _sample(system, flows, st, rec, s, tau, constant):
    """Record response, slips and coordinates at the equidistant sampling times within [time, time + tau)."""
    each = len(rec.samples) // (len(rec.section) - 1)
    start = st.time[0]
    begin = math.ceil(start / system.period * each - SAMPLE)
    for i in range(max(begin, 0), each):
        t = i * system.period / each - start
        if t >= tau:
            break
        t = max(t, 0.0)
        entry = rec.samples[st.counters[PERIOD] * each + i]
        p = rec.coordinates[st.counters[PERIOD] * each + i]
        entry[0] = constant
        for k in range(len(p)):
            p[k] = st.constant[k]
        for r in range(system.bodies):
            entry[1 + r] = st.displacement[r] + t * (st.velocity[r] + 0.5 * st.free_acceleration[r] * t)
        for j in range(st.counters[ACTIVE]):
            z = flows.eigenvalue[s, j] * t
            first = exp_minus_one(z)
            line = exp_minus_line(z, first)
            entry[0] += (flows.response[s, j] * st.amplitude[j] * (1.0 + first)).real
            for r in range(system.bodies):
                entry[1 + r] += (flows.motion[s, r, j] * st.amplitude[j] * line).real
            for k in range(len(p)):
                p[k] += (flows.shape[s, j, k] * st.amplitude[j] * (1.0 + first)).real
        for h in range(len(system.frequency)):
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                growth, beyond = secular(flows.eigenvalue[s, j], flows.eigenvalue[s, h], t)
                drive = flows.load[s, j] * st.amplitude[h]
                entry[0] += (flows.response[s, j] * drive * growth).real
                for r in range(system.bodies):
                    entry[1 + r] += (flows.motion[s, r, j] * drive * beyond).real
                for k in range(len(p)):
                    p[k] += (flows.shape[s, j, k] * drive * growth).real
