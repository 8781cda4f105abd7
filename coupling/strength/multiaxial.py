"""One number for six stress components, with a sign: signed von Mises and the largest principal stress."""

from __future__ import annotations

import numpy as np

from vanedamp.modal.algebra import von_mises

# |s1 + s3| / (|s1| + |s3|) below which the stress is pure shear to round-off, which has no sign of its own
_PURE_SHEAR = 1e-9


def principal_stresses(components: np.ndarray) -> np.ndarray:
    """Return the principal stresses (3, ...), Pa, ascending, of components (6, ...) xx, yy, zz, xy, yz, zx."""
    xx, yy, zz, xy, yz, zx = np.asarray(components, dtype=float)
    tensors = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    return np.moveaxis(np.linalg.eigvalsh(np.moveaxis(tensors, (0, 1), (-2, -1))), -1, 0)


def largest_principal(components: np.ndarray) -> np.ndarray:
    """Return the principal stress (...) of largest magnitude, Pa, with its sign; tensile in pure shear."""
    low, _, high = principal_stresses(components)
    return np.where(low + high < -_PURE_SHEAR * (np.abs(low) + np.abs(high)), low, high)


def signed_von_mises(components: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (...), Pa, with the sign of the principal stress of largest magnitude."""
    return np.copysign(von_mises(np.asarray(components, dtype=float)), largest_principal(components))
