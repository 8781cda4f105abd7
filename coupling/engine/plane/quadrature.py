"""Integrals of a segment: energies, harmonics, peaks, the largest tilt.

The integrands are products of the motion's own exponentials and parabolas. With few modes Gauss's rule of eight points
is quick: on pieces in which the fastest mode turns by no more than _TURN it leaves out 1e-15 of them. With many the
pieces are short, and the integrals in closed form quicker (exponential_integrals).
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.engine.plane.exponential_integrals import integrate, response_after, set_up
from vanedamp.coupling.engine.plane.tolerances import PEAK
from vanedamp.coupling.numerics.codes import FLOW, LEAVING, OPEN, PERIOD
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one
from vanedamp.coupling.response.recorder import note_response, note_tilts
from vanedamp.coupling.response.records import CONTACT, EXCITATION, FRICTION, VISCOUS
from vanedamp.coupling.system.system import FLOOR
from vanedamp.coupling.system.unit_kinematics import is_compliant, is_slip, row_speed

_TURN = 1.5
#: number of modes from which on integrals are taken in closed form, if none is slower than this times the excitation:
#: in such a mode closed forms are differences of large numbers
_MANY, _SLOW = 6, 0.01
#: most steps to a peak
_STEPS = 50
_NODES, _WEIGHTS = (tuple(part.tolist()) for part in np.polynomial.legendre.leggauss(8))


@inlined
def motion_at(system, flows, st, scratch, t, q, v):
    """Coordinates and velocities (N,) at time t of the segment; scratch.turn (m,) becomes exp(lambda t) - 1."""
    s = st.counters[FLOW]
    for j in range(flows.modes[s]):
        z = flows.eigenvalue[s, j] * t
        first = exp_minus_one(z)
        scratch.turn[j] = first
        scratch.wave[j] = st.amplitude[j] * exp_minus_line(z, first)
    for i in range(len(q)):
        shift, speed = t * (st.v[i] + 0.5 * t * st.bend[i]), t * st.bend[i]
        for j in range(flows.modes[s]):
            shape = flows.motion[s, i, j]
            shift += (shape * scratch.wave[j]).real
            speed += (shape * flows.eigenvalue[s, j] * st.amplitude[j] * scratch.turn[j]).real
        q[i], v[i] = st.q[i] + shift, st.v[i] + speed


@kernel
def add_up(system, flows, st, rec, scratch, tau):
    """Add a segment of length tau to ledger and records; st is at its start."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    pieces, slowest = max(1, math.ceil(tau * flows.fastest[s] / _TURN)), math.inf
    for j in range(flows.modes[s]):
        rate = flows.eigenvalue[s, j]
        slowest = min(slowest, abs(rate.real) + abs(rate.imag))
    x0, rate0 = response_at(system, st.q, st.v, st.time[0])
    note_response(rec, period, x0)
    note_tilts(system, rec, st.q, period)
    for b in range(len(system.along)):
        if system.tilt[b] >= 0 and not _on_floor(system, st, b):
            rec.lifted[period, b] += tau
    many = flows.modes[s] >= _MANY and slowest > _SLOW * system.frequency[0]
    if many and not _is_sprung(system, st):
        _add_closed_forms(system, flows, st, rec, scratch, tau, pieces, x0, rate0)
        return
    h, q, v = tau / pieces, scratch.ahead[0], scratch.ahead[1]
    for piece in range(pieces):
        for node in range(len(_NODES)):
            t = h * (piece + 0.5 * (1.0 + _NODES[node]))
            motion_at(system, flows, st, scratch, t, q, v)
            _add_node(system, flows, st, rec, scratch, q, v, t, 0.5 * h * _WEIGHTS[node])
        end = h * (piece + 1)
        motion_at(system, flows, st, scratch, end, q, v)
        x1, rate1 = response_at(system, q, v, st.time[0] + end)
        note_response(rec, period, x1)
        if rate0 * rate1 < 0.0:
            note_response(rec, period, _extremum(system, flows, st, scratch, q, v, end - h, end, rate0))
        rate0 = rate1


