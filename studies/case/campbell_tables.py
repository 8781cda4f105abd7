"""The table [campbell] of a case: speeds, engine orders and modes of a Campbell diagram."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.paths import Range, axis_values
from vanedamp.files.toml_input import STRICT, Positive, Real, Whole

_MOST = 10_000
_EXPECTED = "expected a list or a range, such as {start = 0, stop = 6000, num = 31}"


def _several(speeds: Any) -> Any:
    if not isinstance(speeds, Mapping | list | tuple | Range):
        raise ValueError(_EXPECTED)
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
    """speeds in revolutions a minute [rpm]"""
    engine_orders: tuple[Positive, ...] = ()
    """excitation frequencies over the frequency of rotation [-]"""
    modes: Annotated[Whole, Field(ge=1)] = 6
    """number of modes that are followed"""

    def __post_init__(self) -> None:
        if (self.speed is None) == (self.rpm is None):
            raise ValueError("give one of speed (rad/s) and rpm, a list or a range {start = 0, stop = 6000, num = 31}")
        key, given = ("rpm", self.rpm) if self.speed is None else ("speed", self.speed)
        count = given.num if isinstance(given, Range) else len(given or ())
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
        given, unit = (self.rpm, math.pi / 30.0) if self.speed is None else (self.speed, 1.0)
        return unit * np.array(axis_values(given if given is not None else ()))
