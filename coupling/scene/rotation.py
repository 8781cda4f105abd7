"""Rotation of a scene: everything stands in a frame that turns at a constant speed."""

from __future__ import annotations

import math

from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, NonNegative

#: axis of the excitation's frequency; axes of the speed of rotation, and what one of their units is, rad/s
FREQUENCY = "excitation.frequency"
SPEEDS = {"rotation.speed": 1.0, "rotation.rpm": 2 * math.pi / 60}


def hertz_of(path: str, order: float | None) -> float:
    """Return the excitation's frequency, Hz, of a unit of a scene's number, such as a speed of an engine order.

    nan of a number that the frequency does not depend on.
    """
    if path == FREQUENCY:
        return 1.0
    return math.nan if order is None or path not in SPEEDS else frequency_of(order, SPEEDS[path])


def frequency_of(order: float, speed: float) -> float:
    """Return the frequency, Hz, of an engine order at a speed, rad/s."""
    return order * speed / (2 * math.pi)


def speed_of(order: float, frequency: float) -> float:
    """Return the speed, rad/s, at which an engine order has a frequency, Hz."""
    return 2 * math.pi * frequency / order


@dataclass(frozen=True, config=STRICT)
class Rotation:
    """Speed of the frame that structure and bodies turn with: `speed` (rad/s) or `rpm` (revolutions a minute).

    The axis is that of the reduced model; a rigid structure gives a radius for each of its cavities instead.
    """

    speed: NonNegative | None = None
    """speed; or give `rpm` [rad/s]"""
    rpm: NonNegative | None = None
    """revolutions a minute; or give `speed` [rpm]"""

    def __post_init__(self) -> None:
        if (self.speed is None) == (self.rpm is None):
            raise ValueError("give one of speed (rad/s) and rpm")

    @property
    def omega(self) -> float:
        """Speed, rad/s."""
        if self.rpm is not None:
            return SPEEDS["rotation.rpm"] * self.rpm
        return 0.0 if self.speed is None else self.speed
