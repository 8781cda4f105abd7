"""Borders of branches: their special points and peaks, followed over a second number of the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.orbits.border import Border, BorderPoint, SpecialPoint
from vanedamp.coupling.orbits.border_newton import Place, place_of, solved
from vanedamp.coupling.orbits.border_path import BorderPath, Named
from vanedamp.coupling.orbits.branch import Branch, stacked
from vanedamp.coupling.orbits.conditions import Clearance, Condition, Counts, Pair, Peak, Singular
from vanedamp.coupling.orbits.multipliers import decided, multipliers
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.orbits.surface import Surface
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.store import frozen

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
    begin: Callable[[], tuple[Surface, Place | None]]


class Borders:
    """The borders of some branches, found one after the other.

    period_map: of one excitation period; table: with the second number; origin, span: (2,) values of the two numbers at
    which the scaled ones are 0, and their ranges; second: its value on the branches; notes: what could not be done.
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
        """Take up what an interrupted search has finished."""
        self.finished = list(borders)

    def follow(self, branches: Sequence[Branch], changed: Callable[[int, int], None]) -> None:
        """Find all borders; changed: called with the number of places found and of those that there may be."""
        for number, branch in enumerate(branches):
            for kind, at, parameter, begin in self._candidates(branch):
                source = (number, at)
                if any(border.source == source for border in self.finished):
                    continue  # of a checkpoint
                surface, place = begin()
                if place is None:
                    why = _UNCLEAR if kind in _CLEAR else ""
                    where = f"branch {number} at {self.table.parameter} = {parameter:.9g}"
                    self.notes.append(f"the {kind} of {where} cannot be followed{why}")
                elif not self._known(kind, branch.periods, place.border):
                    self._follow(kind, branch.periods, source, surface, place, changed)
        if not self.finished and not self.notes:
            self.notes.append(f"orbit.track: the branches have none of {', '.join(self.track.kinds)}")

    def _known(self, kind: str, periods: int, y: np.ndarray) -> bool:
        """Say whether a border through y at the branches' second number was followed already."""
        return any((kind, periods) == (other, of) and np.abs(y - at).max() < _SAME for other, of, at in self._visited)

    def _follow(
        self, kind: str, periods: int, source: tuple[int, int], surface: Surface, place: Place,
        changed: Callable[[int, int], None],
    ) -> None:  # fmt: skip
        """Follow a border both ways from a place, as far as the ranges of the numbers allow."""
        paths: list[BorderPath] = []
        before = sum(len(border.parameter) for border in self.finished)
        for way in (-1.0, 1.0):
            path = BorderPath(surface, self.table, place._replace(tangent=way * place.tangent), self.own)
            paths.append(path)
            if not 0.0 <= self.own + _AHEAD * np.sign(path.head.tangent[-1]) <= 1.0:
                path.end = "the end of a number's range"
            while not path.end:
                path.advance(self.track.max_points)
                done = before + sum(len(each.places) for each in paths)
                changed(done, done + self.track.max_points)
            if path.end.startswith("closed"):
                break
        self._visited += [(kind, periods, y) for y in (place.border, *(y for path in paths for y in path.visits))]
        self.finished.append(_border(kind, periods, source, surface, paths))

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

    def _surface(self, branch: Branch, index: int, mirrored: bool = False) -> Surface:
        """Return the surface of orbits around a regular one of a branch."""
        nothing = np.zeros((len(self.map.scale), 0))
        paths = (self.table.parameter, self.track.parameter)
        surface = Surface(self.map.over(branch.periods), paths, self.origin, self.span, mirrored, nothing, nothing)
        passage = surface.passage(self._at(surface, branch.state[index], float(branch.parameter[index])))
        return surface if passage is None or mirrored else surface.neutral(surface.derivative(passage))

    def _at(self, surface: Surface, state: np.ndarray, parameter: float) -> np.ndarray:
        return surface.pack(state, np.array([parameter, self.second]))

    def _smooth(self, branch: Branch, point: SpecialPoint) -> tuple[Surface, Place | None]:
        """Return the first place of a fold, pitchfork, doubling or Neimark-Sacker border."""
        mirrored = point.kind == "pitchfork" or (point.kind == "fold" and bool(branch.symmetric[point.index]))
        surface, neutral = self._surface(branch, point.index, mirrored), int(branch.neutral[point.index])
        y = self._at(surface, point.state, point.parameter)
        passage = surface.passage(y)
        if passage is None or (mirrored and neutral):
            return surface, None
        condition: Condition
        if point.kind == "neimark-sacker":
            values = decided(multipliers(surface.derivative(passage))[0], neutral)
            turning = values[np.abs(values.imag) > 0.0]
            condition = Pair(surface, neutral, 2 * float(turning[np.argmin(np.abs(np.abs(turning) - 1.0))].real))
        else:
            condition = Singular.of(surface, point.kind, neutral, passage)
        return surface, self._first(surface, condition, y)

    def _clear(self, branch: Branch, point: SpecialPoint) -> tuple[Surface, Place | None]:
        """Return the first place of a border where an event grazes, from orbits without it.

        None if they may be moved: where a body may rest anywhere, that decides how near it comes.
        """
        near = [index for index in (point.index, point.index + 1) if index < len(branch.parameter)]
        near = [index for index in near if not branch.neutral[index]]
        events = [len(str(branch.sequence[index]).split("; ")) - (not branch.sequence[index]) for index in near]
        for _, index in sorted(zip(events, near, strict=True)):
            surface = self._surface(branch, index)
            here = self._at(surface, point.state, point.parameter)
            away = self._at(surface, branch.state[index], float(branch.parameter[index])) - here
            for way in _WAYS:
                y = here + way * away
                passage = surface.passage(y)
                if passage is None or "; ".join(passage.sequence) != branch.sequence[index]:
                    continue
                place = self._first(surface, Clearance(surface, 0), y)
                if place is not None and np.abs(place.border - here)[-2:].max() < _NEAR:
                    return surface, place
        return self._surface(branch, point.index), None

    def _peak(self, branch: Branch, index: int) -> tuple[Surface, Place | None]:
        """Return the first place of a peak next to the largest of a branch's orbits."""
        surface = self._surface(branch, index)
        y, before, after = (
            self._at(surface, branch.state[i], float(branch.parameter[i])) for i in (index, index - 1, index + 1)
        )
        return surface, self._first(surface, Peak(surface, int(branch.neutral[index]), (after - before)[:-1]), y)

    def _first(self, surface: Surface, condition: Condition, y: np.ndarray) -> Place | None:
        """Return the place of a border near y at the branches' second number; None if there is none."""
        row = np.eye(len(y))[-1]
        passage = surface.passage(y)
        near = None if passage is None else place_of(surface, condition, y, passage, row)
        return None if near is None else solved(surface, near, y, row, 1.0)


