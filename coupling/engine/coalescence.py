"""Modes that nearly coalesce: their amplitudes are large and cancel."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.numerics.tolerances import NEARLY_EQUAL


def coalesce(rate: np.ndarray, vectors: np.ndarray, inverse: np.ndarray) -> bool:
    """Return whether some modes nearly coalesce, by the condition of each eigenvalue (m,), lengths by energy.

    vectors (2q, m) and their inverse (m, 2q), of pairs one, twice: on coordinates and rates of unit mass.
    """
    energy = np.ones((len(vectors), len(rate)))
    energy[: len(vectors) // 2] = np.abs(rate)
    size = np.linalg.norm(vectors * energy, axis=0) * np.linalg.norm(inverse.T / energy, axis=0)
    return bool(np.any(size > NEARLY_EQUAL * np.where(rate.imag > 0, 2, 1)))
