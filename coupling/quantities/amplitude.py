"""Amplitudes of the displacement at `excitation.at`.

Formulas have real numbers only: numpy multiplies complex ones one by one and side by side with other last bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 10


@quantity("m", spread=True)
def amplitude_max(highest: Any) -> Any:
    """largest displacement, without its sign, at `excitation.at`"""
    return highest


@quantity("m", spread=True)
def amplitude_mean(heights: Any, counted: Any) -> Any:
    """mean of the largest displacements of the periods"""
    return heights / counted


@quantity("m")
def amplitude_mean_confidence(confidence: Any) -> Any:
    """half width of the 95 % confidence interval of that mean; unknown if there are too few periods"""
    return confidence


@quantity("m")
def static_deflection(static: Any) -> Any:
    """displacement that static loads of the bodies hold, their weight or centrifugal pull: the mean position of the
    motion; 0 without such loads"""
    return static


@quantity("m")
def amplitude_max_dynamic(distance: Any) -> Any:
    """largest distance from the static deflection"""
    return distance


@quantity("m", spread=True)
def amplitude_mean_dynamic(distances: Any, counted: Any) -> Any:
    """mean of the periods' largest distances from the static deflection, to be compared with linear amplitudes"""
    return distances / counted


@quantity("m")
def amplitude_rms(square: Any, counted: Any, period: Any) -> Any:
    """root mean square of the displacement"""
    return np.sqrt(np.maximum(square / (counted * period), 0.0))


@quantity("m")
def amplitude_harmonic(harmonic: Any, counted: Any, period: Any) -> Any:
    """amplitude X of its part X sin(2 pi f t + phase) at the excitation's frequency, order 1"""
    share = 2.0 / (counted * period)
    return np.hypot(share * harmonic.real, share * harmonic.imag)


@quantity("rad")
def phase(harmonic: Any, counted: Any, period: Any) -> Any:
    """phase of that part"""
    share = 2.0 / (counted * period)
    return np.arctan2(share * harmonic.real, 0.0 - share * harmonic.imag)  # 0.0 - x is no -0.0


@quantity("m", spread=True)
def amplitude_undamped(undamped: Any) -> Any:
    """amplitude of the linear structure without bodies and joints, from the static deflection; unknown under noise"""
    return undamped


@quantity("m", spread=True)
def amplitude_fixed(fixed: Any) -> Any:
    """the same with every body fixed in its cavity, and joints and friction dampers stuck"""
    return fixed
