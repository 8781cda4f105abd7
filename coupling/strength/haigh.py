"""Haigh diagram: permissible stress amplitudes over the mean stress, by the lines of Goodman, Gerber and Soderberg.

A compressive mean stress counts as zero: the lines are horizontal there. It would raise the permissible amplitude of
Goodman's and Soderberg's, and lower Gerber's, neither of which is relied on.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from vanedamp.coupling.strength.material import Fatigue

#: "mean": the mean stress stays while the amplitude grows; "ratio": both grow
Overload = Literal["mean", "ratio"]


def mean_factor(mean: np.ndarray | float, fatigue: Fatigue) -> np.ndarray:
    """Return the permissible amplitude at a mean stress, Pa, over that at none: 1 in compression, 0 beyond the line."""
    used = np.clip(np.asarray(mean, dtype=float) / fatigue.limit, 0.0, 1.0)
    return np.asarray(1.0 - (used**2 if fatigue.mean_stress == "gerber" else used))


def permissible_amplitude(mean: np.ndarray | float, fatigue: Fatigue) -> np.ndarray:
    """Return the stress amplitude, Pa, that the fatigue strength permits at a mean stress, Pa."""
    assert fatigue.strength is not None
    return fatigue.strength * mean_factor(mean, fatigue)


def equivalent_amplitude(amplitude: np.ndarray | float, mean: np.ndarray | float, fatigue: Fatigue) -> np.ndarray:
    """Return the fully reversed amplitude, Pa, of equal damage; inf where the mean stress is beyond the line."""
    amplitude, factor = np.broadcast_arrays(np.asarray(amplitude, dtype=float), mean_factor(mean, fatigue))
    return np.divide(amplitude, factor, out=np.full(amplitude.shape, np.inf), where=factor > 0.0)


def utilisation(
    amplitude: np.ndarray | float, mean: np.ndarray | float, fatigue: Fatigue, overload: Overload = "mean"
) -> np.ndarray:
    """Return how much of the permissible stress is used; 1: just permissible.

    amplitude, mean: Pa. By default the mean stress is fixed while the amplitude grows, as with a vibration upon the
    stress of rotation and temperature: amplitude over the permissible one at that mean. "ratio" scales both, along a
    ray of the diagram: Goodman's is amplitude / strength + mean / tensile strength.
    """
    assert fatigue.strength is not None
    if overload == "mean":
        return equivalent_amplitude(amplitude, mean, fatigue) / fatigue.strength
    first = np.asarray(amplitude, dtype=float) / fatigue.strength
    second = np.maximum(np.asarray(mean, dtype=float) / fatigue.limit, 0.0)
    if fatigue.mean_stress == "gerber":  # 1 / n, where n first + (n second)^2 = 1
        return 0.5 * (first + np.sqrt(first**2 + 4.0 * second**2))
    return first + second


def yield_utilisation(amplitude: np.ndarray | float, mean: np.ndarray | float, fatigue: Fatigue) -> np.ndarray | None:
    """Return the largest stress of the motion over the yield strength (Langer's line); None without that strength."""
    if fatigue.yield_strength is None:
        return None
    return (np.abs(np.asarray(mean, dtype=float)) + amplitude) / fatigue.yield_strength
