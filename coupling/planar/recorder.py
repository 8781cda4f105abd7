"""The recorder of runs with bodies in the plane, by every method: sections and ledger, tilts, samples."""

from __future__ import annotations

from functools import partial
from typing import Protocol

import numpy as np

from vanedamp.coupling.numerics.codes import PERIOD
from vanedamp.coupling.numerics.compiler.jit import entry, inlined
from vanedamp.coupling.response.evaluation import Plane
from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.records import STORED
from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.system.system import FLOOR, System


class Kept(Protocol):
    """The results in the plane that a run has kept, of every method."""

    @property
    def tilt(self) -> np.ndarray:
        """(periods, b) largest |tilt| in the cavity, rad."""

    @property
    def lifted(self) -> np.ndarray:
        """(periods, b) time off the floor, s."""

    @property
    def sampled(self) -> np.ndarray:
        """(n, N) coordinates."""

    @property
    def shut(self) -> np.ndarray:
        """(n, u) whether contacts are closed."""


def plane_of(system: System, kept: Kept, linearisation: float) -> Plane:
    """Return the results in the plane of a run."""
    samples = partial(_samples, system, kept.sampled, kept.shut)
    return Plane(kept.tilt, kept.lifted, system.neglected, linearisation, samples)


def _samples(system: System, sampled: np.ndarray, shut: np.ndarray, x: np.ndarray) -> PlanarSamples:
    """Return the first samples in the plane, as many as there are of the response x (n,)."""
    q, contacts, extended = sampled[: len(x)], system.contacts, np.flatnonzero(system.tilt >= 0)
    base = x - q @ system.response if system.table.any() else np.zeros(len(x))
    gap = system.rest[:contacts] + q @ system.J[:contacts].T
    rotation = q @ system.turn.T
    lift, tilt, across = (np.full(rotation.shape, np.nan) for _ in range(3))
    tilt[:, extended] = q[:, system.tilt[extended]] - rotation[:, extended]
    first = system.along[0]
    for body in extended:
        stands = np.flatnonzero((system.body == body) & (system.surface == FLOOR))
        lift[:, body] = gap[:, stands].mean(axis=1)
        across[:, body] = -q[:, :first] @ system.J[stands, :first].mean(axis=0)
    return PlanarSamples(
        body_lift=lift, body_tilt=tilt, floor_along=base[:, None] + q @ system.floor.T + rotation * system.height,
        floor_across=across,
        floor_rotation=rotation, contact_gap=gap, contact_closed=shut[: len(x), :contacts].astype(bool),
        contacts=tuple(rows_of_units(system).places[:contacts]),
    )  # fmt: skip


@entry
def record_section(system, st, rec, springs):
    """Record section, energies and ledger at the start of a period. springs: energy in those of units, J."""
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
    first = size - len(system.tangential) if bodies == 0 else system.along[0]
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
def put_sample(system, st, rec, row, x, q, state, opened):
    """Keep a sample of the response x and the coordinates q; state: (u,) of the contacts, `opened` where they are."""
    rec.samples[row, 0] = x
    for b in range(len(system.along)):
        slip = q[system.along[b]]
        for i in range(len(q)):
            slip -= system.floor[b, i] * q[i]
        rec.samples[row, 1 + b] = slip
    for i in range(len(q)):
        st.sampled[row, i] = q[i]
    for i in range(rec.coordinates.shape[1]):
        rec.coordinates[row, i] = q[i]
    for r in range(system.contacts):
        st.shut[row, r] = 0 if state[r] == opened else 1


@inlined
def note_tilts(system, st, q, period):
    """Note the tilt of each body in its cavity, where it is the largest of the period so far."""
    for b in range(len(system.along)):
        if system.tilt[b] >= 0:
            tilt = q[system.tilt[b]]
            for i in range(len(q)):
                tilt -= system.turn[b, i] * q[i]
            st.tilt[period, b] = max(st.tilt[period, b], abs(tilt))
