"""Peaks of the linear curves over the swept frequencies, between the points as well."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 110


@quantity("m")
def undamped_peak(undamped_top: Any) -> Any:
    """highest amplitude without bodies from the lowest to the highest frequency"""
    return undamped_top.amplitude


@quantity("Hz")
def undamped_peak_frequency(undamped_top: Any) -> Any:
    """frequency of that"""
    return undamped_top.frequency


@quantity("Hz")
def half_power_width(undamped_top: Any) -> Any:
    """half-power width of that peak"""
    return undamped_top.width


@quantity("m")
def fixed_peak(fixed_top: Any) -> Any:
    """highest amplitude with every body fixed in its cavity"""
    return fixed_top.amplitude


@quantity("Hz")
def fixed_peak_frequency(fixed_top: Any) -> Any:
    """frequency of that"""
    return fixed_top.frequency
