"""Further results of planar bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.system.system import FLOOR, System


class Plane(NamedTuple):
    """Further results of a run with planar bodies, of all its periods; b bodies.

    tilt: (periods, b) largest tilt in the cavity, rad; lifted: (periods, b) time off the floor, s; neglected: (b,)
    shortening of a body over the smallest play, per square of its tilt, nan for sliders; bound: of that for a status
    ok; walls: (periods, b) impacts on walls.
    """

    tilt: np.ndarray
    lifted: np.ndarray
    neglected: np.ndarray
    bound: float
    walls: np.ndarray


def plane_of(system: System, records: Records, linearisation: float) -> Plane:
    """Return the results in the plane of a run."""
    return Plane(records.tilt, records.lifted, system.neglected, linearisation, records.walls)


def planar_samples(system: System, x: np.ndarray, q: np.ndarray, shut: np.ndarray) -> PlanarSamples:
    """Return samples in the plane, from those of the response x (n,), coordinates q (n, N) and closed contacts."""
    contacts, extended = system.contacts, np.flatnonzero(system.tilt >= 0)
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
        floor_rotation=rotation, contact_gap=gap, contact_closed=shut[:, :contacts].astype(bool),
        contacts=tuple(rows_of_units(system).places[:contacts]),
    )  # fmt: skip
