"""A ball on a table x = X sin(w t): its orbit with one impact a period, in closed form (Holmes 1982, J. Sound Vib. 84).

Between impacts the height y over the table has y'' = -g + X w^2 sin(w t). The ball leaves with speed V and is back a
period T later, at the same place: V = g T / 2 upwards after, downwards before the impact. Newton's law there, V - v =
e (V + v) with the table's speed v = X w cos(phi), gives the phase phi of the impact:

    (X w^2 / g) cos(phi) = pi (1 - e) / (1 + e).

In (y, y') the impact y' -> -e y' with guard y has the saltation matrix [[-e, 0], [(1 + e) a / u, -e]]: u = -2 V / (1 +
e) is the rate of y before it, a = y'' = -g (1 - s) with s = (X w^2 / g) sin(phi). Flight for a period is [[1, T], [0,
1]]. Their product has the determinant e^2, since flight loses nothing and the impact takes e by the guard and e by the
jump, and the trace -2 e + (1 + e)^2 (1 - s). A multiplier is 1 at s = 0, where the orbit begins, and -1 at s = 2 (1 +
e^2) / (1 + e)^2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


def beginning(restitution: float) -> float:
    """Return X w^2 / g above which the orbit exists."""
    return math.pi * (1 - restitution) / (1 + restitution)


def doubling(restitution: float) -> float:
    """Return X w^2 / g where the orbit's period doubles."""
    return math.hypot(beginning(restitution), 2 * (1 + restitution**2) / (1 + restitution) ** 2)


@dataclass(frozen=True)
class BouncingBall:
    """The orbit for a restitution and an acceleration X w^2 / g of the table; gravity in m/s^2, period in s.

    late: whether the impact is after phase 0, of the orbit that is stable where it begins; the other one never is.
    """

    restitution: float
    acceleration: float
    gravity: float = 10.0
    period: float = 1.0
    late: bool = True

    @property
    def phase(self) -> float:
        """Phase of the impact, between -pi / 2 and pi / 2."""
        return math.copysign(math.acos(beginning(self.restitution) / self.acceleration), 1.0 if self.late else -1.0)

    @property
    def trace(self) -> float:
        """Sum of the multipliers."""
        e = self.restitution
        return -2 * e + (1 + e) ** 2 * (1 - self.acceleration * math.sin(self.phase))

    @property
    def approach(self) -> float:
        """Speed of approach, m/s."""
        return self.gravity * self.period / (1 + self.restitution)

    @property
    def state(self) -> np.ndarray:
        """Height over the table and its rate (2,) at phase 0, m and m/s."""
        return self.at(0.0)

    def at(self, part: float) -> np.ndarray:
        """Return height over the table and its rate (2,) a part of a period after phase 0, m and m/s."""
        omega = 2 * math.pi / self.period
        table = self.acceleration * self.gravity / omega**2
        flown = self.period * ((part - self.phase / (2 * math.pi)) % 1.0)
        leaves, angle = self.gravity * self.period / 2, 2 * math.pi * part
        height = table * (math.sin(self.phase) - math.sin(angle)) + leaves * flown - self.gravity * flown**2 / 2
        return np.array([height, leaves - self.gravity * flown - table * omega * math.cos(angle)])

    @property
    def monodromy(self) -> np.ndarray:
        """Derivative (2, 2) of the period map at `state`."""
        e, before = self.restitution, self.period * self.phase / (2 * math.pi)
        rate = (1 + e) * self.gravity * (1 - self.acceleration * math.sin(self.phase)) / self.approach
        impact = np.array([[-e, 0.0], [rate, -e]])
        to, back = np.array([[1.0, before], [0.0, 1.0]]), np.array([[1.0, self.period - before], [0.0, 1.0]])
        derivative: np.ndarray = back @ impact @ to
        return derivative
