"""Natural modes of small dense matrices, and what is made of them: modal damping, quasi-static blocks."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from rom.fields import ReducedModelError

# share of its own that a quasi-static coordinate needs for the mass to stay well conditioned
_OWN_SHARE = 1e-10
# squared frequency of a rigid motion, relative to the largest
_RIGID = 1e-12


def spectrum(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared angular frequencies, ascending, and mass-normalised shapes as columns. Raises ReducedModelError."""
    try:
        return linalg.eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise ReducedModelError("mass: not positive definite; drop coordinates without mass of their own") from error


def modal_damping(mass: np.ndarray, stiffness: np.ndarray, ratio: float) -> np.ndarray:
    """(n, n) C = M Phi diag(2 ratio omega) Phi^T M: the same damping ratio for every mode Phi of (K, M).

    Raises ReducedModelError for a ratio outside 0 <= ratio < 1 or a mass that is not positive definite.
    """
    if not 0.0 <= ratio < 1.0:
        raise ReducedModelError(f"damping_ratio: expected 0 <= ratio < 1, not {ratio}")
    eigenvalues, shapes = spectrum(mass, stiffness)
    inertia = mass @ shapes
    damping = inertia * (2.0 * ratio * np.sqrt(np.maximum(eigenvalues, 0.0))) @ inertia.T
    return halved(damping)


def krylov(start: np.ndarray, stiffness: np.ndarray, mass: np.ndarray, count: int) -> list[np.ndarray]:
    """`count` blocks of the Krylov space of K^-1 M, M-orthonormal, without what the blocks before have."""
    blocks: list[np.ndarray] = []
    block = start
    for _ in range(count):
        norms = np.sqrt(np.einsum("ij,ij->j", block, mass @ block))
        rest = block[:, norms > 0.0] / norms[norms > 0.0]
        for known in [*blocks, *blocks]:  # twice is enough
            rest = rest - known @ (known.T @ (mass @ rest))
        values, vectors = np.linalg.eigh(rest.T @ (mass @ rest))
        own = values > _OWN_SHARE
        if not np.any(own):
            break
        blocks.append(rest @ (vectors[:, own] / np.sqrt(values[own])))
        block = np.linalg.solve(stiffness, mass @ blocks[-1])
    return blocks


def check_elastic(squares: np.ndarray, every: np.ndarray) -> None:
    """Raise ReducedModelError if squared frequencies have a rigid motion, beside all of the structure."""
    if squares.size and squares.min() <= _RIGID * every.max():
        raise ReducedModelError("modes: a rigid motion would be dropped, which has no static response; keep more modes")


def halved(matrix: np.ndarray) -> np.ndarray:
    """The symmetric part."""
    return 0.5 * (matrix + matrix.T)
