"""Checks of the arrays of a reduced model: shape, finiteness, symmetry, definiteness."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.files import store
from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import symmetric_part

_ASYMMETRY = 1e-9
# negative eigenvalues of a semidefinite K, relative to the largest: round-off of the rigid motions of a free structure
_INDEFINITE = 1e-9


class ReducedModelError(VanedampError):
    """A reduced model that does not fit together, or a question it cannot answer; the message names the field."""


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
    """Return the lowest eigenvalue relative to the highest, the diagonal scaled to one so that units play no part."""
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    eigenvalues = linalg.eigvalsh(matrix / np.outer(scale, scale))
    return float(eigenvalues[0] / eigenvalues[-1])
