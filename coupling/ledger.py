"""The account of a segment: energies, harmonics, mean square, momentum, peaks and samples, all in closed form."""

from __future__ import annotations

import math

from coupling.compiled import kernel
from coupling.events import exp_minus_line, exp_minus_one
from coupling.state import AWAKE, EXCITATION, FLOW, PERIOD, VISCOUS


@kernel
def account(rows, flows, st, rec, work, tau):
    """Energy, harmonic, mean square, momentum and peak of the segment [0, tau], by closed-form integrals."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    first = work.first[: st.counters[AWAKE]]
    st.ledger[EXCITATION] += _work(rows, flows, st, s, first, tau)
    st.ledger[VISCOUS] += _viscous(flows, st, s, first, tau)
    constant = 0.0
    for i in range(len(st.constant)):
        constant += rows.response[i] * st.constant[i]
    rec.harmonic[period] += _harmonic(flows.response[s], flows.eigenvalue[s], st, first, tau, constant, 0.0)
    rec.square[period] += _square(flows, st, s, first, tau, constant)
    rec.momentum[period] += _momentum(rows, flows, st, s, first, work.speed, tau)
    rec.peak[period] = _peak(flows, st, s, tau, constant, rec.peak[period])
    if rec.samples.shape[0] > 0:
        _sample(rows, flows, st, rec, s, tau, constant)


@kernel
def _integral(rate, last, tau):
    """Integral of exp(rate t) over [0, tau], given last = exp(rate tau) - 1."""
    z = rate * tau
    if abs(z.real) + abs(z.imag) < 1e-5:
        return tau * (1.0 + z * (0.5 + z / 6.0))
    return last / rate


@kernel
def _product(x, y):
    """exp(u + v) - 1 from x = exp(u) - 1 and y = exp(v) - 1."""
    return x * y + x + y


@kernel
def _work(rows, flows, st, s, first, tau):
    """Work of the harmonic loads, whose amplitude is that of the sine: Im exp(i omega t)."""
    rate0, phase = flows.eigenvalue[s, 0], st.amplitude[0]
    total = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        c = flows.work[s, j] * st.amplitude[j]
        forward = phase * c * _integral(rate + rate0, _product(first[a], first[0]), tau)
        back = phase.conjugate() * c * _integral(rate - rate0, _product(first[a], first[0].conjugate()), tau)
        total += 0.5 * (forward.imag - back.imag)
    for b in range(len(rows.mass)):
        if rows.inertia[b] != 0.0:
            speed = _free_speed(rows, flows, st, s, b)
            i0, i1 = _line_integrals(rate0, first[0], tau)
            total += -rows.inertia[b].imag * (phase * (speed * i0 + st.body_drift[b] * i1)).imag
    return total


@kernel
def _free_speed(rows, flows, st, s, b):
    """Constant part of a free body's velocity at the segment's start; 0 for a body that rides on the structure."""
    if flows.body_acceleration[s, b, b] == 0.0:
        return 0.0
    speed = st.velocity[b]
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        speed -= (flows.motion[s, b, j] * flows.eigenvalue[s, j] * st.amplitude[j]).real
    return speed


@kernel
def _line_integrals(rate, last, tau):
    """Integrals of exp(rate t) and of t exp(rate t) over [0, tau]."""
    i0 = _integral(rate, last, tau)
    z = rate * tau
    if abs(z.real) + abs(z.imag) < 1e-2:
        return i0, tau * tau * (0.5 + z / 3.0 + z * z / 8.0 + z * z * z / 30.0 + z * z * z * z / 144.0)
    return i0, (tau * (last + 1.0) - i0) / rate


@kernel
def _viscous(flows, st, s, first, tau):
    """Energy lost in the structure's dampers: integral of p' D p'."""
    total = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        for b in range(a + 1):
            k = st.awake[b]
            if flows.uncoupled[s] and k != j and k != 0:
                continue
            rate_j, rate_k = flows.eigenvalue[s, j], flows.eigenvalue[s, k]
            both = st.amplitude[j] * st.amplitude[k] * flows.loss[s, j, k]
            mixed = st.amplitude[j] * st.amplitude[k].conjugate() * flows.loss_conjugate[s, j, k]
            conjugate = first[b].conjugate()
            part = (
                both * _integral(rate_j + rate_k, _product(first[a], first[b]), tau)
                + mixed * _integral(rate_j + rate_k.conjugate(), _product(first[a], conjugate), tau)
            ).real
            total += 0.5 * part if j == k else part
    return total


@kernel
def _harmonic(row, eigenvalue, st, first, tau, constant, drift):
    """Integral over the segment of (constant + drift t + Re sum row_j c_j exp(lambda_j t)) exp(-i omega t)."""
    back, turn = st.amplitude[0].conjugate(), first[0].conjugate()
    i0, i1 = _line_integrals(-eigenvalue[0], turn, tau)
    total = constant * i0 + drift * i1
    for a in range(len(first)):
        j = st.awake[a]
        c = row[j] * st.amplitude[j]
        if c == 0.0:
            continue
        total += 0.5 * c * _integral(eigenvalue[j] - eigenvalue[0], _product(first[a], turn), tau)
        rate = eigenvalue[j].conjugate()
        total += 0.5 * c.conjugate() * _integral(rate - eigenvalue[0], _product(first[a].conjugate(), turn), tau)
    return back * total


