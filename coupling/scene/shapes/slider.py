"""Bodies that only move along their cavity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from vanedamp.coupling.scene.shapes.shape import CEILING, FLOOR, BodyMeasures, Point, Shape


class Slider(Shape):
    """A body that only moves along its cavity; its height, if it is known, says how high its centre is."""

    planar = extended = False

    def points(self, body: BodyMeasures, surface: int) -> tuple[Point, ...]:
        """Return its centre, for walls."""
        return () if surface in (FLOOR, CEILING) else ((-1, 0.0, 0.0),)

    def face(self, body: BodyMeasures) -> tuple[float, float]:
        """Return the floor: sliders touch whatever their heights."""
        return 0.0, 0.0

    def shortening(self, body: BodyMeasures) -> float:
        """Return nan: it never tilts."""
        return float("nan")


class Open(Slider):
    """A block or a slider, whichever is enough: a slider until that is chosen (model_order.choices)."""

    planar = True
    measures: ClassVar[Mapping[str, str]] = {"length": "", "height": ""}
