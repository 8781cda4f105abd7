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
#: scenes and passages that are kept for the next step, which often wants them again; more would fill the memory
_MAPS, _PASSAGES = 3, 16


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


@dataclass(frozen=True, eq=False)
class Scaled:
    """Orbits of a period map in scaled coordinates."""

    map: PeriodMap

    @property
    def size(self) -> int:
        """Number of coordinates of a state."""
        return len(self.map.scale)

    @cached_property
    def weight(self) -> np.ndarray:
        """Sizes (k,) by which states are divided: the mean square of a scaled state counts."""
        return np.asarray(self.map.scale * math.sqrt(self.size))


@dataclass(frozen=True, eq=False)
class Problem(Scaled):
    """Orbits of a period map over a range of its parameter, scaled.

    origin: parameter at which the scaled one is 0, nan for a map without; span: range of the parameter; count: of
    passages so far.
    """

    origin: float = math.nan
    span: float = 1.0
    count: Counter[str] = field(default_factory=Counter)
    _maps: dict[float, PeriodMap] = field(default_factory=dict)
    _passages: dict[bytes, Passage | None] = field(default_factory=dict)

    @cached_property
    def along_parameter(self) -> np.ndarray:
        """The unit row (k + 1,) of the parameter: orbits in a plane normal to it have one value of that."""
        return np.append(np.zeros(self.size), 1.0)

    def at(self, parameter: float) -> PeriodMap:
        """Return the map at a value of the parameter. Raises InputError for one that is no scene."""
        if math.isnan(parameter):
            return self.map
        if parameter not in self._maps:
            keep(self._maps, parameter, self.map.at(parameter), _MAPS)
        return self._maps[parameter]

    def parameter(self, y: np.ndarray) -> float:
        """Return the parameter, nan for a map without."""
        return self.origin + self.span * float(y[-1])

    def pack(self, state: np.ndarray, parameter: float) -> np.ndarray:
        """Return y (k + 1,)."""
        share = 0.0 if math.isnan(self.origin) else (parameter - self.origin) / self.span
        return np.append(state / self.weight, share)

    def passage(self, y: np.ndarray) -> Passage | None:
        """Return the passage of y; None if its parameter makes no scene, or the passage has no end or no derivative."""
        return self._passage(y[:-1] * self.weight, self.parameter(y))

    def motion(self, y: np.ndarray) -> Passage | None:
        """Return the passage of y without its derivative; None if its parameter makes no scene, or it has no end."""
        return self._passage(y[:-1] * self.weight, self.parameter(y), False)

    def _passage(self, state: np.ndarray, parameter: float, derivative: bool = True) -> Passage | None:
        key = np.append(state, (parameter, derivative)).tobytes()
        if key not in self._passages:
            keep(self._passages, key, self._walked(state, parameter, derivative), _PASSAGES)
        return self._passages[key]

    def _walked(self, state: np.ndarray, parameter: float, derivative: bool) -> Passage | None:
        self.count["passages"] += 1
        try:
            passage = self.at(parameter)(state, derivative)
        except InputError:
            return None
        return passage if passage.serves(derivative) else None

    def residual(self, y: np.ndarray, passage: Passage) -> np.ndarray:
        """Return by how much an orbit misses itself, scaled (k,)."""
        return np.asarray(passage.state / self.weight - y[:-1])

    def slope(self, y: np.ndarray) -> np.ndarray:
        """Return the derivative of the residual by the scaled parameter (k,); 0 where there is none."""
        try:
            along = replace(self.at(self.parameter(y)), numbers=(self.map.parameter,))
            found = along(y[:-1] * self.weight).by_number[:, 0]
        except (InputError, NotSmooth):
            return np.zeros(self.size)
        known = np.asarray(found / self.weight * self.span)
        return known if np.isfinite(known).all() else np.zeros(self.size)


def keep(kept: dict[Any, Any], key: Any, value: Any, most: int) -> None:
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
        state, periods = start[:-1] * problem.weight, problem.map.periods
        parameter, nothing = problem.parameter(start), Passage.stopped(np.full(problem.size, np.nan), periods)
        status, motion = OrbitStatus.STOPPED, problem.motion(start)
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
        status, problem.parameter(y), y[:-1] * problem.weight, problem.map.periods, scale, passage, missed, count,
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
    matrix[:-1, :-1] = passage.scaled(problem.map.scale) - np.eye(problem.size)
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
