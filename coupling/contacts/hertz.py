"""Hertz's contacts: force, approach, pressure and first yield of a point and of a line of contact.

Elastic half-spaces without friction, whose contact is small against the radii (Hertz 1882; Johnson, Contact Mechanics,
1985, chapters 4 and 5). A contact is convex: it stiffens as it is pressed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

_TOO_WIDE = "the strip of contact would be as wide as the bodies: a line of contact does not hold here"
#: depths, in half widths of the contact, where the most stressed one is sought
_DEPTHS = np.linspace(0.0, 3.0, 601)


class Contact(Protocol):
    """A contact of two elastic bodies, by the force that presses them, N."""

    def approach(self, force: float) -> float:
        """Return how far distant points of the bodies approach each other, m."""

    def stiffness(self, force: float) -> float:
        """Return the tangent stiffness, N/m: that of small motion about a force."""

    def energy(self, force: float) -> float:
        """Return the elastic energy, J."""

    def force_of_energy(self, energy: float) -> float:
        """Return the force, N, that stores an energy, J."""

    def half_width(self, force: float) -> float:
        """Return the radius of the contact, or half the width of its strip, m."""

    def pressure(self, force: float) -> float:
        """Return the largest pressure, Pa."""

    def force_of_pressure(self, pressure: float) -> float:
        """Return the force, N, that has a largest pressure, Pa."""


@dataclass(frozen=True)
class Point:
    """Spheres, or a spherical crown on a plane: F = (4/3) E* sqrt(R) d^(3/2) (Johnson, section 4.2).

    radius: 1/(1/R1 + 1/R2), m; modulus: E* = 1/((1 - nu1^2)/E1 + (1 - nu2^2)/E2), Pa.
    """

    radius: float
    modulus: float

    @property
    def coefficient(self) -> float:
        """K of F = K d^(3/2), N/m^1.5."""
        return 4 / 3 * self.modulus * math.sqrt(self.radius)

    def approach(self, force: float) -> float:
        """Return the approach, m."""
        return float((force / self.coefficient) ** (2 / 3))

    def stiffness(self, force: float) -> float:
        """Return the tangent stiffness, N/m."""
        return float(1.5 * self.coefficient ** (2 / 3) * force ** (1 / 3))

    def energy(self, force: float) -> float:
        """Return the elastic energy, J."""
        return 0.4 * force * self.approach(force)

    def force_of_energy(self, energy: float) -> float:
        """Return the force, N, of an energy, J."""
        return float(self.coefficient * (2.5 * energy / self.coefficient) ** 0.6)

    def half_width(self, force: float) -> float:
        """Return the radius of the contact, m."""
        return math.sqrt(self.radius * self.approach(force))

    def pressure(self, force: float) -> float:
        """Return the largest pressure, Pa: 3 F/(2 pi a^2)."""
        return float((6 * force * self.modulus**2 / (math.pi**3 * self.radius**2)) ** (1 / 3))

    def force_of_pressure(self, pressure: float) -> float:
        """Return the force, N, of a largest pressure, Pa."""
        return math.pi**3 * self.radius**2 * pressure**3 / (6 * self.modulus**2)


@dataclass(frozen=True)
class Line:
    """Cylinder on a plane, or an edge rounded to a radius: a strip of contact, in plane strain.

    The displacements of half-planes have no limit far away: the approach is that of points at a depth below
    the surfaces (Johnson, section 5.6), d = F/w [(1 - nu1^2)/(pi E1) (2 ln(2 d1/a) - nu1/(1 - nu1)) + the same of
    the other body]. `line` makes it.
    width: w, m, of the strip along its line; constant: of d = F (constant - log(F)/(pi E* w)), m/N.
    """

    radius: float
    modulus: float
    width: float
    constant: float

    @property
    def _slope(self) -> float:
        return 1 / (math.pi * self.modulus * self.width)

    @property
    def _most(self) -> float:
        """Force at which the strip is so wide that the approach no longer grows, N."""
        return math.exp(self.constant / self._slope - 1)

    def approach(self, force: float) -> float:
        """Return the approach, m."""
        return force * (self.constant - self._slope * math.log(force)) if force > 0.0 else 0.0

    def stiffness(self, force: float) -> float:
        """Return the tangent stiffness, N/m."""
        return 1 / (self.constant - self._slope * (1 + math.log(force))) if force > 0.0 else 0.0

    def energy(self, force: float) -> float:
        """Return the elastic energy, J. Raises ValueError for a force whose strip is as wide as the bodies."""
        if force <= 0.0:
            return 0.0
        if not force < self._most:
            raise ValueError(_TOO_WIDE)
        return 0.5 * force**2 * (self.constant - self._slope * (0.5 + math.log(force)))

    def force_of_energy(self, energy: float) -> float:
        """Return the force, N, of an energy, J. Raises ValueError for one whose strip is as wide as the bodies."""
        return _inverse(self.energy, energy, self._most * (1 - 1e-9))

    def half_width(self, force: float) -> float:
        """Return half the width of the strip, m."""
        return math.sqrt(4 * force * self.radius / (math.pi * self.modulus * self.width))

    def pressure(self, force: float) -> float:
        """Return the largest pressure, Pa: 2 F/(pi a w)."""
        return math.sqrt(force * self.modulus / (math.pi * self.radius * self.width))

    def force_of_pressure(self, pressure: float) -> float:
        """Return the force, N, of a largest pressure, Pa."""
        return math.pi * self.radius * self.width * pressure**2 / self.modulus


def line(radius: float, width: float, depth: float, young: tuple[float, float], poisson: tuple[float, float]) -> Line:
    """Return a line of contact of two bodies. depth: m, of the points of both bodies whose approach it is."""
    modulus = effective_modulus(young, poisson)
    constant = 0.0
    for E, nu in zip(young, poisson, strict=True):
        wide = math.log(4 * depth**2 * math.pi * modulus * width / (4 * radius))  # 2 ln(2 d/a) + ln(F)
        constant += (1 - nu**2) / (math.pi * E * width) * (wide - nu / (1 - nu))
    return Line(radius, modulus, width, constant)


def effective_modulus(young: tuple[float, float], poisson: tuple[float, float]) -> float:
    """Return E* of two bodies, Pa."""
    return 1 / sum((1 - nu**2) / E for E, nu in zip(young, poisson, strict=True))


@lru_cache(maxsize=64)
def yield_pressure(poisson: float, along_line: bool) -> float:
    """Return the largest pressure at first yield (von Mises) over the yield strength, by the stresses below it.

    The stresses on the axis, at the depth z = zeta a: Johnson 1985, sections 3.4 and 4.2; a line in plane strain.
    1.60 and 1.79 at nu = 0.3 there. Below nu of about 0.25 a line yields first at its surface.
    """
    stress: Callable[[float | np.ndarray], np.ndarray] = _of_line(poisson) if along_line else _of_point(poisson)
    from scipy.optimize import minimize_scalar

    at = float(_DEPTHS[int(np.argmax(stress(_DEPTHS)))])
    step = float(_DEPTHS[1])
    peak = minimize_scalar(
        lambda z: -float(stress(z)), bounds=(max(at - step, 0.0), at + step), method="bounded", options={"xatol": 1e-9}
    )
    return 1 / max(-float(peak.fun), float(stress(at)))


def _of_point(nu: float) -> Callable[[float | np.ndarray], np.ndarray]:
    """Return von Mises' stress over the largest pressure at the depth zeta below the middle of a point."""

    def stress(z: float | np.ndarray) -> np.ndarray:
        radial = -(1 + nu) * (1 - z * np.arctan2(1.0, z)) + 0.5 / (1 + z**2)
        return np.asarray(np.abs(radial + 1 / (1 + z**2)))

    return stress


def _of_line(nu: float) -> Callable[[float | np.ndarray], np.ndarray]:
    """Return von Mises' stress over the largest pressure at the depth zeta below the middle of a line."""

    def stress(z: float | np.ndarray) -> np.ndarray:
        root = np.sqrt(1 + z**2)
        x, down = -((1 + 2 * z**2) / root - 2 * z), -1 / root
        along = nu * (x + down)
        return np.asarray(np.sqrt(0.5 * ((x - down) ** 2 + (down - along) ** 2 + (along - x) ** 2)))

    return stress


def _inverse(function: Callable[[float], float], value: float, most: float) -> float:
    """Return where a rising function of a number in (0, most) has a value. Raises ValueError where it has not."""
    from scipy.optimize import brentq

    if value <= 0.0:
        return 0.0
    if not value < function(most):
        raise ValueError(_TOO_WIDE)
    low = most
    while function(low) > value:
        low *= 0.1
    return float(brentq(lambda force: function(force) - value, low, most, xtol=1e-300, rtol=8.9e-16))
