"""Newton's method for periodic orbits: a state that the period map takes to itself.

Orbits and their parameter are zeros of one function of y = (state, parameter), both scaled: the state by the map's
scale and the square root of its size, the parameter by the range of the branch. A last row says which zero is meant:
the one of a given parameter, or the one at a given arclength (Keller 1977).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import lstsq

from vanedamp.coupling.derivatives.differences import NotSmooth
from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.multipliers import NULL, decided, multipliers, null_space
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.quantities.quantity import Measured, table
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.display import Displayed
from vanedamp.files.toml_input import InputError

#: what to do where sectors have events at one instant
WAVE = "[orbit] wave = true finds the travelling wave of a tuned ring"
#: coordinates of a state that are printed one by one
_PRINTED = 12
#: scaled length of a Newton step after which the orbit is known to round-off, because its square is
_SMALL = 1e-8
#: scaled residual of an orbit, over the size of its map's derivative, which is what round-off of the state grows by
_RESIDUAL = 1e-13
#: the same for an orbit whose map's derivative is nearly singular, so that steps do not become small
_ROUND_OFF = 1e-13
#: scaled distance of an orbit from its mirror image
_SYMMETRIC = 1e-6
#: corrections of a point of a branch before its step is shortened, which is better than many
_ITERATIONS, _HALVINGS = 8, 3
#: moments of an orbit at which a derivative on all sides is sought
_SECTIONS = 4
#: scenes that are kept for the next step
_MAPS = 3


class OrbitStatus(StrEnum):
    """How the search for an orbit ended.

    FORBIDDEN: the orbits that Newton's method heads for have another sequence of events than it assumes; UNDETERMINED:
    the motion comes to its end, but has no derivative there, as where sectors of a ring have events at one instant.
    """

    OK = "ok"
    NOT_CONVERGED = "not_converged"
    FORBIDDEN = "sequence_forbidden"
    STOPPED = "engine_stopped"
    UNDETERMINED = "derivative_undetermined"


class Section(NamedTuple):
    """A moment of an orbit: periods after its start, the period map that begins then, state (k,) and passage."""

    later: float
    map: PeriodMap | None
    state: np.ndarray
    passage: Passage


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Measured, Displayed):
    """A periodic orbit, or the last state of a search for one. All its quantities are attributes (results.md).

    parameter: of the branch, nan without one; state: (k,) at the start of the excitation's period; periods: of the
    excitation; scale: (k,) by which coordinates are compared; passage: its own; residual: largest fraction of the scale
    by which it misses itself; iterations: of Newton's method; symmetric: whether it is its own mirror image half a
    period later; map: whose orbit it is.
    """

    status: OrbitStatus
    parameter: float
    state: np.ndarray
    periods: int
    scale: np.ndarray
    passage: Passage
    residual: float
    iterations: int
    symmetric: bool = False
    map: PeriodMap | None = field(default=None, repr=False)

    def shown(self) -> dict[str, Any]:
        """Return the results that are printed, by name: of an orbit that was not found, how the search ended."""
        names = ["status", "parameter", "periods", "residual", "iterations"]
        if self.status is OrbitStatus.OK:
            names += ["stable", "multipliers", "neutral", "symmetric"]
        values = {name: getattr(self, name) for name in names} | dict(self.quantities) | {"state": self.state}
        if self.map is None:
            return values
        if self.status is OrbitStatus.UNDETERMINED and self.map.travelling is not None:
            values["hint"] = WAVE
        values["parameter"] = f"{self.map.parameter} = {self.parameter:.6g} {unit_of(self.map.parameter)}".removesuffix(
            " 1"
        )
        if len(self.state) <= _PRINTED:
            values |= dict(zip(self.map.names, self.state.tolist(), strict=True)) | {"state": None}
        return values

    def printed_units(self) -> Mapping[str, str]:
        """Return the units of the results that have one, by name."""
        units = {name: table()[name].unit for name in self.quantities if table()[name].unit != "1"}
        if self.map is not None:
            mode = "m" if self.map.scene.structure.model == "rigid" else "kg^0.5 m"
            for name in self.map.names:
                unit = "rad" if " tilt" in name else mode if name.startswith("mode") else "m"
                units[name] = f"{unit}/s" if name.endswith(" rate") else unit
        return units

    @cached_property
    def derivative(self) -> np.ndarray:
        """The derivative (k, k) of the period map in scaled coordinates."""
        return self.passage.scaled(self.scale)

    @cached_property
    def section(self) -> Section:
        """Where its derivative is taken: at the start of the period unless an event or a contact at rest makes a kink.

        A kink at the start of a passage is none of the motion, whose neighbours come to that event or rest as it does.
        """
        own = Section(0.0, self.map, self.state, self.passage)
        if self.map is None or self.passage.status not in (PassageStatus.GRAZING, PassageStatus.COINCIDENT):
            return own
        for periods in self._quiet():
            if (later := self.map.later(self.state, periods)) is None:
                continue
            passage = later[0](later[1])
            if passage.status is PassageStatus.OK:
                return Section(periods, *later, passage)
        return own

    def _quiet(self) -> list[float]:
        """Return times amid the longest intervals between events, in periods, the longest first."""
        assert self.map is not None
        times = self.map.times(self.passage)
        ends = np.array([*times, times[0] + self.periods] if times else [0.0, self.periods])
        longest = np.argsort(-np.diff(ends), kind="stable")[:_SECTIONS]
        return [float((ends[place] + ends[place + 1]) / 2 % self.periods) for place in longest]

    @cached_property
    def _multipliers(self) -> tuple[np.ndarray, int]:
        return multipliers(self.section.passage.scaled(self.scale))

    @property
    def multipliers(self) -> np.ndarray:
        """Multipliers (k,) complex, the largest first."""
        return self._multipliers[0]

    @property
    def neutral(self) -> int:
        """How many multipliers are 1 because the orbit may be moved: of bodies at rest or in free flight."""
        return self._multipliers[1]

    @property
    def undetermined(self) -> bool:
        """Whether multipliers say nothing of stability: the period map has no derivative that holds on all sides."""
        return self.section.passage.status is not PassageStatus.OK

    @property
    def stable(self) -> bool:
        """Whether all multipliers but the neutral ones lie inside the unit circle, and decide the stability."""
        return not self.undetermined and bool(np.all(np.abs(decided(*self._multipliers)) < 1.0))

    @cached_property
    def quantities(self) -> Mapping[str, Any]:  # type: ignore[override]
        """Its quantities by name, from one run over its periods (orbit_quantities); none of one that was not found."""
        if self.status is not OrbitStatus.OK or self.map is None:
            return {}
        status = self.section.passage.status.value
        return self.map.over(self.periods).quantities(self.state, *self._multipliers, status)

    def __dir__(self) -> Iterable[str]:
        """Return the names of attributes, those of all quantities among them: what it has takes a run to know."""
        return [*object.__dir__(self), *table()]


class Point(NamedTuple):
    """An orbit on a branch: y = (state, parameter) scaled (k + 1,), slope of the residual by the parameter (k,),
    unit tangent of the branch (k + 1,)."""

    y: np.ndarray
    orbit: Orbit
    slope: np.ndarray
    tangent: np.ndarray


class Scaled:
    """Orbits of a period map over numbers of its scene, in scaled coordinates y = (state, numbers).

    map: with any values of the numbers; paths: of these; origin, span: values at which the scaled ones are 0, and their
    ranges; mirrored: whether orbits are symmetric, and the map takes half a period (PeriodMap.half).
    """

    map: PeriodMap
    paths: tuple[str, ...]
    origin: Any
    span: Any
    mirrored = False
    #: passages that are kept for the next step, which often wants them again; more would fill the memory
    _MOST = 16

    @property
    def size(self) -> int:
        """Number of coordinates of a state."""
        return len(self.map.scale)

    @cached_property
    def weight(self) -> np.ndarray:
        """Sizes (k,) by which states are divided: the mean square of a scaled state counts."""
        return np.asarray(self.map.scale * math.sqrt(self.size))

    def pack(self, state: np.ndarray, numbers: Any) -> np.ndarray:
        """Return y of a state (k,) and the numbers."""
        return np.append(state / self.weight, np.where(np.isnan(self.origin), 0.0, (numbers - self.origin) / self.span))

    def state(self, y: np.ndarray) -> np.ndarray:
        """Return the state (k,)."""
        return np.asarray(y[: self.size] * self.weight)

    def numbers(self, y: np.ndarray) -> np.ndarray:
        """Return the numbers; nan for a map without."""
        return np.asarray(self.origin + self.span * y[self.size :])

    @cached_property
    def _maps(self) -> dict[tuple[float, ...], PeriodMap]:
        return {}

    @cached_property
    def _passages(self) -> dict[bytes, Passage | None]:
        return {}

    def at(self, *numbers: float) -> PeriodMap:
        """Return the map at values of the numbers. Raises InputError for values that make no scene."""
        if any(map(math.isnan, numbers)):
            return self.map
        if numbers not in self._maps:
            _keep(self._maps, numbers, self.map.with_numbers(dict(zip(self.paths, numbers, strict=True))), _MAPS)
        return self._maps[numbers]

    def passage(self, y: np.ndarray, derivative: bool = True) -> Passage | None:
        """Return the passage of y; None if its numbers make no scene, or it has no end, or no derivative if wanted."""
        key = np.append(y, derivative).tobytes()
        if key not in self._passages:
            _keep(self._passages, key, self._walked(y, derivative), self._MOST)
        return self._passages[key]

    def _walked(self, y: np.ndarray, derivative: bool = True, paths: tuple[str, ...] = ()) -> Passage | None:
        """Return a passage, with derivatives by some of the numbers."""
        try:
            along = self.at(*self.numbers(y).tolist())
        except InputError:
            return None
        along = replace(along, numbers=paths) if paths else along
        passage = (along.half if self.mirrored else along)(self.state(y), derivative)
        return passage if passage.serves(derivative) or paths else None

    def columns(self, y: np.ndarray, numbers: int) -> np.ndarray | None:
        """Return the derivative (k, n) of the residual by the first n scaled numbers; None where it is unknown."""
        try:
            passage = self._walked(y, True, self.paths[:numbers])
        except NotSmooth:
            return None
        if passage is None:
            return None
        found = passage.by_number / self.weight[:, None] * np.atleast_1d(self.span)[:numbers]
        return found if np.isfinite(found).all() else None

    def residual(self, y: np.ndarray, passage: Passage) -> np.ndarray:
        """Return by how much an orbit misses itself, scaled (k,)."""
        return np.asarray(passage.state / self.weight - y[: self.size])

    def derivative(self, passage: Passage) -> np.ndarray:
        """Return the derivative (k, k) of the map in scaled coordinates."""
        return passage.scaled(self.map.scale)


@dataclass(frozen=True, eq=False)
class Problem(Scaled):
    """Orbits of a period map over a range of its parameter. origin: nan for a map without; count: of iterations."""

    map: PeriodMap
    origin: float = math.nan
    span: float = 1.0
    count: Counter[str] = field(default_factory=Counter)

    @property
    def paths(self) -> tuple[str, ...]:  # type: ignore[override]
        """Path of the parameter."""
        return (self.map.parameter,)

    @cached_property
    def along_parameter(self) -> np.ndarray:
        """The unit row (k + 1,) of the parameter: orbits in a plane normal to it have one value of that."""
        return np.append(np.zeros(self.size), 1.0)

    def parameter(self, y: np.ndarray) -> float:
        """Return the parameter, nan for a map without."""
        return float(self.numbers(y)[0])

    def slope(self, y: np.ndarray) -> np.ndarray:
        """Return the derivative of the residual by the scaled parameter (k,); 0 where there is none."""
        columns = self.columns(y, 1)
        return np.zeros(self.size) if columns is None else columns[:, 0]


def _keep(kept: dict[Any, Any], key: Any, value: Any, most: int) -> None:
    """Keep a value in place of the oldest of many."""
    kept[key] = value
    if len(kept) > most:
        del kept[next(iter(kept))]


def find_orbit(period_map: PeriodMap, start: np.ndarray) -> Orbit:
    """Return the periodic orbit that Newton's method finds from a state (k,), or the last iterate and why it failed."""
    problem = Problem(period_map)
    start = problem.pack(np.asarray(start, float), math.nan)
    orbit = solve(problem, start, problem.along_parameter, np.zeros(problem.size))
    return with_symmetry(problem, orbit) if orbit.status is OrbitStatus.OK else orbit


