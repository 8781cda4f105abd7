"""The energy balance of a segment, its harmonics, peak and tilts, and the motion within it.

All is in closed form, but for extremes of tilts, which are sought as peaks are (engine.peaks). Forms of the amplitudes
have what the modes contribute (energy_forms); bodies also have a linear speed, speed + drift t, whose products with
modes are integrated here.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.amplitudes import amplitude_changes, row_change
from vanedamp.coupling.engine.energy_forms import (
    add_forms,
    add_segment,
    at_point,
    free_momentum,
    points_of,
    quadratic_form,
    slow_product,
    turning_back,
)
from vanedamp.coupling.engine.peaks import may_exceed
from vanedamp.coupling.numerics.codes import ACTIVE, FLOW, OPEN, PERIOD, SINGLE
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.tolerances import PEAK
from vanedamp.coupling.response.records import CONTACT, EXCITATION, FRICTION, VISCOUS
from vanedamp.coupling.system.unit_kinematics import has_friction, is_compliant, is_slip, row_speed

#: pieces of a period in which a tilt has one extremum at most, and most pieces of a segment where modes are faster
_PIECES, _MOST_PIECES = 16, 4096
#: most steps to an extremum of a tilt
_STEPS = 40


@inlined
def move(system, flows, st, scratch, t, q, v):
    """Set coordinates and velocities (N,) at time t of the segment, and the changes of the amplitudes until then."""
    s, count = st.counters[FLOW], st.counters[ACTIVE]
    amplitude_changes(flows, st, scratch, t)
    for i in range(len(q)):
        shift, speed = row_change(flows.motion[s, i], flows.velocity[s, i], scratch.bend, scratch.gain, count)
        q[i], v[i] = st.q[i] + (shift + t * (st.v[i] + 0.5 * t * st.bend[i])), st.v[i] + (speed + t * st.bend[i])


@inlined
def end_segment(system, flows, st, rec, scratch, tau, q, v):
    """Add the segment [0, tau], at whose end coordinates and velocities are q and v (`move`)."""
    s, period, count = st.counters[FLOW], st.counters[PERIOD], st.counters[ACTIVE]
    for j in range(count):
        c, gain = st.amplitude[j], scratch.gain[j]
        st.change[2 * j], st.change[2 * j + 1] = gain.real, gain.imag
        scratch.total[2 * j], scratch.total[2 * j + 1] = 2.0 * c.real + gain.real, 2.0 * c.imag + gain.imag
    add_forms(system, flows, st, rec, scratch, s, period, count)
    _add_bodies(system, flows, st, rec, scratch, s, period, tau, count)
    if flows.rubs[s]:
        _add_friction(system, flows, st, scratch, s, tau, count)
    if flows.coalescing[s]:
        _add_losses(system, flows, st, rec, scratch, s, tau, count)
    grows = math.exp(flows.growth[s] * tau) if flows.growth[s] > 0.0 else 1.0
    add_segment(system, flows, st, rec, scratch, s, period, tau, st.offset[0], grows)
    for b in range(len(system.along)):
        if system.tilt[b] >= 0:
            if flows.airborne[s, b]:
                rec.lifted[period, b] += tau
            _note_tilt(system, rec, period, b, _tilt(system, b, st.q))
            if flows.rocks[s, b]:
                _note_rocking(system, flows, st, rec, scratch, b, tau, q, v)
            else:
                _note_tilt(system, rec, period, b, _tilt(system, b, q))


@inlined
def _add_bodies(system, flows, st, rec, scratch, s, period, tau, count):
    """Add momentum of the linear part of the bodies' speeds, and the work of loads on it."""
    speed, drift = -free_momentum(flows.linear[s], st.amplitude, count), 0.0
    for i in system.along:
        speed += system.mass[i] * st.v[i]
        drift += system.mass[i] * st.bend[i]
    rec.momentum[period] += turning_back(speed, drift, system.frequency[0], scratch.gain[0], scratch.bend[0], tau)
    for h in range(len(system.frequency)):
        steady, rising = complex(0.0, 0.0), complex(0.0, 0.0)
        for i in range(system.modes, len(st.q)):
            load = system.load[h, i].conjugate()
            if load != 0.0:
                rate = st.v[i]
                for j in range(count):
                    rate -= (flows.velocity[s, i, j] * st.amplitude[j]).real
                steady += load * rate
                rising += load * st.bend[i]
        if steady != 0.0 or rising != 0.0:
            st.ledger[EXCITATION] += turning_back(
                steady, rising, system.frequency[h], scratch.gain[h], scratch.bend[h], tau
            ).real


