"""Response of the sectors of a ring: what its displacement and its bodies have, of each sector."""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.coupling.quantities import amplitude, impacts
from vanedamp.coupling.quantities.quantity import Quantity, quantity

ORDER = 100
#: what each sector has, too; amplitudes are distances from the static deflection
OF_SECTORS = (
    amplitude.amplitude_mean, amplitude.amplitude_max, amplitude.amplitude_undamped, amplitude.amplitude_fixed,
    impacts.impacts_per_period,
)  # fmt: skip


def _of_each(one: Quantity) -> Quantity:
    about = f"{one.about}, of each sector"
    return Quantity(f"sector_{one.name}", one.unit, ("sector",), about, lambda sectors: getattr(sectors, one.name))


QUANTITIES = [_of_each(one) for one in OF_SECTORS]


@quantity()
def amplification(sectors: Any) -> Any:
    """largest mean amplitude of a sector over that of the tuned ring without bodies in resonance; unknown without"""
    return None if sectors.tuned is None else sectors.amplitude_mean.max() / sectors.tuned


@quantity()
def localisation(sectors: Any) -> Any:
    """largest mean amplitude of a sector over the root mean square of all, 1 to the root of N; unknown at rest"""
    square = np.sqrt((sectors.amplitude_mean**2).mean())
    return sectors.amplitude_mean.max() / square if square > 0.0 else None
