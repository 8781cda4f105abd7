"""Poles of known responses are found again, with noise, close together, beside modes outside the band."""

import numpy as np
import pytest

from tests.tools.tiers import cases
from vanedamp.modal.frf import QUANTITIES, Frf, FrfError, identify
from vanedamp.modal.rational_fit import Rational


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
    with pytest.raises(FrfError, match="no mode of the band"):
        identify(frf, 3)
    with pytest.raises(FrfError, match="all are zero"):
        identify(Frf(AXIS, np.zeros_like(AXIS)))
    with pytest.raises(FrfError, match="quantity: expected one of"):
        Frf(AXIS, AXIS, "compliance")


def noise(rng, shape, kind):
    """Of unit variance: complex, in the real part alone, or of a Hann window, which neighbouring lines share."""
    if kind == "real":
        return rng.standard_normal(shape) + 0j
    values = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)
    if kind == "hann":
        values = (values - 0.5 * (np.roll(values, 1, -1) + np.roll(values, -1, -1))) / np.sqrt(1.5)
    return values


@pytest.mark.parametrize("draws", cases([24, 100], fast=[24]))
@pytest.mark.parametrize(
    ("quantity", "lines", "responses", "count"),
    [("receptance", 16, 1, 1), ("accelerance", 801, 1, 1), ("mobility", 100, 3, 1), ("accelerance", 100, 1, 2)],
)
def test_noise_has_no_modes(quantity, lines, responses, count, draws):
    """One in 10^4 may pass by the bound of `Rational.chance`: none of these 100, around zero or around a constant."""
    axis = np.linspace(2200.0, 2700.0, lines)
    for seed in range(draws):
        values = noise(np.random.default_rng(seed), (responses, lines), ["complex", "real", "hann"][seed % 3])
        with pytest.raises(FrfError, match="no mode of the band"):
            identify(Frf(axis, values + (100.0 if seed % 2 else 0.0), quantity), count)


@pytest.mark.parametrize("draws", cases([60, 300], fast=[60]))
@pytest.mark.parametrize(("kind", "responses"), [("real", 1), ("complex", 3)])
def test_the_chance_of_noise_is_bounded(kind, responses, draws):
    """Of noise responses no more fall below a bound than it says, within three standard deviations."""
    s, chances = 1j * np.linspace(0.8, 1.0, 16), []
    for seed in range(draws):
        problem = Rational(s, noise(np.random.default_rng(seed), (responses, s.size), kind), 0)
        chances.append(problem.chance(problem.fit(problem.relocated(1))))
    for bound in (0.5, 0.1, 0.01):
        share = np.mean(np.array(chances) < bound)
        assert share <= bound + 3.0 * np.sqrt(bound * (1.0 - bound) / len(chances))