def solve(
    problem: Problem, start: np.ndarray, row: np.ndarray, slope: np.ndarray, iterations: int = 20, halvings: int = 10
) -> Orbit:
    """Return the orbit in the plane through `start` (k + 1,) normal to `row` (k + 1,).

    slope: derivative of the residual by the parameter (k,), near the orbit: the steps mend it on the way.
    Steps are least squares of least norm, so that neutral coordinates stay where they are; a step that does not lessen
    the residual, such as one into another sequence of events, is halved.
    """
    y, passage = start, problem.passage(start)
    if passage is None:
        state, periods = problem.state(start), problem.map.periods
        parameter, nothing = problem.parameter(start), Passage.stopped(np.full(problem.size, np.nan), periods)
        status, motion = OrbitStatus.STOPPED, problem.passage(start, False)
        if motion is not None:
            status = OrbitStatus.UNDETERMINED
        known = None if motion is None else problem.at(parameter)
        return Orbit(status, parameter, state, periods, problem.map.scale, nothing, math.nan, 0, map=known)
    residual, status, count = problem.residual(y, passage), OrbitStatus.NOT_CONVERGED, 0
    scale = problem.map.scale
    for count in range(1, iterations + 1):  # noqa: B007
        right = np.append(-residual, -row @ (y - start))
        step = least_squares(bordered(problem, passage, slope, row), right)
        size = 1.0 + float(np.linalg.norm(y))
        last = float(np.linalg.norm(step)) <= _SMALL * size
        bound = math.inf if last else float(np.linalg.norm(residual))
        taken, changed = _taken(problem, y, step, passage, bound, halvings)
        if taken is None:
            # near a bifurcation a residual at round-off is an orbit, and the next step is noise
            if float(np.abs(residual).max(initial=0.0)) <= _ROUND_OFF * _reach(passage, scale, size):
                status = OrbitStatus.OK
            else:
                status = OrbitStatus.FORBIDDEN if changed else status
            break
        moved = taken[0] - y
        y, passage, residual = taken
        # what an exact slope would have left is of second order (Broyden's update, of this column only)
        slope = slope + residual * (moved[-1] / max(float(moved @ moved), np.finfo(float).tiny))
        missed = float(np.abs(residual).max(initial=0.0))
        if last and missed <= _RESIDUAL * _reach(passage, scale, size):
            status = OrbitStatus.OK
            break
    missed = float(np.abs(residual).max(initial=0.0)) * math.sqrt(problem.size)
    return Orbit(
        status, problem.parameter(y), problem.state(y), problem.map.periods, scale, passage, missed, count,
        map=problem.at(problem.parameter(y)),
    )  # fmt: skip


