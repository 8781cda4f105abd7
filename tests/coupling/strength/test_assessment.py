"""Utilisation and life of hot spots: closed forms, by histories that arrive in parts."""

import math

import numpy as np
import pytest

from vanedamp.coupling.strength.assessment import assessed, fatigue_of
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.spot_history import SpotHistories

DATA = {
    "strength": 400e6, "tensile_strength": 1000e6, "yield_strength": 900e6, "exponent": 5.0, "knee": 1e7,
    "after_knee": "original", "scatter": 4.0,
}  # fmt: skip
UNIAXIAL = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def histories(amplitude, static, parts, material, samples=100, periods=60):
    """Histories of a sine along x about a static stress, added in parts of whole samples."""
    stress = static + amplitude * np.sin(2.0 * np.pi * (0.25 + np.arange(samples * periods) / samples))
    found = SpotHistories([material])
    for begin, end in zip(parts, [*parts[1:], samples * periods], strict=True):
        part = (UNIAXIAL[:, None] * stress[begin:end])[None]
        found.add(np.arange(begin, end), part, part.mean(axis=-1))
    return found


@pytest.mark.parametrize("criterion", ["von_mises", "principal"])
@pytest.mark.parametrize("parts", [[0], [0, 100, 1234, 4001]])
def test_life_of_a_sine_about_a_static_stress(parts, criterion):
    """150 MPa upon 400 MPa: Goodman's equivalent amplitude is 250 MPa, and a cycle in 10 ms does 1 / N of it."""
    material = fatigue_of({"fatigue": DATA | {"criterion": criterion}})
    cycles = histories(150e6, 400e6, parts, material).cycles(0, repeats=True)
    amplitudes = {criterion: 150e6, f"{criterion}_max": 180e6}
    found = assessed(material, amplitudes, 400e6 * UNIAXIAL, cycles, duration=0.6)
    life = 1e7 * (250.0 / 400.0) ** -5 * 0.01 / 3600.0
    expected = {
        "amplitude": 150e6, "mean": 400e6, "equivalent_amplitude": 250e6, "utilisation": 0.625, "utilisation_max": 0.75,
        "yield_utilisation": 550.0 / 900.0, "damage": 60 * (250.0 / 400.0) ** 5 / 1e7, "damage_per_hour": 1.0 / life,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-9)
    assert found["life_hours"] == pytest.approx({"10%": life / 2, "50%": life, "90%": life * 2}, rel=1e-9)


def test_only_what_is_evaluated_counts():
    material = fatigue_of({"fatigue": DATA})
    kept = histories(150e6, 0.0, [0, 1000, 2000], material)
    assert kept.cycles(0, first=2000, repeats=True).counts.sum() == pytest.approx(40.0)
    assert kept.cycles(0, first=99999) is None


def test_without_a_curve_there_is_no_life():
    material = fatigue_of({"fatigue": {"strength": 4e8}})
    assert histories(1e8, 0.0, [0], material).cycles(0) is None
    found = assessed(material, {"von_mises": 1e8, "principal": 1e8}, np.zeros(6), None)
    assert found["utilisation"] == 0.25 and "life_hours" not in found and "yield_utilisation" not in found
    assert fatigue_of({"fatigue": {}}) is None and fatigue_of({}) is None


def test_a_mean_stress_beyond_the_line_leaves_no_life():
    material = fatigue_of({"fatigue": DATA})
    cycles = histories(1e8, 0.0, [0], material).cycles(0, repeats=True)
    found = assessed(material, {"von_mises": 1e8}, 1.1e9 * UNIAXIAL, cycles, 1.0)
    assert found["utilisation"] == math.inf and found["life_hours"]["50%"] == 0.0


def test_spots_may_have_several_materials():
    stress = np.zeros((3, 6, 200))
    stress[:, 0] = 1e8 * np.sin(2.0 * np.pi * np.arange(200) / 100.0)
    found = SpotHistories([None, Fatigue(**DATA), Fatigue(strength=1e8)])
    found.add(np.zeros(200), stress, stress.mean(axis=-1))
    assert [found.cycles(place) is None for place in range(3)] == [True, False, True]
