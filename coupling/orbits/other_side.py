"""Orbits beyond the place where the sequence of events along a branch ends.

An orbit of another sequence is sought where the branch would continue, at the root of the distance along it where a
new impact grazes, and where an event passes the start of the period: there the state at the start jumps, by what the
event does, while the orbit continues as if nothing had happened. It is followed past that place by states at another
moment of the period.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.bifurcations import Located, bifurcations
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import (
    Orbit,
    Point,
    Problem,
    at_parameter,
    bordered,
    corrected,
    least_squares,
    near,
    point_of,
    reached,
)

#: note on a body that reaches a wall and has free travel on the other side
CENTRED = ": a body that may rest anywhere is moved to the middle of where it does not"
#: scaled distance within which a neutral coordinate is sought an end
_FARTHEST = 10.0
#: how often the search for the place of a new event is widened
_WIDENINGS = 6
#: periods from the start of one within which an event passes it; steps past it; scaled distance of a state behind
_AT_START, _STEPS, _BEHIND = 1e-3, 12, 1e-6


class OtherSide:
    """The search for orbits of other sequences; step, min_step: of the arclength of the branch."""

    def __init__(self, problem: Problem, step: float, min_step: float) -> None:
        self.problem, self.step, self.min_step = problem, step, min_step

    def find(self, last: Point, step: float) -> tuple[Point | None, str]:
        """Return an orbit beyond a change of sequence and how it was found."""
        sequence = last.orbit.passage.sequence
        for size in self.step * 10.0 ** np.arange(-3.0, -7.0, -1.0):
            y = last.y + size * last.tangent
            passage = self.problem.passage(y)
            if passage is None:
                continue
            if passage.sequence != sequence:
                orbit = self._beside(last, y, passage)
                if orbit is not None:
                    away = self.problem.pack(orbit.state, orbit.parameter) - last.y
                    return point_of(self.problem, orbit, away / np.linalg.norm(away)), ""
        for factor in (1.0, 2.0, 4.0):
            orbit = corrected(self.problem, last, factor * step)
            if orbit is not None:
                return point_of(self.problem, orbit, last.tangent), f", stepped over by {factor * step:.2g}"
        return None, ""

    def past_the_start(self, last: Point) -> tuple[Point, list[Located]] | None:
        """Return an orbit beyond the last one, where an event passes the start, and the bifurcations on the way.

        The branch is followed from where no event is near, to the end of the range at most. None where no event passes
        the start.
        """
        periods = last.orbit.periods
        times = self.problem.at(last.orbit.parameter).times(last.orbit.passage)
        if not times or min(times[0], periods - times[-1]) > _AT_START:
            return None
        apart = np.diff([*times, times[0] + periods])
        later = float(times[int(apart.argmax())] + 0.5 * apart.max()) % periods
        there = replace(self.problem, map=replace(self.problem.map, begin=later % 1.0, _earlier=[]))
        head = self._moved(self.problem, last, there, later)
        if head is None:
            return None
        found, step = list[Located](), self.step
        for _ in range(_STEPS):
            point = reached(there, head, step)
            if point is None:
                step /= 4
                continue
            for each in bifurcations(there, head, point):
                moved = self._state(there, each.orbit.state, each.orbit.parameter, periods - later)
                if moved is not None:
                    own = self.problem.at(each.orbit.parameter)
                    found.append(each._replace(orbit=replace(each.orbit, state=moved, map=own)))
            before = (
                bisect(there.at(each.orbit.parameter).times(each.orbit.passage), periods - later)
                for each in (head, point)
            )
            passed = len(set(before)) > 1
            head = point
            if passed or not 0.0 < point.y[-1] < 1.0:
                back = self._moved(there, point, self.problem, periods - later)
                return None if back is None else (back, found)
        return None

    def _moved(self, problem: Problem, point: Point, other: Problem, later: float) -> Point | None:
        """Return a point of a problem as one of another, whose section is some periods later; None if it is lost."""
        parameter = point.orbit.parameter
        behind = point.y - _BEHIND * point.tangent
        states = [
            self._state(problem, problem.state(y), problem.parameter(y), later) for y in (point.y, behind)
        ]  # fmt: skip
        if states[0] is None or states[1] is None:
            return None
        y, before = other.pack(states[0], parameter), other.pack(states[1], problem.parameter(behind))
        passage, row = other.passage(y), (y - before) / np.linalg.norm(y - before)
        if passage is None:
            return None
        orbit = replace(point.orbit, state=states[0], passage=passage, map=other.at(parameter))
        return point_of(other, orbit, row)

    @staticmethod
    def _state(problem: Problem, state: np.ndarray, parameter: float, later: float) -> np.ndarray | None:
        """Return where a motion from a state (k,) is some periods later."""
        found = problem.at(parameter).later(state, later)
        return None if found is None else found[1]

    def passage(self, last: Point) -> Passage | None:
        """Return a passage of the next sequence of events, of a state close to the last orbit; None if none is near."""
        for size in self.step * 10.0 ** np.arange(-6.0, 0.0):
            passage = self.problem.passage(last.y + size * last.tangent)
            if passage is not None and passage.sequence != last.orbit.passage.sequence:
                return passage
        return None

    def centred(self, last: Point) -> Point | None:
        """Return the orbit with its neutral coordinates centred in its sequence's range; None if they already are.

        A body that may rest anywhere is at a wall, though its motion has free travel on the other side. The tangent
        takes it on along the middle.
        """
        y = self._amid(last.y, last)
        if y is None or np.linalg.norm(y - last.y) < self.min_step:
            return None
        orbit = self._at_parameter(y, last)
        if orbit is None:
            return None
        tangent = last.tangent
        for ahead in (0.1 * self.step, 1e-3 * self.step):
            other = self._at_parameter(y + ahead * last.tangent, last)
            moved = None if other is None else self._amid(self.problem.pack(other.state, other.parameter), last)
            if moved is not None:
                tangent = (moved - y) / np.linalg.norm(moved - y)
                break
        return point_of(self.problem, orbit, tangent)

    def _at_parameter(self, y: np.ndarray, last: Point) -> Orbit | None:
        """Return the orbit of the same sequence at the parameter of y; None if there is none."""
        orbit = at_parameter(self.problem, y, last.slope)
        return orbit if orbit is not None and orbit.passage.sequence == last.orbit.passage.sequence else None

    def _amid(self, y: np.ndarray, last: Point) -> np.ndarray | None:
        """Return y with its neutral coordinates centred in its sequence's range; None for an orbit without any."""
        neutral = null_space(last.orbit.derivative)
        for free in neutral:
            direction, base = np.append(free, 0.0), y

            def stays(at: float, base: np.ndarray = base, direction: np.ndarray = direction) -> bool:
                passage = self.problem.passage(base + at * direction)
                return passage is not None and passage.sequence == last.orbit.passage.sequence

            reaches = [_reach(stays, sign) for sign in (-1.0, 1.0)]
            if max(map(abs, reaches)) < _FARTHEST:
                y = y + sum(reaches) / 2 * direction
        return y if len(neutral) else None

    def _beside(self, last: Point, y: np.ndarray, passage: Passage) -> Orbit | None:
        """Return an orbit of another sequence that begins where the present one ends; None if none is found.

        y, passage: beyond the end, along the tangent. The new event adds v k to the residual, k a direction and v a
        measure of the event, such as the speed of a grazing impact: a root of the distance along the tangent, so that
        orbits lie at last.y + v alpha to first order, (D - 1) alpha = -k (Nordmark 1991). Terms of second order, as
        that distance, are a root along the tangent.
        """
        problem, sequence = self.problem, last.orbit.passage.sequence
        residual = problem.residual(y, passage)
        kick = float(np.linalg.norm(residual))
        if kick == 0.0:
            return None
        here = bordered(problem, last.orbit.passage, last.slope, last.tangent)
        alpha = least_squares(here, np.append(-residual / kick, 0.0))
        length, away = float(np.linalg.norm(alpha)), float(np.linalg.norm(y - last.y))
        for share in (1e-3, 1e-2, 1e-1, 1.0):
            measure = share * self.step / length
            base = last.y + measure * alpha
            distance = self._root(last, base, away * min(measure / kick, (measure / kick) ** 2), residual)
            if distance is None:
                continue
            start = base + distance * last.tangent
            found = problem.passage(start)
            if found is None:
                continue
            orbit = near(problem, start, alpha / length, problem.slope(start), 2 * length * measure)
            if orbit is not None and orbit.passage.sequence != sequence:
                return orbit
        return None

    def _root(self, last: Point, base: np.ndarray, distance: float, residual: np.ndarray) -> float | None:
        """Return how far along the tangent from `base` the residual has no part in another; None if nowhere near."""

        def part(at: float) -> float:
            y = base + at * last.tangent
            passage = self.problem.passage(y, False)
            return np.nan if passage is None else float(residual @ self.problem.residual(y, passage))

        for _ in range(_WIDENINGS):
            if part(-distance) * part(distance) < 0.0:
                try:
                    return float(brentq(part, -distance, distance, xtol=1e-3 * distance, maxiter=60))
                except ValueError:
                    return None
            distance *= 10
        return None


def _reach(stays: Callable[[float], bool], sign: float) -> float:
    """Return how far a condition holds from 0 in a direction, at most some _FARTHEST."""
    low, high = 0.0, 1e-9
    while stays(sign * high) and high < _FARTHEST:
        low, high = high, 2 * high
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if stays(sign * middle) else (low, middle)
    return sign * low