def corrected(problem: Problem, head: Point, step: float) -> Orbit | None:
    """Return the orbit in the plane normal to the tangent, at a distance along it; None if there is none near."""
    return near(problem, head.y + step * head.tangent, head.tangent, head.slope, abs(step))


def reached(problem: Problem, head: Point, step: float) -> Point | None:
    """Return the point at an arclength from another, at most the end of the range; None if there is none."""
    orbit = corrected(problem, head, step)
    if orbit is None:
        return None
    y = problem.pack(orbit.state, orbit.parameter)
    edge = 1.0 if y[-1] > 1.0 else 0.0
    if not 0.0 <= y[-1] <= 1.0 and 0.0 <= head.y[-1] <= 1.0:
        share = (edge - head.y[-1]) / (y[-1] - head.y[-1])
        start = head.y + share * (y - head.y)
        start[-1] = edge
        orbit = at_parameter(problem, start, head.slope) or orbit
    return point_of(problem, orbit, head.tangent)


def near(problem: Problem, predicted: np.ndarray, row: np.ndarray, slope: np.ndarray, distance: float) -> Orbit | None:
    """Return the orbit in the plane through a point; with the slope there, if the one given does not serve."""
    for renewed in (False, True):
        if renewed:
            given, passage = slope, problem.passage(predicted)
            if passage is None or np.array_equal(given, slope := problem.slope(predicted)):
                return None
        orbit = solve(problem, predicted, row, slope, _ITERATIONS, _HALVINGS)
        problem.count["iterations"] += orbit.iterations
        if orbit.status is OrbitStatus.OK:
            off = np.linalg.norm(problem.pack(orbit.state, orbit.parameter) - predicted)
            return orbit if off <= distance else None
    return None


