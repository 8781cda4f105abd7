"""Block Lanczos for K x = lambda M x, with shift and invert: eigenpairs from solves of several right-hand sides.

A triangular solve waits for memory, not for arithmetic: four right-hand sides cost little more than one. Blocks also
find several copies of a multiple eigenvalue. Grimes, Lewis and Simon (1994), SIAM J. Matrix Anal. Appl. 15(1); here all
directions are kept and orthogonalised against, and a full space restarts with its best vectors (Wu and Simon 2000, SIAM
J. Matrix Anal. Appl. 22(2)).

Why not SLEPc's Krylov-Schur (3.18), which has no blocks: with the same factors of 73,122 freedoms it takes as long
for 6 modes (1.1 s and 1.2 s), 2.2 s for 20 (here 1.8 s) and 7.0 s for 60 (here 4.6 s). MPI ranks divide it (`petsc`).
Why not scipy's eigsh (ARPACK, 1.10), which has none either: with the same factors 1.4 to 1.7 times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import symmetric_part

#: the inverse of K - shift M applied to rows (k, n)
Solve = Callable[[np.ndarray], np.ndarray]

_RESTARTS = 100
# residuals below this, relative to the largest eigenvalue of the shifted inverse, are the round-off of its solves
_ROUND_OFF = 5e-14
# directions are dropped below this fraction of their block, and made orthogonal once more below the other
_DEPENDENT, _LOSING = 1e-14, 1e-6


class NotConvergedError(ArithmeticError):
    """Fewer eigenpairs than asked for have converged."""


def block(count: int) -> int:
    """Return how many right-hand sides a solve has for `count` eigenpairs: fewer cost more each, more are more work."""
    return min(max(count // 4, 4), 12)


def directions(count: int) -> int:
    """Return the most vectors that are kept for `count` eigenpairs; smaller problems are solved densely."""
    return 2 * count + 16 * block(count)


def eigenpairs(
    solve: Solve, mass: Any, count: int, shift: float = 0.0, tolerance: float = 1e-11, spare: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues (m,) nearest to a shift, nearest first, and mass-orthonormal vectors (m, n).

    solve      (K - shift M)^-1 applied to rows, or its inverse in a subspace, where the vectors then lie
    mass       (n, n) sparse, positive definite
    tolerance  of the residual of the shifted inverse, relative to its eigenvalue, in the norm of the mass: eigenvalues
               have its square; not below the round-off of the largest one
    spare      that many more pairs, to the square root of the tolerance

    n must be greater than `directions(count + spare)`. Raises NotConvergedError.
    """
    wanted, width = count + spare, block(count)
    limits = np.r_[np.full(count, tolerance), np.full(spare, tolerance**0.5)]
    space, random = _Space(mass, directions(wanted)), np.random.default_rng(0)
    for _ in range(_RESTARTS):
        while space.count <= space.most - width:
            if space.block == 0:  # at the start, or the space holds all that its start can reach
                space.begin(solve(_product(mass, random.standard_normal((width, space.size)))))
            leak = space.extend(solve)
            values, turns = space.ritz(wanted)
            residuals = np.linalg.norm(leak @ turns[-leak.shape[1] :], axis=0)
            size = np.abs(values)
            converged = residuals <= np.maximum(limits[: len(values)] * size, _ROUND_OFF * size.max())
            if len(values) == wanted and converged.all():
                return shift + 1.0 / values, turns.T @ space.vectors[: len(turns)]
        space.restart(wanted + 2 * width)
    raise NotConvergedError(f"{np.count_nonzero(converged)} of {wanted} modes converged")


class _Space:
    """Mass-orthonormal rows, their products with the mass, and the operator projected on them.

    The last `block` of the `count` rows is the one that the operator has not been applied to.
    """

    def __init__(self, mass: Any, most: int) -> None:
        self.size, self.most, self.count, self.block = mass.shape[0], most, 0, 0
        self._before = 0  # first of the rows that the operator couples with the last block
        self.vectors, self.inertia = np.empty((most, self.size)), np.empty((most, self.size))
        self.projected = np.zeros((most, most))
        self._mass = mass

    def begin(self, rows: np.ndarray) -> None:
        """Append independent rows (b, n) that are not from the space."""
        self.append(self._orthogonal(rows, 0)[0])
        self._before = self.count - self.block

    def append(self, rows: np.ndarray) -> np.ndarray:
        """Make rows (b, n) orthonormal, append the independent ones, return their components (b, j) in `rows`."""
        shares = np.eye(len(rows))
        for _ in range(3):
            inertia = _product(self._mass, rows)
            scale = np.sqrt(np.maximum(np.einsum("ij,ij->i", rows, inertia), np.finfo(float).tiny))
            gram = symmetric_part((rows @ inertia.T) / scale / scale[:, None])
            values, turns = linalg.eigh(gram)
            kept = values > _DEPENDENT
            turn, root = turns[:, kept], np.sqrt(values[kept])
            rows, inertia = ((turn / scale[:, None] / root).T @ each for each in (rows, inertia))
            shares = shares @ (turn * scale[:, None] * root)
            if values[kept].min(initial=1.0) > _LOSING:
                break
            rows = self._orthogonal(rows, 0)[0]
        self.block = len(rows)
        start, self.count = self.count, self.count + self.block
        self.vectors[start : self.count], self.inertia[start : self.count] = rows, inertia
        return shares

    def extend(self, solve: Solve) -> np.ndarray:
        """Apply the operator to the last block and append new directions; return its components (j, b) in them."""
        count, last = self.count, slice(self.count - self.block, self.count)
        rows, shares = self._orthogonal(solve(self.inertia[last]), self._before)
        self.projected[:count, last] = shares
        self.projected[last, :count] = shares.T
        self._before = last.start
        return self.append(rows).T

    def ritz(self, wanted: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest Ritz values by size (w,), and their vectors (k, w) in the rows the operator has met."""
        known = self.count - self.block
        values, turns = np.linalg.eigh(self.projected[:known, :known])
        largest = np.argsort(-np.abs(values), kind="stable")[:wanted]
        return values[largest], turns[:, largest]

    def restart(self, kept: int) -> None:
        """Keep the best Ritz vectors and the last block only."""
        values, turns = self.ritz(kept)
        known = len(turns)
        for rows in (self.vectors, self.inertia):
            last = rows[known : self.count].copy()
            rows[: len(values)] = turns.T @ rows[:known]
            rows[len(values) : len(values) + self.block] = last
        self.projected[:] = 0.0
        self.projected[np.arange(len(values)), np.arange(len(values))] = values
        self.count, self._before = len(values) + self.block, 0

    def _orthogonal(self, rows: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rows (b, n) without their components along the space, and these (k, b).

        first: of the rows of the space along which the components are more than round-off.
        """
        found = np.zeros((self.count, len(rows)))
        for start in (first, 0):  # twice is enough (Parlett 1980, The Symmetric Eigenvalue Problem, section 6-9)
            shares = self.inertia[start : self.count] @ rows.T
            rows = rows - shares.T @ self.vectors[start : self.count]
            found[start:] += shares
        return rows, found


def _product(mass: Any, rows: np.ndarray) -> np.ndarray:
    """Return the products (b, n) of a symmetric matrix with rows."""
    return np.ascontiguousarray((mass @ np.ascontiguousarray(rows.T)).T)
