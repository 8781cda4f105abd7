"""Stress at the corners of cells: recovered from inside them, with an estimate of its error; corners of the body."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.modal import fenicsx
from vanedamp.modal.algebra import von_mises
from vanedamp.modal.fenicsx import ufl

#: stresses (cells, corners, 6) of cells (int32), each cell's own
OfCells = Callable[[np.ndarray], np.ndarray]

_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
# faces of cells by their corners, in turn
_FACES = {
    4: ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)),
    8: ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)),
}


class StressRecovery:
    """Stress at the corners of cells: the mean of the cells of one volume group that meet there.

    Each cell's own is extrapolated from its Gauss points, at which the stress of finite elements is most accurate
    (Barlow 1976, Int. J. Numer. Methods Eng. 10; Hinton and Campbell 1974, same journal, 8). Stress jumps from group to
    group: a corner of several groups is a place for each.

    places    (k, 3) m
    groups    (k,) numbers of their volume groups, in the order of `domain.volumes`
    corners   (cells, c) places at the corners of cells
    """

    def __init__(self, domain: fenicsx.Domain, degree: int) -> None:
        self._mesh = domain.mesh
        cells, coordinates = fenicsx.corners(domain.mesh)
        numbers = np.empty(len(cells), dtype=np.int64)
        for number, members in enumerate(domain.volumes.values()):
            numbers[members] = number
        keys, indices = np.unique(numbers[:, None] * len(coordinates) + cells, return_inverse=True)
        self.corners = indices.reshape(cells.shape)
        self.groups, self._vertices = np.divmod(keys, len(coordinates))
        self.places = coordinates[self._vertices]
        self._cells, self._coordinates = cells, coordinates
        self._points, self._to_corners = _sampling(cells.shape[1], degree)

    def of_cells(self, stress: Any) -> OfCells:
        """Return a function that evaluates a UFL stress tensor in cells, with its functions' values when called."""
        components = ufl.as_vector([stress[pair] for pair in _PAIRS])
        sample = fenicsx.sampler(components, self._mesh, self._points)
        return lambda cells: np.einsum("cq,eqi->eci", self._to_corners, sample(cells))

    def mean(self, of_cells: OfCells, points: np.ndarray | None = None) -> Callable[[], np.ndarray]:
        """Return a function that evaluates the recovered stress (6, k) at places (indices; default: all)."""
        wanted = np.arange(len(self.places)) if points is None else np.asarray(points)
        cells = self.cells_at(wanted)
        corners = self.corners[cells].ravel()
        row = np.full(len(self.places), -1)
        row[wanted] = np.arange(len(wanted))  # of a place that is wanted twice, the last
        used = row[corners] >= 0
        counts = np.bincount(row[corners[used]], minlength=len(wanted))
        average = sparse.csr_array(
            (1.0 / counts[row[corners[used]]], (row[corners[used]], np.flatnonzero(used))),
            shape=(len(wanted), corners.size),
        )
        return lambda: np.asarray((average @ of_cells(cells).reshape(-1, 6)).T[:, row[wanted]])

    def errors(self, of_cells: OfCells, points: np.ndarray) -> np.ndarray:
        """Return an estimate (k,), Pa, of the error of the recovered von Mises stress at places (indices).

        It is the largest von Mises stress of the difference between cells' own stress and the recovered one, at all
        corners of the cells that meet at the place: the estimate of Zienkiewicz and Zhu (1987, Int. J. Numer. Methods
        Eng. 24) by its largest value in place of its mean square.
        """
        cells = self.cells_at(points)
        around = np.unique(self.corners[cells])
        recovered = self.mean(of_cells, around)().T[np.searchsorted(around, self.corners[cells])]
        jumps = von_mises(np.moveaxis(of_cells(cells) - recovered, -1, 0)).max(axis=1)
        return np.array([jumps[(self.corners[cells] == point).any(axis=1)].max() for point in points])

    def cells_at(self, points: np.ndarray) -> np.ndarray:
        """Return the cells (int32) that have a corner at any of the places (indices)."""
        wanted = np.zeros(len(self.places), dtype=bool)
        wanted[points] = True
        return np.flatnonzero(wanted[self.corners].any(axis=1)).astype(np.int32)

    def around(self, point: int) -> np.ndarray:
        """Return the places (m, 3), m, of the corners of the cells at a place (index)."""
        return self.places[np.unique(self.corners[self.cells_at(np.array([point]))])]

    def interior_angle(self, point: int) -> float:
        """Return the largest angle inside the body, degrees, of the edges of its surface within a cell of a place.

        180 where the surface is flat, 270 where two faces at a right angle meet in a re-entrant corner. Faces are those
        between the corners of cells, also of curved ones.
        """
        if not hasattr(self, "_angles"):
            self._angles = interior_angles(self._cells, self._coordinates)
        near = self._cells[self.cells_at(np.array([point]))]
        return float(self._angles[near].max())


def interior_angles(cells: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
    """Return the largest angle inside a body, degrees, of its edges at every vertex (n,); 0 inside of it.

    cells: (c, 4) or (c, 8) vertices of tetrahedra or hexahedra in the order of dolfinx; coordinates: (n, 3).
    """
    local = np.array(_FACES[cells.shape[1]])
    faces = cells[:, local].reshape(-1, local.shape[1])
    _, first, counts = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = first[counts == 1]
    inside = coordinates[cells[outer // len(local)]].mean(axis=1)
    faces = faces[outer]
    corners = coordinates[faces]
    middle = corners.mean(axis=1)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    if faces.shape[1] == 3:
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal *= np.sign(((middle - inside) * normal).sum(axis=1))[:, None]
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    keys = edges[:, 0] * len(coordinates) + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    _, start, shared = np.unique(keys[order], return_index=True, return_counts=True)
    pairs = order[np.add.outer(start[shared == 2], [0, 1])]
    left, right = (pairs // faces.shape[1]).T
    fold = np.degrees(np.arccos(np.clip((normal[left] * normal[right]).sum(axis=1), -1.0, 1.0)))
    concave = (normal[left] * (middle[right] - middle[left])).sum(axis=1) > 0.0
    angles = np.zeros(len(coordinates))
    np.maximum.at(angles, edges[pairs[:, 0]].ravel(), np.repeat(180.0 + np.where(concave, fold, -fold), 2))
    return angles


def _sampling(corners: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (q, 3) of the reference cell, and the weights (corners, q) of their values at its corners.

    Gauss points of the rule of degree 2 or 3; of cubic displacements, whose stress they do not determine, the corners.
    """
    # the first coordinate changes the fastest from vertex to vertex
    reference = np.array([(x, y, z) for z, y, x in product((0.0, 1.0), repeat=3)])
    if corners == 4:
        reference = np.vstack([np.zeros(3), np.eye(3)])
    if degree > 2:
        return reference, np.eye(corners)
    middle, near = (0.25, 1.0 / np.sqrt(5.0)) if corners == 4 else (0.5, 1.0 / np.sqrt(3.0))
    points = middle + near * (reference - middle)
    return points, np.linalg.inv(fenicsx.linear_shapes(points, corners))