@kernel
def _square(flows, st, s, first, tau, constant):
    """Integral of the squared response; pairs of modes below 1e-9 of the largest are left out."""
    largest = 0.0
    for a in range(len(first)):
        j = st.awake[a]
        largest = max(largest, abs(flows.response[s, j] * st.amplitude[j]))
    total = constant * constant * tau
    for a in range(len(first)):
        j = st.awake[a]
        cj, rate_j = flows.response[s, j] * st.amplitude[j], flows.eigenvalue[s, j]
        if abs(cj) <= 1e-9 * largest:
            continue
        total += 2.0 * constant * (cj * _integral(rate_j, first[a], tau)).real
        for b in range(a + 1):
            k = st.awake[b]
            ck, rate_k = flows.response[s, k] * st.amplitude[k], flows.eigenvalue[s, k]
            if abs(ck) <= 1e-9 * largest:
                continue
            part = (
                cj * ck * _integral(rate_j + rate_k, _product(first[a], first[b]), tau)
                + cj * ck.conjugate()
                * _integral(rate_j + rate_k.conjugate(), _product(first[a], first[b].conjugate()), tau)
            ).real  # fmt: skip
            total += 0.5 * part if j == k else part
    return total


@kernel
def _momentum(rows, flows, st, s, first, row, tau):
    """Integral of the bodies' momentum times exp(-i omega t)."""
    total = 0.0j
    for b in range(len(rows.mass)):
        for a in range(len(first)):
            j = st.awake[a]
            row[j] = flows.body[s, b, j] * flows.eigenvalue[s, j]
        speed = _free_speed(rows, flows, st, s, b)
        total += rows.mass[b] * _harmonic(row, flows.eigenvalue[s], st, first, tau, speed, st.body_drift[b])
    return total


@kernel
def _response_at(flows, st, s, t, constant):
    """Response, its slope and curvature at t."""
    x, v, w = constant, 0.0, 0.0
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        rate = flows.eigenvalue[s, j]
        part = flows.response[s, j] * st.amplitude[j] * (exp_minus_one(rate * t) + 1.0)
        x += part.real
        part *= rate
        v += part.real
        w += (part * rate).real
    return x, v, w


@kernel
def _peak(flows, st, s, tau, constant, peak):
    """Largest |response| on [0, tau] and before.

    Between points of a grid the response differs from its cubic Hermite interpolant by at most (bound of the fourth
    derivative) h^4/384: the grid keeps this below 1e-3 of the response, and each maximum found is polished by Newton.
    """
    fourth, size = 0.0, abs(constant)
    for a in range(st.counters[AWAKE]):
        j = st.awake[a]
        part = abs(flows.response[s, j] * st.amplitude[j])
        rate = flows.eigenvalue[s, j]
        square = rate.real * rate.real + rate.imag * rate.imag
        fourth += part * square * square
        size += part
    if size <= peak or tau <= 0.0:
        return peak
    step = tau if fourth == 0.0 else min(tau, (0.384 * size / fourth) ** 0.25)
    pieces = min(math.ceil(tau / step), 4096)
    x0, v0, w0 = _response_at(flows, st, s, 0.0, constant)
    peak = max(peak, abs(x0))
    h = tau / pieces
    for i in range(pieces):
        x1, v1, w1 = _response_at(flows, st, s, (i + 1) * h, constant)
        peak = max(peak, abs(x1))
        if v0 * v1 < 0.0 and max(abs(x0) + abs(v0) * h, abs(x1) + abs(v1) * h) > peak:
            lo, hi = i * h, (i + 1) * h
            t, x, v, w = lo + h * v0 / (v0 - v1), x0, v0, w0
            for _ in range(8):
                x, v, w = _response_at(flows, st, s, t, constant)
                if v * v0 > 0.0:
                    lo = t
                else:
                    hi = t
                better = t - v / w if w != 0.0 else lo
                if not lo < better < hi:
                    better = 0.5 * (lo + hi)
                if abs(better - t) < 1e-8 * h:
                    break
                t = better
            peak = max(peak, abs(x))
        x0, v0, w0 = x1, v1, w1
    return peak


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
        entry[0] = _response_at(flows, st, s, t, constant)[0]
        for r in range(len(rows.mass)):
            shift = t * (st.velocity[r] + 0.5 * st.drift[r] * t)
            for a in range(st.counters[AWAKE]):
                j = st.awake[a]
                z = flows.eigenvalue[s, j] * t
                shift += (flows.motion[s, r, j] * st.amplitude[j] * exp_minus_line(z, exp_minus_one(z))).real
            entry[1 + r] = st.displacement[r] + shift
