"""Utilisation and life at a hot spot, as plain data, from its stress and the data of its material."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.strength.counting import Cycles
from vanedamp.coupling.strength.haigh import equivalent_amplitude, utilisation, yield_utilisation
from vanedamp.coupling.strength.life import damage, hours, quantiles
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.multiaxial import largest_principal, signed_von_mises


def fatigue_of(facts: Mapping[str, Any]) -> Fatigue | None:
    """Return the fatigue data in the facts of a hot spot (rom.recovery.hot_spots); None without a strength."""
    data = facts.get("fatigue") or {}
    return Fatigue(**data).completed(None) if data.get("strength") else None


def assessed(
    fatigue: Fatigue,
    amplitudes: Mapping[str, float],
    static: np.ndarray,
    cycles: Cycles | None = None,
    duration: float = 0.0,
) -> dict[str, Any]:
    """Return utilisation and life at a hot spot as plain data, Pa.

    amplitudes: by criterion, "von_mises" and "principal"; those with "_max", if there are any, give "utilisation_max"
    static: (6,) stress about which the motion vibrates; the criterion's number of it is the mean stress
    cycles: counted about it over a duration, s; without them, or without a curve, there is no life
    """
    mean = mean_stress(fatigue, static)
    amplitude = amplitudes[fatigue.criterion]
    found: dict[str, Any] = {
        "criterion": fatigue.criterion, "mean_line": fatigue.mean_stress, "amplitude": amplitude, "mean": mean,
        "equivalent_amplitude": float(equivalent_amplitude(amplitude, mean, fatigue)),
        "utilisation": float(utilisation(amplitude, mean, fatigue)),
    }  # fmt: skip
    if (most := amplitudes.get(f"{fatigue.criterion}_max")) is not None:
        found["utilisation_max"] = float(utilisation(most, mean, fatigue))
    if (used := yield_utilisation(amplitude, mean, fatigue)) is not None:
        found["yield_utilisation"] = float(used)
    if cycles is not None and fatigue.exponent is not None:
        total = damage(cycles, fatigue, mean)
        median = hours(total, duration)
        found["damage"] = total
        found["damage_per_hour"] = 3600.0 * total / duration
        found["life_hours"] = quantiles(median, fatigue)
    return found


def mean_stress(fatigue: Fatigue, static: np.ndarray) -> float:
    """Return the mean stress of the criterion, Pa, of a static stress (6,)."""
    return float({"von_mises": signed_von_mises, "principal": largest_principal}[fatigue.criterion](static))
