"""Intervals, misfit and proposals against closed forms of models whose residuals are straight."""

import math

import numpy as np
import pytest
from scipy import stats

from vanedamp.studies.identification.fit import Minimum
from vanedamp.studies.identification.statistics import covariance, few_changes, information, profile, shrunk, threshold

RNG = np.random.default_rng(7)


class Straight:
    """Residuals J (z - z0) + rest: the part of a Fit that profiles use."""

    def __init__(self, jacobian, centre, rest=0.0):
        self.jacobian_of, self.centre, self.rest = jacobian, centre, rest
        self.calls = 0

    def scatter(self, z):
        return 0.0

    def remember(self, z):
        """It has no motions."""

    def recall(self):
        """It has none to begin with."""

    def minimum(self, z, held=(), close=0.0, most=0):
        self.calls += 1
        z, free = np.array(z), np.setdiff1d(np.arange(len(z)), held)
        off = self.jacobian_of[:, list(held)] @ (z[list(held)] - self.centre[list(held)])
        if len(free):
            z[free] = self.centre[free] - np.linalg.lstsq(self.jacobian_of[:, free], off, rcond=None)[0]
        residual = self.jacobian_of @ (z - self.centre)
        return Minimum(z, float(residual @ residual) + self.rest, True)


def test_profiles_of_straight_residuals_end_at_their_covariance():
    jacobian, centre = RNG.standard_normal((20, 3)) * [30.0, 60.0, 100.0], np.array([0.4, 0.5, 0.6])
    fit, scatter, most = Straight(jacobian, centre, 5.0), covariance(jacobian), threshold(False, 17)
    assert scatter == pytest.approx(np.linalg.inv(jacobian.T @ jacobian), rel=1e-9)
    best = Minimum(centre, 5.0, True)
    for number in range(3):
        fit.calls = 0
        found = profile(fit, best, scatter, number, most)
        half = 1.959964 * math.sqrt(scatter[number, number])
        assert found.ends == pytest.approx((centre[number] - half, centre[number] + half), rel=1e-3)
        assert found.open == (False, False) and found.better is None
        assert fit.calls == 2  # the first step of each side is the last
        rise = ((found.z - centre[number]) ** 2) / scatter[number, number]
        assert found.rise == pytest.approx(rise, rel=1e-6, abs=1e-9)


def test_flat_and_half_open_numbers():
    jacobian, centre = np.array([[40.0, 0.0], [0.0, 0.0], [3.0, 0.0]]), np.array([0.02, 0.5])
    scatter = covariance(jacobian)
    assert np.isinf(scatter[1, 1]) and scatter[0, 0] == pytest.approx(1 / 1609.0)
    fit, best = Straight(jacobian, centre), Minimum(centre, 0.0, True)
    assert profile(fit, best, scatter, 1, 3.84).open == (True, True)
    half = profile(fit, best, scatter, 0, 3.84)
    assert half.open == (True, False) and half.ends[0] == 0.0
    assert half.ends[1] == pytest.approx(0.02 + math.sqrt(3.84 / 1609.0), rel=0.02)


def test_a_better_minimum_is_reported():
    fit = Straight(np.array([[50.0, 10.0], [0.0, 40.0]]), np.array([0.5, 0.5]))
    wrong = Minimum(np.array([0.47, 0.5]), (50.0 * 0.03) ** 2, True)
    found = profile(fit, wrong, covariance(fit.jacobian_of), 0, 3.84)
    assert found.better is not None and found.better.misfit < wrong.misfit


def test_thresholds():
    assert threshold(False, 10) == pytest.approx(3.841459, rel=1e-6)
    assert threshold(True, 10) == pytest.approx(stats.t.ppf(0.975, 10) ** 2, rel=1e-9)


def test_few_changes_of_sign():
    alternating = np.resize([1.0, -1.0], 20)
    assert few_changes(np.repeat([1.0, -1.0], 10)) < 1e-4 < 0.9 < few_changes(alternating)
    assert np.isnan(few_changes(alternating[:9]))
    assert few_changes(np.ones(12)) == 0.5**11
    # of independent residuals the chance is nearly uniform
    chances = np.array([few_changes(RNG.standard_normal(40)) for _ in range(400)])
    assert abs((chances < 0.5).mean() - 0.5) < 0.15 and (chances < 0.01).mean() < 0.04


def test_further_measurements_shrink_deviations():
    told = information(np.array([[10.0, 0.0], [0.0, 1.0]]))
    assert told == pytest.approx(np.array([[112.0, 0.0], [0.0, 13.0]]))
    found = shrunk(told, [np.array([[0.0, 6.0]]), np.zeros((1, 2))])
    assert found == pytest.approx(1 / np.sqrt([[112.0, 49.0], [112.0, 13.0]]))
