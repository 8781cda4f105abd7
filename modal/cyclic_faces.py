"""The two faces of a cyclic sector: their nodes in pairs, and the reason where they do not fit."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import rotation
from vanedamp.modal.matrices import SystemMatrices

#: distance of two nodes that are one, over the size of the sector
TOLERANCE = 1e-6
# fraction of the size: with the correct axis, centres of the faces are closer than this, however they are meshed
_SAME_CENTRE = 1e-2
# degrees between angles that differ
_ANGLE = 1e-3


class CyclicError(VanedampError):
    """A sector that makes no ring; the message starts with the argument or key."""


def paired(
    matrices: SystemMatrices, low: str, high: str, sectors: int, axis: np.ndarray, point: np.ndarray,
    tolerance: float = TOLERANCE,
) -> tuple[np.ndarray, np.ndarray, float]:  # fmt: skip
    """Return the nodes (k,) of the face `low`, those (k,) of `high` on which they fall, and the largest distance, m.

    Raises CyclicError with the reason where a turn by the angle of a sector does not bring one face to the other, or
    the supports of two paired nodes differ.
    """
    from scipy.spatial import cKDTree  # cases load this file

    first, second = matrices.patch(low), matrices.patch(high)
    size = float(np.ptp(matrices.coordinates, axis=0).max())
    rotated = rotation(axis, 2.0 * math.pi / sectors)
    starts, ends = ((matrices.coordinates - point)[patch.nodes] for patch in (first, second))
    distances, order = cKDTree(starts @ rotated.T).query(ends)
    worst = int(np.argmax(distances))
    fits = distances[worst] <= tolerance * size
    if not fits or len(order) != len(starts) or np.unique(order).size != len(order):
        low_centre, high_centre = (patch.weights @ at / patch.area for patch, at in ((first, starts), (second, ends)))
        check_angle(low_centre, high_centre, sectors, axis, size)
        if len(starts) != len(ends):
            raise CyclicError(f"ring.low: {low!r} has {len(starts)} nodes, {high!r} {len(ends)}; mesh both faces alike")
        x, y, z = matrices.coordinates[second.nodes[worst]]
        raise CyclicError(
            f"ring.high: faces part at ({x:.6g}, {y:.6g}, {z:.6g}) by {distances[worst]:.3g} m, with up to "
            f"{tolerance * size:.3g} m allowed; mesh both alike, or give a larger tolerance"
        )
    nodes = first.nodes[order]
    _check_supports(matrices, nodes, second.nodes, rotated)
    return nodes, second.nodes, float(distances[worst])


def check_sides(
    matrices: SystemMatrices, low: str, high: str, sectors: int, axis: np.ndarray, point: np.ndarray
) -> None:
    """Raise CyclicError where `high` is nearer to the other neighbour's `low`: springs would cross the sector."""
    first, second = (
        patch.weights @ (matrices.coordinates[patch.nodes] - point) / patch.area
        for patch in (matrices.patch(low), matrices.patch(high))
    )
    rotated = rotation(axis, 2.0 * math.pi / sectors)
    next_one, before = (float(np.linalg.norm(second - centre)) for centre in (rotated @ first, rotated.T @ first))
    if next_one > (1.0 + _ANGLE) * before:
        raise CyclicError(
            "ring.spring.low: low and high are swapped: a positive turn about the axis leads to the next sector, but "
            f"{high!r} is nearer to {low!r} of the one before"
        )


def check_angle(first: np.ndarray, second: np.ndarray, sectors: int, axis: np.ndarray, size: float) -> None:
    """Raise CyclicError if, by the centres (3,) of both faces, the axis or the number of sectors is wrong.

    Centres from a point of the axis, a unit vector; size: of the sector; all in one unit of length.
    """
    heights = [float(axis @ centre) for centre in (first, second)]
    arms = [centre - height * axis for centre, height in zip((first, second), heights, strict=True)]
    radii = [float(np.linalg.norm(arm)) for arm in arms]
    if max(abs(radii[0] - radii[1]), abs(heights[0] - heights[1])) > _SAME_CENTRE * size:
        raise CyclicError(
            f"ring.axis: the faces are centred at the radii {radii[0]:.6g} and {radii[1]:.6g} m and at "
            f"{heights[0]:.6g} and {heights[1]:.6g} m along the axis; expected the same, check axis and point"
        )
    if min(radii) < _SAME_CENTRE * size:
        return
    angle = math.degrees(math.atan2(axis @ np.cross(*arms), arms[0] @ arms[1]))
    wanted = 360.0 / sectors
    if abs(angle - wanted) <= _ANGLE * wanted or (sectors == 2 and abs(abs(angle) - 180.0) <= _ANGLE):
        return
    if abs(angle + wanted) <= _ANGLE * wanted:
        raise CyclicError("ring.low: low and high are swapped: a positive turn about the axis brings low to high")
    number = round(360.0 / abs(angle)) if angle else 0
    whole = number > 1 and abs(360.0 / number - abs(angle)) <= _ANGLE * abs(angle)
    remedy = f"sectors = {number}" if whole else "no whole part of a turn; check axis and point"
    raise CyclicError(f"ring.sectors: the faces are {abs(angle):.6g} degrees apart: {remedy}, not {sectors}")


def _check_supports(matrices: SystemMatrices, low: np.ndarray, high: np.ndarray, turn: np.ndarray) -> None:
    """Raise CyclicError for paired nodes with different supports."""
    held = np.zeros(matrices.size, dtype=bool)
    held[matrices.fixed] = True
    held = held.reshape(-1, 3)
    # directions held at the low node, turned, must be the ones held at the high node
    onto = np.einsum("ij,kj,lj->kil", turn, held[low].astype(float), turn)
    wrong = np.abs(onto - np.eye(3) * held[high][:, None, :]).max(axis=(1, 2)) > 1e-9
    if wrong.any():
        x, y, z = matrices.coordinates[high[int(np.argmax(wrong))]]
        raise CyclicError(
            f"support: the faces of the ring are held differently at ({x:.6g}, {y:.6g}, {z:.6g}); hold both alike, in "
            "all directions or along the axis"
        )
