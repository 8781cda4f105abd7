"""Where lines of the excitation's frequency over the speed, such as engine orders, meet a structure's resonances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: speeds over a range unless the caller says how many
_EVEN = 65
#: accuracy of a speed, relative to the highest
_ACCURACY = 1e-12

#: natural frequencies (n,), Hz, ascending, at a speed
Natural = Callable[[float], np.ndarray]


def crossings(
    natural: Natural, line: Callable[[float], float], low: float, high: float, even: int = _EVEN
) -> list[float]:
    """Return the speeds from low to high at which a line (Hz over the speed) meets a natural frequency, ascending.

    even: speeds over the range, between two of which each natural frequency meets the line once at most.
    """
    from scipy.optimize import brentq

    speeds = np.linspace(low, high, even)
    above = np.array([natural(float(speed)) - line(float(speed)) for speed in speeds])
    roots = []
    for index, mode in np.argwhere((above[:-1] > 0.0) != (above[1:] > 0.0)):

        def distance(speed: float, mode: int = int(mode)) -> float:
            return float(natural(speed)[mode]) - line(speed)

        left, right = speeds[index : index + 2]
        roots.append(float(brentq(distance, left, right, xtol=_ACCURACY * high)))
    return sorted(roots)
