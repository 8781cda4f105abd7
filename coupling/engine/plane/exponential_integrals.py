"""Integrals of a segment in closed form: of products of signals  c_0 + c_1 t + c_2 t^2 + Re sum_j g_j exp(lambda_j t).

An integral of a product needs those of  t^k exp(lambda_j t)  and of  exp((lambda_j + lambda_k) t), exp((lambda_j +
conj lambda_k) t): they are found once a segment and serve all products.
"""

from __future__ import annotations

from vanedamp.coupling.numerics.codes import FLOW, PERIOD
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.exponentials import exp_minus_one
from vanedamp.coupling.response.records import EXCITATION, FRICTION, VISCOUS
from vanedamp.coupling.system.unit_kinematics import has_friction, is_slip, row_speed

#: signals: the response, the momentum of the bodies, slip and friction of a contact
_X, _MOMENTUM, _SLIP, _FORCE = range(4)
#: |z| up to which quotients of exp(z) - 1 are taken from their series, and terms of these
_NEAR, _TERMS, _NEAREST, _FEW = 0.5, 18, 0.05, 10


@kernel
def set_up(system, flows, st, scratch, tau):
    """Set the integrals of exponentials (scratch.moment, scratch.pair), and the signals of response and momentum."""
    s = st.counters[FLOW]
    m = flows.modes[s]
    for j in range(m):
        z = flows.eigenvalue[s, j] * tau
        first = exp_minus_one(z)
        scratch.turn[j] = first
        one, two, three = _moments(z, first)
        scratch.moment[0, j], scratch.moment[1, j], scratch.moment[2, j] = (
            tau * one,
            tau * tau * two,
            tau * tau * tau * three,
        )
    for j in range(m):
        for k in range(j + 1):
            one, two = flows.eigenvalue[s, j], flows.eigenvalue[s, k]
            first, other = scratch.turn[j], scratch.turn[k]
            back = other.conjugate()
            same = tau * _quotient((one + two) * tau, first + other + first * other)
            apart = tau * _quotient((one + two.conjugate()) * tau, first + back + first * back)
            scratch.pair[0, j, k], scratch.pair[0, k, j] = same, same
            scratch.pair[1, j, k], scratch.pair[1, k, j] = apart, apart.conjugate()
    _follow_response(system, flows, st, scratch, m)
    _follow_momentum(system, flows, st, scratch, m)


@inlined
def _moments(z, first):
    """Integrals of exp(z u), u exp(z u) and u^2 exp(z u) from 0 to 1; first: exp(z) - 1."""
    if max(abs(z.real), abs(z.imag)) > _NEAR:
        one = first / z
        two = (first + 1.0 - one) / z
        return one, two, (first + 1.0 - 2.0 * two) / z
    term = complex(1.0, 0.0)
    one, two, three = complex(0.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0)
    for k in range(_TERMS):
        one, two, three = one + term / (k + 1), two + term / (k + 2), three + term / (k + 3)
        term *= z / (k + 1)
    return one, two, three


@inlined
def _quotient(z, first):
    """(exp(z) - 1)/z, with first = exp(z) - 1."""
    if max(abs(z.real), abs(z.imag)) > _NEAREST:
        return first / z
    term, total = complex(1.0, 0.0), complex(0.0, 0.0)
    for k in range(_FEW):
        total += term / (k + 1)
        term *= z / (k + 1)
    return total


@inlined
def _follow_response(system, flows, st, scratch, m):
    """Set the signal of the response, that of a prescribed base included."""
    s, c = st.counters[FLOW], scratch.constant[_X]
    c[0], c[1], c[2] = 0.0, 0.0, 0.0
    for i in range(len(st.q)):
        c[0] += system.response[i] * st.q[i]
        c[1] += system.response[i] * st.v[i]
        c[2] += 0.5 * system.response[i] * st.bend[i]
    for j in range(m):
        shape = complex(0.0, 0.0)
        for i in range(len(st.q)):
            shape += system.response[i] * flows.motion[s, i, j]
        g = shape * st.amplitude[j]
        c[0] -= g.real
        c[1] -= (g * flows.eigenvalue[s, j]).real
        scratch.signal[_X, j] = g
    for h in range(len(system.frequency)):
        scratch.signal[_X, h] += system.table[h] * st.amplitude[h]


