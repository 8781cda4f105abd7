"""The tables of a case for its operating conditions: [rotation], [campbell] and [temperature]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.paths import Range, axis_values
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.files.toml_input import STRICT, Direction, NonNegative, Positive, Real, Whole

_RPM = SPEEDS["rotation.rpm"]
_MOST = 10_000


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
    """speed in revolutions per minute [rpm]"""
    max_speed: Positive | None = None
    """maximum speed that a reduced model is for (default: the speed) [rad/s]"""
    max_rpm: Positive | None = None
    """the same in revolutions per minute [rpm]"""
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
        return self.speed if self.speed is not None else _RPM * (self.rpm or 0.0)

    @property
    def greatest(self) -> float:
        """Maximum speed that a reduced model covers, rad/s."""
        if self.max_speed is not None:
            return self.max_speed
        return self.omega if self.max_rpm is None else _RPM * self.max_rpm


def _several(speeds: Any) -> Any:
    if not isinstance(speeds, Mapping | list | tuple | Range):
        raise ValueError("expected a list or a range, such as {start = 0, stop = 6000, num = 31}")
    return speeds


def _form(speeds: Any) -> str:
    return "list" if isinstance(speeds, list | tuple) else "range"


Speeds = Annotated[
    Annotated[Range, Tag("range")] | Annotated[tuple[Real, ...], Tag("list")],
    Discriminator(_form),
    BeforeValidator(_several),
]


@dataclass(frozen=True, config=STRICT)
class CampbellTable:
    """A Campbell diagram."""

    speed: Speeds | None = None
    """speeds, an ascending list or a range {start, stop, num}; or give `rpm` [rad/s]"""
    rpm: Speeds | None = None
    """speeds in revolutions per minute [rpm]"""
    engine_orders: tuple[Positive, ...] = ()
    """excitation frequencies over the frequency of rotation [-]"""
    modes: Annotated[Whole, Field(ge=1)] = 6
    """number of modes that are followed"""
    operating: tuple[NonNegative, NonNegative] | None = None
    """lowest and highest speed of operation, to which crossings have a margin, as the speeds [rad/s or rpm]"""

    def __post_init__(self) -> None:
        if self.operating is not None and self.operating[0] > self.operating[1]:
            raise ValueError("operating: expected the lowest speed, then the highest")
        if (self.speed is None) == (self.rpm is None):
            raise ValueError("give one of speed (rad/s) and rpm, a list or a range {start = 0, stop = 6000, num = 31}")
        key, values = ("rpm", self.rpm) if self.speed is None else ("speed", self.speed)
        count = values.num if isinstance(values, Range) else len(values or ())
        if not 2 <= count <= _MOST:
            raise ValueError(f"{key}: {count} speeds; expected 2 to {_MOST}")
        speeds = self.speeds
        if speeds[0] < 0.0 or np.any(np.diff(speeds) <= 0.0):
            raise ValueError(f"{key}: expected ascending speeds from zero or more")
        if len(set(self.engine_orders)) != len(self.engine_orders):
            raise ValueError("engine_orders: one is there twice")

    @property
    def speeds(self) -> np.ndarray:
        """Speeds (s,), rad/s."""
        return self._unit * np.array(axis_values((self.rpm if self.speed is None else self.speed) or ()))

    @property
    def operation(self) -> tuple[float, float] | None:
        """Lowest and highest speed of operation, rad/s."""
        return None if self.operating is None else (self._unit * self.operating[0], self._unit * self.operating[1])

    @property
    def _unit(self) -> float:
        return _RPM if self.speed is None else 1.0


@dataclass(frozen=True, config=STRICT)
class TemperatureTable:
    """Temperature of the structure, in K throughout or in degrees Celsius throughout."""

    reference: Real
    """temperature without thermal stress, at which `young` is the modulus [K or degree C]"""
    uniform: Real | None = None
    """temperature of the whole structure; or give `file` [K or degree C]"""
    file: str | None = None
    """CSV file of temperatures, with the columns x, y, z (m) and temperature"""

    def __post_init__(self) -> None:
        if (self.uniform is None) == (self.file is None):
            raise ValueError("give one of uniform and file")
