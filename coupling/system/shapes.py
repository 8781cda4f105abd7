"""What assembly asks of the shape of a body: where it touches the surfaces of its cavity and its neighbours.

Points count from the body's centre, along and across the cavity, by the half extents (a, b) of the body, m.
"""

from __future__ import annotations

from typing import ClassVar

from vanedamp.coupling.scene.bodies import Damper
from vanedamp.coupling.system.surfaces import CEILING, FLOOR, LEFT, RIGHT

#: a point of a body: number of the corner (0 to 3, counterclockwise from the lower left one; -1: none), and its place
Point = tuple[int, float, float]
#: relative tolerance of heights that are the same
_SAME = 1e-12


class Slider:
    """A body that only moves along its cavity."""

    #: whether it moves across its cavity and turns as well
    extended: ClassVar[bool] = False
    #: whether it rolls where friction holds the point that touches
    rolls: ClassVar[bool] = False

    def points(self, a: float, b: float, surface: int) -> tuple[Point, ...]:
        """Return the points that touch a surface of the cavity (surfaces.SIDES)."""
        return () if surface in (FLOOR, CEILING) else ((-1, 0.0, 0.0),)

    def face(self, a: float, b: float) -> tuple[float, float]:
        """Return the lowest and the highest point above the floor, m, at which it touches a neighbour."""
        return 0.0, 0.0

    def rise(self, a: float, tilt: float) -> float:
        """Return the height, m, by which a tilt, rad, lifts the centre of a body that stands on the floor."""
        return 0.0

    def shortening(self, a: float, b: float) -> float:
        """Return by how much a tilt shortens the body, m, to second order per square of the tilt; nan: never tilted."""
        return float("nan")


class Block(Slider):
    """A rectangle, which touches with its corners."""

    extended = True
    _CORNERS: ClassVar = {LEFT: (0, 3), RIGHT: (1, 2), FLOOR: (0, 1), CEILING: (2, 3)}

    def points(self, a: float, b: float, surface: int) -> tuple[Point, ...]:
        """Return the two corners on that side."""
        corners = (-a, -b), (a, -b), (a, b), (-a, b)
        return tuple((corner, *corners[corner]) for corner in self._CORNERS[surface])

    def face(self, a: float, b: float) -> tuple[float, float]:
        """Return the whole height."""
        return 0.0, 2 * b

    def rise(self, a: float, tilt: float) -> float:
        """Return the height of the middle of a bottom that stands on a corner."""
        return a * abs(tilt)

    def shortening(self, a: float, b: float) -> float:
        """Return half of the longer half extent."""
        return max(a, b) / 2


class Disc(Slider):
    """A disc, which touches with the points of its rim that face the surfaces."""

    extended = True
    rolls = True

    def points(self, a: float, b: float, surface: int) -> tuple[Point, ...]:
        """Return the one point of the rim."""
        return ((-1, *{LEFT: (-a, 0.0), RIGHT: (a, 0.0), FLOOR: (0.0, -b), CEILING: (0.0, b)}[surface]),)

    def face(self, a: float, b: float) -> tuple[float, float]:
        """Return the height of the centre."""
        return b, b

    def shortening(self, a: float, b: float) -> float:
        """Return zero: it looks the same from every side."""
        return 0.0


_SHAPES = {"slider": Slider(), "block": Block(), "disc": Disc()}


def shape_of(damper: Damper) -> Slider:
    """Return the shape of a body; a slider's for one whose shape is still open."""
    return _SHAPES["slider" if damper.shape == "auto" else damper.shape]


def common_heights(left: Damper, right: Damper) -> tuple[float, ...]:
    """Return the heights above the floor, m, at which two neighbours touch: the ends of the common part of their faces.

    () where they have none.
    """
    faces = [shape_of(damper).face(*damper.half_extent) for damper in (left, right)]
    low, high = max(low for low, _ in faces), min(high for _, high in faces)
    if low - high > _SAME * abs(high):
        return ()
    return (low,) if high - low <= _SAME * abs(high) else (low, high)