def at_parameter(problem: Problem, y: np.ndarray, slope: np.ndarray) -> Orbit | None:
    """Return the orbit near y (k + 1,) with its parameter; None if there is none near."""
    orbit = solve(problem, y, problem.along_parameter, slope, _ITERATIONS, _HALVINGS)
    return orbit if orbit.status is OrbitStatus.OK else None


def _reach(passage: Passage, scale: np.ndarray, size: float) -> float:
    """Return the size of a passage's sums: scaled states times its derivative."""
    return size * (1.0 + float(np.abs(passage.scaled(scale)).max(initial=0.0)))


def _taken(
    problem: Problem, y: np.ndarray, step: np.ndarray, passage: Passage, bound: float, halvings: int
) -> tuple[tuple[np.ndarray, Passage, np.ndarray] | None, bool]:
    """Take a step, or the largest part of it that brings the residual below a bound.

    Returns y, its passage and its residual, or None, and whether the sequence of events changes on the way.
    """
    changed, share = False, 1.0
    for _ in range(halvings):
        trial = y + share * step
        found = problem.passage(trial) if np.isfinite(trial).all() else None
        if found is not None:
            residual = problem.residual(trial, found)
            if np.linalg.norm(residual) < (1.0 - 1e-3 * share) * bound:
                return (trial, found, residual), changed
            changed = changed or found.sequence != passage.sequence
        share /= 2
    return None, changed


