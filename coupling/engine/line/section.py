"""The section of a run: state and energies at the start of an excitation period."""

from __future__ import annotations

from vanedamp.coupling.engine.line.compliant_contacts import spring_energy
from vanedamp.coupling.engine.line.gap_kinematics import rigid
from vanedamp.coupling.numerics.codes import AWAKE, FLOW, PERIOD, SPRUNG
from vanedamp.coupling.numerics.compiler.jit import inlined, summing
from vanedamp.coupling.response.recorder import put_response


@inlined
def record_start(system, flows, st, rec, scratch):
    """Record section and ledger at the start of a period."""
    n, b, y, springs = len(st.constant), system.bodies, scratch.coordinates, 0.0
    structure_state(flows, st, y)
    for r in range(len(st.state)):
        # a Jenkins element keeps its spring's energy while it slides
        if st.state[r] == SPRUNG or (r < system.friction_rows and not rigid(system, r) and system.limit[r] > 0.0):
            springs += spring_energy(system, st, r)
    p, rate, section, part = y[:n], y[n:], rec.section[st.counters[PERIOD]], rec.parts[st.counters[PERIOD]]
    x, velocity, energy = _structure(system.response, system.stiffness, p, rate)
    energy, momentum = energy + springs, 0.0
    part[0] = energy
    for k in range(b):
        speed, height = st.velocity[k] + _dot(system.floor[k], rate), st.displacement[k]
        if system.weight[n + k] != 0.0:
            height += _dot(system.floor[k], p)
        momentum += system.mass[n + k] * speed
        part[1 + k] = 0.5 * system.mass[n + k] * speed * speed - system.weight[n + k] * height
        energy += part[1 + k]
        section[3 + k], section[3 + b + k] = st.displacement[k], st.velocity[k]
    put_response(system, rec, st.counters[PERIOD], x, velocity, momentum, energy, st.ledger)


@summing
def _structure(response, stiffness, p, p_rate):
    """Return the response of the modes, its rate, and the energy of the structure."""
    x, rate, energy = 0.0, 0.0, 0.0
    for i in range(len(p)):
        x += response[i] * p[i]
        rate += response[i] * p_rate[i]
        energy += 0.5 * (p_rate[i] * p_rate[i] + stiffness[i] * p[i] * p[i])
    return x, rate, energy


@summing
def _dot(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@inlined
def structure_state(flows, st, y):
    """Set y to (p, p') at the segment's start."""
    s, n = st.counters[FLOW], len(st.constant)
    for i in range(2 * n):
        y[i] = st.constant[i] if i < n else 0.0
    for j in range(st.counters[AWAKE]):
        c, shape = st.amplitude[j], flows.shape[s, j]
        for i in range(flows.support[s, j, 0], flows.support[s, j, 1]):
            y[i] += shape[i].real * c.real - shape[i].imag * c.imag
            y[n + i] += shape[n + i].real * c.real - shape[n + i].imag * c.imag
