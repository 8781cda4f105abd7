"""Elimination against the inverse of numpy."""

import numpy as np
import pytest

from vanedamp.coupling.numerics.compiler.jit import entry
from vanedamp.coupling.numerics.elimination import reciprocal, solve


@entry
def _solve(matrix, x, k):
    return solve(matrix, x, k)


@entry
def _reciprocal(z):
    return reciprocal(z)


@pytest.mark.parametrize("k", [1, 2, 5, 30])
@pytest.mark.parametrize("density", [0.2, 1.0])
def test_random_systems(k, density):
    """With zeros on the diagonal, and room behind the unknowns."""
    rng = np.random.default_rng(k)
    matrix = rng.normal(size=(k + 2, k + 2)) + 1j * rng.normal(size=(k + 2, k + 2))
    matrix[rng.random(matrix.shape) > density] = 0.0
    matrix[np.arange(k), np.roll(np.arange(k), 1)] += 3.0
    matrix[0, 0] = 0.0 if k > 1 else 1.0
    x = rng.normal(size=k + 2) + 1j * rng.normal(size=k + 2)
    exact, rest = np.linalg.solve(matrix[:k, :k], x[:k]), x[k:].copy()
    condition = np.linalg.cond(matrix[:k, :k])
    assert _solve(matrix, x, k)
    assert np.abs(x[:k] - exact).max() <= 1e-14 * condition * np.abs(exact).max()
    assert np.array_equal(x[k:], rest)


def test_singular():
    assert not _solve(np.ones((2, 2), complex), np.ones(2, complex), 2)
    assert not _solve(np.zeros((1, 1), complex), np.ones(1, complex), 1)


def test_reciprocal():
    for z in (2.0 + 0.0j, -3j, 1e-100 + 1e-90j, 0.3 - 4e7j):
        assert _reciprocal(z) == pytest.approx(1 / z, rel=1e-15)
