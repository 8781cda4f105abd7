"""Joints: dry friction under a normal force that varies, between parts of the structure: platforms, shrouds, roots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal, Self

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import Element
from vanedamp.coupling.scene.elements.element import Parts, SceneElement, Unit
from vanedamp.coupling.scene.repetition import Sectors
from vanedamp.files.toml_input import STRICT, Fraction, InputError, NonNegative, Positive

_Points = tuple[str, str]
#: what does not move, in place of a label
_CASING = "casing"
#: of points that a pair gives
_MISSING: Any = None


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Joint(SceneElement):
    """Contact with Coulomb friction between two points of the structure, or one and the casing.

    It sticks, slips and opens; its normal force follows the motion across it. One with a constant normal force is a
    friction damper.
    """

    on_structure = True
    rubs = True
    at: str | None = None
    """pair of a case, in place of between and normal; of a ring, that of "platform@+1" has its second side in the next
    sector"""
    between: _Points = _MISSING
    """interface labels of a reduced model whose motions slip on each other; one may be "casing", which is at rest; of a
    ring, "tip@+1" is in the next sector (default: those of the pair)"""
    normal: _Points = _MISSING
    """labels of the motions of the same points across the joint, which opens as the first moves on from the second
    (default: those of the pair)"""
    friction: NonNegative
    """coefficient of friction [-]"""
    preload: NonNegative = 0.0
    """constant load that closes the joint; at rest the normal force balances it [N]"""
    preload_by_speed: NonNegative = 0.0
    """what the speed of rotation adds to it: preload + preload_by_speed speed^2 [N s^2]"""
    sideways: _Points | Literal[True] | None = None
    """labels of the motions of the same points along it at right angles to between, or true for those of a pair
    (default: none); needs normal_stiffness or residual. Each direction has its own limit of friction, a box"""
    gap: NonNegative = 0.0
    """distance across the joint at rest; not with a preload [m]"""
    normal_stiffness: Positive | None = None
    """stiffness across the joint (default: by the contact law) [N/m]"""
    tangential_stiffness: Positive | None = None
    """stiffness along the joint until it slips, unloaded at time zero; needs normal_stiffness (default: rigid) [N/m]"""
    residual: bool = False
    """put the flexibility between the points that the reduced model's modes lack in series with both stiffnesses, or in
    their places"""
    restitution: Fraction = 0.0
    """coefficient of restitution, where the contact law takes one [-]"""
    sectors: Sectors | None = None
    """sectors of a ring that have one (default: as written)"""

    def __post_init__(self) -> None:
        if self.at is not None:
            if self.between is not _MISSING or self.normal is not _MISSING:
                raise ValueError("at: a pair has both of between and normal; leave them out")
            if isinstance(self.sideways, tuple):
                raise ValueError("sideways: a pair has its own labels; give true")
            name, mark, where = self.at.partition("@")
            sectors = "" if where[:1] in ("+", "-") else mark + where, mark + where
            first, second = (f"{name}_{number}" for number in (1, 2))
            for key, of in (("between", ""), ("normal", "_across"), ("sideways", "_sideways")):
                if key != "sideways" or self.sideways:
                    object.__setattr__(self, key, (f"{first}{of}{sectors[0]}", f"{second}{of}{sectors[1]}"))
            object.__setattr__(self, "at", None)  # as if written out
        for key, points in (("between", self.between), ("normal", self.normal)):
            if points is _MISSING:
                raise ValueError(f"{key}: missing; name two points, or give `at`, a pair of the case")
        if self.sideways is True:
            raise ValueError("sideways: true is of a pair, `at`; name two points")
        for key, points in self._points.items():
            if points[0] == points[1]:
                raise ValueError(f"{key}: '{points[0]}' does not rub on itself; name another point, or \"{_CASING}\"")
            if [one == _CASING for one in self.between] != [one == _CASING for one in points]:
                raise ValueError(f'{key}: expected "{_CASING}" in the same place as in between')
        if self.gap and (self.preload or self.preload_by_speed):
            raise ValueError("gap: a joint that is open at rest has no preload; give one of them")
        if self.tangential_stiffness is not None and not self.yields:
            raise ValueError("tangential_stiffness: needs normal_stiffness, of the same part; give both")
        if self.sideways and not self.yields:
            raise ValueError("sideways: needs normal_stiffness or residual: rigid, its normal force has no share")

    @property
    def yields(self) -> bool:  # type: ignore[override]
        """Whether it has a spring of its own across."""
        return self.normal_stiffness is not None or self.residual

    @property
    def sliders(self) -> int:
        """Number of its units that have a spring along."""
        return (len(self._points) - 1) * (self.tangential_stiffness is not None or self.residual)

    @property
    def _points(self) -> dict[str, _Points]:
        """Its points, by key."""
        given: dict[str, Any] = {"between": self.between, "normal": self.normal, "sideways": self.sideways}
        return {key: points for key, points in given.items() if points}

    def labels(self) -> Mapping[str, str | None]:
        """Return the labels of its points, by key and place."""
        return {
            f"{key}[{place}]": label
            for key, points in self._points.items()
            for place, label in enumerate(points)
            if label != _CASING
        }

    def relabelled(self, label: Callable[[str, str], str]) -> Self:
        """Return it with other labels, by key and label."""

        def turned(key: str) -> _Points:
            first, last = (one if one == _CASING else label(key, one) for one in self._points[key])
            return first, last

        moved: dict[str, Any] = {key: turned(key) for key in self._points}
        return replace(self, **moved)

    def check(self, scene: Any) -> None:
        """Raise ValueError for what the contact law does not take."""
        if self.yields:
            return
        try:
            scene.contact.element(self.restitution, 1.0)
        except InputError as error:
            raise ValueError(str(error)) from None
        if scene.contact.parallel and (self.preload or self.preload_by_speed):
            raise ValueError("preload: springs in parallel begin one after the other; give normal_stiffness")

    def units(self, number: int, parts: Parts) -> Iterator[Unit]:
        """Yield its contact; of two directions along one each, which share its normal force: half, with twice mu."""

        def shares(key: str) -> dict[str, float]:
            return {label: sign for label, sign in zip(self._points[key], (1.0, -1.0), strict=True) if label != _CASING}

        def apart(key: str) -> np.ndarray:
            motions = [sign * parts.motion(label, f"joint[{number}].{key}") for label, sign in shares(key).items()]
            row = np.sum(motions, axis=0)
            if not row.any():
                raise InputError(f"joint[{number}].{key}: {' and '.join(shares(key))} do not move on each other")
            return row

        def stiffness(key: str, given: float | None) -> float:
            yields = (1.0 / given if given else 0.0) + self.residual * parts.flexibility(shares(key))
            if not yields > 0.0:
                raise InputError(
                    f"joint[{number}].residual: the modes lack none between {' and '.join(shares(key))}; "
                    "give stiffnesses, or take few natural modes (structure.natural = true)"
                )
            return 1.0 / yields

        along = [key for key in ("between", "sideways") if key in self._points]
        normal, share = apart("normal"), len(along)
        load = (self.preload + self.preload_by_speed * parts.speed**2) / share
        if self.yields:
            element = Element(0.0, stiffness("normal", self.normal_stiffness) / share)
        else:
            element = parts.contact(normal, self.restitution, *shares("normal"))
        for direction, key in enumerate(along):
            tangential = stiffness(key, self.tangential_stiffness) if self.sliders else np.inf
            yield Unit(
                normal, apart(key), self.gap - load / element.stiffness, share * self.friction, element, 0.0, number,
                corner=direction if share > 1 else -1, closing=load, tangential=tangential,
            )  # fmt: skip
