"""Stops: contact of the structure with the ground, or with itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.elements.element import Parts, SceneElement, Unit
from vanedamp.coupling.scene.repetition import Sectors
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import STRICT, Fraction, InputError, NonNegative


@dataclass(frozen=True, config=STRICT)
class Stop(SceneElement):
    """Contact of the structure with the ground, or with itself."""

    on_structure = True
    side: Literal["left", "right"]
    """side of the structure: a stop on the right limits positive displacement"""
    gap: NonNegative
    """distance at rest [m]"""
    restitution: Fraction = 1.0
    """coefficient of restitution [-]"""
    at: str | None = None
    """interface label of a reduced model that touches the stop (default: excitation.at)"""
    to: str | None = None
    """interface label of a reduced model that the stop is at and moves with (default: the ground); of a ring,
    "shroud@+1" is in the next sector"""
    sectors: Sectors | None = None
    """sectors of a ring that have one (default: as written)"""

    def __post_init__(self) -> None:
        if self.to is not None and self.to == self.at:
            raise ValueError(f"to: a point ('{self.to}') does not touch itself; name another, or leave it out")

    def labels(self) -> Mapping[str, str | None]:
        """Return `at` and `to`."""
        return {"at": self.at, "to": self.to}

    def check(self, scene: Any) -> None:
        """Raise ValueError for a restitution that the contact law has no element for, or a label that is missing."""
        try:
            scene.contact.element(self.restitution, 1.0)
        except InputError as error:
            raise ValueError(str(error)) from None
        if isinstance(scene.structure, Rom) and self.at is None:
            raise ValueError("at: name the interface label of the reduced model that hits the stop")

    def units(self, number: int, parts: Parts) -> Iterator[Unit]:
        """Yield its contact, whose gap closes as the structure moves to its side."""
        towards = -1.0 if self.side == "right" else 1.0
        normal = towards * parts.motion(self.at, f"stop[{number}].at")
        labels = [self.at]
        if self.to is not None:
            normal = normal - towards * parts.motion(self.to, f"stop[{number}].to")
            labels.append(self.to)
        contact = parts.contact(normal, self.restitution, *labels)
        yield Unit(normal, np.zeros(len(normal)), self.gap, element=contact, play=0.0, body=number)
