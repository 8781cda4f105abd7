"""A band of excitation frequencies, or of speeds along an engine order, over which a study evaluates its scene."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.paths import Range, axis_values
from vanedamp.coupling.scene.rotation import Rotation, hertz_of, speed_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.linear_response import linear_amplitudes, linear_peaks
from vanedamp.files.toml_input import STRICT, InputError, Positive

File = TypeVar("File", bound=Scene)

_MOST_FREQUENCIES = 10_000
#: quantity of the points of a band, and its unit
UNITS = {"band": ("frequencies", "Hz"), "speeds": ("speeds", "rad/s"), "rpm": ("speeds", "rpm")}
Values = Range | Annotated[tuple[Positive, ...], Field(min_length=1)]


@dataclass(frozen=True, config=STRICT)
class Band:
    """Frequencies, or speeds along an engine order. TABLE: name of the table that a derived record describes."""

    TABLE: ClassVar[str] = ""
    band: Values | None = None
    """excitation frequencies, a rising list or a range {start, stop, num} [Hz]"""
    speeds: Values | None = None
    """speeds in place of the band, along an engine order [rad/s]"""
    rpm: Values | None = None
    """speeds in revolutions per minute in place of the band, along an engine order [rpm]"""

    def __post_init__(self) -> None:
        if sum(getattr(self, name) is not None for name in UNITS) != 1:
            raise ValueError("give one of band (Hz) and, for an engine order, speeds (rad/s) and rpm")
        key, (what, unit) = self.key, UNITS[self.key]
        if self.count > _MOST_FREQUENCIES:
            raise ValueError(f"{key}: {self.count} {what}; at most {_MOST_FREQUENCIES}")
        if self.values.min() <= 0.0:
            raise ValueError(f"{key}: expected positive {what}, not {self.values.min():g} {unit}")
        for before, after in itertools.pairwise(self.values.tolist()):
            if after <= before:
                raise ValueError(f"{key}: expected {what} that rise, not {after:g} {unit} after {before:g} {unit}")

    @property
    def key(self) -> str:
        """Which of band, speeds and rpm is given."""
        return next(name for name in UNITS if getattr(self, name) is not None)

    @property
    def count(self) -> int:
        """Number of points of the band."""
        points = getattr(self, self.key)
        return points.num if isinstance(points, Range) else len(points)

    @property
    def values(self) -> np.ndarray:
        """Points of the band, in the unit of its key."""
        return np.array(axis_values(getattr(self, self.key)), float)

    def frequencies(self, order: float | None) -> np.ndarray:
        """Return the excitation frequencies, Hz, with an engine order if there is one.

        Raises InputError for frequencies of an engine order, and for speeds without one.
        """
        if self.key == "band":
            if order is not None:
                raise InputError(
                    f"{self.TABLE}.band: the frequency follows the speed by excitation.engine_order; give speeds or rpm"
                )
            return self.values
        if order is None:
            raise InputError(
                f"{self.TABLE}.{self.key}: a frequency follows the speed by excitation.engine_order only; name that in "
                "place of excitation.frequency, or give a band in Hz"
            )
        return hertz_of("rotation.rpm" if self.key == "rpm" else "rotation.speed", order) * self.values


def file_in(record: type[File], tables: Mapping[str, Any], table: str, missing: str, path: str | Path) -> File:
    """Return the record of a study file from its tables; errors name the file's `path`.

    missing: advice in the error if the study's own table is missing. Raises InputError.
    """
    data = dict(tables)
    if table not in data:
        raise InputError(f"{path}: {table}: missing; {missing}")
    entries = data[table]
    if isinstance(entries, dict) and not set(UNITS) & set(entries):
        raise InputError(
            f"{path}: {table}.band: missing; give frequencies (Hz), or for an engine order speeds (rad/s) or rpm"
        )
    return record.of(data, path)


def scene_in(file: Scene) -> Scene:
    """Return the scene in the file of a study, which has further tables."""
    return Scene(**{item.name: getattr(file, item.name) for item in fields(Scene)})


def placed(scene: Scene, table: Band) -> tuple[Scene, np.ndarray]:
    """Return a scene at the beginning of its band, in which its resonance lies, and the frequencies (f,), Hz.

    Raises InputError for a band that does not suit the scene.
    """
    band = table.frequencies(scene.excitation.engine_order)
    if scene.excitation.resonance_near is None:
        near = float(band[0]), float(band[-1])
        scene = replace(scene, excitation=replace(scene.excitation, resonance_near=near))
    return at_frequency(scene, float(band[0])), band


def reference_amplitude(scene: Scene, band: np.ndarray, over_band: Literal["worst", "mean"]) -> float:
    """Return the amplitude without bodies in a band of frequencies (f,), m: its maximum, or the mean of the points."""
    if over_band == "worst":
        return float(linear_peaks(scene, *ends(scene, band))[0].amplitude)
    return float(linear_amplitudes(scene, band)[0].mean())


def at_frequency(scene: Scene, frequency: float) -> Scene:
    """Return the scene at a frequency of its engine order, Hz; a scene without an engine order remains unchanged."""
    order = scene.excitation.engine_order
    return scene if order is None else replace(scene, rotation=Rotation(speed=speed_of(order, frequency)))


def drive(scene: Scene, frequency: float) -> dict[str, Any]:
    """Return the changes to a scene, by path, that set an excitation frequency, Hz, or the speed that gives it."""
    order = scene.excitation.engine_order
    return {"excitation.frequency": frequency} if order is None else {"rotation.speed": speed_of(order, frequency)}


def ends(scene: Scene, band: np.ndarray) -> tuple[float, float]:
    """Return the ends of a band of frequencies (f,), Hz, as arguments of `linear_peaks`."""
    low, high, order = float(band[0]), float(band[-1]), scene.excitation.engine_order
    return (low, high) if order is None else (speed_of(order, low), speed_of(order, high))
