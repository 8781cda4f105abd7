"""Checks of the arrays of a reduced model: shape, finiteness, symmetry, definiteness."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.files import store
from vanedamp.files.errors import LARGEST, VanedampError
from vanedamp.modal.algebra import symmetric_part

_ASYMMETRY = 1e-9
# negative eigenvalues of a semidefinite K, relative to the largest: round-off of the rigid motions of a free structure
_INDEFINITE = 1e-9
# relative to a matrix's largest entry: smaller diagonal entries count as zero
_LEAST = 1e-60


class ReducedModelError(VanedampError):
    """A reduced model that does not fit together, or a request that it cannot meet; the message names the field."""


def check_definite(squares: np.ndarray) -> None:
    """Raise ReducedModelError for squared angular frequencies, ascending, of a stiffness that is not semidefinite."""
    lowest, highest = squares[[0, -1]]
    if lowest < -_INDEFINITE * highest:
        raise ReducedModelError(
            f"stiffness: not positive semidefinite, the lowest squared angular frequency is {lowest:.3g}"
        )


def unit(directions: np.ndarray) -> np.ndarray:
    """Return directions (k, 3) scaled to length one, to round-off; zeros stay."""
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    return store.frozen(directions / np.where((lengths == 0.0) | np.isclose(lengths, 1.0, rtol=1e-12), 1.0, lengths))


def shaped(name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return a frozen array of that shape, all finite. Raises ReducedModelError."""
    array = store.frozen(values)
    if array.shape != shape:
        raise ReducedModelError(f"{name}: expected shape {shape}, not {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ReducedModelError(f"{name}: holds entries that are not finite")
    check_size(name, array)
    return array


def symmetric(name: str, values: Any, size: int) -> np.ndarray:
    """Return a frozen symmetric matrix (size, size). Raises ReducedModelError."""
    array = shaped(name, values, (size, size))
    if array.any() and asymmetry(array) > _ASYMMETRY:
        raise ReducedModelError(f"{name}: not symmetric; if only one triangle is stored, mirror it")
    return store.frozen(symmetric_part(array))


def asymmetry(matrix: np.ndarray) -> float:
    """Return the largest |A - A^T| relative to the largest |A|, of a matrix that is not zero."""
    return float(np.abs(matrix - matrix.T).max() / np.abs(matrix).max())


def definiteness(matrix: np.ndarray) -> float:
    """Return the lowest eigenvalue relative to the largest, the diagonal scaled to one so that units play no part.

    Entries (n, n) up to LARGEST. A negative diagonal is scaled to -1.
    """
    diagonal = np.abs(np.diag(matrix))
    scale = np.sqrt(np.maximum(diagonal, _LEAST * np.abs(matrix).max()))
    eigenvalues = linalg.eigvalsh(matrix / np.outer(scale, scale))
    return float(eigenvalues[0] / np.abs(eigenvalues).max())


def check_size(name: str, matrix: np.ndarray) -> None:
    """Raise ReducedModelError for an entry whose square and products are no numbers."""
    largest = float(np.abs(matrix).max(initial=0.0))
    if largest > LARGEST:
        raise ReducedModelError(f"{name}: has an entry of {largest:.3g}; expected up to {LARGEST:g} in SI units")


def check_mass(mass: np.ndarray) -> None:
    """Raise ReducedModelError for a mass on the diagonal whose inverse is no number."""
    diagonal = np.diag(mass)
    bad = np.flatnonzero((diagonal > 0.0) & (diagonal < 1.0 / LARGEST))
    if bad.size:
        raise ReducedModelError(
            f"mass: coordinate {bad[0]} has {diagonal[bad[0]]:.3g} kg; expected zero, or at least {1.0 / LARGEST:g}"
        )
