"""Rings for tests: chains around a circle, whose waves are known in closed form."""

from __future__ import annotations

import numpy as np

from vanedamp.rom.ring.ring_model import RingModel


def chain_ring(
    sectors: int = 6, masses: tuple[float, ...] = (0.1,), spring: float = 1e6, inner: float = 4e6,
    coupling: float = 0.05, damping_ratio: float = 0.002, radius: float = 0.2, modes: int | None = None,
) -> RingModel:  # fmt: skip
    """Return a ring of chains: in each sector masses (kg), the first on a spring to the ground and on `coupling` times
    this spring to those of both neighbours, each other on the spring `inner` to the one before. All waves are kept.

    The label "tip" is the last mass, "root" the first. They move along the circle, y of sector 0, at the radius (m).
    """
    count = len(masses)
    own = np.zeros((count, count))
    own[0, 0] = spring
    for place in range(1, count):
        own[place - 1 : place + 1, place - 1 : place + 1] += inner * np.array([[1.0, -1.0], [-1.0, 1.0]])
    diameters, squares, fields = [], [], []
    for diameter in range(sectors // 2 + 1):
        stiffness = own.copy()
        stiffness[0, 0] += 2.0 * coupling * spring * (1.0 - np.cos(2 * np.pi * diameter / sectors))
        scale = 1.0 / np.sqrt(masses)
        found, shapes = np.linalg.eigh(scale[:, None] * stiffness * scale)
        pair = 0 < 2 * diameter < sectors
        for square, shape in zip(found, (scale[:, None] * shapes).T, strict=True):
            z = shape * np.sqrt((2.0 if pair else 1.0) / sectors)
            diameters += [diameter] * (2 if pair else 1)
            squares += [square] * (2 if pair else 1)
            fields += [z, 0.0 * z] if pair else [z]
    fields = np.array(fields)
    order = np.argsort(squares, kind="stable")
    part = fields @ own @ fields.T
    at = np.zeros((len(order), 3))
    at[:, 1] = fields @ np.array(masses)
    return RingModel(
        sectors=sectors, axis=np.array([0.0, 0.0, 1.0]), point=np.zeros(3), diameters=np.array(diameters)[order],
        squares=np.array(squares)[order], modes=modes or len(order), interface=("tip", "root"),
        selection=fields[order][:, [-1, 0]].T, directions=np.tile([0.0, 1.0, 0.0], (2, 1)), normals=np.zeros((2, 3)),
        positions=np.tile([radius, 0.0, 0.0], (2, 1)), arms=np.zeros(2), base_load=at[order], part_load=at[order],
        stiffness=part[np.ix_(order, order)], mass=(fields * masses @ fields.T)[np.ix_(order, order)],
        damping_ratio=damping_ratio,
    )  # fmt: skip
