"""The energy balance of a segment, and its harmonics, mean square, momentum, peak and samples, all in closed form."""

from __future__ import annotations

import math

from vanedamp.coupling.exact.peaks import highest
from vanedamp.coupling.numerics.codes import (
    AWAKE,
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
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular
from vanedamp.coupling.numerics.jit import inlined, kernel
from vanedamp.coupling.response.records import CONTACT, EXCITATION, VISCOUS

#: terms of the series for products with driven modes: the remainder is below 1e-16
_TERMS = 11

#: modal contributions below this fraction of the largest are neglected in the mean square
_NEGLIGIBLE = 1e-9


@inlined
def account(system, flows, st, rec, scratch, tau):
    """Add energy, harmonic, mean square, momentum and peak of the segment [0, tau], by closed-form integrals."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    constant = 0.0
    for i in range(len(st.constant)):
        constant += system.response[i] * st.constant[i]
    felt = _gather_changes(flows, st, scratch, s)
    _quadratic_forms(flows, st, rec, scratch, s, period, felt)
    if flows.damped[s]:
        _dashpot_loss(flows, st, scratch, s)
    _linear_forms(system, flows, st, rec, scratch, s, period, tau, constant)
    for i in range(flows.slow_count[s]):
        if flows.slow[s, i, 2] == CALM:
            rec.square[period] += _calm_square(flows, st, s, i, tau, constant)
            break
        _slow_pair(flows, st, rec, s, period, i, tau, constant)
    rec.peak[period] = highest(system, flows, st, scratch, s, tau, constant, rec.peak[period])
    if rec.samples.shape[0] > 0:
        _sample(system, flows, st, rec, s, tau, constant)


@inlined
def _gather_changes(flows, st, scratch, s):
    """Set changes and sums of the awake amplitudes: the excitation, the modes that the response feels, the rest.

    Returns the number of those that it feels, the excitation included.
    """
    count, e, largest = st.counters[AWAKE], flows.driven.shape[1] - 1, 0.0
    for a in range(count):
        j = st.awake[a]
        wave = flows.response[s, j] * st.amplitude[j]
        scratch.wave[a] = wave
        largest = max(largest, abs(wave.real) + abs(wave.imag))
    felt, last = 0, count
    for a in range(count):
        wave = scratch.wave[a]
        if a < e or abs(wave.real) + abs(wave.imag) > _NEGLIGIBLE * largest:
            place = felt
            felt += 1
        else:
            last -= 1
            place = last
        j = st.awake[a]
        change = scratch.gain[a]
        scratch.mode_order[place] = j
        scratch.change[place] = change
        scratch.total[place] = 2.0 * st.amplitude[j] + change
    return felt


@inlined
def _quadratic_forms(flows, st, rec, scratch, s, period, felt):
    """Add viscous loss and squared response: quadratic forms at the segment's end minus those at its start.

    With c the amplitudes at the start, c + d at the end, the difference is d Q (2 c + d): it does not cancel.
    """
    loss, square, e = 0.0, 0.0, flows.driven.shape[1] - 1
    for a in range(st.counters[AWAKE]):
        j = scratch.mode_order[a]
        dr, di, tr, ti = scratch.change[a].real, scratch.change[a].imag, scratch.total[a].real, scratch.total[a].imag
        form, other = flows.loss[s, j, j], flows.square[s, j, j]
        loss += dr * (form[0] * tr + form[1] * ti) + di * (form[2] * tr + form[3] * ti)
        square += dr * (other[0] * tr + other[1] * ti) + di * (other[2] * tr + other[3] * ti)
        for b in range(a if a < felt or not flows.uncoupled[s] else e):
            k = scratch.mode_order[b]
            change, total = scratch.change[b], scratch.total[b]
            er, ei, ur, ui = change.real, change.imag, total.real, total.imag
            rr, ri, ir, ii = dr * ur + er * tr, dr * ui + ei * tr, di * ur + er * ti, di * ui + ei * ti
            form, other = flows.loss[s, j, k], flows.square[s, j, k]
            loss += form[0] * rr + form[1] * ri + (form[2] * ir + form[3] * ii)
            square += other[0] * rr + other[1] * ri + (other[2] * ir + other[3] * ii)
    st.ledger[VISCOUS] += loss
    rec.square[period] += square


@kernel
def _dashpot_loss(flows, st, scratch, s):
    """Add the loss in the dashpots of closed contacts, a quadratic form like the viscous loss."""
    loss = 0.0
    for a in range(st.counters[AWAKE]):
        j = scratch.mode_order[a]
        dr, di, tr, ti = scratch.change[a].real, scratch.change[a].imag, scratch.total[a].real, scratch.total[a].imag
        form = flows.dashpot[s, j, j]
        loss += dr * (form[0] * tr + form[1] * ti) + di * (form[2] * tr + form[3] * ti)
        for b in range(a):
            k = scratch.mode_order[b]
            change, total = scratch.change[b], scratch.total[b]
            er, ei, ur, ui = change.real, change.imag, total.real, total.imag
            rr, ri, ir, ii = dr * ur + er * tr, dr * ui + ei * tr, di * ur + er * ti, di * ui + ei * ti
            form = flows.dashpot[s, j, k]
            loss += form[0] * rr + form[1] * ri + (form[2] * ir + form[3] * ii)
    st.ledger[CONTACT] += loss


@inlined
def _linear_forms(system, flows, st, rec, scratch, s, period, tau, constant):
    """Add harmonic, momentum, mean and work of the loads, by their linear maps of the amplitudes."""
    work_r, work_i, harm_r, harm_i, mom_r, mom_i, mean, free = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    old_work_r, old_work_i, old_harm_r, old_harm_i, old_mom_r, old_mom_i = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = scratch.mode_order[a]
        dr, di, tr, ti = scratch.change[a].real, scratch.change[a].imag, scratch.total[a].real, scratch.total[a].imag
        row, c = flows.linear[s, j], st.amplitude[j]
        harm_r += row[HARMONIC_MAP] * dr + row[HARMONIC_MAP + 1] * di
        harm_i += row[HARMONIC_MAP + 2] * dr + row[HARMONIC_MAP + 3] * di
        mom_r += row[MOMENTUM_MAP] * dr + row[MOMENTUM_MAP + 1] * di
        mom_i += row[MOMENTUM_MAP + 2] * dr + row[MOMENTUM_MAP + 3] * di
        mean += row[MEAN_MAP] * dr + row[MEAN_MAP + 1] * di
        free += row[FREE_MOMENTUM_MAP] * c.real + row[FREE_MOMENTUM_MAP + 1] * c.imag
        work_r += row[WORK_MAP] * dr + row[WORK_MAP + 1] * di
        work_i += row[WORK_MAP + 2] * dr + row[WORK_MAP + 3] * di
        old_harm_r += row[HARMONIC_MAP] * tr + row[HARMONIC_MAP + 1] * ti
        old_harm_i += row[HARMONIC_MAP + 2] * tr + row[HARMONIC_MAP + 3] * ti
        old_mom_r += row[MOMENTUM_MAP] * tr + row[MOMENTUM_MAP + 1] * ti
        old_mom_i += row[MOMENTUM_MAP + 2] * tr + row[MOMENTUM_MAP + 3] * ti
        old_work_r += row[WORK_MAP] * tr + row[WORK_MAP + 1] * ti
        old_work_i += row[WORK_MAP + 2] * tr + row[WORK_MAP + 3] * ti
    # mode 0: phase x + i y, with the sums and changes of both factors as in _quadratic_forms
    change, total = scratch.change[0], scratch.total[0]
    loads = total.real * work_r + total.imag * work_i + change.real * old_work_r + change.imag * old_work_i
    harmonic = total.conjugate() * complex(harm_r, harm_i) + change.conjugate() * complex(old_harm_r, old_harm_i)
    momentum = total.conjugate() * complex(mom_r, mom_i) + change.conjugate() * complex(old_mom_r, old_mom_i)
    # integral of exp(-i omega t)
    flat = complex(0.0, 1.0 / system.omega) * change.conjugate()
    st.ledger[EXCITATION] += 0.5 * loads
    rec.harmonic[period] += 0.5 * harmonic + constant * flat
    rec.momentum[period] += 0.5 * momentum
    rec.square[period] += constant * (mean + constant * tau)
    for h in range(1, len(system.frequency)):
        st.ledger[EXCITATION] += _work_of_harmonic(
            flows.linear[s], st.counters[AWAKE], scratch.mode_order, scratch.change, scratch.total, h
        )
    if system.bodies > 0:
        _free_bodies(system, flows, st, rec, scratch, s, period, tau, free)


@kernel
def _work_of_harmonic(linear, count, order, changes, totals, h):
    """Return the work of the loads of harmonic h on the modes, as _linear_forms adds that of the first."""
    on_x, on_y, old_x, old_y = 0.0, 0.0, 0.0, 0.0
    for a in range(count):
        row = linear[order[a], WORK_MAP + 4 * h : WORK_MAP + 4 * (h + 1)]
        dr, di, tr, ti = changes[a].real, changes[a].imag, totals[a].real, totals[a].imag
        on_x += row[0] * dr + row[1] * di
        on_y += row[2] * dr + row[3] * di
        old_x += row[0] * tr + row[1] * ti
        old_y += row[2] * tr + row[3] * ti
    change, total = changes[h], totals[h]
    return 0.5 * (total.real * on_x + total.imag * on_y + change.real * old_x + change.imag * old_y)


@inlined
def _free_bodies(system, flows, st, rec, scratch, s, period, tau, waves):
    """Add momentum and work of the polynomial part of the bodies' motion."""
    n, speed, drift = system.modes, -waves, 0.0
    for b in range(system.bodies):
        drift += system.mass[n + b] * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += system.mass[n + b] * st.velocity[b]
    for h in range(len(system.frequency)):
        rate = system.frequency[h]
        flat = complex(0.0, 1.0 / rate) * scratch.change[h].conjugate()
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


@kernel
def _work_on_bodies(system, flows, st, scratch, s, h, tau, flat):
    """Return the work of the base on the polynomial part of the bodies' motion, in cavities of several directions."""
    n, speed, drift, rate = system.modes, 0.0j, 0.0j, system.frequency[h]
    for b in range(system.bodies):
        load = system.load[h, n + b].conjugate()
        drift += load * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            own = st.velocity[b]
            for a in range(st.counters[AWAKE]):
                j = st.awake[a]
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
        rec.square[period] += constant * (flows.slow_square[s, i] * c * _slow_integral(rate, tau)).real
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
def _calm_square(flows, st, s, first, tau, constant):
    """Return the integral of (constant + x)^2 - constant^2 over [0, tau], x of modes with |rate tau| < 0.005.

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
    series, total = (x0, x1, x2, x3, x4, x5, x6), 0.0
    for i in range(7):
        total += 2.0 * constant * series[i] / (i + 1.0)
        for k in range(7):
            total += series[i] * series[k] / (i + k + 1.0)
    return total * tau


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
        share = 1.0 / n
        product, c, other = share * product, share * c, share * other
        total += product * (1.0 / (n + 1.0))
        if n > 2 and abs(product.real) + abs(product.imag) <= 1e-18 * (abs(total.real) + abs(total.imag)):
            break
    return total


@kernel
def _sample(system, flows, st, rec, s, tau, constant):
    """Record response, slips and coordinates at the equidistant sampling times within [time, time + tau)."""
    each = len(rec.samples) // (len(rec.section) - 1)
    start = st.time[0]
    begin = math.ceil(start / system.period * each - 1e-12)
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
        for a in range(st.counters[AWAKE]):
            j = st.awake[a]
            z = flows.eigenvalue[s, j] * t
            first = exp_minus_one(z)
            line = exp_minus_line(z, first)
            entry[0] += (flows.response[s, j] * st.amplitude[j] * (1.0 + first)).real
            for r in range(system.bodies):
                entry[1 + r] += (flows.motion[s, r, j] * st.amplitude[j] * line).real
            for k in range(len(p)):
                p[k] += (flows.shape[s, k, j] * st.amplitude[j] * (1.0 + first)).real
        for h in range(len(system.frequency)):
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                growth, beyond = secular(flows.eigenvalue[s, j], flows.eigenvalue[s, h], t)
                drive = flows.load[s, j] * st.amplitude[h]
                entry[0] += (flows.response[s, j] * drive * growth).real
                for r in range(system.bodies):
                    entry[1 + r] += (flows.motion[s, r, j] * drive * beyond).real
                for k in range(len(p)):
                    p[k] += (flows.shape[s, k, j] * drive * growth).real