@inlined
def _follow_momentum(system, flows, st, scratch, m):
    s, c = st.counters[FLOW], scratch.constant[_MOMENTUM]
    c[0], c[1], c[2] = 0.0, 0.0, 0.0
    for i in system.along:
        c[0] += system.mass[i] * st.v[i]
        c[1] += system.mass[i] * st.bend[i]
    for j in range(m):
        shape = complex(0.0, 0.0)
        for i in system.along:
            shape += system.mass[i] * flows.motion[s, i, j]
        g = shape * (flows.eigenvalue[s, j] * st.amplitude[j])
        scratch.signal[_MOMENTUM, j] = g
        c[0] -= g.real


@inlined
def _follow_slip(system, flows, st, scratch, m, r):
    """Set the signals of slip and friction force of a unit."""
    s, u, c, force = st.counters[FLOW], len(system.rest), scratch.constant[_SLIP], scratch.constant[_FORCE]
    c[0], c[1], c[2] = row_speed(system, u + r, st.v), row_speed(system, u + r, st.bend), 0.0
    force[0], force[1], force[2] = st.force[u + r], 0.0, 0.0
    for j in range(m):
        g = flows.rows[s, u + r, j] * flows.eigenvalue[s, j] * st.amplitude[j]
        scratch.signal[_SLIP, j], scratch.signal[_FORCE, j] = g, flows.force[s, u + r, j] * st.amplitude[j]
        c[0] -= g.real


@kernel
def _product(scratch, one, other, m, tau):
    """Integral of the product of two signals."""
    a, b, g, h = scratch.constant[one], scratch.constant[other], scratch.signal[one], scratch.signal[other]
    total, power = 0.0, 1.0
    for k in range(5):
        power *= tau
        for i in range(max(k - 2, 0), min(k, 2) + 1):
            total += a[i] * b[k - i] * power / (k + 1)
    for j in range(m):
        of_one = b[0] * scratch.moment[0, j] + b[1] * scratch.moment[1, j] + b[2] * scratch.moment[2, j]
        of_other = a[0] * scratch.moment[0, j] + a[1] * scratch.moment[1, j] + a[2] * scratch.moment[2, j]
        total += (g[j] * of_one + h[j] * of_other).real
        same, apart = complex(0.0, 0.0), complex(0.0, 0.0)
        for k in range(m):
            same += h[k] * scratch.pair[0, j, k]
            apart += h[k].conjugate() * scratch.pair[1, j, k]
        total += 0.5 * (g[j] * (same + apart)).real
    return total


@inlined
def _integral(scratch, signal, m, tau):
    """Integral of a signal."""
    c, total = scratch.constant[signal], 0.0
    for k in range(3):
        total += c[k] * tau ** (k + 1) / (k + 1)
    for j in range(m):
        total += (scratch.signal[signal, j] * scratch.moment[0, j]).real
    return total


@inlined
def _harmonic(st, scratch, signal, m):
    """Integral of a signal times the conjugate phase of the first harmonic."""
    c, g, total = scratch.constant[signal], scratch.signal[signal], complex(0.0, 0.0)
    for k in range(3):
        total += c[k] * scratch.moment[k, 0].conjugate()
    for j in range(m):
        total += 0.5 * (g[j] * scratch.pair[1, j, 0] + (g[j] * scratch.pair[0, j, 0]).conjugate())
    return total * st.amplitude[0].conjugate()


