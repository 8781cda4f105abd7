"""Wear of the contacts of a scene with [wear]."""

from __future__ import annotations

import math
from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 70


@quantity("m/h", spread=True, limited=True)
def wear_depth_rate(wear: Any) -> Any:
    """fastest depth of wear of a contact; unknown without the size of a patch"""
    return max((one.depth_rate for one in wear if one.depth_rate is not None), default=math.nan)


@quantity("m^3/h", spread=True, limited=True)
def wear_volume_rate(wear: Any) -> Any:
    """volume that all contacts lose, of both partners"""
    return sum(one.volume_rate for one in wear)


@quantity("W")
def wear_work_rate(wear: Any) -> Any:
    """integral of normal force times slip speed, of all contacts, per time"""
    return sum(one.work_rate for one in wear)
