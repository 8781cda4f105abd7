"""Restitution of spheres that yield, versus the speed of impact: by closed forms, each with its range of speeds.

Elastic and perfectly plastic, without adhesion, rate or wave effects: upper bounds of the rest after an impact.
Below the speed of first yield a collision loses nothing here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.contacts.hertz import Point

#: pressure under a fully plastic indent over the yield strength (Johnson 1985, section 6.3)
PLASTIC_PRESSURE = 3.0
#: half width over the radius, times E*/Y, from which an indent is fully plastic (about 30, there)
FULLY_PLASTIC = 30.0


class Restitution(NamedTuple):
    """A law of restitution: name, source, lowest speed at which it holds, m/s, and why."""

    name: str
    source: str
    lowest: float
    range: str


def thornton(speed: np.ndarray | float, yield_speed: float) -> np.ndarray:
    """Return the restitution at speeds of approach, m/s, of a contact that yields from a speed on; 1 below.

    The pressure grows as Hertz has it up to a limit, which it keeps over the yielded middle; it unloads elastically
    from a larger radius (Thornton 1997, J. Appl. Mech. 64, 383-386). Tends to 1.185 (yield_speed/speed)^(1/4).
    """
    ratio = np.minimum(yield_speed / np.maximum(np.asarray(speed, float), yield_speed), 1.0)
    fraction = ratio / (ratio + 2 * np.sqrt(1.2 - 0.2 * ratio**2))
    e = math.sqrt(1.2 * math.sqrt(3)) * np.sqrt(1 - ratio**2 / 6) * fraction**0.25
    return np.asarray(np.where(ratio == 1.0, 1.0, e))


def johnson(speed: np.ndarray | float, contact: Point, mass: float, yield_strength: float) -> np.ndarray:
    """Return the restitution at speeds, m/s, of a fully plastic impact, which falls like speed^(-1/4).

    The pressure of the indent is constant, 3 Y, and the rebound elastic, from the curvature that is left
    (Johnson 1985, section 11.5): about 3.8 (Y/E*)^(1/2) (m v^2/(2 Y R^3))^(-1/8). mass: reduced, kg.
    """
    pressure = PLASTIC_PRESSURE * yield_strength
    energy = 0.5 * mass * np.asarray(speed, float) ** 2
    factor = 0.3 * math.pi**1.25 * 4**0.75 * pressure / contact.modulus
    return np.asarray(np.sqrt(factor) * (energy / (pressure * contact.radius**3)) ** -0.125)


def fully_plastic_speed(contact: Point, mass: float, yield_strength: float) -> float:
    """Return the speed, m/s, from which the indent at the end of compression is fully plastic."""
    half_width = FULLY_PLASTIC * yield_strength * contact.radius / contact.modulus
    energy = math.pi * half_width**4 * PLASTIC_PRESSURE * yield_strength / (4 * contact.radius)
    return math.sqrt(2 * energy / mass)
