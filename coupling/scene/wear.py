"""Wear of the contacts: rates by Archard's law and by impacts, and the patches over which they wear."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Fraction, NonNegative, Positive, Real, Whole

#: names of what wears: surfaces of cavities, the face to the next body, friction dampers and stops
Side = Literal["left", "right", "floor", "ceiling", "body", "casing", "stop", "joint"]


@dataclass(frozen=True, config=STRICT)
class WearRates:
    """How fast a contact wears, and over which patch. What is not given is 0, or taken from the body."""

    coefficient: NonNegative | None = None
    """Archard's coefficient K of sliding: volume K/H times the integral of normal force times slip speed [-]"""
    hardness: Positive | None = None
    """hardness H of the softer partner, with `coefficient` [Pa]"""
    rate: NonNegative | None = None
    """specific wear rate K/H, in place of coefficient and hardness [1/Pa]"""
    impact_rate: NonNegative | None = None
    """volume per sum of the energies of impacts, each to the power `impact_exponent` [m^3/J^n]"""
    share: Fraction | None = None
    """fraction of the volume that the cavity loses, of neighbours the right one; the body loses the rest
    (default: 0.5) [-]"""
    area: Positive | None = None
    """patch of one contact that wears (default: by the extents of the face, in equal parts for its corners) [m^2]"""
    edge: Positive | None = None
    """extent of the strip that wears at a corner (default: an equal part of the face) [m]"""

    def __post_init__(self) -> None:
        if self.coefficient is not None and self.rate is not None:
            raise ValueError("give one of rate (1/Pa) and coefficient with hardness")
        if self.coefficient is not None and self.hardness is None:
            raise ValueError("hardness: missing; coefficient needs it (Pa), or give rate = coefficient/hardness (1/Pa)")
        if self.hardness is not None and self.coefficient is None:
            raise ValueError("coefficient: missing; hardness is for Archard's law (or give rate, 1/Pa, alone)")

    @property
    def sliding_rate(self) -> float | None:
        """Volume per work of normal force times slip, 1/Pa; None: not given."""
        if self.coefficient is not None and self.hardness is not None:
            return self.coefficient / self.hardness
        return self.rate


@dataclass(frozen=True, config=STRICT)
class WearPair(WearRates):
    """Contacts with rates of their own: those of a body, of a surface, or of both. Later tables come first."""

    damper: Annotated[Whole, Field(ge=0)] | None = None
    """number of the body, from 0; of a stop, joint or friction damper its own number (default: all)"""
    side: Side | None = None
    """surface: "left", "right", "floor", "ceiling", "body" (the next body to the right), "casing" (friction damper),
    "stop" or "joint" (default: all)"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.damper is None and self.side is None:
            raise ValueError("damper, side: both missing; name the contacts that this table is for")


@dataclass(frozen=True, config=STRICT)
class Wear(WearRates):
    """Wear of all contacts, but for those of `pair`; for solver.method exact."""

    impact_exponent: Annotated[Real, Field(gt=0, le=10)] = 1.0
    """exponent n of the energy of an impact in impact wear [-]"""
    width: Positive | None = None
    """extent of the bodies in the direction out of the plane [m]"""
    length: Positive | None = None
    """extent along the cavity of bodies that have none of their own [m]"""
    height: Positive | None = None
    """extent across the cavity of bodies that have none of their own [m]"""
    pair: tuple[WearPair, ...] = ()
    """contacts with rates of their own"""
