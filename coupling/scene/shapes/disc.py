"""Discs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from vanedamp.coupling.scene.shapes.shape import OUTWARDS, BodyMeasures, Point, Shape


class Disc(Shape):
    """A disc, which touches with the points of its rim that face the surfaces."""

    rolls = True
    measures: ClassVar[Mapping[str, str]] = {"radius": ""}

    def half_extent(self, body: BodyMeasures) -> tuple[float, float]:
        """Return the radius, twice."""
        radius = body.measure("radius") or 0.0
        return radius, radius

    def inertia(self, body: BodyMeasures) -> float:
        """Return it for a homogeneous disc."""
        a, _ = self.half_extent(body)
        return body.mass * (a * a / 2)

    def points(self, body: BodyMeasures, surface: int) -> tuple[Point, ...]:
        """Return the one point of the rim."""
        a, b = self.half_extent(body)
        x, y = OUTWARDS[surface]
        return ((-1, x * a, y * b),)

    def shortening(self, body: BodyMeasures) -> float:
        """Return zero: it looks the same from every side."""
        return 0.0