def bordered(problem: Problem, passage: Passage, slope: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return the derivative of the residual by y, and a row below it (k + 1, k + 1)."""
    matrix = np.empty((problem.size + 1, problem.size + 1))
    matrix[:-1, :-1] = problem.derivative(passage) - np.eye(problem.size)
    matrix[:-1, -1], matrix[-1] = slope, row
    return matrix


def tangent_of(problem: Problem, passage: Passage, slope: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return the unit tangent of the branch (k + 1,), on the side of `row`, without neutral coordinates."""
    tangent = least_squares(bordered(problem, passage, slope, row), problem.along_parameter)
    length = float(np.linalg.norm(tangent))
    return tangent / length if length > 0.0 else row


def point_of(problem: Problem, orbit: Orbit, row: np.ndarray) -> Point:
    """Return an orbit as a point of a branch that continues in the direction of `row` (k + 1,)."""
    y = problem.pack(orbit.state, orbit.parameter)
    slope = problem.slope(y)
    return Point(y, orbit, slope, tangent_of(problem, orbit.passage, slope, row))


def passes(before: np.ndarray, after: np.ndarray, place: np.ndarray) -> bool:
    """Say whether the way from one y to the next leads past another."""
    piece = after - before
    share = (place - before) @ piece / max(float(piece @ piece), np.finfo(float).tiny)
    away = np.linalg.norm(place - before - share * piece)
    return bool(0.0 <= share < 1.0 and away < 0.05 * np.linalg.norm(piece))


def least_squares(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution (k + 1,) of least norm, in which neutral coordinates do not move."""
    return np.asarray(lstsq(matrix, right, cond=NULL, check_finite=False)[0])


def with_symmetry(problem: Problem, orbit: Orbit) -> Orbit:
    """Return the orbit with whether it is symmetric, which takes another half of a period."""
    found = problem.at(orbit.parameter).mirrored(orbit.state)
    if found is None:
        return orbit
    difference, size = (found - orbit.state) / orbit.scale, 1.0 + float(np.abs(orbit.state / orbit.scale).max())
    for free in null_space(orbit.derivative):  # where a body rests is nothing that a mirror could change
        difference = difference - free * (free @ difference)
    return replace(orbit, symmetric=bool(np.abs(difference).max() < _SYMMETRIC * size))
