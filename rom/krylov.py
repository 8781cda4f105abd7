"""Krylov spaces of a factorised structure: blocks of quasi-static modes, and the lowest natural modes.

A block of quasi-static modes is the static response to the inertia of the block before, K^-1 M psi: it says how the
structure lags behind that block, to the next order in omega^2 (Craig and Hale 1988, J. Guidance 11(6), block-Krylov
component synthesis).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from vanedamp.modal.algebra import orthonormal

Solve = Callable[[np.ndarray], np.ndarray]
#: vectors that Lanczos keeps, at least and for each mode
_LEAST_DIRECTIONS = 20


def krylov(
    start: np.ndarray,
    solve: Solve,
    mass: Any,
    count: int,
    select: Callable[[np.ndarray, list[np.ndarray]], np.ndarray] = lambda block, before: block,
) -> list[np.ndarray]:
    """Return up to `count` blocks (n, j <= m) of the Krylov space of K^-1 M, M-orthonormal.

    start   (n, m) fields that span the first block
    solve   K^-1 applied to loads (n, m)
    select  the part of a block to keep, from the block and those before; left out: all of it

    A block has no combinations that the blocks before have; there are fewer blocks where nothing is left.
    """
    blocks: list[np.ndarray] = []
    for _ in range(count):
        fields = solve(mass @ blocks[-1]) if blocks else start
        block = orthonormal(fields, mass, blocks)
        if block.shape[1]:
            block = select(block, blocks)
        if not block.shape[1]:
            break
        blocks.append(block)
    return blocks


def directions(modes: int) -> int:
    """Return the number of vectors that `lowest_modes` works with; structures of that size are solved densely."""
    return max(2 * modes + 1, _LEAST_DIRECTIONS)


def lowest_modes(
    stiffness: sparse.csr_array, mass: sparse.csr_array, modes: int, solve: Solve, shift: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenvalues (m,) ascending and vectors (n, m) of K x = lambda M x by Lanczos.

    solve: (K + shift M)^-1 applied to a vector, or its inverse in a subspace, where the vectors then lie. Raises
    ArpackError where it does not converge.
    """
    start = solve(np.random.default_rng(0).standard_normal(mass.shape[0]))
    inverse = LinearOperator(stiffness.shape, matvec=solve, dtype=float)
    values, vectors = eigsh(stiffness, modes, mass, sigma=-shift, OPinv=inverse, v0=start, ncv=directions(modes))
    order = np.argsort(values)
    return values[order], vectors[:, order]
