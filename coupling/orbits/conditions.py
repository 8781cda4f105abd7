"""Conditions on orbits over two numbers: scalar functions that vanish where orbits bifurcate, graze or peak.

A singular matrix is seen by a bordered system, which is regular and whose last unknown vanishes with the determinant
(Griewank and Reddien 1984; Govaerts 2000, Numerical Methods for Bifurcations of Dynamical Equilibria, chapter 3).
Normal forms are those of maps (Kuznetsov 2004, Elements of Applied Bifurcation Theory, sections 5.4 and 9).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.linalg import eigvals, solve, svd

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.multipliers import decided, indicators
from vanedamp.coupling.orbits.problem import OrbitProblem

#: clearance, relative to its scale, up to which an orbit is followed that does not graze yet: the border itself is
#: extrapolated, which leaves its square
_LEVEL = 1e-7
#: scaled steps of differences: of first derivatives for a normal form, of amplitudes, and of conditions
_NORMAL_FORM, _AMPLITUDE, _STEP, _SMALL_STEP = 1e-4, 1e-5, 1e-7, 1e-2 * _LEVEL
#: by which they are shortened where another motion lies within them; and largest change of a derivative within one
_SHRINKS, _CHANGE = (1.0, 1e-2, 1e-4), 0.1


class Counts(NamedTuple):
    """Orbits that meet at a border, and stable ones of them, at a smaller and a larger first number: (2,) each."""

    orbits: tuple[int, int]
    stable: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Condition:
    """A condition on orbits over two numbers, with as many neutral multipliers as its orbits have.

    step: of its differences; level: by which its zero is away from the border.
    """

    problem: OrbitProblem
    neutral: int
    kind: ClassVar[str]
    step: ClassVar[float] = _STEP
    level: ClassVar[float] = 0.0

    def value(self, y: np.ndarray, passage: Passage) -> float:
        """Return the function that vanishes; nan where it is none."""
        raise NotImplementedError

    def slope(self, y: np.ndarray, passage: Passage, direction: np.ndarray) -> float:
        """Return its derivative along a direction (k + 2,), by differences; nan where it is unknown."""
        return difference(self.problem, self.value, y, passage, direction, self.step)

    def renewed(self, y: np.ndarray, passage: Passage) -> Condition:
        """Return the condition with references taken from a point of the border."""
        return self

    def multipliers(self, passage: Passage) -> np.ndarray:
        """Return the multipliers unknown to have modulus 1."""
        return decided(eigvals(self.problem.derivative(passage)), self.neutral)

    def tests(self, y: np.ndarray, passage: Passage) -> Mapping[str, float]:
        """Return functions that vanish at points of codimension two, by their names: here of other multipliers."""
        rest = indicators(self.multipliers(passage), 0)
        values = {"fold": rest.unity, "flip": rest.doubling, "Neimark-Sacker": rest.torus}
        return {f"{self.kind}-{name}": value for name, value in values.items()}

    def inside(self, passage: Passage) -> int:
        """Return 1 where all these multipliers lie inside the unit circle, else 0."""
        return int(np.all(np.abs(self.multipliers(passage)) < 1.0))

    def counts(self, passage: Passage, y: np.ndarray, rate: float, along: np.ndarray) -> Counts:
        """Return the orbits on both sides: here the orbit itself.

        rate: of the condition along the branch per its first number; along: (k,) slope of the residual by that.
        """
        return Counts((1, 1), (self.inside(passage), self.inside(passage)))


@dataclass(frozen=True, eq=False)
class Singular(Condition):
    """A multiplier of 1 or -1 of the map, by kind; b, c: (k,) borders of the singular matrix."""

    kind: str  # type: ignore[misc]
    b: np.ndarray
    c: np.ndarray

    @classmethod
    def of(cls, problem: OrbitProblem, kind: str, neutral: int, passage: Passage) -> Singular:
        """Return the condition by the singular vectors at a passage."""
        nothing = np.zeros(problem.size)
        condition = cls(problem, neutral, kind, nothing, nothing)
        left, _, right = svd(condition._matrix(passage))
        return replace(condition, b=left[:, -1], c=right[-1])

    @property
    def unit(self) -> float:
        """The multiplier, of a pitchfork over the mirrored half period."""
        return 1.0 if self.kind == "fold" else -1.0

    def _matrix(self, passage: Passage) -> np.ndarray:
        if self.unit > 0:
            return self.problem.by_state(passage)
        return self.problem.derivative(passage) + np.eye(self.problem.size)

    def _solved(self, passage: Passage) -> tuple[np.ndarray, np.ndarray, float]:
        """Return right and left null vectors (k,) and their remainder."""
        size = self.problem.size
        matrix = np.zeros((size + 1, size + 1))
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1, :-1] = self._matrix(passage), self.b, self.c
        right = solve(matrix, np.eye(size + 1)[-1])
        left = solve(matrix.T, np.eye(size + 1)[-1])
        return right[:-1], left[:-1], float(right[-1])

    def value(self, y: np.ndarray, passage: Passage) -> float:
        """Return the last unknown of the bordered system."""
        return self._solved(passage)[2]

    def renewed(self, y: np.ndarray, passage: Passage) -> Singular:
        """Return the condition with the null vectors of a passage as borders."""
        right, left, _ = self._solved(passage)
        return replace(self, b=left / np.linalg.norm(left), c=right / np.linalg.norm(right))

    def _normal_form(self, y: np.ndarray, passage: Passage) -> float:
        """Return the coefficient of the normal form, times the product of the null vectors; nan where it is unknown.

        Of a fold, of second order: zero at a cusp. Of the others, of third order: above zero, the orbits that bifurcate
        are as stable as the others were.
        """
        right, left, _ = self._solved(passage)
        M = self.problem.derivative(passage)
        for step in _NORMAL_FORM * np.array(_SHRINKS):
            sides = [self.problem.passage(y + way * step * np.append(right, (0.0, 0.0))) for way in (1, -1)]
            up, down = (
                self.problem.derivative(side)
                if side and side.sequence == passage.sequence
                else np.full(M.shape, np.nan)
                for side in sides
            )
            if np.abs(up - down).max() < _CHANGE * np.abs(M).max():
                break
        else:
            return np.nan
        second = (up - down) / (2 * step)
        if self.unit > 0:
            return float(left @ second @ right / 2)
        third = (up + down - 2 * M) / step**2
        bent = solve(np.eye(len(M)) - M, second @ right)
        return float(left @ third @ right / 6 + left @ second @ bent / 2)

    def multipliers(self, passage: Passage) -> np.ndarray:
        """Return the multipliers but those that are known to have modulus 1."""
        values = super().multipliers(passage)
        return np.delete(values, np.argmin(np.abs(values - self.unit)))

    def tests(self, y: np.ndarray, passage: Passage) -> Mapping[str, float]:
        """Return the product of the null vectors, the coefficient of the normal form, other multipliers."""
        right, left, _ = self._solved(passage)
        rest = indicators(self.multipliers(passage), 0)
        product, form = float(left @ right), self._normal_form(y, passage)
        if self.unit > 0:
            flip = "fold-pitchfork" if self.problem.mirrored else "fold-flip"
            values = {"cusp": form, "1:1 resonance": product, flip: rest.doubling}
        elif self.problem.mirrored:
            values = {"generalised pitchfork": form / product, "1:1 resonance": product, "fold-pitchfork": rest.unity}
        else:
            values = {"generalised doubling": form / product, "1:2 resonance": product, "fold-flip": rest.unity}
        return values | {f"{self.kind}-Neimark-Sacker": rest.torus}

    def counts(self, passage: Passage, y: np.ndarray, rate: float, along: np.ndarray) -> Counts:
        """Return two orbits on one side of a fold; of the others those that bifurcate, too."""
        right, left, _ = self._solved(passage)
        form, product = self._normal_form(y, passage), float(left @ right)
        inside = self.inside(passage)
        if self.unit > 0:
            larger = form * float(left @ along) < 0.0
            return Counts((0, 2), (0, inside)) if larger else Counts((2, 0), (inside, 0))
        inward, supercritical = -rate / product > 0.0, form / product > 0.0  # multiplier, by the first number
        new = 2 if self.problem.mirrored else 1
        own = (0, 1) if inward else (1, 0)
        # they are on the side where the others are unstable, if stable ones go out
        beside = own[::-1] if supercritical else own
        orbits = 1 + new * beside[0], 1 + new * beside[1]
        stable = [inside * (one + new * supercritical * there) for one, there in zip(own, beside, strict=True)]
        return Counts(orbits, (stable[0], stable[1]))


@dataclass(frozen=True, eq=False)
class MultiplierPair(Condition):
    """A pair of multipliers with the product 1; total: the sum of the pair that is meant, near the border."""

    kind = "neimark-sacker"
    total: float

    def _pair(self, passage: Passage) -> tuple[complex, complex, np.ndarray]:
        """Return product and sum of the pair, and the other multipliers."""
        values = super().multipliers(passage)
        pairs = list(itertools.combinations(range(len(values)), 2))
        ends = [(values[i] * values[j], values[i] + values[j]) for i, j in pairs]
        best = min(range(len(pairs)), key=lambda n: abs(ends[n][0] - 1.0) + abs(ends[n][1] - self.total))
        return (*ends[best], np.delete(values, pairs[best]))

    def multipliers(self, passage: Passage) -> np.ndarray:
        """Return the multipliers without the pair."""
        return self._pair(passage)[2]

    def value(self, y: np.ndarray, passage: Passage) -> float:
        """Return the product of the pair, less one."""
        return float(self._pair(passage)[0].real) - 1.0

    def renewed(self, y: np.ndarray, passage: Passage) -> MultiplierPair:
        """Return the condition on the pair of a passage."""
        return replace(self, total=float(self._pair(passage)[1].real))

    def tests(self, y: np.ndarray, passage: Passage) -> Mapping[str, float]:
        """Return the distance of the pair's angle from small fractions of a turn, and other multipliers."""
        total, rest = self._pair(passage)[1], indicators(self.multipliers(passage), 0)
        strong = {f"1:{n} resonance": total.real - at for n, at in ((1, 2.0), (2, -2.0), (3, -1.0), (4, 0.0))}
        return strong | {"fold-Neimark-Sacker": rest.unity, "flip-Neimark-Sacker": rest.doubling}

    def counts(self, passage: Passage, y: np.ndarray, rate: float, along: np.ndarray) -> Counts:
        """Return the orbit itself, stable on one side; the torus is not counted."""
        inside = self.inside(passage)
        return Counts((1, 1), (0, inside) if rate < 0.0 else (inside, 0))


