"""Steady state and confidence: against processes whose statistics are known, and on the engine's own responses."""

import mpmath
import numpy as np
import pytest

from tests.coupling.engine.line.test_closed_forms import cluster
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.steady_state import mean_confidence, student_quantile, transient_length
from vanedamp.coupling.simulation import simulate


def autoregressive(rng, n, correlation):
    """AR(1) with unit innovations: the mean of n entries has variance 1/(n (1 - correlation)^2) for long series."""
    series = np.zeros(n)
    noise = rng.normal(size=n)
    for i in range(1, n):
        series[i] = correlation * series[i - 1] + noise[i]
    return series


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.8])
def test_confidence_interval_covers_the_mean(correlation):
    """The 95 % interval holds the true mean in 95 % of 400 series, within three standard errors of that count."""
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(400):
        series = autoregressive(rng, 2000, correlation)
        covered += abs(series.mean()) <= mean_confidence(series)
    assert 0.95 - 3 * np.sqrt(0.05 * 0.95 / 400) - 0.01 <= covered / 400 <= 0.99


def test_students_quantile_is_that_of_the_incomplete_beta_function():
    for freedom in [1.0, 1.2, 2.0, 2.7, 4.0, 6.9, 9.0]:
        with mpmath.workdps(30):
            t = mpmath.mpf(student_quantile(freedom))
            # P(|T| < t), whose slope is that of the density
            tail = mpmath.betainc(freedom / 2, 0.5, 0, freedom / (freedom + t**2), regularized=True)
            density = (1 + t**2 / freedom) ** (-(freedom + 1) / 2) / mpmath.sqrt(freedom)
            density /= mpmath.beta(freedom / 2, mpmath.mpf(0.5))
            assert abs((tail - mpmath.mpf("0.05")) / (2 * density * t)) < 1e-15


def test_transient_of_a_decay_is_found():
    rng = np.random.default_rng(2)
    decay = 50.0 * np.exp(-np.arange(2000) / 60.0)
    cut = transient_length(10.0 + decay + autoregressive(rng, 2000, 0.3), 2000)
    assert 120 < cut < 700


def test_a_drift_has_no_steady_state():
    assert transient_length(np.linspace(0.0, 1.0, 500) ** 2, 500) == -1
    assert transient_length(np.ones(10), 10) == -1


@pytest.mark.parametrize("seed", range(8))
def test_the_cut_has_the_least_standard_error(seed):
    """By the rule as it is written: the variance of what is left over its length."""
    rng, n = np.random.default_rng([seed, 3]), 300
    series = 1.0 + 3.0 * np.exp(-np.arange(n) / rng.uniform(5.0, 60.0)) + autoregressive(rng, n, 0.4)
    errors = [np.var(series[cut:]) / (n - cut) for cut in range(n - 20)]
    least = int(np.argmin(errors))
    assert transient_length(np.append(series, np.nan), n) == (least if least <= n // 2 else -1)


@pytest.mark.parametrize(("frequency_ratio", "tolerance"), [(0.96, 0.01), (0.985, 0.01), (1.0, 0.06)])
def test_automatic_steady_state_agrees_with_a_long_run(frequency_ratio, tolerance):
    automatic = simulate(cluster(frequency_ratio, time={"periods": 20_000, "steady": "auto", "tolerance": tolerance}))
    long = simulate(cluster(frequency_ratio, time={"periods": 30_000, "transient": 5_000}))
    assert automatic.status == Status.OK
    assert automatic.periods < 20_000
    assert automatic.amplitude_mean_confidence <= tolerance * automatic.amplitude_mean
    # two independent means: both intervals, and as much again for chance
    apart = abs(automatic.amplitude_mean - long.amplitude_mean)
    assert (
        apart <= 2 * (automatic.amplitude_mean_confidence + long.amplitude_mean_confidence) + 1e-3 * long.amplitude_mean
    )


def test_a_chaotic_mean_that_stays_uncertain_says_so():
    response = simulate(cluster(1.0, time={"periods": 400, "steady": "auto", "tolerance": 1e-3}))
    # where the transient ends is itself a matter of chance in 400 periods
    assert response.status in (Status.UNCERTAIN, Status.NOT_STEADY)
    assert response.amplitude_mean_confidence > 1e-3 * response.amplitude_mean


def test_a_run_too_short_to_be_steady_says_so():
    response = simulate(cluster(1.0, time={"periods": 30, "steady": "auto"}))
    assert response.status == Status.NOT_STEADY
    assert response.periods == 30
    assert response.amplitude_mean_confidence is None
