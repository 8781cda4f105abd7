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
from functools import partial
from typing import Any

import numpy as np

from vanedamp.modal.subspace import Subspace, product

#: the inverse of K - shift M applied to rows (k, n)
Solve = Callable[[np.ndarray], np.ndarray]

_RESTARTS = 100
# residuals below this, relative to the largest eigenvalue of the shifted inverse, are the round-off of its solves
_ROUND_OFF = 5e-14


class NotConvergedError(ArithmeticError):
    """Fewer eigenpairs than asked for have converged."""


def block(count: int) -> int:
    """Return the number of right-hand sides per solve for `count` eigenpairs: fewer cost more each, more add work."""
    return min(max(count // 4, 4), 12)


def directions(count: int, width: int = 0) -> int:
    """Return the most vectors that are kept for `count` eigenpairs by blocks; smaller problems are solved densely."""
    return 2 * count + 16 * (width or block(count))


def eigenpairs(
    solve: Solve, mass: Any, count: int, shift: float = 0.0, tolerance: float = 1e-11, spare: int = 0, width: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues (m,) nearest to a shift, nearest first, and mass-orthonormal vectors (m, n).

    solve      (K - shift M)^-1 applied to rows, or its inverse in a subspace, where the vectors then lie
    mass       (n, n) positive definite, sparse or applied to rows
    tolerance  of the residual of the shifted inverse, relative to its eigenvalue, in the norm of the mass: eigenvalues
               have its square; not below the round-off of the largest one
    spare      that many more pairs, to the square root of the tolerance
    width      right-hand sides of a solve; of an eigenvalue with so many copies none is missed. Default: `block(count)`

    n must be greater than `directions(count + spare, width)`. Raises NotConvergedError.
    """
    wanted = count + spare
    limits = np.r_[np.full(count, tolerance), np.full(spare, tolerance**0.5)]
    space, random = _Krylov(mass, directions(wanted, width)), np.random.default_rng(0)
    width = width or block(count)
    for _ in range(_RESTARTS):
        while space.count <= space.most - width:
            if space.block == 0:  # at the start, or the space holds all that its start can reach
                space.begin(solve(space.mass(random.standard_normal((width, space.size)))))
            leak = space.extend(solve)
            values, vectors = space.ritz(wanted)
            residuals = np.linalg.norm(leak @ vectors[-leak.shape[1] :], axis=0)
            size = np.abs(values)
            converged = residuals <= np.maximum(limits[: len(values)] * size, _ROUND_OFF * size.max())
            if len(values) == wanted and converged.all():
                return shift + 1.0 / values, vectors.T @ space.vectors[: len(vectors)]
        space.restart(wanted + 2 * width)
    raise NotConvergedError(f"{np.count_nonzero(converged)} of {wanted} modes converged")


class _Krylov(Subspace):
    """A Krylov space: the operator has not been applied to the last `block` rows yet."""

    def __init__(self, mass: Any, most: int) -> None:
        super().__init__(mass if callable(mass) else partial(product, mass), mass.shape[0], most)
        self._before = 0  # first of the rows that the operator couples with the last block

    def begin(self, rows: np.ndarray) -> None:
        """Append independent rows (b, n) that are not from the space."""
        self.append(self.orthogonal(rows)[0])
        self._before = self.count - self.block

    def extend(self, solve: Solve) -> np.ndarray:
        """Apply the operator to the last block and append new directions; return its components (j, b) in them."""
        count, last = self.count, slice(self.count - self.block, self.count)
        rows, shares = self.orthogonal(solve(self.inertia), self._before)
        self.projected[:count, last] = shares
        self.projected[last, :count] = shares.T
        self._before = last.start
        return self.append(rows).T

    def ritz(self, wanted: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest Ritz values by size (w,), and their vectors (k, w) in the rows the operator has met."""
        size = self.count - self.block
        values, vectors = np.linalg.eigh(self.projected[:size, :size])
        largest = np.argsort(-np.abs(values), kind="stable")[:wanted]
        return values[largest], vectors[:, largest]

    def restart(self, count: int) -> None:
        """Keep the best Ritz vectors and the last block only."""
        values, vectors = self.ritz(count)
        last = self.vectors[len(vectors) : self.count].copy()
        self.turn(vectors)
        self.vectors[self.count : self.count + self.block] = last
        self.projected[:] = 0.0
        self.projected[np.arange(len(values)), np.arange(len(values))] = values
        self.count, self._before = self.count + self.block, 0