@kernel
def _add_closed_forms(system, flows, st, rec, scratch, tau, pieces, x0, rate0):
    """Add the integrals of a segment, and its peaks: of the response on pieces, of tilts as often as it turns."""
    period, q, v = st.counters[PERIOD], scratch.ahead[0], scratch.ahead[1]
    set_up(system, flows, st, scratch, tau)
    integrate(system, flows, st, rec, scratch, tau)
    turns = max(1, math.ceil(tau * system.frequency[0] / _TURN))
    for piece in range(turns):
        for node in range(len(_NODES)):
            motion_at(system, flows, st, scratch, tau / turns * (piece + 0.5 * (1.0 + _NODES[node])), q, v)
            note_tilts(system, rec, q, period)
    h = tau / pieces
    for piece in range(pieces):
        x1, rate1, _ = response_after(flows, st, scratch, h * (piece + 1))
        note_response(rec, period, x1)
        if rate0 * rate1 < 0.0:
            low, high, t = h * piece, h * (piece + 1), h * (piece + 0.5)
            for _ in range(_STEPS):  # Newton's method, held between the bounds
                x, rate, bend = response_after(flows, st, scratch, t)
                low, high = (t, high) if (rate > 0.0) == (rate0 > 0.0) else (low, t)
                step = t - rate / bend if bend != 0.0 else low
                step = step if low < step < high else 0.5 * (low + high)
                if abs(step - t) <= PEAK * h:
                    break
                t = step
            note_response(rec, period, x)
        rate0 = rate1


@inlined
def _is_sprung(system, st):
    """Whether a compliant contact is closed: its force has integrals of its own."""
    sprung = False
    for r in range(system.contacts):
        sprung = sprung or (is_compliant(system, r) and st.state[r] < OPEN)
    return sprung


@inlined
def _on_floor(system, st, b):
    for r in range(system.contacts):
        shut = st.state[r] != OPEN and st.state[r] != LEAVING
        if shut and system.body[r] == b and system.surface[r] == FLOOR:
            return True
    return False


@kernel
def _add_node(system, flows, st, rec, scratch, q, v, t, weight):
    """Add the integrands at one point, times its weight."""
    s, size, u, period = st.counters[FLOW], len(st.q), len(system.rest), st.counters[PERIOD]
    power, loss, momentum = 0.0, 0.0, 0.0
    for h in range(len(system.frequency)):
        phase = st.amplitude[h] * (1.0 + scratch.turn[h])
        for i in range(size):
            power += (system.load[h, i] * phase).real * v[i]
    for i in range(size):
        damper = 0.0
        for k in range(size):
            damper += system.damping[i, k] * v[k]
        loss += v[i] * damper
    friction, contact = 0.0, 0.0
    for r in range(u):
        state = st.state[r]
        if is_compliant(system, r) and state < OPEN:
            rate = row_speed(system, r, v)
            taken = system.dashpot[r] * rate * rate
            contact += taken
            for row in (r, u + r):
                force = _force_at(flows, st, scratch, row)
                st.pushed[row] += weight * force
                if row >= u and is_slip(state):
                    taken -= force * row_speed(system, row, v)
            st.lost[r] += weight * taken
        if is_slip(state) and not flows.held[s, r]:
            friction -= _force_at(flows, st, scratch, u + r) * row_speed(system, u + r, v)
    for i in system.along:
        momentum += system.mass[i] * v[i]
    note_tilts(system, rec, q, period)
    x, _ = response_at(system, q, v, st.time[0] + t)
    phase = st.amplitude[0] * (1.0 + scratch.turn[0])
    back = phase.conjugate()
    st.ledger[EXCITATION] += weight * power
    st.ledger[VISCOUS] += weight * loss
    st.ledger[FRICTION] += weight * friction
    st.ledger[CONTACT] += weight * contact
    rec.harmonic[period] += weight * x * back
    rec.momentum[period] += weight * momentum * back
    rec.square[period] += weight * x * x
    if len(rec.swing) > 0:
        rec.swing[period, 2] += weight * x


@inlined
def _force_at(flows, st, scratch, row):
    """Return the force of a row at the time of `motion_at`, N."""
    s, force = st.counters[FLOW], st.force[row]
    for j in range(flows.modes[s]):
        force += (flows.force[s, row, j] * st.amplitude[j] * (1.0 + scratch.turn[j])).real
    return force


@inlined
def response_at(system, q, v, time):
    """Return displacement and speed of the response, that of a prescribed base included."""
    x, rate = 0.0, 0.0
    for h in range(len(system.frequency)):
        if system.table[h] != 0.0:
            angle = system.frequency[h] * time
            part = system.table[h] * complex(math.cos(angle), math.sin(angle))
            x += part.real
            rate -= system.frequency[h] * part.imag
    for i in range(len(q)):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
    return x, rate


@kernel
def _extremum(system, flows, st, scratch, q, v, low, high, rate):
    """Return the response where its speed vanishes between two times, by bisection."""
    x = 0.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        motion_at(system, flows, st, scratch, middle, q, v)
        x, now = response_at(system, q, v, st.time[0] + middle)
        if now == 0.0:
            break
        low, high = (middle, high) if (now > 0.0) == (rate > 0.0) else (low, middle)
    return x
