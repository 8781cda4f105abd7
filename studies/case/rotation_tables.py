"""The table [rotation] of a case: the axis that the structure turns about, and its speeds."""

from __future__ import annotations

from typing import Any

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.files.toml_input import STRICT, Direction, NonNegative, Positive, Real


@dataclass(frozen=True, config=STRICT)
class RotationTable:
    """Rotation about an axis."""

    axis: Direction
    """direction of the axis of rotation, of any length [-]"""
    point: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)
    """a point of the axis [m]"""
    speed: NonNegative | None = None
    """speed; or give `rpm` (default: standstill) [rad/s]"""
    rpm: NonNegative | None = None
    """speed in revolutions a minute [rpm]"""
    max_speed: Positive | None = None
    """greatest speed that a reduced model is for (default: the speed) [rad/s]"""
    max_rpm: Positive | None = None
    """the same in revolutions a minute [rpm]"""
    gyroscopic: bool = False
    """give modes the gyroscopic coupling, which makes them complex"""

    def __post_init__(self) -> None:
        for first, second in (("speed", "rpm"), ("max_speed", "max_rpm")):
            if getattr(self, first) is not None and getattr(self, second) is not None:
                raise ValueError(f"give one of {first} (rad/s) and {second}")
        if self.greatest < self.omega:
            raise ValueError(f"max_speed: {self.greatest:g} rad/s lies below the speed, {self.omega:g} rad/s")

    @property
    def omega(self) -> float:
        """Speed, rad/s."""
        return _radians(self.speed, self.rpm)

    @property
    def greatest(self) -> float:
        """Greatest speed that a reduced model is for, rad/s."""
        given = self.max_speed is not None or self.max_rpm is not None
        return _radians(self.max_speed, self.max_rpm) if given else self.omega


def _radians(speed: Any, rpm: Any) -> float:
    return float(speed) if speed is not None else SPEEDS["rotation.rpm"] * float(rpm or 0.0)