def _border(kind: str, periods: int, source: tuple[int, int], surface: Surface, paths: Sequence[BorderPath]) -> Border:
    """Return the record of a border that was followed one way or both."""
    back, ahead = paths if len(paths) > 1 else (None, paths[0])
    before = [] if back is None else back.places[:0:-1]
    places = [*before, *ahead.places]
    numbers = np.array([surface.numbers(place.border) for place in places])
    special = [(len(before) + index, named) for index, named in ahead.named]
    special += [] if back is None else [(len(before) - 1 - index, named) for index, named in back.named]
    found = [multipliers(surface.derivative(place.passage))[0] for place in places]
    counts = [_counts(place) for place in places]
    return Border(
        kind=kind, source=source, periods=periods, parameter=frozen(numbers[:, 0]), second=frozen(numbers[:, 1]),
        state=frozen([surface.state(place.border) for place in places]),
        multipliers=frozen([values**2 if surface.mirrored else values for values in found], complex),
        quantities=stacked([_quantities(surface, place.y) for place in places]),
        orbits=frozen([each.orbits for each in counts], int),
        stable_orbits=frozen([each.stable for each in counts], int),
        special=tuple(_point(surface, index, named) for index, named in sorted(special, key=lambda entry: entry[0])),
        ends=("closed" if back is None else back.end, ahead.end),
    )  # fmt: skip


def _quantities(surface: Surface, y: np.ndarray) -> dict[str, Any]:
    return surface.at(*surface.numbers(y).tolist()).quantities(surface.state(y))


def _point(surface: Surface, index: int, named: Named) -> BorderPoint:
    parameter, second = surface.numbers(named.y).tolist()
    return BorderPoint(index, parameter, named.kind, named.note, frozen(surface.state(named.y)), second)


def _counts(place: Place) -> Counts:
    """Return the orbits on both sides of a place, at smaller and larger values of the first number."""
    surface, along = place.condition.surface, place.columns[:, 0] * np.sign(place.condition.surface.span[0])
    state = np.linalg.lstsq(surface.deflated(place.passage), -along, rcond=None)[0]
    rate = float(place.gradient @ np.concatenate([state, [np.sign(surface.span[0]), 0.0]]))
    return place.condition.counts(place.passage, place.y, rate, along)
