"""The mesh of a whole ring: that of one sector rotated N times, with the nodes of the joints merged."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vanedamp.modal.algebra import rotation, sector_rotations
from vanedamp.modal.records.ring_modes import RingModes

#: distance relative to the sector's size up to which nodes of two sectors are merged
_SAME = 1e-4


class WholeRing(NamedTuple):
    """A ring's mesh.

    sector, node  (n,) of each node, the sector and its place in the sector's mesh
    points        (n, 3) m
    cells         (c, k) places of their nodes
    """

    sector: np.ndarray
    node: np.ndarray
    points: np.ndarray
    cells: np.ndarray

    def shape(self, modes: RingModes, mode: int) -> np.ndarray:
        """Return the complex shape (n, 3) of a mode: the wave is Re(shape exp(i phase)); real for a standing wave."""
        real, imaginary = (modes.whole(mode, phase)[self.sector, self.node] for phase in (0.0, -np.pi / 2.0))
        return real if 2 * abs(modes.diameters[mode]) in (0, modes.sectors) else real + 1j * imaginary


def joints(modes: RingModes, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes (k,) of a sector's low face and, in the same order, the matching nodes of its high face."""
    turn = rotation(modes.axis, modes.angle)
    away, nearest = cKDTree(coordinates).query((coordinates - modes.point) @ turn.T + modes.point)
    low = np.flatnonzero(away <= _SAME * np.linalg.norm(np.ptp(coordinates, axis=0)))
    return low, nearest[low]


def whole_ring(modes: RingModes, coordinates: np.ndarray, cells: np.ndarray) -> WholeRing:
    """Return the mesh of a ring from its sector's nodes (n, 3), m, and cells (c, k)."""
    sectors, count = modes.sectors, len(coordinates)
    low, high = joints(modes, coordinates)
    numbers = np.arange(sectors * count).reshape(sectors, count)
    # the high face of a sector is the low face of the next; nodes on the axis are those of all sectors
    numbers[:, high] = np.roll(numbers[:, low], -1, axis=0)
    on_axis = low[low == high]
    numbers[:, on_axis] = on_axis
    unique, inverse = np.unique(numbers, return_inverse=True)
    sector, node = np.divmod(unique, count)
    turned = np.einsum("sij,nj->sni", sector_rotations(modes.axis, sectors), coordinates - modes.point)
    points = turned[sector, node] + modes.point
    return WholeRing(sector, node, points, inverse.reshape(sectors, count)[:, cells].reshape(-1, cells.shape[1]))


def with_parts(shapes: Iterable[tuple[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return real fields by name: of a complex shape its real and its imaginary part."""
    fields: dict[str, np.ndarray] = {}
    for name, shape in shapes:
        if np.iscomplexobj(shape):
            fields |= {f"{name}, real": shape.real, f"{name}, imaginary": shape.imag}
        else:
            fields[name] = shape
    return fields
