"""Motion of bodies in the plane."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 40


@quantity("rad", ("damper",))
def tilt_max(tilt: Any) -> Any:
    """largest tilt of each body in its cavity; unknown for sliders"""
    return tilt


@quantity("1", ("damper",))
def lift_share(lifted: Any, counted: Any, period: Any) -> Any:
    """fraction of the time that each body is off its floor"""
    return lifted / (counted * period)


@quantity("1", ("damper",))
def linearisation(tilt: Any, neglected: Any) -> Any:
    """error of small tilts over the smallest clearance, for each body"""
    return neglected * tilt**2


@quantity("1", ("damper",))
def wall_impacts(walls: Any, counted: Any) -> Any:
    """mean number of impacts on its walls in a period, for each body; the others hit floors, ceilings and each other"""
    return walls / counted
