"""What touches: shapes and materials of a body and its wall, as files give them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.hertz import Contact, Point, effective_modulus, line, yield_pressure
from vanedamp.files.toml_input import STRICT, Positive, Real

Poisson = Annotated[Real, Field(ge=0, lt=0.5)]


@dataclass(frozen=True, config=STRICT)
class Pair:
    """A body and its wall: elastic, smooth, without friction where they touch.

    A radius, without a width, is that of a sphere or of a spherical crown: a point of contact. With a width it is that
    of a cylinder or of a rounded edge: a line of contact.
    """

    young: Positive
    """Young's modulus of the body [Pa]"""
    poisson: Poisson = 0.3
    """Poisson's ratio of the body [-]"""
    wall_young: Positive | None = None
    """Young's modulus of the wall (default: the body's) [Pa]"""
    wall_poisson: Poisson | None = None
    """Poisson's ratio of the wall (default: the body's) [-]"""
    radius: Positive | None = None
    """radius of the body's sphere, crown, cylinder or rounded edge where it touches [m]"""
    wall_radius: Positive | None = None
    """radius of the wall there, convex too (default: a plane) [m]"""
    width: Positive | None = None
    """length of a line of contact, of a cylinder or a rounded edge (default: a point of contact) [m]"""
    depth: Positive | None = None
    """of a line: depth below both surfaces of the points whose approach counts, such as half the body's length [m]"""
    yield_strength: Positive | None = None
    """yield strength of the softer of both [Pa]"""
    length: Positive | None = None
    """of `stiffness = "patch"`: length of the body along the normal [m]"""
    area: Positive | None = None
    """of `stiffness = "patch"`: area of the body's face [m^2]"""
    restitution_speeds: tuple[Positive, Positive] | None = None
    """lowest and highest speed of approach for which the restitution is known, as of its measurement [m/s]"""

    def __post_init__(self) -> None:
        if self.width is not None and self.depth is None:
            raise ValueError("depth: missing; the approach along a line of contact is that of points at a depth [m]")
        if self.width is None and self.depth is not None:
            raise ValueError("depth: is for a line of contact; give its width too, or leave depth out")
        for key in ("width", "wall_radius"):
            if getattr(self, key) is not None and self.radius is None:
                raise ValueError(f"{key}: is of a rounded contact; give its radius, or leave {key} out")
        if self.restitution_speeds is not None and self.restitution_speeds[0] > self.restitution_speeds[1]:
            low, high = self.restitution_speeds
            raise ValueError(f"restitution_speeds: expected the lower one first, not [{low:g}, {high:g}]")

    @property
    def _poissons(self) -> tuple[float, float]:
        return self.poisson, self.poisson if self.wall_poisson is None else self.wall_poisson

    @property
    def _youngs(self) -> tuple[float, float]:
        return self.young, self.young if self.wall_young is None else self.wall_young

    @property
    def contact(self) -> Contact | None:
        """The rounded contact; None without a radius."""
        if self.radius is None:
            return None
        radius = self.radius if self.wall_radius is None else 1 / (1 / self.radius + 1 / self.wall_radius)
        if self.width is None or self.depth is None:
            return Point(radius, effective_modulus(self._youngs, self._poissons))
        return line(radius, self.width, self.depth, self._youngs, self._poissons)

    @property
    def first_yield(self) -> float | None:
        """The largest pressure at first yield, Pa: of the material that yields at the lower one; None: unknown."""
        if self.yield_strength is None:
            return None
        return self.yield_strength * min(yield_pressure(nu, self.width is not None) for nu in self._poissons)

    @property
    def body_flexibility(self) -> float | None:
        """Flexibility of the body between its face and its centre of mass, m/N; None without a length and an area.

        L/(3 E A) of a column that its own inertia presses: the stress falls linearly from the face to the free end.
        """
        if self.length is None or self.area is None:
            return None
        return self.length / (3 * self.young * self.area)
