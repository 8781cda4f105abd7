"""Pairs: two sides of a structure that touch each other, as the interface coordinates of joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial import cKDTree

from vanedamp.modal.algebra import first_largest
from vanedamp.modal.matrices import SystemMatrices, unit_direction
from vanedamp.rom.interface import InterfaceCoordinate, InterfaceError
from vanedamp.rom.reduced import ACROSS, SIDEWAYS

# sine of an angle of one degree: directions as people write them
_SQUARE = 0.0175
# cosine of the least angle between the outward normals of faces that face each other; length of a mean normal
_FACING, _FLAT = -0.9, 0.5
# distance of points that touch, relative to the extent of their side; for single points, to that of the structure
_APART, _SAME = 1e-2, 1e-6

_Sides = tuple[str, str]


def pair_motions(
    matrices: SystemMatrices,
    label: str,
    sides: _Sides,
    along: Sequence[float] | np.ndarray,
    normal: Sequence[float] | np.ndarray | None = None,
    points: int | None = None,
    tolerance: float | None = None,
    turn: tuple[np.ndarray, np.ndarray] | None = None,
    sideways: bool = False,
) -> list[InterfaceCoordinate]:
    """Return the motions of two sides that touch, along and across: "<label>_1", "<label>_1_across", "<label>_2" ...

    sides      patches; the pair opens as the first moves on from the second, by their motions across
    along      direction in which they slip
    normal     direction across, out of the second side into the first; None: the normal of the faces
    points     None: mean motions of the sides; else the number of pairs of nodes, spread evenly over the sides, with
               labels of "<label>.1", "<label>.2" ...
    tolerance  largest distance of the sides' centroids, or of the nodes of a pair, m; None: a hundredth of the first
               side's extent, or of single points round-off
    turn       of a ring: matrix (3, 3) and point (3,), m, of the axis, that turn the second side into the next sector,
               where it touches the first; its motions are in the axes of its own sector then
    sideways   whether each side has a third motion, "<label>_1_sideways", along it at right angles to `along`

    Raises InterfaceError for sides apart, or that are one, and directions that are no normal and tangent;
    modal.matrices.MatricesError for an unknown patch.
    """
    if sides[0] == sides[1] and turn is None:
        raise InterfaceError(f"{label}: '{sides[0]}' does not touch itself; name two sides")
    patches, (matrix, point) = [matrices.patch(side) for side in sides], turn or (np.eye(3), np.zeros(3))
    across = _across(label, sides, [-patches[0].normal, matrix @ patches[1].normal], normal)
    slip = unit_direction(along)
    if abs(slip @ across) > _SQUARE:
        angle = np.degrees(np.arccos(min(abs(slip @ across), 1.0)))
        raise InterfaceError(
            f"{label}: the direction along, {_shown(slip)}, is at {angle:.0f} degrees to the normal {_shown(across)}; "
            "expected 90"
        )
    slip = unit_direction(slip - (slip @ across) * across)
    directions = [slip, across, np.cross(across, slip)][: 3 if sideways else 2]
    positions = [matrices.coordinates[patch.nodes] for patch in patches]
    there = [positions[0], point + (positions[1] - point) @ matrix.T]
    if turn is None and not np.setdiff1d(patches[0].nodes, patches[1].nodes).size:
        raise InterfaceError(
            f"{label}: {sides[0]} and {sides[1]} have the same nodes: the mesh joins them; mesh the parts apart"
        )
    extent = np.ptp(positions[0], axis=0).max()
    most = tolerance or max(_APART * extent, _SAME * np.ptp(matrices.coordinates, axis=0).max())
    if points is None:
        centroids = [patch.weights @ at / patch.area for patch, at in zip(patches, there, strict=True)]
        apart = float(np.linalg.norm(centroids[1] - centroids[0]))
        if apart > most:
            raise InterfaceError(
                f"{label}: the centroids of {sides[0]} and {sides[1]} are {apart:.3g} m apart; expected up to "
                f"{most:.3g} m: name sides that touch, or give `tolerance`"
            )
        return [*_motions(label, sides, directions, matrix, None)]
    nodes = [patches[0].nodes, patches[1].nodes if turn is None else -1 - patches[1].nodes]  # of another sector
    pairs = _nearest(label, sides, there, nodes, most, points)
    chosen = _spread(positions[0][pairs[:, 0]], points)
    return [
        motion
        for number, (one, other) in enumerate(pairs[chosen], start=1)
        for motion in _motions(f"{label}.{number}", sides, directions, matrix, (positions[0][one], positions[1][other]))
    ]


def _motions(
    label: str,
    sides: _Sides,
    directions: Sequence[np.ndarray],
    matrix: np.ndarray,
    nodes: tuple[np.ndarray, np.ndarray] | None,
) -> Iterator[InterfaceCoordinate]:
    """Yield the motions of a pair, means or of nodes at two positions. matrix: (3, 3), to axes of the second side."""
    for number, side in enumerate(sides):
        kind, point = ("average", None) if nodes is None else ("node", tuple(nodes[number].tolist()))
        for suffix, direction in zip(("", ACROSS, SIDEWAYS), directions, strict=False):
            own = direction @ matrix if number else direction
            yield InterfaceCoordinate(f"{label}_{number + 1}{suffix}", side, tuple(own.tolist()), kind, point=point)


def _across(
    label: str, sides: _Sides, of_sides: Sequence[np.ndarray], given: Sequence[float] | np.ndarray | None
) -> np.ndarray:
    """Return the unit normal (3,) out of the second side into the first, as given or by those that the sides have."""
    known = [unit_direction(normal) for normal in of_sides if np.linalg.norm(normal) > _FLAT]
    if given is not None:
        across = unit_direction(given)
        if any(across @ normal < 0.0 for normal in known):
            raise InterfaceError(
                f"{label}: the normal {_shown(across)} points into {sides[1]}; give the one out of it into {sides[0]}"
            )
        return across
    if not known:
        raise InterfaceError(
            f"{label}: {sides[0]} and {sides[1]} have no normal: they are node sets, or curve too much; give `normal`, "
            f"three numbers out of {sides[1]} into {sides[0]}"
        )
    if len(known) == 2 and known[0] @ known[1] < -_FACING:
        angle = np.degrees(np.arccos(np.clip(-known[0] @ known[1], -1.0, 1.0)))
        raise InterfaceError(
            f"{label}: {sides[0]} and {sides[1]} do not face each other: their normals are at {angle:.0f} degrees, "
            "expected 180; name other sides, or give `normal`"
        )
    return unit_direction(np.sum(known, axis=0))


def _nearest(
    label: str, sides: _Sides, positions: Sequence[np.ndarray], nodes: Sequence[np.ndarray], most: float, points: int
) -> np.ndarray:
    """Return pairs (p, 2) of places of nodes in both sides, nearest to each other, up to a distance, m."""
    apart, other = cKDTree(positions[1]).query(positions[0])
    mutual = cKDTree(positions[0]).query(positions[1])[1][other] == np.arange(len(other))
    close = np.flatnonzero(mutual & (apart <= most) & (nodes[0] != nodes[1][other]))
    if len(close) < points:
        least = f"the nearest two are {apart.min():.3g} m apart; " if apart.min() > most else ""
        raise InterfaceError(
            f"{label}: {len(close)} nodes of {sides[0]} lie within {most:.3g} m of a node of {sides[1]}, points = "
            f"{points} needs as many; {least}name sides that touch, take fewer points, or give `tolerance`"
        )
    return np.column_stack([close, other[close]])


def _spread(positions: np.ndarray, count: int) -> list[int]:
    """Return the indices of nodes next to the centres of as many equal parts of a side, one each, ascending."""
    first = first_largest(np.linalg.norm(positions - positions.mean(axis=0), axis=1))
    chosen, apart = [first], np.linalg.norm(positions - positions[first], axis=1)
    while len(chosen) < count:
        chosen.append(first_largest(apart))
        apart = np.minimum(apart, np.linalg.norm(positions - positions[chosen[-1]], axis=1))
    nearest = list[int]()
    for centre in kmeans2(positions, positions[chosen], minit="matrix", iter=100)[0]:
        apart = np.linalg.norm(positions - centre, axis=1)
        apart[nearest] = 2.0 * apart.max()
        nearest.append(first_largest(-apart))
    return sorted(nearest)


def _shown(vector: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in vector) + "]"
