"""Orbits of a period map over numbers of its scene, as zeros of one function of state and numbers."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import svd

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.multipliers import NULL
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.tangents.differences import NotSmooth
from vanedamp.files.record import empty
from vanedamp.files.toml_input import InputError

#: scenes and passages that are kept for the next step, which often needs them; more would fill the memory
_MAPS, _PASSAGES = 3, 64


@dataclass(frozen=True, eq=False)
class OrbitProblem:
    """Orbits of a period map over m numbers of its scene; none are those of the map as it is.

    Points are y (k + m,): states over the map's scale and the root of its size, so that their mean square counts, and
    numbers as fractions of their ranges. paths: of the numbers; origin, span: (m,) where these are 0, and the ranges;
    mirrored: whether orbits are symmetric, and the map takes half a period (PeriodMap.half); anchor: (k, k) what makes
    `by_state` regular where any orbit may be moved (`anchored`); count: of Newton's iterations so far.
    """

    map: PeriodMap
    paths: tuple[str, ...] = ()
    origin: np.ndarray = field(default_factory=empty)
    span: np.ndarray = field(default_factory=empty)
    mirrored: bool = False
    anchor: np.ndarray | float = 0.0
    count: Counter[str] = field(default_factory=Counter)
    _maps: dict[tuple[float, ...], PeriodMap] = field(default_factory=dict)
    _passages: dict[bytes, Passage | None] = field(default_factory=dict)

    @classmethod
    def along(cls, period_map: PeriodMap, low: float, span: float) -> OrbitProblem:
        """Return the orbits over a range of a map's own parameter."""
        return cls(period_map, (period_map.parameter,), np.array([low]), np.array([span]))

    @property
    def size(self) -> int:
        """Number k of coordinates of a state."""
        return len(self.map.scale)

    @cached_property
    def weight(self) -> np.ndarray:
        """Sizes (k,) by which states are divided."""
        return np.asarray(self.map.scale * math.sqrt(self.size))

    def row(self, number: int = -1) -> np.ndarray:
        """Return the unit row (k + m,) of a number: points in a plane normal to it have one value of that."""
        return np.eye(self.size + len(self.paths))[number]

    def pack(self, state: np.ndarray, *numbers: float) -> np.ndarray:
        """Return y (k + m,)."""
        return np.concatenate([state / self.weight, (np.array(numbers) - self.origin) / self.span])

    def state(self, y: np.ndarray) -> np.ndarray:
        """Return the state (k,)."""
        return np.asarray(y[: self.size] * self.weight)

    def numbers(self, y: np.ndarray) -> np.ndarray:
        """Return the numbers (m,)."""
        return np.asarray(self.origin + self.span * y[self.size :])

    def close(self, y: np.ndarray, share: float) -> float:
        """Return the scaled distance that is a fraction of the smallest number, at most of its range."""
        shares = np.abs(self.numbers(y) / self.span)
        return share * float(np.min(shares, where=shares > 0.0, initial=1.0))

    def at(self, y: np.ndarray) -> PeriodMap:
        """Return the map at the numbers of y. Raises InputError for numbers that make no scene."""
        if not self.paths:
            return self.map
        numbers = tuple(self.numbers(y).tolist())
        if numbers not in self._maps:
            _keep(self._maps, numbers, self.map.with_numbers(dict(zip(self.paths, numbers, strict=True))), _MAPS)
        return self._maps[numbers]

    def passage(self, y: np.ndarray, derivative: bool = True) -> Passage | None:
        """Return the passage of y; None if its numbers make no scene, or it has no end or no derivative."""
        key = np.append(y, derivative).tobytes()
        if key not in self._passages:
            try:
                passage: Passage | None = self._walked(self.at(y), y, derivative)
            except InputError:
                passage = None
            _keep(self._passages, key, passage if passage and passage.serves(derivative) else None, _PASSAGES)
        return self._passages[key]

    def _walked(self, along: PeriodMap, y: np.ndarray, derivative: bool) -> Passage:
        return (along.half if self.mirrored else along)(self.state(y), derivative)

    def residual(self, y: np.ndarray, passage: Passage) -> np.ndarray:
        """Return by how much an orbit misses itself, scaled (k,)."""
        return np.asarray(passage.state / self.weight - y[: self.size])

    def derivative(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the map in scaled coordinates."""
        return passage.scaled(self.map.scale)

    def amplitude(self, y: np.ndarray, passage: Passage) -> float:
        """Return the mean over whole periods of the largest displacement, m; a passage of a wave has a part of one."""
        if self.map.wave:
            passage = replace(self.at(y), wave=False, earlier=[])(self.state(y), False)
        return float(passage.peaks.mean())

    def by_state(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the residual by the state, with the anchor."""
        return np.asarray(self.derivative(passage) - np.eye(self.size) + self.anchor)

    def by_numbers(self, y: np.ndarray, count: int | None = None) -> np.ndarray:
        """Return the derivative (k, n) of the residual by the first scaled numbers, or all; nan where it is unknown."""
        paths = self.paths[:count]
        try:
            passage = self._walked(self.at(y).by(paths), y, True)
        except (InputError, NotSmooth):
            return np.full((self.size, len(paths)), np.nan)
        return np.asarray(passage.by_number / self.weight[:, None] * self.span[:count])

    def anchored(self, passage: Passage) -> OrbitProblem:
        """Return the problem whose `by_state` keeps the directions in which an orbit may be moved."""
        rows, sizes, columns = svd(self.derivative(passage) - np.eye(self.size))
        null = sizes <= NULL * max(1.0, sizes[0])
        return replace(self, anchor=rows[:, null] @ columns[null], _passages={})


def _keep(cache: dict[Any, Any], key: Any, value: Any, most: int) -> None:
    """Keep a value instead of the oldest of many."""
    cache[key] = value
    if len(cache) > most:
        del cache[next(iter(cache))]
