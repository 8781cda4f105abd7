"""Basquin's curve, Miner's sum and scatter in closed form."""

import math

import numpy as np
import pytest

from vanedamp.coupling.strength.counting import Cycles, rainflow_cycles
from vanedamp.coupling.strength.haigh import equivalent_amplitude
from vanedamp.coupling.strength.life import damage, damage_per_cycle, hours, life_at, quantiles, starts
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.files.toml_input import InputError

CURVE = {"strength": 400e6, "exponent": 5.0, "knee": 2e6}


@pytest.mark.parametrize(("after", "exponent"), [("original", 5.0), ("haibach", 9.0), (7.0, 7.0), ("none", math.inf)])
def test_curve_on_both_sides_of_its_knee(after, exponent):
    curve = Fatigue(**CURVE, after_knee=after)
    found = damage_per_cycle([800e6, 400e6, 200e6], curve)
    np.testing.assert_allclose(found, [32.0 / 2e6, 1 / 2e6, 2.0**-exponent / 2e6], rtol=1e-14)
    assert damage_per_cycle(0.0, curve) == 0.0


@pytest.mark.parametrize("history", [[0.0, 100.0], [100.0, 0.0], [0.0, 0.0, 40.0, 100.0, 100.0]])
def test_two_points_are_half_a_cycle(history):
    """ASTM E1049-85, section 5.4.4: a range that is left is half a cycle."""
    assert [values.tolist() for values in rainflow_cycles(history)] == [[100.0], [50.0], [0.5]]
    assert [values.tolist() for values in rainflow_cycles([7.0, 7.0])] == [[], [], []]


def test_damage_of_a_sine_is_its_cycles_over_those_to_failure():
    """Goodman at a static stress of half the tensile strength doubles the amplitude."""
    curve = Fatigue(**CURVE, tensile_strength=1000e6).completed(None)
    history = 300e6 * np.sin(2.0 * np.pi * np.arange(4000) / 100.0)
    expected = 40.0 / (2e6 * (600.0 / 400.0) ** -5)
    assert damage(rainflow_cycles(history, repeats=True), curve, static=500e6) == pytest.approx(expected, rel=1e-12)
    cycle = damage_per_cycle(equivalent_amplitude(300e6, 500e6, curve), curve)
    assert 40.0 * cycle == pytest.approx(expected, rel=1e-12)


def test_miners_sum_by_hand():
    curve = Fatigue(**CURVE, after_knee="original", mean_stress="none")
    cycles = Cycles(np.array([1600e6, 800e6]), np.array([1e8, -1e8]), np.array([0.5, 1.0]))
    assert damage(cycles, curve) == pytest.approx((0.5 * 32.0 + 1.0) / 2e6, rel=1e-14)


def test_scatter_is_the_ratio_of_lives():
    curve = Fatigue(**CURVE, scatter=4.0)
    lives = quantiles(1000.0, curve)
    assert lives["90%"] / lives["10%"] == pytest.approx(4.0, rel=1e-12)
    assert lives["50%"] == 1000.0
    assert lives["10%"] == pytest.approx(500.0, rel=1e-12)
    # log10 of life is normal: draws of it against the quantile
    draws = 1000.0 * 10.0 ** np.random.default_rng(2).normal(scale=math.log10(4.0) / 2.5631031, size=200_000)
    assert np.mean(draws < life_at(1000.0, curve, 0.025)) == pytest.approx(0.025, abs=0.002)


def test_hours_and_starts():
    assert hours(1e-3, 36.0) == pytest.approx(10.0)
    assert starts(1e-4, 2.0) == pytest.approx(5000.0)
    assert hours(0.0, 1.0) == starts(0.0) == math.inf


def test_bad_arguments_are_rejected_in_one_line():
    with pytest.raises(InputError, match=r"^fatigue.exponent: missing; a life needs exponent and knee"):
        damage_per_cycle(1e8, Fatigue(strength=4e8))
    with pytest.raises(InputError, match=r"^probability: expected a number between 0 and 1, not 1"):
        life_at(1.0, Fatigue(**CURVE), 1.0)
    with pytest.raises(InputError, match=r"^passes_per_start: expected a positive number, not -1"):
        starts(1.0, -1.0)
