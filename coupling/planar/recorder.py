"""The recorder of runs with bodies in the plane, by every method: sections and ledger, tilts."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.numerics.codes import PERIOD
from vanedamp.coupling.numerics.jit import inlined, kernel
from vanedamp.coupling.planar.constraints import SURFACES, PlanarSystem
from vanedamp.coupling.response.evaluation import Plane
from vanedamp.coupling.response.records import STORED


def plane_of(system: PlanarSystem, tilt: np.ndarray, lifted: np.ndarray, linearisation: float) -> Plane:
    """Return the results in the plane of a run; tilt, lifted: (periods, b)."""
    places = [
        (int(body), SURFACES[surface], int(corner))
        for body, surface, corner in zip(system.body, system.surface, system.corner, strict=True)
    ]
    return Plane(tilt, lifted, system.neglected, linearisation, places, system.spring)


@kernel
def record_section(system, st, rec, springs):
    """Record section, energies and ledger at the start of a period. springs: energy in those of contacts, J."""
    size, bodies, period = len(st.q), len(system.along), st.counters[PERIOD]
    entry, part = rec.section[period], rec.parts[period]
    x, rate, momentum, energy = 0.0, 0.0, 0.0, springs
    for h in range(len(system.table)):
        x += system.table[h].real
        rate -= system.frequency[h] * system.table[h].imag
    for i in range(size):
        x += system.response[i] * st.q[i]
        rate += system.response[i] * st.v[i]
        force = 0.0
        for k in range(size):
            force += system.stiffness[i, k] * st.q[k]
        energy += 0.5 * st.q[i] * force
    first = size if bodies == 0 else system.along[0]
    for i in range(first):
        energy += 0.5 * system.mass[i] * st.v[i] * st.v[i]
    part[0] = energy
    for b in range(bodies):
        at = system.along[b]
        part[1 + b] = 0.0
        for i in range(at, at + (3 if system.tilt[b] >= 0 else 1)):
            part[1 + b] += 0.5 * system.mass[i] * st.v[i] * st.v[i] - system.weight[i] * st.q[i]
        energy += part[1 + b]
        momentum += system.mass[at] * st.v[at]
        slip, speed = st.q[at], st.v[at]
        for i in range(size):
            slip -= system.floor[b, i] * st.q[i]
            speed -= system.floor[b, i] * st.v[i]
        entry[3 + b], entry[3 + bodies + b] = slip, speed
    entry[0], entry[1], entry[2] = x, rate, momentum
    st.ledger[STORED] = energy
    for i in range(len(st.ledger)):
        rec.ledger[period, i] = st.ledger[i]


@inlined
def note_tilts(system, st, q, period):
    """Note the tilt of each body in its cavity, where it is the largest of the period so far."""
    for b in range(len(system.along)):
        if system.tilt[b] >= 0:
            tilt = q[system.tilt[b]]
            for i in range(len(q)):
                tilt -= system.turn[b, i] * q[i]
            st.tilt[period, b] = max(st.tilt[period, b], abs(tilt))
