"""Joints: dry friction between parts of the structure, or one and the casing: platforms, shrouds, snubbers, roots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import Element
from vanedamp.coupling.scene.elements.element import Parts, SceneElement, Unit
from vanedamp.coupling.scene.repetition import Sectors
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import STRICT, Fraction, InputError, NonNegative, Positive

_Points = tuple[str, str]
_CASING = "casing"


@dataclass(frozen=True, config=STRICT)
class Joint(SceneElement):
    """Coulomb friction between two points of the structure, or one and the casing, under a constant or varying load."""

    on_structure = True
    rubs = True
    friction: NonNegative
    """coefficient of friction [-]"""
    preload: NonNegative = 0.0
    """force that presses the points together while the structure is at rest, where it is in balance [N]"""
    preload_by_speed: NonNegative = 0.0
    """what the square of the speed of rotation adds to it: preload + preload_by_speed speed^2 [N s^2]"""
    gap: NonNegative = 0.0
    """distance across the joint at rest; not with a preload [m]"""
    between: _Points | None = None
    """interface labels of a reduced model whose motions along the joint slip on each other, one may be "casing"; of a
    ring, "tip@+1" is in the next sector (default: the response and the casing)"""
    second: _Points | None = None
    """labels of their motions in the other direction along the joint: each direction has friction of its own, up to
    friction times the normal force (a box in place of the circle)"""
    normal: _Points | None = None
    """labels of their motions across the joint, which opens as the first moves on and the second does not (default:
    the normal force is the preload all the time)"""
    normal_stiffness: Positive | None = None
    """stiffness across the joint (default: by the contact law) [N/m]"""
    restitution: Fraction = 0.0
    """coefficient of restitution, where the contact law takes one [-]"""
    sectors: Sectors | None = None
    """sectors of a ring that have one (default: as written)"""

    def __post_init__(self) -> None:
        points = self._points()
        for key, pair in points.items():
            if pair[0] == pair[1]:
                raise ValueError(f"{key}: '{pair[0]}' does not rub on itself; name another point, or \"{_CASING}\"")
        if self.gap and (self.preload or self.preload_by_speed):
            raise ValueError("gap: a joint that is open at rest has no preload; give one of them")
        if self.normal is None:
            for key in ("gap", "normal_stiffness", "restitution"):
                if getattr(self, key):
                    raise ValueError(f"{key}: needs the motions across the joint; give normal = [label, label]")
        if self.second is not None and self.between is None:
            raise ValueError("second: needs the first direction; give between = [label, label]")

    @property
    def yields(self) -> bool:  # type: ignore[override]
        """Whether it has a spring of its own across."""
        return self.normal_stiffness is not None

    def _points(self) -> dict[str, _Points]:
        return {key: pair for key in ("between", "second", "normal") if (pair := getattr(self, key)) is not None}

    def labels(self) -> Mapping[str, str | None]:
        """Return the labels of its points, by key and place."""
        pairs = self._points().items()
        return {f"{key}[{place}]": label for key, pair in pairs for place, label in enumerate(pair) if label != _CASING}

    def relabelled(self, label: Callable[[str, str], str]) -> Self:
        """Return it with other labels, by key and label."""
        pairs = {
            key: tuple(one if one == _CASING else label(f"{key}[{place}]", one) for place, one in enumerate(pair))
            for key, pair in self._points().items()
        }
        return replace(self, **pairs)

    def check(self, scene: Any) -> None:
        """Raise ValueError for what the structure or the contact law does not take."""
        if isinstance(scene.structure, Rom) and self.between is None:
            raise ValueError('between: name the interface labels of the reduced model that rub, or one and "casing"')
        if self.normal is None or self.yields:
            return
        try:
            rigid = not np.isfinite(scene.contact.element(self.restitution, 1.0).stiffness)
        except InputError as error:
            raise ValueError(str(error)) from None
        if self.second is not None and rigid:
            raise ValueError("second: a rigid normal has no share for each direction; give normal_stiffness")
        if scene.contact.parallel and (self.preload or self.preload_by_speed):
            raise ValueError("preload: springs in parallel begin one after the other; give normal_stiffness")

    def units(self, number: int, parts: Parts) -> Iterator[Unit]:
        """Yield its contact, one for each direction along it, or friction elements where its load is constant."""

        def across(key: str) -> np.ndarray:
            pair: tuple[str | None, str | None] = getattr(self, key) or (None, _CASING)
            motions = [
                sign * parts.motion(label, f"joint[{number}].{key}")
                for sign, label in zip((1.0, -1.0), pair, strict=True)
                if label != _CASING
            ]
            return np.sum(motions, axis=0)

        slips = [across(key) for key in ("between", "second") if key == "between" or self.second is not None]
        load, share = self.preload + self.preload_by_speed * parts.speed**2, 1.0 / len(slips)
        if self.normal is None:
            for slip in slips:
                yield Unit(0.0 * slip, slip, body=number, limit=self.friction * load)
            return
        normal = across("normal")
        if self.normal_stiffness is None:
            given = [label for label in self.normal if label != _CASING]
            element = parts.contact(normal, self.restitution, *given)
        else:
            element = Element(0.0, self.normal_stiffness)
        # directions share the spring, so that the friction of each is that of the whole normal force
        element = element._replace(stiffness=share * element.stiffness, dashpot=share * element.dashpot)
        for slip in slips:
            yield Unit(
                normal, slip, self.gap - share * load / element.stiffness, self.friction / share, element, 0.0, number,
                closing=share * load,
            )  # fmt: skip