@dataclass(frozen=True, eq=False)
class Clearance(Condition):
    """An event that does not happen, but nearly: orbits without it, whose distance to it is the level.

    after: of two events between which the time vanishes, in periods, the number of the first; None for a clearance.
    """

    kind = "grazing"
    step = _SMALL_STEP
    level = _LEVEL
    after: int | None = None

    @classmethod
    def of(cls, problem: OrbitProblem, y: np.ndarray, passage: Passage) -> Clearance:
        """Return the condition that nearly holds: of a clearance, or of the two events next to each other."""
        apart = np.diff(problem.at(y).times(passage))
        return cls(problem, 0, None if np.isfinite(passage.clearance[0]) or not len(apart) else int(apart.argmin()))

    def value(self, y: np.ndarray, passage: Passage) -> float:
        """Return the smallest clearance, or the time between two events, less the level."""
        least = passage.clearance[0]
        if self.after is not None:
            least = float(np.diff(self.problem.at(y).times(passage))[self.after])
        return least - self.level if np.isfinite(least) else np.nan

    def counts(self, passage: Passage, y: np.ndarray, rate: float, along: np.ndarray) -> Counts:
        """Return the orbit without the event, on one side; those with it are not counted."""
        inside = self.inside(passage)
        return Counts((0, 1), (0, inside)) if rate > 0.0 else Counts((1, 0), (inside, 0))


