"""Rectangles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from vanedamp.coupling.scene.shapes.shape import BodyMeasures, Polygon, Shape


class Block(Polygon):
    """A rectangle, which touches with its corners."""

    measures: ClassVar[Mapping[str, str]] = {"length": "", "height": ""}
    half_extent = Shape.half_extent
    inertia = Shape.inertia

    def corners(self, body: BodyMeasures) -> np.ndarray:
        """Return its four corners."""
        a, b = self.half_extent(body)
        return np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
