"""Utilisation and life at a hot spot, as plain data, from its stress and the data of its material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.stress import SCALARS
from vanedamp.coupling.response.spot_stress import SpotStress
from vanedamp.coupling.strength.counting import Cycles
from vanedamp.coupling.strength.haigh import equivalent_amplitude, utilisation, yield_utilisation
from vanedamp.coupling.strength.life import damage, hours, quantiles, starts
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.multiaxial import largest_principal, signed_von_mises
from vanedamp.coupling.strength.spectral import Moments, dirlik_damage, narrow_band_damage
from vanedamp.files.toml_input import validate


def fatigue_of(facts: Mapping[str, Any]) -> Fatigue | None:
    """Return the fatigue data in the facts of a hot spot (rom.recovery.hot_spots); None without a strength."""
    data = facts.get("fatigue") or {}
    return validate(Fatigue, data, "fatigue data of a hot spot").completed(None) if data.get("strength") else None


def assessed(
    fatigue: Fatigue,
    amplitudes: Mapping[str, float],
    static: np.ndarray,
    cycles: Cycles | None = None,
    duration: float | None = None,
) -> dict[str, Any]:
    """Return utilisation and life at a hot spot as plain data, Pa.

    amplitudes: by criterion, "von_mises" and "principal"; those with "_max", if there are any, give "utilisation_max"
    static: (6,) stress about which the motion vibrates; the criterion's number of it is the mean stress
    cycles: counted about it; without them, or without a curve, there is no life
    duration: counted, s, if repeated: then the life is "life_hours"; None: of a motion that happens now
    and then, whose life is "life_repeats", how often
    """
    mean = mean_stress(fatigue, static)
    amplitude = amplitudes[fatigue.criterion]
    results: dict[str, Any] = {
        "criterion": fatigue.criterion, "mean_line": fatigue.mean_stress, "amplitude": amplitude, "mean": mean,
        "equivalent_amplitude": float(equivalent_amplitude(amplitude, mean, fatigue)),
    } | {name: float(value) for name, value in used(amplitude, mean, fatigue).items()}  # fmt: skip
    if (most := amplitudes.get(f"{fatigue.criterion}_max")) is not None:
        results["utilisation_max"] = float(utilisation(most, mean, fatigue))
    if cycles is not None and fatigue.exponent is not None:
        results["damage"] = total = damage(cycles, fatigue, mean)
        if duration is None:
            results["life_repeats"] = quantiles(starts(total), fatigue)
        else:
            results["damage_per_hour"] = 3600.0 * total / duration
            results["life_hours"] = quantiles(hours(total, duration), fatigue)
    return results


def used(amplitude: np.ndarray | float, mean: float, fatigue: Fatigue) -> dict[str, np.ndarray]:
    """Return the utilisation of stress amplitudes, Pa, and that of the yield strength if there is one."""
    of_yield = yield_utilisation(amplitude, mean, fatigue)
    ratios = {"utilisation": utilisation(amplitude, mean, fatigue)}
    return ratios if of_yield is None else ratios | {"yield_utilisation": of_yield}


def with_strength(
    stress: SpotStress, material: Fatigue | None, cycles: Cycles | None, noise: Mapping[str, Moments], duration: float
) -> SpotStress:
    """Return the stress of a spot with utilisation and life; cycles: counted over a duration, s.

    Where static stresses are not known ("mean_known"), the mean stress is that of the motion. noise: spectral moments
    of von Mises stress, by linear curve, whose damages per hour "noise" has.
    """
    if material is None:
        return stress
    amplitudes = {f"{name}{of}": getattr(stress, f"{name}{of}") for name in SCALARS for of in ("", "_max")}
    static = stress.mean if stress.static is None else stress.static
    strength = {"mean_known": stress.static is not None} | assessed(material, amplitudes, static, cycles, duration)
    if noise and material.exponent is not None:
        rules = {"narrow_band": narrow_band_damage, "dirlik": dirlik_damage}
        strength["noise"] = {
            curve: {f"{name}_per_hour": rule(of, 3600.0, material, strength["mean"]) for name, rule in rules.items()}
            for curve, of in noise.items()
        }
    return replace(stress, strength=strength)


def mean_stress(fatigue: Fatigue, static: np.ndarray) -> float:
    """Return the mean stress of the criterion, Pa, of a static stress (6,)."""
    return float({"von_mises": signed_von_mises, "principal": largest_principal}[fatigue.criterion](static))
