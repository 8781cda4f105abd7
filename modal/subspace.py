"""A growing space of mass-orthonormal vectors, with a projected operator: the base of the block eigensolvers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import symmetric_part

# directions are dropped below this fraction of their block, and made orthogonal once more below the other
_DEPENDENT, _LOSING = 1e-14, 1e-6
# entries of all rows that are combined at once
_COLUMNS = 1 << 14

#: a matrix (n, n) applied to rows (k, n)
Rows = Callable[[np.ndarray], np.ndarray]


class Subspace:
    """Mass-orthonormal rows, and a symmetric operator projected on them.

    mass       applied to rows
    vectors    (most, n), of which `count` are in use; the last `block` of these were appended last
    inertia    (block, n) products of these last rows with the mass: of the others they are computed where needed, which
               takes less than the solves between, and half the memory
    projected  (most, most) the operator between the rows
    """

    def __init__(self, mass: Rows, size: int, most: int) -> None:
        self.mass, self.size, self.most, self.count, self.block = mass, size, most, 0, 0
        self.vectors, self.inertia = np.empty((most, size)), np.empty((0, size))
        self.projected = np.zeros((most, most))

    def append(self, rows: np.ndarray) -> np.ndarray:
        """Make rows (b, n) orthonormal, append the independent ones, return their components (b, j) in `rows`.

        The rows are orthogonal to the space already.
        """
        shares = np.eye(len(rows))
        for _ in range(3):
            inertia = self.mass(rows)
            scale = np.sqrt(np.maximum(np.einsum("ij,ij->i", rows, inertia), np.finfo(float).tiny))
            gram = symmetric_part((rows @ inertia.T) / scale / scale[:, None])
            values, vectors = linalg.eigh(gram)
            independent = values > _DEPENDENT
            selected, root = vectors[:, independent], np.sqrt(values[independent])
            rows, inertia = ((selected / scale[:, None] / root).T @ array for array in (rows, inertia))
            shares = shares @ (selected * scale[:, None] * root)
            if values[independent].min(initial=1.0) > _LOSING:
                break
            rows = self.orthogonal(rows)[0]
        self.block, self.inertia = len(rows), inertia
        self.vectors[self.count : self.count + self.block] = rows
        self.count += self.block
        return shares

    def orthogonal(self, rows: np.ndarray, first: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Return rows (b, n) without their components along the space, and these (k, b).

        first: of the rows of the space along which the components are more than round-off.
        """
        components = np.zeros((self.count, len(rows)))
        for start in (first, 0):  # twice is enough (Parlett 1980, The Symmetric Eigenvalue Problem, section 6-9)
            shares = self.vectors[start : self.count] @ self.mass(rows).T
            rows = rows - shares.T @ self.vectors[start : self.count]
            components[start:] += shares
        return rows, components

    def turn(self, vectors: np.ndarray) -> None:
        """Replace the first rows by orthonormal combinations (k, j) of them, and drop the others."""
        for start in range(0, self.size, _COLUMNS):  # in place
            columns = slice(start, start + _COLUMNS)
            self.vectors[: vectors.shape[1], columns] = vectors.T @ self.vectors[: len(vectors), columns]
        self.count = vectors.shape[1]


def product(matrix: Any, rows: np.ndarray) -> np.ndarray:
    """Return the products (b, n) of a symmetric matrix with rows."""
    return np.ascontiguousarray((matrix @ np.ascontiguousarray(rows.T)).T)
