"""Impacts of a motion, and the mass that it feels of the bodies."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.quantities.quantity import quantity

ORDER = 20


@quantity(spread=True)
def impacts_per_period(impacts: Any, counted: Any) -> Any:
    """mean number of impacts in a period"""
    return impacts / counted


@quantity(spread=True)
def attached_mass_fraction(
    harmonic: Any, momentum: Any, momentum_change: Any, load: Any, carried: Any, omega: Any, counted: Any, period: Any
) -> Any:  # fmt: skip
    """fraction of the bodies' mass attached to the structure at the excitation's frequency: Re(F / (omega^2 X)) / sum m
    of the contact forces' part F; unknown without bodies or motion"""
    share = 2.0 / (counted * period)
    x, y = share * harmonic.real, share * harmonic.imag
    along = share * (momentum_change - omega * momentum.imag) - load.real
    across = share * (omega * momentum.real) - load.imag
    return 0.0 - (along * x + across * y) / (omega * omega * (x * x + y * y)) / carried
