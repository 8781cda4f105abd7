"""Damage from spectra of a stationary Gaussian stress: narrow band in closed form, and Dirlik's for any bandwidth.

Spectral moments l_i are integrals of omega^i times the one-sided density over omega, in Pa^2 (rad/s)^i; l_0 is the
variance. Amplitudes are half ranges, and 1 / N = A S^b with A = 1 / (knee strength^b): then the damage of a narrow band
over a time T is T / (2 pi) sqrt(l_2 / l_0) A (2 l_0)^(b/2) Gamma(1 + b/2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, gammainc, gammaincc

from vanedamp.coupling.strength.haigh import mean_factor
from vanedamp.coupling.strength.life import curve_of
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.files.toml_input import InputError

# 1 - l_2 / sqrt(l_0 l_4) below which Dirlik's coefficients are round-off: the band is narrow
_NARROW = 1e-6


class Moments(NamedTuple):
    """Spectral moments of a stress: l0 Pa^2, l1 Pa^2 rad/s, l2 Pa^2 (rad/s)^2, l4 Pa^2 (rad/s)^4."""

    l0: float
    l1: float
    l2: float
    l4: float

    @property
    def irregularity(self) -> float:
        """Upward crossings of the mean over peaks, l2 / sqrt(l0 l4): 1 for a narrow band, 0 for a wide one."""
        return self.l2 / math.sqrt(self.l0 * self.l4)

    @property
    def crossings(self) -> float:
        """Upward crossings of the mean, 1/s."""
        return math.sqrt(self.l2 / self.l0) / (2.0 * math.pi)

    @property
    def peaks(self) -> float:
        """Peaks, 1/s."""
        return math.sqrt(self.l4 / self.l2) / (2.0 * math.pi)


def moments(frequency_hz: np.ndarray, density: np.ndarray) -> Moments:
    """Return the moments of a one-sided density (f,), Pa^2/Hz, linear between its frequencies (f,), Hz.

    Raises InputError for a density that is negative somewhere or zero everywhere, or frequencies that do not ascend.
    """
    frequency, density = np.asarray(frequency_hz, dtype=float), np.asarray(density, dtype=float)
    if frequency.ndim != 1 or frequency.shape != density.shape or frequency.size < 2:
        raise InputError("density: expected one value per frequency, at least two")
    if frequency[0] < 0.0 or not (np.diff(frequency) > 0.0).all() or not np.isfinite(frequency).all():
        raise InputError("frequency_hz: expected frequencies from zero or above it, ascending")
    if not (density >= 0.0).all() or not np.isfinite(density).all() or not density.any():
        raise InputError("density: expected numbers that are not negative, not all zero")
    from scipy.integrate import trapezoid

    omega = 2.0 * math.pi * frequency
    return Moments(*(float(trapezoid(omega**order * density, frequency)) for order in (0, 1, 2, 4)))


def line_moments(frequency_hz: np.ndarray, amplitudes: np.ndarray) -> Moments:
    """Return the moments of a sum of sines of random phases: frequencies (n,) Hz, amplitudes (n,) or (n, c) Pa.

    Several components c add their powers: those of `von_mises_components` give the moments of the von Mises stress.
    """
    power = 0.5 * np.abs(np.asarray(amplitudes)).reshape(len(frequency_hz), -1) ** 2
    omega = 2.0 * math.pi * np.asarray(frequency_hz, dtype=float)
    return Moments(*(float(omega**order @ power.sum(axis=1)) for order in (0, 1, 2, 4)))


def von_mises_components(components: np.ndarray) -> np.ndarray:
    """Return five linear combinations (5, ...) of stress components (6, ...) whose squares add to von Mises' squared.

    Their powers add to the density of the von Mises stress of Preumont and Piefort (1994).
    """
    xx, yy, zz, xy, yz, zx = components
    root = math.sqrt(3.0)
    return np.array([xx - 0.5 * (yy + zz), 0.5 * root * (yy - zz), root * xy, root * yz, root * zx])


def spectral_density(
    history: np.ndarray, sampling_hz: float, segment: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (f,), Hz, and the one-sided density (f,), Pa^2/Hz, of samples (t,) or (c, t), by Welch.

    Several components add their powers. segment: samples of a segment (default: an eighth of the history), Hann window,
    half overlapping, the mean of each removed.
    """
    from scipy.signal import welch  # loads most of scipy

    history = np.atleast_2d(np.asarray(history, dtype=float))
    frequency, density = welch(history, sampling_hz, nperseg=segment or max(history.shape[1] // 8, 2))
    return frequency, density.sum(axis=0)


def narrow_band_damage(spectrum: Moments, duration: float, fatigue: Fatigue, mean: float = 0.0) -> float:
    """Return Miner's sum over a duration, s, of a narrow band, whose peaks are Rayleigh's; mean: stress, Pa.

    With one exponent it is the closed form above. With a knee each side has its incomplete gamma function. Source:
    Miles (1954).
    """
    if not spectrum.l0 > 0.0:
        return 0.0
    return spectrum.crossings * duration * _rayleigh_damage(math.sqrt(spectrum.l0), fatigue, mean)


def dirlik_damage(spectrum: Moments, duration: float, fatigue: Fatigue, mean: float = 0.0) -> float:
    """Return Miner's sum over a duration, s, of rainflow cycles by Dirlik's density; mean: stress, Pa.

    Source: Dirlik, Application of computers in fatigue analysis (thesis, Warwick 1985): an exponential and two Rayleigh
    densities of the amplitude over the standard deviation, fitted to simulated histories.
    """
    irregularity = spectrum.irregularity if spectrum.l0 > 0.0 else 1.0
    if 1.0 - irregularity < _NARROW:
        return narrow_band_damage(spectrum, duration, fatigue, mean)
    deviation = math.sqrt(spectrum.l0)
    mean_frequency = spectrum.l1 / spectrum.l0 * math.sqrt(spectrum.l2 / spectrum.l4)
    first = 2.0 * (mean_frequency - irregularity**2) / (1.0 + irregularity**2)
    rest = 1.0 - irregularity - first + first**2
    width = (irregularity - mean_frequency - first**2) / rest
    second = rest / (1.0 - width)
    third = 1.0 - first - second
    scale = 1.25 * (irregularity - third - second * width) / first
    return spectrum.peaks * duration * (
        first * _mean_damage(scale * deviation, 1.0, fatigue, mean)
        + second * _rayleigh_damage(abs(width) * deviation, fatigue, mean)
        + third * _rayleigh_damage(deviation, fatigue, mean)
    )  # fmt: skip


def _rayleigh_damage(deviation: float, fatigue: Fatigue, mean: float) -> float:
    return _mean_damage(math.sqrt(2.0) * deviation, 2.0, fatigue, mean)


def _mean_damage(scale: float, power: float, fatigue: Fatigue, mean: float) -> float:
    """Return the mean damage of a cycle if (amplitude / scale)^power has the density exp(-x); scale: Pa.

    With the power 1 the amplitude's density is exponential, with 2 Rayleigh's, of the deviation scale / sqrt(2).
    """
    strength, knee_cycles, above, below = curve_of(fatigue)
    strength *= float(mean_factor(mean, fatigue))
    if not strength > 0.0:
        return math.inf
    if not scale > 0.0:
        return 0.0
    knee = (strength / scale) ** power
    relative = scale / strength
    total = relative**above * gamma(1.0 + above / power) * gammaincc(1.0 + above / power, knee)
    if not math.isinf(below):
        total += relative**below * gamma(1.0 + below / power) * gammainc(1.0 + below / power, knee)
    return float(1.0 / knee_cycles * total)
