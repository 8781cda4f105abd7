"""Life: Basquin's curve with a knee, Miner's sum, quantiles from scatter."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtri

from vanedamp.coupling.strength.counting import Cycles
from vanedamp.coupling.strength.haigh import equivalent_amplitude
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.files.toml_input import InputError

#: probabilities of failure whose lives are results
PROBABILITIES = (0.1, 0.5, 0.9)
# difference of the normal distribution's quantiles at 90 % and 10 %
_BETWEEN = ndtri(0.9) - ndtri(0.1)


def curve_of(fatigue: Fatigue) -> tuple[float, float, float, float]:
    """Return strength, Pa, knee, and exponents above and below it. Raises InputError without a curve."""
    if fatigue.exponent is None or fatigue.knee is None or fatigue.strength is None:
        raise InputError("fatigue.exponent: missing; a life needs exponent and knee of a curve of stress and life")
    return fatigue.strength, fatigue.knee, *fatigue.exponents


def damage_per_cycle(amplitude: np.ndarray | float, fatigue: Fatigue) -> np.ndarray:
    """Return 1 / N of fully reversed amplitudes, Pa: (amplitude / strength)^k / knee, k by the side of the knee.

    Source: Basquin (1910); below the knee Haibach (1970): 2 k - 1. Raises InputError without a curve.
    """
    strength, knee, above, below = curve_of(fatigue)
    used = np.asarray(amplitude, dtype=float) / strength
    under = np.zeros_like(used) if math.isinf(below) else np.minimum(used, 1.0) ** below
    return np.where(used >= 1.0, used**above, under) / knee


def damage(cycles: Cycles, fatigue: Fatigue, static: float = 0.0) -> float:
    """Return Miner's sum of counted cycles of stress, Pa; 1: failure.

    Each counts at its own mean stress, to which the static stress, Pa, is added.
    """
    equivalent = equivalent_amplitude(0.5 * cycles.ranges, cycles.means + static, fatigue)
    return float(np.sum(cycles.counts * damage_per_cycle(equivalent, fatigue)))


def life_at(median: float, fatigue: Fatigue, probability: float) -> float:
    """Return the life by which a fraction of parts has failed, in the unit of the median life.

    log10 of life is normal; its standard deviation is log10(scatter) / 2.563, since scatter is the ratio of the lives
    at 90 % and 10 %.
    """
    if not 0.0 < probability < 1.0:
        raise InputError(f"probability: expected a number between 0 and 1, not {probability:g}")
    return float(median * fatigue.scatter ** (ndtri(probability) / _BETWEEN))


def quantiles(median: float, fatigue: Fatigue) -> dict[str, float]:
    """Return the lives by which fractions of parts have failed, {"10%": ...}, in the unit of the median life."""
    return {f"{100 * chance:g}%": life_at(median, fatigue, chance) for chance in PROBABILITIES}


def hours(damage: float, duration: float) -> float:
    """Return the hours until Miner's sum is 1 if a duration, s, brings a damage; inf without damage."""
    return duration / damage / 3600.0 if damage > 0.0 else math.inf


def starts(damage_per_pass: float, passes_per_start: float = 1.0) -> float:
    """Return the starts until Miner's sum is 1 if each passes a resonance several times; inf without damage."""
    if not passes_per_start > 0.0:
        raise InputError(f"passes_per_start: expected a positive number, not {passes_per_start:g}")
    return 1.0 / (damage_per_pass * passes_per_start) if damage_per_pass > 0.0 else math.inf
