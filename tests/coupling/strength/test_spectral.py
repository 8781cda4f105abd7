"""Damage from spectra: closed forms against quadrature in 40 digits, Dirlik against counted histories."""

import itertools
import math

import mpmath
import numpy as np
import pytest

from tests.tools.tiers import cases
from vanedamp.coupling.strength.counting import rainflow_cycles
from vanedamp.coupling.strength.life import damage
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.spectral import (
    Moments,
    dirlik_damage,
    line_moments,
    moments,
    narrow_band_damage,
    spectral_density,
    von_mises_components,
)
from vanedamp.files.toml_input import InputError
from vanedamp.modal.algebra import von_mises

CURVE = {"strength": 200e6, "knee": 1e6}
FOUND = Moments(l0=(60e6) ** 2, l1=3.1e3 * (60e6) ** 2, l2=(3.3e3 * 60e6) ** 2, l4=(3.9e3) ** 4 * (60e6) ** 2)


def quadrature(deviation, curve):
    """Mean of 1 / N over Rayleigh's density of the amplitude, in 40 digits."""
    above, below = curve.exponents
    with mpmath.workdps(40):
        d, strength = mpmath.mpf(deviation), mpmath.mpf(curve.strength)

        def part(low, high, exponent):
            def integrand(s):
                return (s / strength) ** exponent * s / d**2 * mpmath.exp(-(s**2) / (2 * d**2))

            edges = [low + (high - low) * mpmath.mpf(k) / 40 for k in range(41)]
            return mpmath.quad(integrand, edges)

        total = part(strength, strength + 60 * d, mpmath.mpf(above))
        if not math.isinf(below):
            total += part(mpmath.mpf(0), strength, mpmath.mpf(below))
        return total / mpmath.mpf(curve.knee)


@pytest.mark.parametrize(
    ("exponent", "after"),
    cases(
        itertools.product([3.0, 5.5, 12.0], ["original", "haibach", "none", 12.5]),
        fast=[(3.0, "original"), (5.5, "haibach"), (12.0, "none"), (5.5, 12.5)],
    ),
)
def test_narrow_band_is_the_mean_over_rayleighs_density(exponent, after):
    curve = Fatigue(**CURVE, exponent=exponent, after_knee=after)
    expected = 3600.0 * 3.3e3 / (2.0 * math.pi) * float(quadrature(60e6, curve))
    assert narrow_band_damage(FOUND, 3600.0, curve) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("b", [3.0, 5.5, 12.0])
def test_narrow_band_in_its_closed_form(b):
    """T / (2 pi) sqrt(l2 / l0) A (2 l0)^(b/2) Gamma(1 + b/2) with 1 / N = A S^b."""
    curve = Fatigue(**CURVE, exponent=b, after_knee="original")
    a = 1.0 / (curve.knee * curve.strength**b)
    closed = 100.0 / (2.0 * math.pi) * math.sqrt(FOUND.l2 / FOUND.l0) * a * (2.0 * FOUND.l0) ** (b / 2)
    assert narrow_band_damage(FOUND, 100.0, curve) == pytest.approx(closed * math.gamma(1.0 + b / 2), rel=1e-12)


def test_a_mean_stress_lowers_the_strength():
    """Goodman at half the tensile strength: amplitudes count twice."""
    curve = Fatigue(**CURVE, exponent=4.0, after_knee="original", tensile_strength=1e9).completed(None)
    for rule in (narrow_band_damage, dirlik_damage):
        assert rule(FOUND, 1.0, curve, 5e8) == pytest.approx(16.0 * rule(FOUND, 1.0, curve), rel=1e-12)
        assert rule(FOUND, 1.0, curve, -5e8) == rule(FOUND, 1.0, curve)
        assert rule(FOUND, 1.0, curve, 1e9) == math.inf


def test_dirlik_ends_at_the_narrow_band():
    curve = Fatigue(**CURVE, exponent=5.0)
    for width in (1e-2, 1e-3, 1e-4):
        frequency = 1000.0 * np.linspace(1.0 - width, 1.0 + width, 2001)
        found = moments(frequency, np.full(2001, (60e6) ** 2 / (2e3 * width)))
        ratio = dirlik_damage(found, 1.0, curve) / narrow_band_damage(found, 1.0, curve)
        assert ratio == pytest.approx(1.0, abs=5.0 * width)


