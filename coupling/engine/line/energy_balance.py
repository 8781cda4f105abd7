"""The energy balance of a segment, and its harmonics, mean square, momentum, peak and samples, all in closed form."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.energy_forms import (
    add_forms,
    add_segment,
    at_point,
    free_momentum,
    points_of,
    turning_back,
)
from vanedamp.coupling.engine.line.sleeping import free_speed, show_sleepers
from vanedamp.coupling.engine.line.tolerances import SAMPLE
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    ASLEEP,
    FLOW,
    HARMONIC_MAP,
    MEAN_MAP,
    MOMENTUM_MAP,
    PERIOD,
    WORK_MAP,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one, secular
from vanedamp.coupling.response.records import CONTACT, EXCITATION, VISCOUS


@inlined
def end_segment(system, flows, st, rec, scratch, tau):
    """Add the segment's [0, tau] own terms: slow pairs of modes, parabolas of the bodies, the peak, samples."""
    s, period, constant = st.counters[FLOW], st.counters[PERIOD], st.offset[0]
    if system.bodies > 0:
        _free_bodies(system, flows, st, rec, scratch, s, period, tau)
    add_segment(system, flows, st, rec, scratch, s, period, tau, constant, 1.0)
    if flows.coalescing[s]:
        _add_losses(system, flows, st, rec, scratch, s, tau)
    if rec.samples.shape[0] > 0:
        if st.counters[ASLEEP] > 0:
            show_sleepers(system, flows, st)
        _sample(system, flows, st, rec, s, tau, constant)


@inlined
def add_interval(system, flows, st, rec, scratch):
    """Add energies, harmonic, mean square and momentum of the modes since the interval began; begin the next.

    An interval lies in one subsystem and one period. Each integral is a form of the amplitudes at its end minus that
    at its start, without the jumps of the form at impacts in between (`subtract_impact`). With c the amplitudes at the
    start, c + d at the end, the difference of a quadratic form Q is d Q (2 c + d): it does not cancel.
    """
    s, period, count = st.counters[FLOW], st.counters[PERIOD], st.counters[ACTIVE]
    change, total = st.change, scratch.total
    for j in range(count):
        total[2 * j] = 2.0 * st.amplitude[j].real - change[2 * j]
        total[2 * j + 1] = 2.0 * st.amplitude[j].imag - change[2 * j + 1]
    add_forms(system, flows, st, rec, scratch, s, period, count)
    for i in range(2 * count):
        change[i] = 0.0


@inlined
def subtract_impact(system, flows, st, rec, r, impulse):
    """Take the jump of all forms at an impulse on row r (N s) out of the interval, before the amplitudes jump."""
    s = st.counters[FLOW]
    _subtract_jump(
        system, flows, st, rec, flows.kick[s, r], flows.kick_maps[s, r], flows.impulse_response[s, r], impulse
    )


@inlined
def subtract_step(system, flows, st, rec, r, force, shift):
    """Do the same at a step of the friction on body r (N), which shifts the response by its constant part (m)."""
    s, period, mean = st.counters[FLOW], st.counters[PERIOD], 0.0
    for j in range(st.counters[ACTIVE]):
        mean += (
            flows.linear[s, j, MEAN_MAP] * st.change[2 * j] + flows.linear[s, j, MEAN_MAP + 1] * st.change[2 * j + 1]
        )
    rec.square[period] -= shift * mean
    rec.harmonic[period] -= shift * (complex(0.0, 1.0 / system.omega) * complex(st.change[0], -st.change[1]))
    st.offset[0] += shift
    _subtract_jump(system, flows, st, rec, flows.step[s, r], flows.step_maps[s, r], flows.step_response[s, r], force)


@kernel
def _subtract_jump(system, flows, st, rec, kick, maps, response, impulse):
    """Take the jump of all forms out of the interval as the amplitudes jump by a response times an impulse."""
    s, period, e, back = st.counters[FLOW], st.counters[PERIOD], len(system.frequency), st.amplitude[0].conjugate()
    loss, square, contact = _kicks(kick, st.amplitude, response, impulse, flows.modes[s])
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
def _free_bodies(system, flows, st, rec, scratch, s, period, tau):
    """Add momentum and work of the polynomial part of the bodies' motion."""
    n, drift = system.modes, 0.0
    asleep = st.counters[ASLEEP] > 0
    speed = 0.0 if asleep else -free_momentum(flows.linear[s], st.amplitude, st.counters[ACTIVE])
    for b in range(system.bodies):
        drift += system.mass[n + b] * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += system.mass[n + b] * (free_speed(flows, st, b) if asleep else st.velocity[b])
    for h in range(len(system.frequency)):
        rate = system.frequency[h]
        momentum = turning_back(speed, drift, rate, scratch.gain[h], scratch.bend[h], tau)
        if h == 0:
            rec.momentum[period] += momentum
        if system.alike:
            load = system.load[h, n] / system.mass[n]
            st.ledger[EXCITATION] += load.real * momentum.real + load.imag * momentum.imag
        else:
            st.ledger[EXCITATION] += _work_on_bodies(system, flows, st, scratch, s, h, tau)


@kernel
def _work_on_bodies(system, flows, st, scratch, s, h, tau):
    """Return the work of the base on the polynomial part of the bodies' motion, in cavities of several directions."""
    n, speed, drift, rate = system.modes, 0.0j, 0.0j, system.frequency[h]
    for b in range(system.bodies):
        load = system.load[h, n + b].conjugate()
        drift += load * st.coordinate_acceleration[n + b]
        if flows.body_acceleration[s, b, b] != 0.0:
            speed += load * free_speed(flows, st, b)
    return turning_back(speed, drift, rate, scratch.gain[h], scratch.bend[h], tau).real


@kernel
def _add_losses(system, flows, st, rec, scratch, s, tau):
    """Add losses and mean square of modes that nearly coalesce, which have no forms (energy_forms.at_point)."""
    n, count, speed = system.modes, st.counters[ACTIVE], scratch.coordinates
    points = points_of(flows, st, s, tau)
    for i in range(points):
        weight = at_point(system, flows, st, rec, scratch, s, tau, i, points)
        for k in range(n):
            speed[k] = 0.0
            for j in range(count):
                speed[k] += (flows.shape[s, j, n + k] * scratch.wave[j]).real
        for k in range(n):
            for l in range(n):
                st.ledger[VISCOUS] += weight * system.damping[k, l] * speed[k] * speed[l]
        for r in range(len(system.dashpot)):
            if flows.active_set[s, r] and system.dashpot[r] > 0.0:
                rate = 0.0
                for j in range(count):
                    rate += (flows.velocity[s, r, j] * scratch.wave[j]).real
                st.ledger[CONTACT] += weight * system.dashpot[r] * rate * rate


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
