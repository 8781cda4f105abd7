"""The section of a run: state and energies at the start of an excitation period."""

from __future__ import annotations

from vanedamp.coupling.exact.compliant_contacts import spring_energy
from vanedamp.coupling.exact.gap_kinematics import rigid
from vanedamp.coupling.numerics.codes import AWAKE, FLOW, PERIOD, SPRUNG
from vanedamp.coupling.numerics.compiler.jit import inlined
from vanedamp.coupling.response.recorder import put_section


@inlined
def record_start(system, flows, st, rec, scratch):
    """Record section and ledger at the start of a period."""
    n, b, y, springs = len(st.constant), system.bodies, scratch.coordinates, 0.0
    structure_state(flows, st, y)
    for r in range(len(st.state)):
        # a Jenkins element keeps its spring's energy while it slides
        if st.state[r] == SPRUNG or (r < system.friction_rows and not rigid(system, r) and system.limit[r] > 0.0):
            springs += spring_energy(system, st, r)
    put_section(
        system, rec, st.counters[PERIOD], y[:n], y[n:], st.displacement[:b], st.velocity[:b], springs, st.ledger
    )


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
