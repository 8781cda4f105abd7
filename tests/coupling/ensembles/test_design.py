"""The design of an ensemble: indices and quantiles of functions with closed forms."""

import numpy as np
import pytest

from vanedamp.coupling.ensembles.design import QUANTILES, design, independent, indices, quantiles
from vanedamp.coupling.scene.ranges import EnsembleTable

#: Ishigami's function sin x + a sin^2 y + b z^4 sin x on (-pi, pi)^3
A, B = 7.0, 0.1


def ishigami(x):
    return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])


@pytest.mark.parametrize("seed", [0, 1])
def test_indices_of_ishigamis_function(seed):
    x = design({name: (-np.pi, np.pi) for name in "xyz"}, EnsembleTable(samples=2**13, seed=seed))
    first, first_half, total, total_half = indices(ishigami(x), 3, seed)
    own = [0.5 * (1 + B * np.pi**4 / 5) ** 2, A**2 / 8, 0.0]
    shared = 8 * B**2 * np.pi**8 / 225
    variance = sum(own) + shared
    np.testing.assert_allclose(first, np.array(own) / variance, atol=0.02)
    np.testing.assert_allclose(total, np.array([own[0] + shared, own[1], shared]) / variance, atol=0.02)
    assert (first_half < 0.05).all() and (total_half < 0.05).all() and (total_half > 0.0).all()


def test_the_same_seed_gives_the_same_numbers():
    ranges = {"x": (0.0, 1.0), "y": (2.0, 3.0)}
    x = design(ranges, EnsembleTable(samples=16, seed=0))
    np.testing.assert_array_equal(x, design(ranges, EnsembleTable(samples=16, seed=0)))
    assert not np.array_equal(x, design(ranges, EnsembleTable(samples=16, seed=1)))
    values = x[:, 0] ** 2 + x[:, 1]
    np.testing.assert_array_equal(indices(values, 2, 0), indices(values, 2, 0))


def test_quantiles_of_a_monotone_function():
    x = design({"x": (1.0, 3.0)}, EnsembleTable(samples=256))[:, 0]
    found = quantiles(np.exp(x), 1)
    # each half of the samples has one point in each of 256 equal parts
    np.testing.assert_allclose((np.log(found) - 1.0) / 2.0, QUANTILES, atol=1 / 128)


def test_samples_of_a_logarithmic_range():
    x = independent(design({"x": (1e-3, 1e3)}, EnsembleTable(samples=256, distribution="log-uniform")), 1)[:, 0]
    assert x.min() >= 1e-3 and x.max() <= 1e3
    np.testing.assert_allclose((np.log10(np.quantile(x, QUANTILES)) + 3) / 6, QUANTILES, atol=1 / 128)


def test_blocks_with_a_missing_result_are_left_out():
    x = design({"x": (0.0, 1.0), "y": (0.0, 1.0)}, EnsembleTable(samples=64))
    values = x[:, 0] + 2 * x[:, 1]
    some = values.copy()
    some[5] = np.nan  # of the second block of four
    kept = np.delete(np.arange(len(values)), np.arange(4, 8))
    np.testing.assert_array_equal(indices(some, 2, 0), indices(values[kept], 2, 0))
    assert np.isfinite(quantiles(some, 2)).all()


def test_a_constant_has_no_indices():
    x = design({"x": (0.0, 1.0)}, EnsembleTable(samples=8))
    assert np.isnan(indices(np.full(len(x), 3.0), 1, 0)).all()
    assert np.isnan(quantiles(np.full(len(x), np.nan), 1)).all()
