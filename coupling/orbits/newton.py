"""Newton's method for periodic orbits: a state that the period map takes to itself.

Orbits and the numbers that they depend on are zeros of one function (orbits.problem). With as many rows below as there
are numbers it says which zero is meant: that of a condition on the orbit, that in a plane (Keller 1977).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import lstsq

from vanedamp.coupling.derivatives.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.multipliers import NULL, decided, multipliers, null_space
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.quantities.quantity import QuantityRecord, table
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.display import Displayed

#: remedy where sectors have events at one instant
WAVE = "[orbit] wave = true finds the travelling wave of a tuned ring"
#: coordinates of a state that are printed one by one
_PRINTED = 12
#: scaled length of a Newton step after which the orbit is known to round-off, because its square is; of one after which
#: a condition is, too, whose slopes are learnt on the way; of one that says nothing of slopes
_SMALL, _SMALLER, _NOISE = 1e-8, 1e-10, 1e-12
#: scaled residual at round-off, over the size of the map's derivative, by which round-off of the state grows
_ROUND_OFF = 1e-13
#: scaled distance of an orbit from its mirror image
_SYMMETRIC = 1e-6
#: moments of an orbit at which a derivative on all sides is sought
_SECTIONS = 4


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
class PeriodicOrbit(QuantityRecord, Displayed):
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

        A kink at the start of a passage is none of the motion.
        """
        section = Section(0.0, self.map, self.state, self.passage)
        if self.map is None or self.passage.status not in (PassageStatus.GRAZING, PassageStatus.COINCIDENT):
            return section
        for periods in self._quiet():
            if (later := self.map.later(self.state, periods)) is None:
                continue
            passage = later[0](later[1])
            if passage.status is PassageStatus.OK:
                return Section(periods, *later, passage)
        return section

    def _quiet(self) -> list[float]:
        """Return times amid the longest intervals between events, in periods, the longest first."""
        assert self.map is not None
        times = self.map.times(self.passage)
        ends = np.array([*times, times[0] + self.periods] if times else [0.0, self.periods])
        longest = np.argsort(-np.diff(ends), kind="stable")[:_SECTIONS]
        return [float((ends[index] + ends[index + 1]) / 2 % self.periods) for index in longest]

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
        """Return the names of attributes, those of all quantities among them: a run decides which it has."""
        return [*object.__dir__(self), *table()]


class Zero(NamedTuple):
    """Where Newton's method has ended, and how: y (k + m,) of a problem, its passage, by how much it misses itself, as
    the largest fraction of the scale, and iterations."""

    status: OrbitStatus
    y: np.ndarray
    passage: Passage
    missed: float
    iterations: int

    @classmethod
    def of(cls, problem: OrbitProblem, orbit: PeriodicOrbit, *numbers: float) -> Zero:
        """Return that of an orbit at some numbers."""
        return cls(orbit.status, problem.pack(orbit.state, *numbers), orbit.passage, orbit.residual, orbit.iterations)

    def orbit(self, problem: OrbitProblem) -> PeriodicOrbit:
        """Return the record of it: the first number is the orbit's parameter."""
        stopped = self.status is OrbitStatus.STOPPED
        return PeriodicOrbit(
            self.status, float([*problem.numbers(self.y), math.nan][0]), problem.state(self.y), problem.map.periods,
            problem.map.scale, self.passage, self.missed, self.iterations, map=None if stopped else problem.at(self.y),
        )  # fmt: skip


def find_orbit(period_map: PeriodMap, start: np.ndarray) -> PeriodicOrbit:
    """Return the periodic orbit that Newton's method finds from a state (k,), or the last iterate and why it failed."""
    orbit = zero_of_map(period_map, start)
    return with_symmetry(orbit) if orbit.status is OrbitStatus.OK else orbit


def zero_of_map(period_map: PeriodMap, start: np.ndarray) -> PeriodicOrbit:
    """Return the same, without whether it is symmetric."""
    problem = OrbitProblem(period_map)
    return solve(problem, problem.pack(np.asarray(start, float)), np.zeros((0, problem.size))).orbit(problem)


