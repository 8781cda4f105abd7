"""Largest forces and pressures of the impacts of a scene with a rounded [contact.pair], over its contacts."""

from __future__ import annotations

import math
from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 80


@quantity("N")
def contact_force(contacts: Any) -> Any:
    """largest force of an impact; 0 without impacts"""
    return max((one.peak_force for one in contacts), default=0.0)


@quantity("Pa", spread=True, limited=True)
def contact_pressure(contacts: Any) -> Any:
    """Hertz's largest pressure under that force"""
    return max((one.pressure for one in contacts), default=0.0)


@quantity(spread=True, limited=True)
def contact_utilisation(contacts: Any) -> Any:
    """that pressure over the one at first yield; unknown without a yield strength"""
    known = [one.utilisation for one in contacts if one.utilisation is not None]
    return max(known) if known else (math.nan if contacts else 0.0)


@quantity("m/s")
def impact_speed_max(contacts: Any) -> Any:
    """largest speed of approach of an impact"""
    return max((one.fastest for one in contacts), default=0.0)