@pytest.mark.parametrize("share", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("kind", ["complex", "real"])
@pytest.mark.parametrize("ratio", [1e-4, 1e-3, 1e-2])
def test_modes_under_noise_are_not_refused(kind, ratio, share):
    """Noise of up to 10 % of the peak, four lines in the half-power bandwidth, other modes below and above the band."""
    bandwidth = 2.0 * ratio * 2414.0
    axis = 2414.0 + bandwidth * np.arange(-20.0, 20.0, 0.25)
    clean = response(axis, [(2414.0, ratio, 1.0), (900.0, 0.01, 2.0), (5000.0, 0.01, 3.0)])
    peak = np.abs(clean).max()
    for seed in range(5):
        poles = identify(Frf(axis, clean + share * peak * noise(np.random.default_rng(seed), axis.shape, kind)), 1)
        deviations = np.hypot(poles.deviations[0], [1e-5 * bandwidth, 1e-3 * ratio])
        # ten lines at 10 % noise leave the ratio within some 6 %; noise in one part doubles what that part shows
        assert np.all(np.abs([poles.frequencies_hz[0] - 2414.0, poles.damping_ratios[0] - ratio]) < 6.0 * deviations)
        assert poles.deviations[0, 1] < 0.1 * ratio


def test_close_modes_under_noise_are_not_refused():
    """Two modes half a bandwidth apart at 1 % noise of the peak, three responses."""
    gains = np.array([[1.0, 0.8], [1.0, -0.8], [0.3, 1.0]])
    clean = np.array([response(AXIS, [(2414.0, 0.005, a), (2426.0, 0.005, b)]) for a, b in gains])
    for seed in range(5):
        disturbed = clean + 0.01 * np.abs(clean).max() * noise(np.random.default_rng(seed), clean.shape, "complex")
        poles = identify(Frf(AXIS, disturbed), 2)
        assert poles.frequencies_hz == pytest.approx([2414.0, 2426.0], abs=0.3)
        assert poles.damping_ratios == pytest.approx([0.005, 0.005], rel=0.05)
        with pytest.raises(FrfError, match="no mode of the band"):
            identify(Frf(AXIS, disturbed), 3)


def test_refuses_a_mode_between_two_lines():
    """A bandwidth of a tenth of the line spacing, and one line disturbed: both are spikes on single lines."""
    clean = response(AXIS, [(2414.0, 0.1 * 0.625 / (2 * 2414.0), 1.0)])
    disturbance = 1e-3 * np.abs(clean).max() * noise(np.random.default_rng(0), AXIS.shape, "complex")
    spike = np.where(np.arange(AXIS.size) == 300, 100.0, 0.0)
    for values in (clean, clean + disturbance, spike + noise(np.random.default_rng(1), AXIS.shape, "complex")):
        with pytest.raises(FrfError, match=r"its lines resolve: half-power bandwidth .* Hz, line spacing 0\.625 Hz"):
            identify(Frf(AXIS, values))


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("spoiled", ["radians", "degrees", "decibels", "magnitude"])
def test_what_is_no_frequency_response_gives_no_damping(quantity, spoiled):
    """Magnitudes and phases taken as real and imaginary parts, without their unit so that both have the same size."""
    clean = response(AXIS, PAIR[:1], quantity)
    size, angle = np.abs(clean) / np.abs(clean).max(), np.angle(clean)
    values = {
        "radians": 1e-6 * size + 1j * angle, "degrees": size + 1j * np.degrees(angle),
        "decibels": 20.0 * np.log10(size) + 1j * np.degrees(angle), "magnitude": size + 0j,
    }[spoiled]  # fmt: skip
    with pytest.raises(FrfError, match=r"no mode of the band|misses the response"):
        identify(Frf(AXIS, values, quantity))


def test_the_band_holds_the_peak():
    """A mode of 10 % damping has half-power points 240 Hz to either side."""
    wide = response(AXIS, [(2450.0, 0.1, 1.0)])
    assert identify(Frf(AXIS, wide)).damping_ratios == pytest.approx([0.1], rel=1e-6)
    with pytest.raises(
        FrfError, match=r"does not hold its half-power points, 2205 and 2695 Hz; widen or move the band"
    ):
        identify(Frf(AXIS, wide).band(2300.0, 2600.0))


def test_a_fit_that_misses_half_of_the_response_is_refused():
    """One of two modes of equal height is fitted: the other half is left."""
    modes = [(2350.0, 0.002, 1.0), (2550.0, 0.002, 1.0)]
    with pytest.raises(FrfError, match=r"values: the fit misses the response in the (band|peak) .* Hz by \d+% of it"):
        identify(Frf(AXIS, response(AXIS, modes)), 1)
    assert identify(Frf(AXIS, response(AXIS, modes)), 2).misfit < 1e-9


def test_the_peak_between_two_frequencies():
    frf = Frf(AXIS, response(AXIS, PAIR))
    assert frf.peak_hz() == pytest.approx(2414.0, abs=0.7)
    assert frf.peak_hz(2520.0, 2700.0) == pytest.approx(2530.0, abs=3.0)
    assert np.isnan(frf.peak_hz(1.0, 2.0))
