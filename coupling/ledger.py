"""The account of a segment: energies, harmonics, mean square, momentum, peaks and samples, all in closed form."""

from __future__ import annotations

import math

from coupling.compiled import inlined, kernel
from coupling.events import exp_minus_line, exp_minus_one, secular, secular_bound
from coupling.state import ALONE, AWAKE, CONTACT, DIFFERENCE, EXCITATION, FLOW, PERIOD, VISCOUS

#: of the series for products with driven modes: what is left out is below 1e-16
_TERMS = 11

#: shares of the response below this part of the largest count for nothing in its square
_NEGLIGIBLE = 1e-9


@inlined
def account(rows, flows, st, rec, work, tau):
    """Energy, harmonic, mean square, momentum and peak of the segment [0, tau], by closed-form integrals."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    constant = 0.0
    for i in range(len(st.constant)):
        constant += rows.response[i] * st.constant[i]
    felt = _gather(flows, st, work, s)
    _pairs(flows, st, rec, work, s, period, felt)
    if flows.damped[s]:
        _dashpots(flows, st, work, s)
    _with_excitation(rows, flows, st, rec, work, s, period, tau, constant)
    for i in range(flows.slow_count[s]):
        _slow_pair(flows, st, rec, s, period, i, tau, constant)
    rec.peak[period] = _peak(rows, flows, st, work, s, tau, constant, rec.peak[period])
    if rec.samples.shape[0] > 0:
        _sample(rows, flows, st, rec, s, tau, constant)


@inlined
def _gather(flows, st, work, s):
    """Changes and sums of the awake amplitudes: the excitation, then the modes that the response feels, then the rest.

    Returns how many it feels, the excitation included.
    """
    count, largest = st.counters[AWAKE], 0.0
    for a in range(count):
        j = st.awake[a]
        wave = flows.response[s, j] * st.amplitude[j]
        work.wave[a] = wave
        largest = max(largest, abs(wave.real) + abs(wave.imag))
    felt, last = 0, count
    for a in range(count):
        wave = work.wave[a]
        if a == 0 or abs(wave.real) + abs(wave.imag) > _NEGLIGIBLE * largest:
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
    loss, square = 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = work.order[a]
        dr, di, tr, ti = work.change[a].real, work.change[a].imag, work.total[a].real, work.total[a].imag
        form, other = flows.loss[s, j, j], flows.square[s, j, j]
        loss += dr * (form[0] * tr + form[1] * ti) + di * (form[2] * tr + form[3] * ti)
        square += dr * (other[0] * tr + other[1] * ti) + di * (other[2] * tr + other[3] * ti)
        for b in range(a if a < felt or not flows.uncoupled[s] else 1):
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
def _with_excitation(rows, flows, st, rec, work, s, period, tau, constant):
    """What is linear in the modes: work of the loads, harmonic, momentum and mean, by their linear maps."""
    work_r, work_i, harm_r, harm_i, mom_r, mom_i, mean, free = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    old_work_r, old_work_i, old_harm_r, old_harm_i, old_mom_r, old_mom_i = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = work.order[a]
        dr, di, tr, ti = work.change[a].real, work.change[a].imag, work.total[a].real, work.total[a].imag
        row, c = flows.linear[s, j], st.amplitude[j]
        work_r += row[0] * dr + row[1] * di
        work_i += row[2] * dr + row[3] * di
        harm_r += row[4] * dr + row[5] * di
        harm_i += row[6] * dr + row[7] * di
        mom_r += row[8] * dr + row[9] * di
        mom_i += row[10] * dr + row[11] * di
        mean += row[12] * dr + row[13] * di
        free += row[14] * c.real + row[15] * c.imag
        old_work_r += row[0] * tr + row[1] * ti
        old_work_i += row[2] * tr + row[3] * ti
        old_harm_r += row[4] * tr + row[5] * ti
        old_harm_i += row[6] * tr + row[7] * ti
        old_mom_r += row[8] * tr + row[9] * ti
        old_mom_i += row[10] * tr + row[11] * ti
    # mode 0: phase x + i y, with the sums and changes of both factors as in _pairs
    change, total = work.change[0], work.total[0]
    loads = total.real * work_r + total.imag * work_i + change.real * old_work_r + change.imag * old_work_i
    harmonic = total.conjugate() * complex(harm_r, harm_i) + change.conjugate() * complex(old_harm_r, old_harm_i)
    momentum = total.conjugate() * complex(mom_r, mom_i) + change.conjugate() * complex(old_mom_r, old_mom_i)
    # integral of exp(-i omega t)
    flat = complex(0.0, 1.0 / rows.omega) * change.conjugate()
    st.ledger[EXCITATION] += 0.5 * loads
    rec.harmonic[period] += 0.5 * harmonic + constant * flat
    rec.momentum[period] += 0.5 * momentum
    rec.square[period] += constant * (mean + constant * tau)
    if len(rows.mass) > 0:
        _free_bodies(rows, flows, st, rec, work, s, period, tau, free, flat)


@inlined
def _free_bodies(rows, flows, st, rec, work, s, period, tau, waves, flat):
    """Momentum and work of the polynomial part of the bodies' motion."""
    speed, drift = -waves, 0.0
    for b in range(len(rows.mass)):
        drift += rows.mass[b] * st.body_drift[b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += rows.mass[b] * st.velocity[b]
    momentum = speed * flat
    if drift != 0.0:
        # integral of t exp(-i omega t) = ((z - 1) (e^z - 1) + z)/(i omega)^2, z = -i omega tau
        slope = work.bend[0].conjugate() + complex(0.0, rows.omega * tau) * work.gain[0].conjugate()
        momentum += drift / (rows.omega * rows.omega) * slope
    rec.momentum[period] += momentum
    # the base accelerates all bodies alike
    st.ledger[EXCITATION] += rows.inertia[0].imag / rows.mass[0] * momentum.imag


@inlined
def _slow_pair(flows, st, rec, s, period, i, tau, constant):
    """A pair of modes whose product hardly changes: by series of its integral."""
    j, k, kind = flows.slow[s, i]
    c, rate = st.amplitude[j], flows.eigenvalue[s, j]
    if kind == ALONE:
        rec.square[period] += constant * (flows.slow_square[s, i] * c * _slow_integral(rate, tau)).real
        return
    other, rate_other = st.amplitude[k], flows.eigenvalue[s, k]
    if kind == DIFFERENCE:
        other, rate_other = other.conjugate(), rate_other.conjugate()
    if kind == DIFFERENCE and k <= flows.driven[s] and j > 0:
        # in a frame that turns with the excitation
        excitation, phase = flows.eigenvalue[s, 0], st.amplitude[0]
        product = tau * _driven_integral(
            c, (rate - excitation) * tau, flows.load[s, j] * phase * tau,
            other, (rate_other + excitation) * tau, (flows.load[s, k] * phase).conjugate() * tau,
        )  # fmt: skip
    else:
        product = c * other * _slow_integral(rate + rate_other, tau)
    st.ledger[VISCOUS] += (flows.slow_loss[s, i] * product).real
    st.ledger[CONTACT] += (flows.slow_dashpot[s, i] * product).real
    rec.square[period] += (flows.slow_square[s, i] * product).real
    if k == 0 and kind == DIFFERENCE:
        st.ledger[EXCITATION] -= 0.5 * (flows.work[s, j] * product).imag
        rec.harmonic[period] += 0.5 * flows.response[s, j] * product
        rec.momentum[period] += 0.5 * flows.momentum[s, j] * product


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


@inlined
def _peak(rows, flows, st, work, s, tau, constant, peak):
    """Largest |response| on [0, tau] and before.

    Between points of a grid the response differs from its cubic Hermite interpolant by at most (bound of the fourth
    derivative) h^4/384: the grid keeps this below 1e-3 of the response, and each maximum found is polished by Newton.
    Where interpolant and bound stay below the peak so far there is nothing to find.
    """
    fourth, size = 0.0, abs(constant)
    x0, v0, x1, v1 = constant, 0.0, constant, 0.0
    count = st.counters[AWAKE]
    for a in range(count):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        wave = flows.response[s, j] * st.amplitude[j]
        work.wave[a], work.rate[a] = wave, rate
        square = rate.real * rate.real + rate.imag * rate.imag
        part = math.sqrt(wave.real * wave.real + wave.imag * wave.imag)
        fourth += part * square * square
        size += part
        x0 += wave.real
        v0 += rate.real * wave.real - rate.imag * wave.imag
        wave += flows.response[s, j] * work.gain[a]
        x1 += wave.real
        v1 += rate.real * wave.real - rate.imag * wave.imag
    driven = flows.driven[s]
    if driven > 0:
        load = flows.load[s, : driven + 1]
        more = _drive(
            flows.eigenvalue[s], flows.response[s], load, st.amplitude[0], work.gain[0], rows.period, work.drive
        )
        v0, v1, size, fourth = v0 + more[0], v1 + more[1], size + more[2] * tau, fourth + more[3]
    if size <= peak or tau <= 0.0:
        return peak
    peak = max(peak, abs(x0), abs(x1))
    if not _may_exceed(peak, x0, v0, x1, v1, tau, fourth):
        return peak
    h = 0.125 * rows.period
    if fourth * min(h, tau) ** 4 <= 0.384 * size:
        pieces = math.ceil(tau / h)
        for a in range(count):
            work.turn[a] = flows.turn[s, st.awake[a]]
    else:
        pieces = min(math.ceil(tau * math.sqrt(math.sqrt(fourth / (0.384 * size)))), 4096)
        h = tau / pieces
        for a in range(count):
            work.turn[a] = exp_minus_one(work.rate[a] * h) + 1.0
    return _climb(
        work.rate[:count], work.wave, work.turn, work.drive[: driven + 1], work.growth, constant, x0, v0, x1, v1, tau,
        h, pieces, fourth, peak,
    )  # fmt: skip


@kernel
def _drive(eigenvalue, response, load, phase, change, period, drive):
    """Share of the response in the growth of driven modes: sets drive, 1/s.

    Returns what it adds to the speed at both ends and to the bounds of the response, by time, and fourth derivative.
    """
    v0, v1, size, fourth = 0.0, 0.0, 0.0, 0.0
    for j in range(1, len(load)):
        drive[j] = response[j] * load[j] * phase
        v0 += drive[j].real
        v1 += (response[j] * load[j] * (phase + change)).real
        size += abs(drive[j].real) + abs(drive[j].imag)
        fourth += secular_bound(drive[j], eigenvalue[j], eigenvalue[0], period, 4)
    return v0, v1, size, fourth


@kernel
def _climb(rates, waves, turns, drives, growths, constant, x0, v0, x1, v1, tau, h, pieces, fourth, peak):
    """The largest |response| on a grid of so many pieces of length h, the last one shorter, and before."""
    count, driven = len(rates), len(drives)
    for j in range(1, driven):
        growths[j], _ = secular(rates[j], rates[0], h)
    end, end_slope = x1, v1
    for i in range(pieces):
        x1, v1 = constant, 0.0
        if i == pieces - 1:
            x1, v1, h = end, end_slope, tau - i * h
        else:
            for a in range(count):
                wave, rate = waves[a] * turns[a], rates[a]
                x1 += wave.real
                v1 += rate.real * wave.real - rate.imag * wave.imag
            for j in range(1, driven):
                x1 += (drives[j] * growths[j]).real
                v1 += (drives[j] * (rates[j] * growths[j] + turns[0])).real
            peak = max(peak, abs(x1))
        if v0 * v1 < 0.0 and _may_exceed(peak, x0, v0, x1, v1, h, fourth):
            peak = max(peak, _extremum(rates, waves, drives, constant, x0, v0, x1, v1, h))
        x0, v0 = x1, v1
        if i < pieces - 1:
            for a in range(count):
                waves[a] *= turns[a]
            for j in range(1, driven):
                waves[j] += drives[j] * growths[j]
                drives[j] *= turns[0]
    return peak


@inlined
def _may_exceed(peak, x0, v0, x1, v1, h, fourth):
    """Whether |x| may exceed peak within [0, h]: cubic interpolant of the ends, and what it may be wrong by."""
    room = peak - fourth * h * h * h * h / 384.0
    # the interpolant's basis functions of the slopes stay below 4/27 h
    rise = max(x0, x1) + (4 / 27) * h * (max(v0, 0.0) + max(-v1, 0.0))
    fall = min(x0, x1) + (4 / 27) * h * (min(v0, 0.0) + min(-v1, 0.0))
    return rise > room or -fall > room


@kernel
def _extremum(rates, waves, drives, constant, x0, v0, x1, v1, h):
    """|x| where its slope vanishes within [0, h], v0 and v1 of opposite sign: Newton from the cubic interpolant."""
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
        # derivatives at t by the recurrence of the modes' characteristic polynomials
        x, v, w, third, fourth, fifth, sixth = constant, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(len(rates)):
            rate, wave = rates[a], waves[a]
            part = wave + wave * exp_minus_one(rate * t)
            twice, square = 2.0 * rate.real, rate.real * rate.real + rate.imag * rate.imag
            d0, d1 = part.real, rate.real * part.real - rate.imag * part.imag
            d2 = twice * d1 - square * d0
            d3 = twice * d2 - square * d1
            d4 = twice * d3 - square * d2
            x, v, w, third, fourth = x + d0, v + d1, w + d2, third + d3, fourth + d4
            fifth += twice * d4 - square * d3
            sixth += (abs(part.real) + abs(part.imag)) * square * square * square
        for j in range(1, len(drives)):
            rate, excitation = rates[j], rates[0]
            growth, _ = secular(rate, excitation, t)
            part, turn = drives[j] * growth, drives[j] * (1.0 + exp_minus_one(excitation * t))
            x += part.real
            part, turn = rate * part + turn, excitation * turn
            v += part.real
            part, turn = rate * part + turn, excitation * turn
            w += part.real
            part, turn = rate * part + turn, excitation * turn
            third += part.real
            part, turn = rate * part + turn, excitation * turn
            fourth += part.real
            part = rate * part + turn
            fifth += part.real
            sixth += secular_bound(drives[j], rate, excitation, 2.0 * math.pi / excitation.imag, 6)
        if v * v0 > 0.0:
            lo = t
        else:
            hi = t
        step = -v / w if w != 0.0 else math.inf
        for _ in range(3):
            slope = v + step * (w + step * (third / 2 + step * (fourth / 6 + step * fifth / 24)))
            step -= slope / (w + step * (third + step * (fourth / 2 + step * fifth / 6)))
        if lo <= t + step <= hi:
            top = x + step * (v + step * (w / 2 + step * (third / 6 + step * (fourth / 24 + step * fifth / 120))))
            square = step * step
            # x has no slope there: a step that is wrong by its square root leaves its digits
            if sixth * square * square * square < 1e-13 * abs(top):
                return abs(top)
            t += step
        else:
            t = 0.5 * (lo + hi)
    return abs(x)


@kernel
def _sample(rows, flows, st, rec, s, tau, constant):
    """Response and slips at the equidistant sampling times within [time, time + tau)."""
    each = len(rec.samples) // (len(rec.section) - 1)
    start = st.time[0]
    begin = math.ceil(start / rows.period * each - 1e-12)
    for i in range(max(begin, 0), each):
        t = i * rows.period / each - start
        if t >= tau:
            break
        t = max(t, 0.0)
        entry = rec.samples[st.counters[PERIOD] * each + i]
        entry[0] = constant
        for r in range(len(rows.mass)):
            entry[1 + r] = st.displacement[r] + t * (st.velocity[r] + 0.5 * st.drift[r] * t)
        for a in range(st.counters[AWAKE]):
            j = st.awake[a]
            z = flows.eigenvalue[s, j] * t
            first = exp_minus_one(z)
            line = exp_minus_line(z, first)
            entry[0] += (flows.response[s, j] * st.amplitude[j] * (1.0 + first)).real
            for r in range(len(rows.mass)):
                entry[1 + r] += (flows.motion[s, r, j] * st.amplitude[j] * line).real
        for j in range(1, flows.driven[s] + 1):
            growth, beyond = secular(flows.eigenvalue[s, j], flows.eigenvalue[s, 0], t)
            drive = flows.load[s, j] * st.amplitude[0]
            entry[0] += (flows.response[s, j] * drive * growth).real
            for r in range(len(rows.mass)):
                entry[1 + r] += (flows.motion[s, r, j] * drive * beyond).real
