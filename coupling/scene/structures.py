"""Structures of a scene."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class Prescribed:
    """A shaker table: x = displacement_amplitude sin(2 pi f t), whatever the bodies do."""

    model: Literal["prescribed"]
    displacement_amplitude: Positive


@dataclass(frozen=True, config=STRICT)
class Rigid:
    """One mode: mass (kg) on a spring (N/m) with viscous damping (ratio, or N s/m).

    centrifugal_stiffness: kg, N/m a squared speed, which the spring gains by rotation (Southwell's coefficient times
    the mass); below zero where spin softening prevails.
    base_mass: kg, by which an acceleration of the base loads the mode at its point (default: the mass, of a rigid body
    on a spring); that of a continuous structure's mode is larger, or below zero (`vanedamp calibrate` gives it).
    """

    model: Literal["rigid"]
    mass: Positive
    stiffness: Positive
    damping_ratio: NonNegative | None = None
    damping: NonNegative | None = None
    centrifugal_stiffness: Real = 0.0
    base_mass: Real | None = None

    def __post_init__(self) -> None:
        if (self.damping_ratio is None) == (self.damping is None):
            raise ValueError("give one of damping_ratio and damping")

    def stiffness_at(self, speed: float) -> float:
        """Return the stiffness, N/m, at a speed of rotation, rad/s."""
        return self.stiffness + speed**2 * self.centrifugal_stiffness

    @property
    def viscous(self) -> float:
        """Viscous damping at standstill, N s/m."""
        return self.viscous_at(0.0)

    def viscous_at(self, speed: float) -> float:
        """Return the viscous damping, N s/m, at a speed of rotation, rad/s."""
        if self.damping is not None:
            return self.damping
        return 2 * (self.damping_ratio or 0.0) * math.sqrt(self.mass * self.stiffness_at(speed))


@dataclass(frozen=True, config=STRICT)
class Rom:
    """A reduced model from a file (`vanedamp reduce`), with the first `modes` of its modes (default: all).

    natural: take the model's own lowest natural modes instead of those of its basis; attached: with residual attachment
    modes, which keep its flexibility. modes = "auto": as many natural modes as keep the estimated error within
    `tolerance`, attached where that is smaller.
    """

    model: Literal["rom"]
    file: str
    modes: Annotated[Whole, Field(ge=0)] | Literal["auto"] | None = None
    natural: bool = False
    attached: bool = False
    tolerance: Annotated[Real, Field(gt=0, lt=1)] = 0.01

    def __post_init__(self) -> None:
        if self.attached and not (self.natural and isinstance(self.modes, int)):
            raise ValueError("attached: attachment modes go with natural = true and a number of modes")


Structure = Annotated[Prescribed | Rigid | Rom, Field(discriminator="model")]


@dataclass(frozen=True, config=STRICT)
class Initial:
    """Displacement (m) and velocity (m/s) of a rigid structure at time zero."""

    displacement: Real = 0.0
    velocity: Real = 0.0
