"""Amplitudes of stress from samples, against closed forms."""

import numpy as np
import pytest

from vanedamp.coupling.strength.stress import MEASURES, period_stress, scalar_stresses
from vanedamp.modal.algebra import von_mises

VON_MISES, PRINCIPAL = (MEASURES.index(name) for name in ("von_mises", "principal"))


def periods(direction, count, each, shift=0.3, mean=0.0):
    """`count` periods of a sine of amplitude 1 along a stress (6,), with a sample more at each end: (1, 6, n)."""
    angle = 2 * np.pi * (np.arange(-1, count * each + 1) + shift) / each
    return (np.sin(angle) + mean)[None, None] * np.asarray(direction)[None, :, None]


def test_principal_stress_is_the_eigenvalue_of_largest_magnitude():
    stress = np.random.default_rng(1).standard_normal((6, 200)) * 1e8
    xx, yy, zz, xy, yz, zx = stress
    eigenvalues = np.linalg.eigvalsh(np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]).transpose(2, 0, 1))
    expected = np.take_along_axis(eigenvalues, np.abs(eigenvalues).argmax(axis=1)[:, None], axis=1)[:, 0]
    equivalent, principal = scalar_stresses(stress)
    assert principal == pytest.approx(np.abs(expected), rel=1e-7)
    assert equivalent == pytest.approx(von_mises(stress), rel=1e-12)


def test_no_stress_is_no_trouble():
    assert np.array_equal(scalar_stresses(np.zeros((6, 3))), np.zeros((2, 3)))


def test_stress_whose_direction_turns_keeps_its_amplitude():
    """xx = cos, xy = sin / sqrt(3): von Mises stress is 1 throughout, in one half of the period with the other sign."""
    angle = 2 * np.pi * np.arange(-1, 65) / 64
    stress = np.zeros((1, 6, 66))
    stress[0, 0], stress[0, 3] = np.cos(angle), np.sin(angle) / np.sqrt(3)
    assert period_stress(stress, 64).amplitude[0, 0, VON_MISES] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("direction", "equivalent", "principal"),
    [
        ((0, 2e8, 0, 0, 0, 0), 2e8, 2e8),
        ((0, 0, 0, 0, 1e8, 0), np.sqrt(3) * 1e8, 1e8),
        ((1e8, 1e8, 0, 0, 0, 0), 1e8, 1e8),
    ],
    ids=["tension", "shear", "two axes"],
)
@pytest.mark.parametrize("mean", [0.0, 5.0])
def test_amplitude_of_a_sine_is_that_about_its_mean(direction, equivalent, principal, mean):
    found = period_stress(periods(direction, 3, 24, mean=mean), 24)
    assert found.amplitude.shape == (3, 1, 8) and found.mean.shape == (3, 1, 6)
    assert found.mean[1, 0] == pytest.approx(mean * np.array(direction), abs=1e-6)
    assert found.amplitude[:, 0, :6] == pytest.approx(np.tile(np.abs(direction), (3, 1)), rel=1e-3)
    assert found.amplitude[:, 0, VON_MISES] == pytest.approx(equivalent, rel=1e-3)
    assert found.amplitude[:, 0, PRINCIPAL] == pytest.approx(principal, rel=1e-3)


def test_each_period_has_its_own_range():
    stress = np.concatenate([periods((1, 0, 0, 0, 0, 0), 1, 32)[..., :-2], 3 * periods((1, 0, 0, 0, 0, 0), 1, 32)], -1)
    amplitude = period_stress(stress, 32).amplitude[:, 0]
    assert amplitude[1, 0] == pytest.approx(3.0, rel=1e-3)
    assert amplitude[0, 0] == pytest.approx(1.0, rel=0.1)  # the last of its samples is one of the larger motion's


def test_peaks_between_samples_are_of_fourth_order():
    errors = []
    for each in (12, 24):
        shifts = np.linspace(0.0, 1.0, 21)
        found = [
            period_stress(periods((1, 0, 0, 0, 0, 0), 1, each, shift), each).amplitude[0, 0, 0] for shift in shifts
        ]
        errors.append(np.abs(np.array(found) - 1.0).max())
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] > 12.0