def gaussian(frequency, density, samples, draw):
    """One period of a Gaussian history of a one-sided density: lines of normal real and imaginary parts."""
    step = frequency[1] - frequency[0]
    lines = np.zeros(samples // 2 + 1, dtype=complex)
    first = round(frequency[0] / step)
    parts = draw.normal(size=(2, frequency.size))
    lines[first : first + frequency.size] = 0.5 * samples * np.sqrt(density * step) * (parts[0] + 1j * parts[1])
    return np.fft.irfft(lines, samples)


BANDS = {
    "one narrow band": [(950.0, 1050.0, 1.0)],
    "one wide band": [(100.0, 1000.0, 1.0)],
    "two bands": [(95.0, 105.0, 1.0), (900.0, 1000.0, 0.1)],
    "two bands of equal power": [(95.0, 105.0, 1.0), (900.0, 1000.0, 1.0)],
}
STEP, SAMPLES, REPETITIONS = 0.05, 655_360, 60  # 20 s each, 32 samples in a period of 1 kHz


def band_density(bands):
    frequency = np.arange(50.0, 1100.0, STEP)
    density = np.zeros(frequency.size)
    for low, high, power in bands:
        density[(frequency >= low) & (frequency <= high)] += power * (60e6) ** 2 / (high - low)
    return frequency, density


def counted(frequency, density, curves):
    """Mean Miner's sums (curves,) of counted histories of 20 s, and their standard errors."""
    sums = []
    for seed in range(REPETITIONS):
        history = gaussian(frequency, density, SAMPLES, np.random.default_rng(seed))
        cycles = rainflow_cycles(history)
        sums.append([damage(cycles, curve) for curve in curves])
    return np.mean(sums, axis=0), np.std(sums, axis=0) / math.sqrt(REPETITIONS)


# by band: deviations of the narrow band and of Dirlik from counted damage for exponents 3, 5, 8 (docs/strength.md)
DEVIATIONS = {
    "one narrow band": [(0.01, 0.01), (0.01, 0.01), (0.02, 0.01)],
    "one wide band": [(0.10, -0.05), (0.14, -0.06), (0.21, -0.02)],
    "two bands": [(0.82, -0.05), (0.75, -0.14), (0.61, -0.20)],
    "two bands of equal power": [(0.52, -0.04), (0.86, -0.14), (1.03, -0.26)],
}


@pytest.mark.parametrize("name", cases(BANDS, fast=["two bands"]))
def test_narrow_band_and_dirlik_against_counted_histories(name):
    frequency, density = band_density(BANDS[name])
    curves = [Fatigue(**CURVE, exponent=b, after_knee="original") for b in (3.0, 5.0, 8.0)]
    sums, errors = counted(frequency, density, curves)
    found = moments(frequency, density)
    for curve, total, error, expected in zip(curves, sums, errors, DEVIATIONS[name], strict=True):
        rules = (narrow_band_damage, dirlik_damage)
        deviations = [rule(found, 20.0, curve) / total - 1.0 for rule in rules]
        assert deviations == pytest.approx(expected, abs=0.01 + 2.0 * error / total)


def test_moments_of_lines_and_of_a_density_are_those_of_the_history():
    """Variances of the history and of its derivatives, taken exactly from its Fourier series."""
    samples, rate = 4096, 8192.0
    draw = np.random.default_rng(4)
    orders, amplitudes = np.array([40, 41, 300]), np.array([3.0, 1.0 + 2.0j, -0.5j])
    frequency = orders * rate / samples
    omega_t = 2.0 * np.pi * np.outer(frequency, np.arange(samples) / rate)
    found = line_moments(frequency, amplitudes)
    for order, moment in ((0, found.l0), (2, found.l2), (4, found.l4)):
        derivative = np.imag((amplitudes * (2.0j * np.pi * frequency) ** (order // 2)) @ np.exp(1j * omega_t))
        assert np.var(derivative) == pytest.approx(moment, rel=1e-10)
    _, density = spectral_density(draw.normal(scale=2.0, size=400_000), 1000.0, segment=1024)
    assert 500.0 * density.mean() == pytest.approx(4.0, rel=0.02)


def test_a_flat_density_in_closed_form():
    found = moments(np.array([100.0, 300.0]), np.array([2.0, 2.0]))
    assert found.l0 == pytest.approx(400.0)
    fine = moments(np.linspace(100.0, 300.0, 100_001), np.full(100_001, 2.0))
    low, high = 200.0 * math.pi, 600.0 * math.pi
    for order, moment in ((1, fine.l1), (2, fine.l2), (4, fine.l4)):
        assert moment == pytest.approx(2.0 * (high ** (order + 1) - low ** (order + 1)) / (order + 1) / 2 / math.pi)
    assert fine.irregularity == pytest.approx(fine.crossings / fine.peaks, rel=1e-12)


def test_powers_of_the_components_are_von_mises_squared():
    stress = np.random.default_rng(8).normal(size=(6, 30))
    np.testing.assert_allclose((von_mises_components(stress) ** 2).sum(axis=0), von_mises(stress) ** 2, rtol=1e-12)


@pytest.mark.parametrize(
    ("frequency", "density", "message"),
    [
        ([1.0, 2.0], [1.0, -1.0], "density: expected numbers that are not negative, not all zero"),
        ([1.0, 2.0], [0.0, 0.0], "density: expected numbers that are not negative, not all zero"),
        ([2.0, 1.0], [1.0, 1.0], "frequency_hz: expected frequencies from zero or above it, ascending"),
        ([1.0], [1.0], "density: expected one value per frequency, at least two"),
    ],
)
def test_a_density_that_is_none_is_rejected(frequency, density, message):
    with pytest.raises(InputError) as error:
        moments(np.array(frequency), np.array(density))
    assert str(error.value) == message


def test_a_spectrum_needs_a_curve():
    with pytest.raises(InputError, match=r"^fatigue.exponent: missing"):
        dirlik_damage(FOUND, 1.0, Fatigue(strength=4e8))
