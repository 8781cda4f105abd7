"""The account of a segment: energies, harmonics, mean square, momentum, peaks and samples, all in closed form."""

from __future__ import annotations

import math

from vanedamp.coupling.exact.peaks import highest
from vanedamp.coupling.exact.state import ALONE, AWAKE, CALM, DIFFERENCE, FLOW, PERIOD
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular
from vanedamp.coupling.numerics.jit import inlined, kernel
from vanedamp.coupling.response.records import CONTACT, EXCITATION, VISCOUS

#: of the series for products with driven modes: what is left out is below 1e-16
_TERMS = 11

#: shares of the response below this part of the largest count for nothing in its square
_NEGLIGIBLE = 1e-9


@inlined
def account(system, flows, st, rec, work, tau):
    """Energy, harmonic, mean square, momentum and peak of the segment [0, tau], by closed-form integrals."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    constant = 0.0
    for i in range(len(st.constant)):
        constant += system.response[i] * st.constant[i]
    felt = _gather(flows, st, work, s)
    _pairs(flows, st, rec, work, s, period, felt)
    if flows.damped[s]:
        _dashpots(flows, st, work, s)
    _with_excitation(system, flows, st, rec, work, s, period, tau, constant)
    for i in range(flows.slow_count[s]):
        if flows.slow[s, i, 2] == CALM:
            rec.square[period] += _calm_square(flows, st, s, i, tau, constant)
            break
        _slow_pair(flows, st, rec, s, period, i, tau, constant)
    rec.peak[period] = highest(system, flows, st, work, s, tau, constant, rec.peak[period])
    if rec.samples.shape[0] > 0:
        _sample(system, flows, st, rec, s, tau, constant)


@inlined
def _gather(flows, st, work, s):
    """Changes and sums of the awake amplitudes: the excitation, then the modes that the response feels, then the rest.

    Returns how many it feels, the excitation included.
    """
    count, e, largest = st.counters[AWAKE], flows.driven.shape[1] - 1, 0.0
    for a in range(count):
        j = st.awake[a]
        wave = flows.response[s, j] * st.amplitude[j]
        work.wave[a] = wave
        largest = max(largest, abs(wave.real) + abs(wave.imag))
    felt, last = 0, count
    for a in range(count):
        wave = work.wave[a]
        if a < e or abs(wave.real) + abs(wave.imag) > _NEGLIGIBLE * largest:
            place = felt
            felt += 1
        else:
            last -= 1
            place = last
        j = st.awake[a]
        change = work.gain[a]
        work.order[place] = j
        work.change[place] = change
        work.total[place] = 2.0 * st.amplitude[j] + change
    return felt


@inlined
def _pairs(flows, st, rec, work, s, period, felt):
    """Viscous loss and squared response: quadratic forms at the segment's end minus those at its start.

    With c the amplitudes at the start, c + d at the end, the difference is d Q (2 c + d): it does not cancel.
    """
    loss, square, e = 0.0, 0.0, flows.driven.shape[1] - 1
    for a in range(st.counters[AWAKE]):
        j = work.order[a]
        dr, di, tr, ti = work.change[a].real, work.change[a].imag, work.total[a].real, work.total[a].imag
        form, other = flows.loss[s, j, j], flows.square[s, j, j]
        loss += dr * (form[0] * tr + form[1] * ti) + di * (form[2] * tr + form[3] * ti)
        square += dr * (other[0] * tr + other[1] * ti) + di * (other[2] * tr + other[3] * ti)
        for b in range(a if a < felt or not flows.uncoupled[s] else e):
            k = work.order[b]
            er, ei, ur, ui = work.change[b].real, work.change[b].imag, work.total[b].real, work.total[b].imag
            rr, ri, ir, ii = dr * ur + er * tr, dr * ui + ei * tr, di * ur + er * ti, di * ui + ei * ti
            form, other = flows.loss[s, j, k], flows.square[s, j, k]
            loss += form[0] * rr + form[1] * ri + (form[2] * ir + form[3] * ii)
            square += other[0] * rr + other[1] * ri + (other[2] * ir + other[3] * ii)
    st.ledger[VISCOUS] += loss
    rec.square[period] += square


@kernel
def _dashpots(flows, st, work, s):
    """Loss in the dashpots of closed contacts, by its form like the viscous loss."""
    loss = 0.0
    for a in range(st.counters[AWAKE]):
        j = work.order[a]
        dr, di, tr, ti = work.change[a].real, work.change[a].imag, work.total[a].real, work.total[a].imag
        form = flows.dashpot[s, j, j]
        loss += dr * (form[0] * tr + form[1] * ti) + di * (form[2] * tr + form[3] * ti)
        for b in range(a):
            k = work.order[b]
            er, ei, ur, ui = work.change[b].real, work.change[b].imag, work.total[b].real, work.total[b].imag
            rr, ri, ir, ii = dr * ur + er * tr, dr * ui + ei * tr, di * ur + er * ti, di * ui + ei * ti
            form = flows.dashpot[s, j, k]
            loss += form[0] * rr + form[1] * ri + (form[2] * ir + form[3] * ii)
    st.ledger[CONTACT] += loss


@inlined
def _with_excitation(system, flows, st, rec, work, s, period, tau, constant):
    """What is linear in the modes: harmonic, momentum, mean and work of the loads, by their linear maps."""
    work_r, work_i, harm_r, harm_i, mom_r, mom_i, mean, free = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    old_work_r, old_work_i, old_harm_r, old_harm_i, old_mom_r, old_mom_i = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = work.order[a]
        dr, di, tr, ti = work.change[a].real, work.change[a].imag, work.total[a].real, work.total[a].imag
        row, c = flows.linear[s, j], st.amplitude[j]
        harm_r += row[0] * dr + row[1] * di
        harm_i += row[2] * dr + row[3] * di
        mom_r += row[4] * dr + row[5] * di
        mom_i += row[6] * dr + row[7] * di
        mean += row[8] * dr + row[9] * di
        free += row[10] * c.real + row[11] * c.imag
        work_r += row[12] * dr + row[13] * di
        work_i += row[14] * dr + row[15] * di
        old_harm_r += row[0] * tr + row[1] * ti
        old_harm_i += row[2] * tr + row[3] * ti
        old_mom_r += row[4] * tr + row[5] * ti
        old_mom_i += row[6] * tr + row[7] * ti
        old_work_r += row[12] * tr + row[13] * ti
        old_work_i += row[14] * tr + row[15] * ti
    # mode 0: phase x + i y, with the sums and changes of both factors as in _pairs
    change, total = work.change[0], work.total[0]
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
        st.ledger[EXCITATION] += _work(flows.linear[s], st.counters[AWAKE], work.order, work.change, work.total, h)
    if system.bodies > 0:
        _free_bodies(system, flows, st, rec, work, s, period, tau, free)


@kernel
def _work(linear, count, order, changes, totals, h):
    """Work of the loads of harmonic h on the modes, as _with_excitation has that of the first."""
    on_x, on_y, old_x, old_y = 0.0, 0.0, 0.0, 0.0
    for a in range(count):
        row = linear[order[a], 12 + 4 * h : 16 + 4 * h]
        dr, di, tr, ti = changes[a].real, changes[a].imag, totals[a].real, totals[a].imag
        on_x += row[0] * dr + row[1] * di
        on_y += row[2] * dr + row[3] * di
        old_x += row[0] * tr + row[1] * ti
        old_y += row[2] * tr + row[3] * ti
    change, total = changes[h], totals[h]
    return 0.5 * (total.real * on_x + total.imag * on_y + change.real * old_x + change.imag * old_y)


@inlined
def _free_bodies(system, flows, st, rec, work, s, period, tau, waves):
    """Momentum and work of the polynomial part of the bodies' motion."""
    n, speed, drift = system.modes, -waves, 0.0
    for b in range(system.bodies):
        drift += system.mass[n + b] * st.drifts[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += system.mass[n + b] * st.velocity[b]
    for h in range(len(system.frequency)):
        rate = system.frequency[h]
        flat = complex(0.0, 1.0 / rate) * work.change[h].conjugate()
        momentum = speed * flat
        if drift != 0.0:
            # integral of t exp(-i omega t) = ((z - 1) (e^z - 1) + z)/(i omega)^2, z = -i omega tau
            slope = work.bend[h].conjugate() + complex(0.0, rate * tau) * work.gain[h].conjugate()
            momentum += drift / (rate * rate) * slope
        if h == 0:
            rec.momentum[period] += momentum
        if system.alike:
            load = system.load[h, n] / system.mass[n]
            st.ledger[EXCITATION] += load.real * momentum.real + load.imag * momentum.imag
        else:
            st.ledger[EXCITATION] += _push(system, flows, st, work, s, h, tau, flat)


@kernel
def _push(system, flows, st, work, s, h, tau, flat):
    """Work of the base on the polynomial part of the bodies' motion, in cavities of several directions."""
    n, speed, drift, rate = system.modes, 0.0j, 0.0j, system.frequency[h]
    for b in range(system.bodies):
        load = system.load[h, n + b].conjugate()
        drift += load * st.drifts[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            own = st.velocity[b]
            for a in range(st.counters[AWAKE]):
                j = st.awake[a]
                own -= (flows.velocity[s, b, j] * st.amplitude[j]).real
            speed += load * own
    # integral of t exp(-i omega t), as in _free_bodies
    slope = work.bend[h].conjugate() + complex(0.0, rate * tau) * work.gain[h].conjugate()
    return (speed * flat + drift / (rate * rate) * slope).real


@inlined
def _slow_pair(flows, st, rec, s, period, i, tau, constant):
    """A pair of modes whose product hardly changes: by series of its integral."""
    j, k, kind, h = flows.slow[s, i]
    c, rate = st.amplitude[j], flows.eigenvalue[s, j]
    if kind == ALONE:
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
    """Integral of (constant + x)^2 - constant^2 over [0, tau], x of modes with |rate tau| < 0.005: by Taylor series.

    A slow mode that crosses quickly swings out to speed / frequency: in products of amplitudes its place would be lost.
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
    """Integral of exp(rate t) over [0, tau] for |rate tau| < 0.01."""
    z = rate * tau
    if z == 0.0:
        return complex(tau, 0.0)
    series = 1.0 + z * (1 / 4) * (1.0 + z * (1 / 5) * (1.0 + z * (1 / 6)))
    return tau * (1.0 + z * (1 / 2) * (1.0 + z * (1 / 3) * series))


@kernel
def _driven_integral(c, delay, push, other, other_delay, other_push):
    """Integral of c d over [0, 1], c' = delay c + push and alike for the other, d."""
    # coefficients of the Taylor series
    product = c * other
    total = product
    for n in range(1, _TERMS):
        product = (delay + other_delay) * product + push * other + c * other_push
        c, other = delay * c, other_delay * other
        if n == 1:
            c, other = c + push, other + other_push
        share = 1.0 / n
        product, c, other = share * product, share * c, share * other
        total += product * (1.0 / (n + 1.0))
        if n > 2 and abs(product.real) + abs(product.imag) <= 1e-18 * (abs(total.real) + abs(total.imag)):
            break
    return total


@kernel
def _sample(system, flows, st, rec, s, tau, constant):
    """Response and slips at the equidistant sampling times within [time, time + tau)."""
    each = len(rec.samples) // (len(rec.section) - 1)
    start = st.time[0]
    begin = math.ceil(start / system.period * each - 1e-12)
    for i in range(max(begin, 0), each):
        t = i * system.period / each - start
        if t >= tau:
            break
        t = max(t, 0.0)
        entry = rec.samples[st.counters[PERIOD] * each + i]
        entry[0] = constant
        for r in range(system.bodies):
            entry[1 + r] = st.displacement[r] + t * (st.velocity[r] + 0.5 * st.drift[r] * t)
        for a in range(st.counters[AWAKE]):
            j = st.awake[a]
            z = flows.eigenvalue[s, j] * t
            first = exp_minus_one(z)
            line = exp_minus_line(z, first)
            entry[0] += (flows.response[s, j] * st.amplitude[j] * (1.0 + first)).real
            for r in range(system.bodies):
                entry[1 + r] += (flows.motion[s, r, j] * st.amplitude[j] * line).real
        for h in range(len(system.frequency)):
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                growth, beyond = secular(flows.eigenvalue[s, j], flows.eigenvalue[s, h], t)
                drive = flows.load[s, j] * st.amplitude[h]
                entry[0] += (flows.response[s, j] * drive * growth).real
                for r in range(system.bodies):
                    entry[1 + r] += (flows.motion[s, r, j] * drive * beyond).real
