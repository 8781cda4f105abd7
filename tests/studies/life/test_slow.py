"""Slow integration: order, the error said, noise that is no error, and bands that hold."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import RK23
from scipy.special import lambertw

from vanedamp.studies.life.slow import Steps, between, integrate


class Rates(NamedTuple):
    rate: np.ndarray
    confidence: np.ndarray


def known(function):
    return lambda state: Rates(function(state), 0.0 * state)


def unit(state):
    return np.ones(len(state))


def growth(state):
    """Rates of x' = x/(1 + x), y' = 1/(1 + y): x + log x and y + y^2/2 grow linearly."""
    return np.array([state[0] / (1 + state[0]), 1 / (1 + state[1])])


def exact(time):
    return np.array([lambertw(np.exp(time)).real, np.sqrt(1 + 2 * time) - 1])


BEGIN = exact(0.0)


@pytest.mark.parametrize("count", [8, 16])
def test_errors_stay_below_what_is_said_and_fall_eightfold(count):
    ends = {}
    for steps in (count, 2 * count):
        *_, last = integrate(known(growth), BEGIN, 4.0, Steps(1.0, 1.0, unit, fixed=steps))
        ends[steps] = np.abs(last.state - exact(4.0))
        assert np.all(ends[steps] < last.error)
    assert np.all(ends[count] / ends[2 * count] == pytest.approx(8.0, rel=0.35))


def test_steps_follow_the_tolerance():
    counts = []
    for tolerance in (1e-2, 1e-4, 1e-6):
        moments = list(integrate(known(growth), BEGIN, 4.0, Steps(tolerance, 10.0, unit)))
        assert moments[-1].time == pytest.approx(4.0)
        assert np.all(np.abs(moments[-1].state - exact(4.0)) < tolerance)
        assert np.all(moments[-1].error <= 1.5 * tolerance)
        counts.append(len(moments))
    assert counts[0] < counts[1] < counts[2] < 40 * counts[1]


def test_no_step_grows_by_more_than_the_reach():
    moments = list(integrate(known(growth), BEGIN, 4.0, Steps(1.0, 0.1, unit)))
    assert max(np.diff([moment.state for moment in moments], axis=0).max(axis=0)) < 0.12


def test_states_between_moments():
    first, *_, last = integrate(known(growth), BEGIN, 0.4, Steps(1.0, 1.0, unit, fixed=1))
    assert between(first, last, 0.2)[0] == pytest.approx(exact(0.2), abs=1e-3)


class Noisy:
    def __init__(self, seed, size):
        self.random, self.size, self.calls = np.random.default_rng(seed), size, 0

    def __call__(self, state):
        self.calls += 1
        rate = growth(state)
        return Rates(rate * (1 + self.size * self.random.standard_normal(2)), 1.96 * self.size * rate)


def calls_of_a_library(rates, tolerance):
    solver = RK23(lambda _, state: rates(state).rate, 0.0, BEGIN, 4.0, rtol=1e-13, atol=tolerance)
    while solver.status == "running" and rates.calls < 2000:
        solver.step()
    return rates.calls


def test_noise_is_no_error_of_steps():
    """A library's integrator takes it for one, and asks for some ten times as many rates as without noise."""
    for seed in range(10):
        rates = Noisy(seed, 0.05)
        *_, last = integrate(rates, BEGIN, 4.0, Steps(1e-4, 10.0, unit))
        assert rates.calls < 60
        assert np.all(np.abs(last.state - exact(4.0)) < 2 * last.band + last.error)
    quiet, noisy = (calls_of_a_library(Noisy(0, size), 1e-4) for size in (0.0, 0.05))
    assert quiet < 100 and noisy > 5 * quiet


def test_bands_hold_the_truth_as_often_as_they_say():
    inside = []
    for seed in range(300):
        *_, last = integrate(Noisy(seed, 0.1), BEGIN, 4.0, Steps(1.0, 10.0, unit, fixed=6))
        inside.append(np.abs(last.state - exact(4.0)) < last.band + last.error)
    share = np.mean(inside, axis=0)
    assert np.all(share > 0.90) and np.all(share < 0.995)


def test_a_jump_of_the_rates_is_passed():
    jump = known(lambda state: np.where(state < 1.0, 1.0, 0.1))
    *_, last = integrate(jump, np.zeros(1), 4.0, Steps(1e-3, 10.0, lambda state: np.ones(1)))
    assert last.state == pytest.approx(1.3, abs=5e-3) and last.error[0] < 1e-2
