"""Poles of known responses are found again, with noise, close together, beside modes outside the band."""

import numpy as np
import pytest

from modal.frf import QUANTITIES, Frf, FrfError, identify


def response(frequencies, modes, quantity="receptance"):
    """Sum of modes (Hz, damping ratio, residue per kg)."""
    omega = 2 * np.pi * frequencies
    total = sum(a / ((2 * np.pi * f) ** 2 - omega**2 + 2j * z * 2 * np.pi * f * omega) for f, z, a in modes)
    return total * (1j * omega) ** QUANTITIES[quantity]


AXIS = np.linspace(2200.0, 2700.0, 801)
PAIR = [(2414.0, 0.002, 1.0), (2530.0, 0.005, -0.6)]


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_two_modes_without_noise_are_exact(quantity):
    outside = [(900.0, 0.01, 2.0), (5000.0, 0.01, 3.0)]
    poles = identify(Frf(AXIS, response(AXIS, PAIR + outside, quantity), quantity).band(2300, 2650), 2)
    # two real terms stand for the modes outside the band
    assert poles.frequencies_hz == pytest.approx([2414.0, 2530.0], rel=1e-5)
    assert poles.damping_ratios == pytest.approx([0.002, 0.005], rel=5e-3)
    exact = identify(Frf(AXIS, response(AXIS, PAIR, quantity), quantity), 2)
    assert exact.damping_ratios == pytest.approx([0.002, 0.005], rel=1e-8)
    assert exact.misfit < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_two_modes_with_noise_are_found_within_their_deviations(seed):
    """2 % noise of the peak; the deviations that come along are honest."""
    rng = np.random.default_rng(seed)
    second = [(f, z, a * g) for (f, z, a), g in zip(PAIR, (0.7, 1.3), strict=True)]
    clean = np.array([response(AXIS, PAIR), response(AXIS, second)])
    noise = (
        0.02
        * np.abs(clean).max()
        / np.sqrt(2)
        * (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape))
    )
    poles = identify(Frf(AXIS, clean + noise), 2)
    assert poles.damping_ratios == pytest.approx([0.002, 0.005], rel=0.05)
    error = np.abs(np.column_stack([poles.frequencies_hz - [2414.0, 2530.0], poles.damping_ratios - [0.002, 0.005]]))
    assert np.all(error < 4.0 * poles.deviations)
    assert np.all(poles.deviations[:, 1] < 0.03 * poles.damping_ratios)


def test_modes_closer_than_their_bandwidth():
    """Half-power bandwidths of 24 Hz at 12 Hz distance: a single peak, which a circle fit would read as one mode."""
    modes = [(2414.0, 0.005, 1.0), (2426.0, 0.005, 0.8)]
    rng = np.random.default_rng(5)
    clean = np.array([response(AXIS, modes), response(AXIS, [modes[0], (2426.0, 0.005, -0.8)])])
    noise = 2e-3 * np.abs(clean).max() * (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape))
    poles = identify(Frf(AXIS, clean + noise), 2)
    assert poles.frequencies_hz == pytest.approx([2414.0, 2426.0], abs=0.2)
    assert poles.damping_ratios == pytest.approx([0.005, 0.005], rel=0.03)


def test_refuses_bands_without_the_modes_asked_for():
    frf = Frf(AXIS, response(AXIS, PAIR))
    with pytest.raises(FrfError, match="band: 100 to 200 Hz holds 0 lines; the response covers 2200 to 2700 Hz"):
        frf.band(100.0, 200.0)
    with pytest.raises(FrfError, match="count: 500 modes need at least"):
        identify(frf, 500)
    with pytest.raises(FrfError, match="no mode of the band"):
        identify(Frf(AXIS, np.ones_like(AXIS) + 0.01 * np.random.default_rng(0).standard_normal(AXIS.size)), 1)
    with pytest.raises(FrfError, match="quantity: expected one of"):
        Frf(AXIS, AXIS, "compliance")
