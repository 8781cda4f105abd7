"""Repetition of a cavity, a friction damper or a stop over the sectors of a ring."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Fraction, Real, Whole

_Number = Annotated[Whole, Field(ge=0)]


def _known(sectors: Any) -> Any:
    numbers = sectors if isinstance(sectors, list | tuple) else [sectors]
    whole = all(isinstance(number, int) and not isinstance(number, bool) and number >= 0 for number in numbers)
    if not len(numbers) or not (whole or sectors in ("all", "alternate")):
        raise ValueError('expected "all", "alternate", the number of a sector, from 0, or a list of numbers')
    return sectors


#: which sectors: all, every second one from 0, one, or some
Sectors = Annotated[
    Literal["all", "alternate"] | _Number | Annotated[tuple[_Number, ...], Field(min_length=1)], BeforeValidator(_known)
]


@dataclass(frozen=True, config=STRICT)
class Scatter:
    """Scatter of a cavity over the sectors of a ring: what a sector draws does not depend on which ones have it."""

    gap: Annotated[Real, Field(ge=0, le=0.2)] = 0.0
    """standard deviation of the gap, normal, relative to it; positions at time zero go with it [-]"""
    position: Fraction = 0.0
    """reach of the bodies' positions at time zero about those written, uniform, as a fraction of half the free travel;
    1: anywhere [-]"""
    seed: _Number = 0
    """seed of what is drawn"""
