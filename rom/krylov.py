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

from vanedamp.modal.algebra import orthonormal
from vanedamp.modal.lanczos import eigenpairs

Solve = Callable[[np.ndarray], np.ndarray]


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


def lowest_modes(mass: sparse.csr_array, modes: int, solve: Solve, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenvalues (m,) ascending and vectors (n, m) of K x = lambda M x by block Lanczos.

    solve: (K + shift M)^-1 applied to loads (n, b), or its inverse in a subspace, where the vectors then lie. n must be
    greater than modal.lanczos.directions(modes). Raises modal.lanczos.NotConvergedError.
    """
    values, rows = eigenpairs(lambda loads: solve(loads.T).T, mass, modes, -shift)
    order = np.argsort(values)
    return values[order], np.ascontiguousarray(rows[order].T)