@dataclass(frozen=True, eq=False)
class Peak(Condition):
    """A largest amplitude along a branch over the first number; way: (k + 1,) direction of that branch."""

    kind = "peak"
    step = 10 * _AMPLITUDE
    way: np.ndarray

    def _tangent(self, y: np.ndarray, passage: Passage) -> np.ndarray | None:
        """Return the unit tangent (k + 1,) of the branch; None where it is unknown."""
        column = self.problem.by_numbers(y, 1)
        if not np.isfinite(column).all():
            return None
        tangent = svd(np.hstack([self.problem.by_state(passage), column]))[2][-1]
        return np.asarray(tangent if tangent @ self.way > 0.0 else -tangent)

    def value(self, y: np.ndarray, passage: Passage) -> float:
        """Return the slope of the logarithm of the amplitude along the branch."""
        mean, tangent = self.problem.amplitude(y, passage), self._tangent(y, passage)
        if tangent is None or mean == 0.0:
            return np.nan
        way = np.append(tangent, 0.0)
        return difference(self.problem, self.problem.amplitude, y, passage, way, _AMPLITUDE, False) / mean

    def renewed(self, y: np.ndarray, passage: Passage) -> Peak:
        """Return the condition with the branch at a passage."""
        way = self._tangent(y, passage)
        return self if way is None else replace(self, way=way)


def difference(
    problem: OrbitProblem, function: Callable[[np.ndarray, Passage], float], y: np.ndarray, passage: Passage,
    direction: np.ndarray, step: float, derivative: bool = True,
) -> float:  # fmt: skip
    """Return the derivative of a function of y and its passage along a direction (k + 2,), by central differences.

    Steps shrink as long as the sequence of events is another one, or the function unknown, on a side; then one side
    serves. nan where none does. derivative: whether the function needs passages'.
    """

    def value(at: np.ndarray) -> float:
        other = problem.passage(at, derivative)
        return np.nan if other is None or other.sequence != passage.sequence else function(at, other)

    for shrink in _SHRINKS:
        h = shrink * step
        sides = np.array([value(y + way * h * direction) for way in (1, -1)])
        if np.isfinite(sides).all():
            return float(sides[0] - sides[1]) / (2 * h)
    return float(np.fmax.reduce((sides - function(y, passage)) / [h, -h]))
