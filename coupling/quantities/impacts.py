"""Impacts of a motion, and the mass that it feels of the bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 20


@quantity(spread=True)
def impacts_per_period(impacts: Any, periods: Any) -> Any:
    """mean number of impacts in a period"""
    return impacts / periods


@quantity(spread=True)
def attached_mass_fraction(
    harmonic: Any, momentum: Any, momentum_change: Any, load: Any, carried: Any, omega: Any, periods: Any, period: Any
) -> Any:  # fmt: skip
    """fraction of the bodies' mass that the structure feels at the excitation's frequency: Re(F / (omega^2 X)) / sum m
    of the contact forces' part F; unknown without bodies or motion"""
    share = 2.0 / (periods * period)
    wave = share * harmonic
    force = share * (momentum_change + 1j * (omega * momentum)) - load
    felt, square = force * np.conjugate(wave), wave * np.conjugate(wave)
    return 0.0 - felt.real / (omega * omega * square.real) / carried
