"""Borders of branches: their special points and peaks, followed over a second number of the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits.border import Border
from vanedamp.coupling.orbits.border_path import BorderPath
from vanedamp.coupling.orbits.branch import Branch, SpecialPoint
from vanedamp.coupling.orbits.conditions import Clearance, Condition, MultiplierPair, Peak, Singular
from vanedamp.coupling.orbits.curve import CurvePoint, beginning, near, regular
from vanedamp.coupling.orbits.multipliers import decided, multipliers
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.scene.orbit import Orbit as Table

#: scaled distance of special points that lie on one border, and of a border's point from the special point it begins at
_SAME, _NEAR = 1e-5, 1e-3
#: kinds whose event does not happen on one side
_CLEAR = ("grazing", "sequence")
_UNCLEAR = ": no event nearly happens next to it, or a body may rest anywhere"
#: scaled distance ahead that must lie in the range of the second number
_AHEAD = 1e-6
#: parts of the way from a grazing orbit to its neighbour on the branch from which Newton's method begins
_WAYS = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)


class _Candidate(NamedTuple):
    """Kind, special point of the branch (-1 less the number of an orbit for a peak), parameter and how to begin."""

    kind: str
    point: int
    parameter: float
    begin: Callable[[], CurvePoint | None]


class Borders:
    """The borders of some branches, found in turn.

    period_map: of one excitation period, or of waves; table: with the second number; origin, span: (2,) values of the
    two numbers at which the scaled ones are 0, and their ranges; second: its value on the branches; notes: what could
    not be done.
    """

    def __init__(
        self, period_map: PeriodMap, table: Table, origin: Sequence[float], span: Sequence[float], second: float
    ) -> None:
        assert table.track is not None
        self.map, self.table, self.track, self.second = period_map, table, table.track, second
        self.origin, self.span = np.array(origin), np.array(span)
        self.finished: list[Border] = []
        self.notes: list[str] = []
        self._visited: list[tuple[str, int, np.ndarray]] = []

    @property
    def own(self) -> float:
        """The scaled second number of the branches."""
        return float((self.second - self.origin[1]) / self.span[1])

    def resume(self, borders: Sequence[Border]) -> None:
        """Resume from an interrupted search."""
        self.finished = list(borders)

    def follow(self, branches: Sequence[Branch], changed: Callable[[int, int], None]) -> None:
        """Find all borders; changed: called with points found and possible."""
        for number, branch in enumerate(branches):
            for kind, at, parameter, begin in self._candidates(branch):
                source = (number, at)
                if any(border.source == source for border in self.finished):
                    continue  # of a checkpoint
                if (first := begin()) is None:
                    why = _UNCLEAR if kind in _CLEAR else ""
                    where = f"branch {number} at {self.table.parameter} = {parameter:.9g}"
                    self.notes.append(f"the {kind} of {where} cannot be followed{why}")
                elif not self._known(kind, branch.periods, first.exact):
                    self._follow(kind, branch.periods, source, first, changed)
        if not self.finished and not self.notes:
            self.notes.append(f"orbit.track: the branches have none of {', '.join(self.track.kinds)}")

    def _known(self, kind: str, periods: int, y: np.ndarray) -> bool:
        """Say whether a border through y at the branches' second number was followed already."""
        return any((kind, periods) == (other, of) and np.abs(y - at).max() < _SAME for other, of, at in self._visited)

    def _follow(
        self, kind: str, periods: int, source: tuple[int, int], first: CurvePoint, changed: Callable[[int, int], None]
    ) -> None:
        """Follow a border both ways from a point, as far as the ranges of the numbers allow."""
        paths: list[BorderPath] = []
        before = sum(len(border.parameter) for border in self.finished)
        for way in (-1.0, 1.0):
            head = replace(first, row=way * first.tangent)
            path = BorderPath(self.table, head, self.track.max_points, self.own)
            paths.append(path)
            if not 0.0 <= self.own + _AHEAD * np.sign(head.tangent[-1]) <= 1.0:
                path.end = path.edge
            while not path.end:
                path.advance()
                done = before + sum(len(each.points) for each in paths)
                changed(done, done + self.track.max_points)
            if path.end == path.closed:
                break
        self._visited += [(kind, periods, y) for y in (first.exact, *(y for path in paths for y in path.visits))]
        self.finished.append(_border(kind, periods, source, paths))

    # -- where borders begin

    def _candidates(self, branch: Branch) -> Iterator[_Candidate]:
        """Yield where borders of a branch may begin."""
        for number, point in enumerate(branch.special):
            if point.kind not in self.track.kinds or (point.kind == "pitchfork" and branch.periods > 1):
                continue  # where a doubled branch joins another one that doubles there
            begin = self._clear if point.kind in _CLEAR else self._smooth
            yield _Candidate(point.kind, number, point.parameter, partial(begin, branch, point))
        if "peak" in self.track.kinds:
            a, sequence = branch.amplitude_mean, branch.sequence
            for i in range(1, len(a) - 1):
                if a[i - 1] < a[i] >= a[i + 1] and sequence[i - 1] == sequence[i] == sequence[i + 1]:
                    yield _Candidate("peak", -1 - i, float(branch.parameter[i]), partial(self._peak, branch, i))

    def _problem(self, branch: Branch, index: int, mirrored: bool = False) -> OrbitProblem:
        """Return the problem of orbits around a regular one of a branch."""
        paths, along = (self.table.parameter, self.track.parameter), self.map.over(branch.periods)
        along = replace(along, wave=along.wave and not mirrored)
        problem = OrbitProblem(along, paths, self.origin, self.span, mirrored)
        passage = problem.passage(self._orbit(problem, branch, index))
        return problem if passage is None or mirrored else problem.anchored(passage)

    def _orbit(self, problem: OrbitProblem, branch: Branch, index: int) -> np.ndarray:
        return problem.pack(branch.state[index], float(branch.parameter[index]), self.second)

    def _smooth(self, branch: Branch, point: SpecialPoint) -> CurvePoint | None:
        """Return the first point of a fold, pitchfork, doubling or Neimark-Sacker border."""
        symmetric, neutral = bool(branch.symmetric[point.index]), int(branch.neutral[point.index])
        mirrored = point.kind == "pitchfork" or (point.kind == "fold" and symmetric and not self.map.wave)
        problem = self._problem(branch, point.index, mirrored)
        y = problem.pack(point.state, point.parameter, self.second)
        passage = problem.passage(y)
        if passage is None or (neutral and (mirrored or self.map.wave)):
            return None
        condition: Condition
        if point.kind == "neimark-sacker":
            values = decided(multipliers(problem.derivative(passage))[0], neutral)
            turning = values[np.abs(values.imag) > 0.0]
            condition = MultiplierPair(
                problem, neutral, 2 * float(turning[np.argmin(np.abs(np.abs(turning) - 1.0))].real)
            )
        else:
            condition = Singular.of(problem, point.kind, neutral, passage)
        return first_point(condition, y)

    def _clear(self, branch: Branch, point: SpecialPoint) -> CurvePoint | None:
        """Return the first point of a border where an event grazes, from orbits without it.

        None if they may be moved: where a body may rest anywhere, that decides how near it comes.
        """
        near = [index for index in (point.index, point.index + 1) if index < len(branch.parameter)]
        near = [index for index in near if not branch.neutral[index]]
        events = [len(str(branch.sequence[index]).split("; ")) - (not branch.sequence[index]) for index in near]
        for _, index in sorted(zip(events, near, strict=True)):
            problem = self._problem(branch, index)
            here = problem.pack(point.state, point.parameter, self.second)
            away = self._orbit(problem, branch, index) - here
            for way in _WAYS:
                y = here + way * away
                passage = problem.passage(y)
                if passage is None or "; ".join(passage.sequence) != branch.sequence[index]:
                    continue
                first = first_point(Clearance.of(problem, y, passage), y)
                if first is not None and np.abs(first.exact - here)[-2:].max() < _NEAR:
                    return first
        return None

    def _peak(self, branch: Branch, index: int) -> CurvePoint | None:
        """Return the first point of a peak next to the largest of a branch's orbits."""
        if self.map.wave and branch.neutral[index]:
            return None  # in a part, a body that may be moved replaces another
        problem = self._problem(branch, index)
        y, before, after = (self._orbit(problem, branch, i) for i in (index, index - 1, index + 1))
        return first_point(Peak(problem, int(branch.neutral[index]), (after - before)[:-1]), y)


def first_point(condition: Condition, y: np.ndarray) -> CurvePoint | None:
    """Return the point of a border near y (k + 2,) at its second number; None without."""
    row = condition.problem.row()
    guess = regular(beginning(condition.problem, y, row, condition))
    return guess and regular(near(guess, y, row, 1.0))


def _border(kind: str, periods: int, source: tuple[int, int], paths: Sequence[BorderPath]) -> Border:
    """Return the record of a border that was followed one way or both."""
    back, ahead = paths if len(paths) > 1 else (None, paths[0])
    before = [] if back is None else back.points[:0:-1]
    special = [replace(named, index=len(before) + named.index) for named in ahead.special]
    special += [] if back is None else [replace(named, index=len(before) - 1 - named.index) for named in back.special]
    return Border.of(
        [*before, *ahead.points], kind=kind, source=source, periods=periods,
        special=tuple(sorted(special, key=lambda named: named.index)),
        ends=("closed" if back is None else back.end, ahead.end),
    )  # fmt: skip
