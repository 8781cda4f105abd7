"""Orbits over two numbers of a scene: a surface in the space of states and numbers.

Its points are y = (state, numbers), scaled: the state by the map's scale and the square root of its size, the numbers
by their ranges. Scalar conditions on it are borders (orbits.conditions), followed by orbits.border_path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.newton import Scaled
from vanedamp.coupling.orbits.period_map import PeriodMap

#: by which steps of differences are shortened where another motion lies within them
_SHRINKS = (1.0, 1e-2, 1e-4)


@dataclass(frozen=True, eq=False)
class Surface(Scaled):
    """Orbits of a period map over two numbers of its scene.

    left, right: (k, n) directions by which those are told apart in which any orbit may be moved (`deflated`).
    """

    map: PeriodMap
    paths: tuple[str, str]
    origin: np.ndarray
    span: np.ndarray
    mirrored: bool = False
    left: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    right: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    _MOST = 64

    def deflated(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the residual by the state, made regular.

        Where any orbit may be moved it is singular; a multiple of left right^T leaves such coordinates where they are.
        """
        return np.asarray(self.derivative(passage) - np.eye(self.size) + self.left @ self.right.T)

    def neutral(self, derivative: np.ndarray) -> Surface:
        """Return the surface with the neutral directions of an orbit with a derivative (k, k)."""
        rows, sizes, columns = svd(derivative - np.eye(len(derivative)))
        null = sizes <= NULL * max(1.0, sizes[0])
        return replace(self, left=rows[:, null], right=columns[null].T)


def difference(
    function: Callable[[np.ndarray], float | None], y: np.ndarray, direction: np.ndarray, step: float, here: float
) -> float | None:
    """Return the derivative of a function of y along a direction (k + 2,), by central differences.

    Steps shrink as long as the function is None on a side; then one side serves. None where none does. here: its value.
    """
    above = below = None
    for shrink in _SHRINKS:
        h = shrink * step
        above, below = function(y + h * direction), function(y - h * direction)
        if above is not None and below is not None:
            return (above - below) / (2 * h)
    if above is not None:
        return (above - here) / h
    return None if below is None else (here - below) / h
