"""The contract of shapes: other code asks the shape of a body these questions, and never for its name.

Points count from the body's centre, along and across the cavity, m. It is the centre of mass and of the smallest
rectangle around the body, whose sides lie along and across.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np

#: names of the surfaces in their order, as keys of a cavity
SIDES = ("left", "right", "floor", "ceiling")
LEFT, RIGHT, FLOOR, CEILING = range(len(SIDES))
#: directions out of the body towards the surfaces
OUTWARDS = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))
#: a point of a body: number of the corner (counterclockwise from the lower left one; -1: none), and its place
Point = tuple[int, float, float]
#: relative tolerance of points that are equally far out
_SAME = 1e-12


class BodyMeasures(Protocol):
    """What a shape asks of its body (scene.bodies.Damper): mass, kg, and measures, m, None where they are not given."""

    @property
    def mass(self) -> float:
        """Mass, kg."""

    def measure(self, key: str) -> float | None:
        """Return a measure by its key."""


class Shape:
    """Base of the shapes: a body that fills the rectangle `length` by `height`, and touches nothing.

    Those that are extended are an outline of corners (`Polygon`) or say themselves at which points they touch.
    """

    #: whether the body needs the plane: it has an extent that counts, and `play` above it
    planar: ClassVar[bool] = True
    #: whether it moves across its cavity and turns as well
    extended: ClassVar[bool] = True
    #: whether it rolls where friction holds the point that touches
    rolls: ClassVar[bool] = False
    #: its measures that a file must give, m: keys of Damper, or further ones, with a description that ends in "[m]"
    measures: ClassVar[Mapping[str, str]] = {}

    def half_extent(self, body: BodyMeasures) -> tuple[float, float]:
        """Return half of its extent along and across, m."""
        return (body.measure("length") or 0.0) / 2, (body.measure("height") or 0.0) / 2

    def inertia(self, body: BodyMeasures) -> float:
        """Return the moment of inertia of the homogeneous body about its centre, kg m^2."""
        a, b = self.half_extent(body)
        return body.mass * ((a * a + b * b) / 3)

    def corners(self, body: BodyMeasures) -> np.ndarray:
        """Return the corners (k, 2) of its outline, counterclockwise from the lower left one; (0, 2): it is round."""
        return np.zeros((0, 2))

    def points(self, body: BodyMeasures, surface: int) -> tuple[Point, ...]:
        """Return the points that touch a surface of the cavity (SIDES)."""
        return ()

    def face(self, body: BodyMeasures) -> tuple[float, float]:
        """Return the lowest and the highest point above the floor, m, at which it touches a neighbour."""
        heights = [self.half_extent(body)[1] + b for _, _, b in self.points(body, RIGHT)]
        return min(heights), max(heights)

    def rise(self, body: BodyMeasures, tilt: float) -> float:
        """Return the height, m, by which a tilt, rad, lifts the centre of a body that stands on the floor."""
        return max((-tilt * a for _, a, _ in self.points(body, FLOOR)), default=0.0)

    def shortening(self, body: BodyMeasures) -> float:
        """Return by how much a tilt shortens the body, m, to second order per square of the tilt; nan: never tilted."""
        return max(self.half_extent(body)) / 2


class Polygon(Shape):
    """A convex outline, the same seen from left and right, which touches with the corners that are farthest out.

    It answers `corners`; all else follows. Of two corners the one that is farther in stays so for tilts below the slope
    of the edge between them, and tilts are small.
    """

    def half_extent(self, body: BodyMeasures) -> tuple[float, float]:
        """Return half of the extent of its corners."""
        a, b = np.abs(self.corners(body)).max(axis=0).tolist()
        return a, b

    def inertia(self, body: BodyMeasures) -> float:
        """Return the sum over the triangles between the centre and the edges."""
        first = self.corners(body)
        second = np.roll(first, -1, axis=0)
        double = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        squares = (first * first + first * second + second * second).sum(axis=1)
        return float(body.mass * (double @ squares) / (6 * double.sum()))

    def points(self, body: BodyMeasures, surface: int) -> tuple[Point, ...]:
        """Return the corners that are farthest out on that side."""
        corners, (x, y) = self.corners(body).tolist(), OUTWARDS[surface]
        out = [x * a + y * b for a, b in corners]
        far = (1.0 - _SAME) * max(out)
        return tuple((number, a, b) for number, (a, b) in enumerate(corners) if out[number] >= far)


def common_heights(*faces: tuple[float, float]) -> tuple[float, ...]:
    """Return the heights above the floor, m, at which neighbours touch: the ends of the common part of their faces.

    () where they have none.
    """
    low, high = max(low for low, _ in faces), min(high for _, high in faces)
    if low - high > _SAME * abs(high):
        return ()
    return (low,) if high - low <= _SAME * abs(high) else (low, high)