@kernel
def integrate(system, flows, st, rec, scratch, tau):
    """Add the integrals of the segment (set_up) to ledger and records."""
    s, period = st.counters[FLOW], st.counters[PERIOD]
    m = flows.modes[s]
    st.ledger[EXCITATION] += _work(system, flows, st, scratch, m)
    st.ledger[VISCOUS] += _loss(system, flows, st, scratch, m, tau)
    for r in range(len(system.rest)):
        if is_slip(st.state[r]) and not flows.held[s, r] and has_friction(system, r):
            _follow_slip(system, flows, st, scratch, m, r)
            st.ledger[FRICTION] -= _product(scratch, _SLIP, _FORCE, m, tau)
    rec.harmonic[period] += _harmonic(st, scratch, _X, m)
    rec.momentum[period] += _harmonic(st, scratch, _MOMENTUM, m)
    rec.square[period] += _product(scratch, _X, _X, m, tau)
    if len(rec.swing) > 0:
        rec.swing[period, 2] += _integral(scratch, _X, m, tau)


@inlined
def _work(system, flows, st, scratch, m):
    """Work of the loads."""
    s, total = st.counters[FLOW], 0.0
    for h in range(len(system.frequency)):
        steady, rising, swinging = complex(0.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0)
        for i in range(len(st.q)):
            if system.load[h, i] != 0.0:
                steady += system.load[h, i] * st.v[i]
                rising += system.load[h, i] * st.bend[i]
        for j in range(m):
            same, apart, speed = complex(0.0, 0.0), complex(0.0, 0.0), flows.eigenvalue[s, j] * st.amplitude[j]
            for i in range(len(st.q)):
                if system.load[h, i] != 0.0:
                    g = flows.motion[s, i, j] * speed
                    same += system.load[h, i] * g
                    apart += system.load[h, i] * g.conjugate()
            steady -= 0.5 * (same + apart)
            swinging += 0.5 * (same * scratch.pair[0, h, j] + apart * scratch.pair[1, h, j])
        total += (st.amplitude[h] * (steady * scratch.moment[0, h] + rising * scratch.moment[1, h] + swinging)).real
    return total


@inlined
def _loss(system, flows, st, scratch, m, tau):
    """Energy that the damping takes: of speeds v = e + t b + Re G z, with flows.drag = C G and G^T C G."""
    s, size, total = st.counters[FLOW], len(st.q), 0.0
    for i in range(size):
        scratch.free[i] = st.v[i]
        for j in range(m):
            scratch.free[i] -= (flows.motion[s, i, j] * flows.eigenvalue[s, j] * st.amplitude[j]).real
    for i in range(size):
        for k in range(size):
            drag = system.damping[i, k]
            if drag != 0.0:
                total += drag * tau * (
                    scratch.free[i] * scratch.free[k]
                    + tau * (scratch.free[i] * st.bend[k] + tau * st.bend[i] * st.bend[k] / 3.0)
                )  # fmt: skip
    for j in range(m):
        steady, rising, same, apart = complex(0.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0)
        for i in range(size):
            steady += scratch.free[i] * flows.drag[s, i, j]
            rising += st.bend[i] * flows.drag[s, i, j]
        for k in range(m):
            same += st.amplitude[k] * flows.loss[s, j, k] * scratch.pair[0, j, k]
            apart += st.amplitude[k].conjugate() * flows.loss_apart[s, j, k] * scratch.pair[1, j, k]
        alone = 2.0 * (steady * scratch.moment[0, j] + rising * scratch.moment[1, j])
        total += (st.amplitude[j] * (alone + 0.5 * (same + apart))).real
    return total


@inlined
def response_after(flows, st, scratch, t):
    """Return displacement, speed and acceleration of the response at a time of the segment (set_up)."""
    s, c = st.counters[FLOW], scratch.constant[_X]
    x, rate, bend = c[0] + t * (c[1] + t * c[2]), c[1] + 2.0 * t * c[2], 2.0 * c[2]
    for j in range(flows.modes[s]):
        eigenvalue = flows.eigenvalue[s, j]
        part = scratch.signal[_X, j] * (1.0 + exp_minus_one(eigenvalue * t))
        x += part.real
        part *= eigenvalue
        rate += part.real
        bend += (part * eigenvalue).real
    return x, rate, bend