@kernel
def _add_friction(system, flows, st, scratch, s, tau, count):
    """Add the losses of units that slip, and loss and impulse of compliant contacts."""
    u, index = len(system.rest), 0
    st.ledger[FRICTION] += quadratic_form(flows.friction[s], st.change, scratch.total, count)
    for i in range(flows.slow_count[s]):
        if flows.slow[s, i, 2] >= SINGLE:
            break
        st.ledger[FRICTION] += (flows.slow_friction[s, i] * slow_product(flows, st, s, i, tau)).real
    for r in range(u):
        compliant, taken = is_compliant(system, r), 0.0
        if is_slip(st.state[r]) and has_friction(system, r) and not flows.held[s, r]:
            taken = _friction_on_drift(system, flows, st, scratch, s, r, tau, count)
            st.ledger[FRICTION] += taken
        if compliant and st.state[r] < OPEN:
            taken += quadratic_form(flows.lost[s, index], st.change, scratch.total, count)
            for i in range(flows.slow_count[s]):
                if flows.slow[s, i, 2] >= SINGLE:
                    break
                taken += (flows.slow_lost[s, index, i] * slow_product(flows, st, s, i, tau)).real
            st.lost[r] += taken
            for row in (r, u + r):
                st.pushed[row] += st.force[row] * tau
                for j in range(count):
                    st.pushed[row] += (flows.force[s, row, j] * flows.inverse[s, j] * scratch.gain[j]).real
        index += 1 if compliant else 0


@kernel
def _add_losses(system, flows, st, rec, scratch, s, tau, count):
    """Add losses and mean square of modes that nearly coalesce, which have no forms (energy_forms.at_point)."""
    u, speed, value, points = len(system.rest), scratch.free, scratch.wave, points_of(flows, st, s, tau)
    for i in range(points):
        weight = at_point(system, flows, st, rec, scratch, s, tau, i, points)
        for k in range(len(speed)):
            speed[k] = _real_part(flows.velocity[s, k], value, count)
        for k in range(len(speed)):
            for l in range(len(speed)):
                st.ledger[VISCOUS] += weight * system.damping[k, l] * speed[k] * speed[l]
        for j in range(count):
            scratch.ahead[j] = flows.eigenvalue[s, j] * value[j]
        for r in range(u if flows.rubs[s] else 0):
            pressed, taken = is_compliant(system, r) and st.state[r] < OPEN, 0.0
            if is_slip(st.state[r]) and has_friction(system, r) and not flows.held[s, r]:
                slip, row = _real_part(flows.rows[s, u + r], scratch.ahead, count), u + r
                taken = -weight * slip * _real_part(flows.force[s, row], value, count)
                st.ledger[FRICTION] += taken
            if pressed:
                push = _real_part(flows.rows[s, r], scratch.ahead, count)
                st.ledger[CONTACT] += weight * system.dashpot[r] * push * push
                st.lost[r] += taken + weight * system.dashpot[r] * push * push


@inlined
def _real_part(functional, amplitude, count):
    """Return the real part of a functional of the active modes' amplitudes."""
    total = 0.0
    for j in range(count):
        total += (functional[j] * amplitude[j]).real
    return total


@inlined
def _friction_on_drift(system, flows, st, scratch, s, r, tau, count):
    """Return the loss by the constant part of a unit's friction, and the rest on the linear part of its slip."""
    row = len(system.rest) + r
    speed, drift = row_speed(system, row, st.v), row_speed(system, row, st.bend)
    shift, mean, slope = tau * (speed + 0.5 * tau * drift), 0.0, 0.0
    for j in range(count):
        gain, inverse, motion = scratch.gain[j], flows.inverse[s, j], flows.rows[s, row, j]
        shift += (motion * scratch.bend[j]).real
        speed -= (motion * flows.eigenvalue[s, j] * st.amplitude[j]).real
        # integrals of exp(lambda t) and t exp(lambda t)
        force = flows.force[s, row, j] * inverse
        mean += (force * gain).real
        slope += (force * (tau * gain - inverse * scratch.bend[j])).real
    return -(st.force[row] * shift + speed * mean + drift * slope)


