"""Engine orders: where their lines, frequency = order speed / (2 pi), meet the resonances of a structure."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.scene.rotation import frequency_of

#: speeds over a range, between two of which a natural frequency meets the line once at most
_EVEN = 65
#: accuracy of a speed, relative to the highest
_ACCURACY = 1e-12

#: natural frequencies (n,), Hz, ascending, at a speed, rad/s
Natural = Callable[[float], np.ndarray]


def crossings(natural: Natural, order: float, low: float, high: float) -> list[float]:
    """Return the speeds from low to high, rad/s, at which an engine order meets a natural frequency, ascending."""
    speeds = np.linspace(low, high, _EVEN)
    above = np.array([natural(float(speed)) - frequency_of(order, speed) for speed in speeds])
    found = []
    for place, mode in np.argwhere((above[:-1] > 0.0) != (above[1:] > 0.0)):

        def distance(speed: float, mode: int = int(mode)) -> float:
            return float(natural(speed)[mode]) - frequency_of(order, speed)

        left, right = speeds[place : place + 2]
        found.append(float(brentq(distance, left, right, xtol=_ACCURACY * high)))
    return sorted(found)
