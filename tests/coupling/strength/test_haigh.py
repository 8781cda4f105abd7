"""Lines of mean stress against numbers worked by hand, and one number for six components."""

import numpy as np
import pytest

from vanedamp.coupling.strength.haigh import (
    equivalent_amplitude,
    permissible_amplitude,
    utilisation,
    yield_utilisation,
)
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.multiaxial import largest_principal, principal_stresses, signed_von_mises

STRENGTHS = {"strength": 400e6, "tensile_strength": 1000e6, "yield_strength": 800e6}


def material(line):
    return Fatigue(**STRENGTHS, mean_stress=line).completed(None)


@pytest.mark.parametrize(
    ("line", "permissible", "equivalent", "along_ratio"),
    [
        # amplitude 150 MPa at a mean of 400 MPa
        ("none", 400e6, 150e6, 0.375),
        ("goodman", 240e6, 250e6, 0.775),  # 400 (1 - 0.4); 150 / 0.6; 0.375 + 0.4
        ("gerber", 336e6, 150e6 / 0.84, 0.5 * (0.375 + 0.780625**0.5)),  # n 0.375 + n^2 0.16 = 1
        ("soderberg", 200e6, 300e6, 0.875),  # 400 (1 - 0.5); 150 / 0.5; 0.375 + 0.5
    ],
)
def test_lines_by_hand(line, permissible, equivalent, along_ratio):
    data = material(line)
    assert permissible_amplitude(400e6, data) == pytest.approx(permissible, rel=1e-14)
    assert equivalent_amplitude(150e6, 400e6, data) == pytest.approx(equivalent, rel=1e-14)
    assert utilisation(150e6, 400e6, data) == pytest.approx(150e6 / permissible, rel=1e-14)
    assert utilisation(150e6, 400e6, data, "ratio") == pytest.approx(along_ratio, rel=1e-12)


@pytest.mark.parametrize("line", ["goodman", "gerber", "soderberg"])
def test_scaled_by_its_utilisation_along_the_ratio_a_stress_lies_on_the_line(line):
    data, mean = material(line), np.linspace(0.0, 500e6, 7)
    amplitude = 120e6
    used = utilisation(amplitude, mean, data, "ratio")
    np.testing.assert_allclose(amplitude / used, permissible_amplitude(mean / used, data), rtol=1e-12)


@pytest.mark.parametrize("line", ["none", "goodman", "gerber", "soderberg"])
def test_compression_counts_as_no_mean_stress(line):
    assert equivalent_amplitude(150e6, -300e6, material(line)) == 150e6
    assert utilisation(150e6, -300e6, material(line), "ratio") == pytest.approx(0.375)


@pytest.mark.parametrize(("line", "end"), [("goodman", 1000e6), ("gerber", 1000e6), ("soderberg", 800e6)])
def test_beyond_the_line_nothing_is_permissible(line, end):
    assert permissible_amplitude([end, 1.1 * end], material(line)).tolist() == [0.0, 0.0]
    assert utilisation(1e6, 1.1 * end, material(line)) == np.inf


def test_yield():
    assert yield_utilisation(150e6, -400e6, material("goodman")) == pytest.approx(550.0 / 800.0)
    assert yield_utilisation(1.0, 1.0, Fatigue(strength=1e8)) is None


def test_without_a_line_of_its_own_a_tensile_strength_gives_goodman():
    assert Fatigue(tensile_strength=1e9).completed(4e8) == Fatigue(
        strength=4e8, tensile_strength=1e9, mean_stress="goodman"
    )
    assert Fatigue(yield_strength=1e9).completed(4e8).mean_stress == "none"


def test_principal_stresses_of_a_turned_state():
    """Principal stresses 300, 50, -100 MPa along the columns of an orthogonal matrix."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    tensor = turn @ np.diag([300e6, 50e6, -100e6]) @ turn.T
    components = np.array([tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[1, 2], tensor[2, 0]])
    np.testing.assert_allclose(principal_stresses(components), [-100e6, 50e6, 300e6], rtol=1e-12)
    expected = np.sqrt(0.5 * (250**2 + 150**2 + 400**2)) * 1e6
    for sign in (1.0, -1.0):
        assert largest_principal(sign * components) == pytest.approx(sign * 300e6)
        assert signed_von_mises(sign * components) == pytest.approx(sign * expected)


def test_uniaxial_stress_keeps_its_sign_and_size():
    history = np.zeros((6, 50))
    history[1] = 2e8 * np.sin(np.linspace(0.1, 6.0, 50))
    np.testing.assert_allclose(signed_von_mises(history), history[1], rtol=1e-12)
    np.testing.assert_allclose(largest_principal(history), history[1], rtol=1e-12)