@inlined
def _tilt(system, b, q):
    """Return the tilt of a body in its cavity; of velocities, its rate."""
    tilt = q[system.tilt[b]]
    for i in range(len(q)):
        tilt -= system.turn[b, i] * q[i]
    return tilt


@inlined
def _note_tilt(system, rec, period, b, tilt):
    rec.tilt[period, b] = max(rec.tilt[period, b], abs(tilt))


@kernel
def _note_rocking(system, flows, st, rec, scratch, b, tau, q, v):
    """Note the largest tilt within a segment in which its rate is not constant; q and v end as at its end."""
    period, pieces = st.counters[PERIOD], _pieces(system, flows, st, b, tau)
    h, x0, rate0 = tau / pieces, _tilt(system, b, st.q), _tilt(system, b, st.v)
    for piece in range(pieces):
        end = tau if piece == pieces - 1 else h * (piece + 1)
        move(system, flows, st, scratch, end, q, v)
        x1, rate1 = _tilt(system, b, q), _tilt(system, b, v)
        _note_tilt(system, rec, period, b, x1)
        if rate0 * rate1 < 0.0 and may_exceed(0.99 * rec.tilt[period, b], 0.0, x0, rate0, x1, rate1, h, 0.0):
            _note_extremum(system, flows, st, rec, scratch, b, h * piece, rate0, end, rate1, q, v)
            move(system, flows, st, scratch, end, q, v)
        x0, rate0 = x1, rate1


@kernel
def _pieces(system, flows, st, b, tau):
    """Return the pieces of a segment on which a tilt is all but a cubic, as in engine.peaks.highest."""
    s, size, fourth = st.counters[FLOW], 0.0, 0.0
    for j in range(st.counters[ACTIVE]):
        rate, row = flows.eigenvalue[s, j], flows.motion[s, system.tilt[b], j]
        for i in range(len(st.q)):
            row -= system.turn[b, i] * flows.motion[s, i, j]
        term, square = abs(row * st.amplitude[j]), rate.real * rate.real + rate.imag * rate.imag
        size += term
        fourth += term * (square * square)
    fine = tau * math.sqrt(math.sqrt(fourth / (0.384 * size))) if size > 0.0 else 0.0
    return max(math.ceil(_PIECES * tau / system.period), min(math.ceil(fine), _MOST_PIECES), 1)


@kernel
def _note_extremum(system, flows, st, rec, scratch, b, lo, low_rate, hi, high_rate, q, v):
    """Note the extremum of a tilt between two times with rates of opposite sign, by the rule of Illinois."""
    slope, side = abs(high_rate - low_rate) / (hi - lo), 0
    for _ in range(_STEPS):
        t = lo + (hi - lo) * (low_rate / (low_rate - high_rate))
        move(system, flows, st, scratch, t, q, v)
        x, rate = _tilt(system, b, q), _tilt(system, b, v)
        _note_tilt(system, rec, st.counters[PERIOD], b, x)
        if rate * rate <= PEAK * slope * abs(x) or not lo < t < hi:
            break
        if rate * high_rate > 0.0:
            hi, high_rate = t, rate
            low_rate *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            lo, low_rate = t, rate
            high_rate *= 0.5 if side < 0 else 1.0
            side = -1


@inlined
def response_at(system, q, v, time):
    """Return displacement and speed of the response, that of a prescribed base included."""
    x, rate = 0.0, 0.0
    for h in range(len(system.frequency)):
        if system.table[h] != 0.0:
            angle = system.frequency[h] * time
            base = system.table[h] * complex(math.cos(angle), math.sin(angle))
            x += base.real
            rate -= system.frequency[h] * base.imag
    for i in range(len(q)):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
    return x, rate
