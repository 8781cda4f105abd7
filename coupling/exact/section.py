"""The section of a run: state and energies at the start of an excitation period."""

from __future__ import annotations

from vanedamp.coupling.exact.compliant_contacts import spring_energy
from vanedamp.coupling.exact.gap_kinematics import rigid
from vanedamp.coupling.exact.state import AWAKE, FLOW, PERIOD, SPRUNG
from vanedamp.coupling.numerics.jit import inlined
from vanedamp.coupling.response.records import STORED


@inlined
def record_section(rows, flows, st, rec, work):
    """Section and ledger at the start of a period."""
    n, b = len(st.constant), len(rows.mass)
    entry, y = rec.section[st.counters[PERIOD]], work.coordinates
    _coordinates(flows, st, y)
    entry[0] = (rows.table * st.amplitude[0]).real
    entry[1] = (1j * rows.omega * rows.table * st.amplitude[0]).real
    for i in range(n):
        entry[0] += rows.response[i] * y[i]
        entry[1] += rows.response[i] * y[n + i]
    momentum, energy, part = 0.0, 0.0, rec.parts[st.counters[PERIOD]]
    for i in range(n):
        energy += 0.5 * (y[n + i] * y[n + i] + rows.stiffness[i] * y[i] * y[i])
    for k in range(b):
        velocity, height = st.velocity[k], st.displacement[k]
        for i in range(n):
            velocity += rows.floor[k, i] * y[n + i]
            height += rows.floor[k, i] * y[i]
        momentum += rows.mass[k] * velocity
        part[1 + k] = 0.5 * rows.mass[k] * velocity * velocity - rows.weight[k] * height
        entry[3 + k], entry[3 + b + k] = st.displacement[k], st.velocity[k]
    entry[2] = momentum
    for r in range(len(st.state)):
        # a Jenkins element keeps its spring's energy while it slides
        if st.state[r] == SPRUNG or (r < rows.friction_rows and not rigid(rows, r) and rows.limit[r] > 0.0):
            energy += spring_energy(rows, st, r)
    part[0] = energy
    for k in range(b):
        energy += part[1 + k]
    st.ledger[STORED] = energy
    for i in range(len(st.ledger)):
        rec.ledger[st.counters[PERIOD], i] = st.ledger[i]


@inlined
def _coordinates(flows, st, y):
    """(p, p') at the segment's start."""
    s, n = st.counters[FLOW], len(st.constant)
    for i in range(2 * n):
        y[i] = st.constant[i] if i < n else 0.0
        for a in range(st.counters[AWAKE]):
            j = st.awake[a]
            y[i] += (flows.shape[s, i, j] * st.amplitude[j]).real
