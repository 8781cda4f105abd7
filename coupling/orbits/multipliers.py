"""Multipliers of an orbit: the eigenvalues of its map's derivative, and their test functions."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigvals, svd

#: singular values of D - 1, relative to the largest, below which a direction is neutral
NULL = 1e-10
#: distance from 1 of the multipliers of neutral directions; for a body in free flight they are a double root
_UNITY = 1e-6


class Indicators(NamedTuple):
    """Test functions of an orbit: each changes its sign at a bifurcation, and is linear in the parameter there.

    unity: of real multipliers that pass 1 (folds and pitchforks); doubling: that pass -1; torus: of pairs that pass the
    unit circle, or of two real multipliers whose product passes 1, which is no bifurcation.
    """

    unity: float
    doubling: float
    torus: float


def multipliers(derivative: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the multipliers (k,), largest first, and how many of them are neutral.

    derivative: (k, k) of the map in scaled coordinates. Neutral ones are 1 without a bifurcation: an orbit may be moved
    that way and stays one, such as a body at rest on its floor, which rests anywhere.
    """
    values = eigvals(derivative)
    values = values[np.lexsort((values.imag, -values.real, -np.round(np.abs(values), 12)))]
    return values, int(np.count_nonzero(np.abs(values - 1.0) < _UNITY)) if len(null_space(derivative)) else 0


def null_space(derivative: np.ndarray) -> np.ndarray:
    """Return orthonormal rows (n, k) that the map moves as it moves the orbit."""
    _, sizes, rows = svd(derivative - np.eye(len(derivative)))
    return rows[sizes <= NULL * max(1.0, sizes[0])] if len(sizes) else rows


def decided(values: np.ndarray, neutral: int) -> np.ndarray:
    """Return the multipliers without the neutral ones, which are the closest to 1."""
    return values[np.argsort(np.abs(values - 1.0), kind="stable")[neutral:]]


def indicators(values: np.ndarray, neutral: int) -> Indicators:
    """Return the test functions of an orbit by its multipliers."""
    rest = decided(values, neutral)
    pairs = [one * other - 1.0 for one, other in itertools.combinations(rest, 2)]
    return Indicators(_signed(rest - 1.0), _signed(rest + 1.0), _signed(np.array(pairs)))


def _signed(factors: np.ndarray) -> float:
    """Return the size of the smallest factor with the sign of the product, which is real."""
    sizes = np.abs(factors)
    if not len(factors) or not sizes.all():
        return 0.0 if len(factors) else 1.0
    return float(np.copysign(sizes.min(), np.prod(factors / sizes).real))
