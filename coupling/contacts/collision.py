"""Collision of two bodies on an elastic contact: largest force, approach, duration; and the spring that replaces it."""

from __future__ import annotations

import math
from typing import NamedTuple

from vanedamp.coupling.contacts.hertz import Contact, Line

#: duration of a collision of spheres over largest approach by speed: 2.9432 (Hertz 1882; Johnson 1985, section 11.4)
DURATION = 2 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)


class Collision(NamedTuple):
    """The largest force, N, and approach, m, of a collision, and its duration, s."""

    force: float
    approach: float
    duration: float


def collision(contact: Contact, mass: float, speed: float) -> Collision:
    """Return the collision of two bodies without loss. mass: 1/(1/m1 + 1/m2), kg; speed: of approach, m/s.

    In closed form for a point; for a line the duration is an integral over the force. Waves in the bodies take no
    energy: the collision lasts for many of their passages. Raises ValueError for a line pressed wider than its bodies.
    """
    force = contact.force_of_energy(0.5 * mass * speed**2)
    approach = contact.approach(force)
    if isinstance(contact, Line):
        return Collision(force, approach, _duration(contact, mass, force))
    return Collision(force, approach, DURATION * approach / speed)


def speed_of_force(contact: Contact, mass: float, force: float) -> float:
    """Return the speed of approach, m/s, of a collision with a largest force, N."""
    return math.sqrt(2 * contact.energy(force) / mass)


def spring(contact: Contact, mass: float, speed: float, match: str) -> float:
    """Return the stiffness, N/m, of the linear spring whose collision has the same largest "force" or "duration".

    For a point, k of the force is 1.371 times that of the duration at every speed.
    """
    impact = collision(contact, mass, speed)
    if match == "force":
        return impact.force**2 / (mass * speed**2)
    return mass * (math.pi / impact.duration) ** 2


def _duration(contact: Line, mass: float, force: float) -> float:
    """Return the duration, s, of a collision with a largest force: the integral of d(approach)/speed."""
    from scipy.integrate import quad

    energy = contact.energy(force)

    def rate(u: float) -> float:
        # the force is (1 - u^2) of the largest, so that the speed, which vanishes there, is linear in u
        now = force * (1 - u * u)
        left = 2 * (energy - contact.energy(now)) / mass
        return 2 * u * force / (contact.stiffness(now) * math.sqrt(left)) if left > 0.0 and now > 0.0 else 0.0

    return 2 * float(quad(rate, 0.0, 1.0, epsabs=0.0, epsrel=1e-10, limit=200)[0])
