"""Orbits over two numbers of a scene: a surface in the space of states and numbers.

Its points are y = (state, numbers), scaled: the state by the map's scale and the square root of its size, the numbers
by their ranges. Scalar conditions on it are borders (orbits.conditions), followed by orbits.border_path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.differences import NotSmooth
from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.newton import Scaled, keep
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.files.toml_input import InputError

#: by which steps of differences are shortened where another motion lies within them
_SHRINKS = (1.0, 1e-2, 1e-4)
#: scenes and passages that are kept for the next step, which often wants them again
_MAPS, _PASSAGES = 3, 64


@dataclass(frozen=True, eq=False)
class Surface(Scaled):
    """Orbits of a period map over two numbers of its scene.

    paths: of the numbers; origin, span: (2,) values at which the scaled ones are 0, and their ranges; mirrored: whether
    orbits are symmetric, and the map takes half a period (PeriodMap.half); left, right: (k, n) directions by which
    those are told apart in which any orbit may be moved (`deflated`).
    """

    paths: tuple[str, str]
    origin: np.ndarray
    span: np.ndarray
    mirrored: bool = False
    left: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    right: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    _passages: dict[bytes, Passage | None] = field(default_factory=dict)
    _maps: dict[tuple[float, ...], PeriodMap] = field(default_factory=dict)

    def pack(self, state: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return y (k + 2,) of a state (k,) and the numbers (2,)."""
        return np.concatenate([state / self.weight, (numbers - self.origin) / self.span])

    def state(self, y: np.ndarray) -> np.ndarray:
        """Return the state (k,)."""
        return np.asarray(y[:-2] * self.weight)

    def numbers(self, y: np.ndarray) -> np.ndarray:
        """Return the two numbers (2,)."""
        return np.asarray(self.origin + self.span * y[-2:])

    def at(self, y: np.ndarray) -> PeriodMap:
        """Return the map at the numbers of y. Raises InputError for numbers that make no scene."""
        numbers = tuple(self.numbers(y).tolist())
        if numbers not in self._maps:
            keep(self._maps, numbers, self.map.with_numbers(dict(zip(self.paths, numbers, strict=True))), _MAPS)
        return self._maps[numbers]

    def passage(self, y: np.ndarray, derivative: bool = True) -> Passage | None:
        """Return the passage of y; None if its numbers make no scene, or it has no end or no derivative."""
        key = np.append(y, derivative).tobytes()
        if key not in self._passages:
            keep(self._passages, key, self._walked(y, derivative), _PASSAGES)
        return self._passages[key]

    def _walked(self, y: np.ndarray, derivative: bool) -> Passage | None:
        try:
            along = self.at(y)
        except InputError:
            return None
        passage = (along.half if self.mirrored else along)(self.state(y), derivative)
        return passage if passage.serves(derivative) else None

    def residual(self, y: np.ndarray, passage: Passage) -> np.ndarray:
        """Return by how much an orbit misses itself, scaled (k,)."""
        return np.asarray(passage.state / self.weight - y[:-2])

    def derivative(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the map in scaled coordinates."""
        return passage.scaled(self.map.scale)

    def deflated(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the residual by the state, made regular.

        Where any orbit may be moved it is singular; a multiple of left right^T leaves such coordinates where they are.
        """
        return np.asarray(self.derivative(passage) - np.eye(self.size) + self.left @ self.right.T)

    def columns(self, y: np.ndarray, numbers: int = 2) -> np.ndarray | None:
        """Return the derivative (k, n) of the residual by the first n scaled numbers; None where it is unknown."""
        try:
            along = replace(self.at(y), numbers=self.paths[:numbers])
            passage = (along.half if self.mirrored else along)(self.state(y))
        except NotSmooth:
            return None
        found = passage.by_number / self.weight[:, None] * self.span[:numbers]
        return found if np.isfinite(found).all() else None

    def neutral(self, derivative: np.ndarray) -> Surface:
        """Return the surface with the neutral directions of an orbit with a derivative (k, k)."""
        rows, sizes, columns = svd(derivative - np.eye(len(derivative)))
        null = sizes <= NULL * max(1.0, sizes[0])
        return Surface(
            self.map, self.paths, self.origin, self.span, self.mirrored, rows[:, null], columns[null].T, {}, self._maps
        )


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