def solve(
    problem: OrbitProblem, start: np.ndarray, row: np.ndarray, slopes: np.ndarray | None = None, iterations: int = 20,
    halvings: int = 10, level: float | None = None, condition: Callable[[np.ndarray, Passage], float] | None = None,
) -> Zero:  # fmt: skip
    """Return the zero in the plane where `row` (k + m,) times y is `level`, by default through `start` (k + m,).

    slopes: derivative of the residual near it (k, k + m), if it is known; with one more row below for that of
    `condition`, another function that is to vanish. The first block (k, k) is exact at every step, the rest is mended
    on the way (Broyden 1965). Steps are least squares of least norm, so that neutral coordinates stay where they are;
    a step that does not lessen the residual, such as one into another sequence of events, is halved. With a condition
    the sequence stays.
    """
    k, passage = problem.size, problem.passage(start)
    if passage is None:
        moves = problem.passage(start, False) is not None
        status = OrbitStatus.UNDETERMINED if moves else OrbitStatus.STOPPED
        return Zero(status, start, Passage.stopped(np.full(k, np.nan), problem.map.periods), math.nan, 0)

    def missed(y: np.ndarray, passage: Passage) -> np.ndarray:
        orbit = problem.residual(y, passage)
        return orbit if condition is None else np.append(orbit, condition(y, passage))

    y, residual, status, count = start, missed(start, passage), OrbitStatus.NOT_CONVERGED, 0
    J, plane = np.zeros((k, len(start))) if slopes is None else slopes.copy(), row @ start if level is None else level
    for count in range(1, iterations + 1):
        J[:k, :k] = problem.by_state(passage)
        # onto the orbits first
        begins = condition is not None and count == 1
        wanted = np.append(residual[:k], 0.0) if begins else residual
        step = least_squares(np.vstack([J, row]), -np.append(wanted, row @ y - plane))
        size, length = 1.0 + float(np.linalg.norm(y)), float(np.linalg.norm(step))
        last = length <= _SMALL * size
        bound = np.full(len(residual), np.inf) if begins or last else residual
        taken, changed = _taken(problem, missed, y, step, passage, bound, halvings)
        if taken is None:
            # near a bifurcation a residual at round-off is an orbit, and the next step is noise
            if float(np.abs(residual).max(initial=0.0)) <= _ROUND_OFF * _reach(problem, passage, size):
                status = OrbitStatus.OK
            elif changed:
                status = OrbitStatus.FORBIDDEN
            break
        moved, before = taken[0] - y, residual
        y, passage, residual = taken
        off = float(np.abs(residual[:k]).max(initial=0.0))
        known = condition is None or (
            not begins and (length <= _SMALLER * size or np.linalg.norm(residual) >= 0.1 * np.linalg.norm(before))
        )
        if last and known and off <= _ROUND_OFF * _reach(problem, passage, size):
            status = OrbitStatus.OK
            break
        if length > _NOISE * size:
            left = np.outer(residual - before - J @ moved, moved / float(moved @ moved))
            J[:, k:] += left[:, k:]
            J[k:, :k] += left[k:, :k]
    off = float(np.abs(residual[:k]).max(initial=0.0)) * math.sqrt(k)
    return Zero(status, y, passage, off, count)


def _reach(problem: OrbitProblem, passage: Passage, size: float) -> float:
    """Return the size of a passage's sums: scaled states times its derivative."""
    return size * (1.0 + float(np.abs(problem.derivative(passage)).max(initial=0.0)))


def _taken(
    problem: OrbitProblem, missed: Callable[[np.ndarray, Passage], np.ndarray], y: np.ndarray, step: np.ndarray,
    passage: Passage, bound: np.ndarray, halvings: int,
) -> tuple[tuple[np.ndarray, Passage, np.ndarray] | None, bool]:  # fmt: skip
    """Take a step, or the largest part of it that lessens the residual, as a whole or, by half, that of the orbit.

    bound: the residual that it must lessen; if it has a condition, the sequence of events stays. Returns y, its passage
    and its residual, or None, and whether the sequence changes on the way.
    """
    changed, share, k = False, 1.0, problem.size
    for _ in range(halvings):
        trial = y + share * step
        tried = problem.passage(trial) if np.isfinite(trial).all() else None
        if tried is not None and (len(bound) == k or tried.sequence == passage.sequence):
            residual = missed(trial, tried)
            less = np.linalg.norm(residual) < (1.0 - 1e-3 * share) * np.linalg.norm(bound)
            if less or np.linalg.norm(residual[:k]) < 0.5 * np.linalg.norm(bound[:k]):
                return (trial, tried, residual), changed
            changed = changed or tried.sequence != passage.sequence
        share /= 2
    return None, changed


def least_squares(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution of least norm, in which neutral coordinates do not move."""
    return np.asarray(lstsq(matrix, right, cond=NULL, check_finite=False)[0])


def with_symmetry(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return the orbit with whether it is symmetric, which takes another half of a period."""
    image = None if orbit.map is None else orbit.map.mirrored(orbit.state)
    if image is None:
        return orbit
    difference, size = (image - orbit.state) / orbit.scale, 1.0 + float(np.abs(orbit.state / orbit.scale).max())
    for free in null_space(orbit.derivative):  # where a body rests is nothing that a mirror could change
        difference = difference - free * (free @ difference)
    return replace(orbit, symmetric=bool(np.abs(difference).max() < _SYMMETRIC * size))
