"""Orbits beyond the point where the sequence of events along a branch ends.

An orbit of another sequence is sought where the branch would continue, at the root of the distance along it where a
new impact grazes, and where an event passes the start of the period: there the state at the start jumps, by what the
event does, while the orbit continues as if nothing had happened. It is followed further by states at another
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
from vanedamp.coupling.orbits.curve import CurvePoint, beginning, corrected, near, reached
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import least_squares
from vanedamp.coupling.orbits.problem import OrbitProblem

#: note on a body that reaches a wall and has free travel on the other side
CENTRED = ": a body that may rest anywhere is moved to the middle of where it does not"
#: scaled distance within which a neutral coordinate is sought an end
_FARTHEST = 10.0
#: how often the search for a new event is widened
_WIDENINGS = 6
#: periods from the start of one within which an event passes it; steps past it; scaled distance of a state behind
_AT_START, _STEPS, _BEHIND = 1e-3, 12, 1e-6


class OtherSide:
    """The search for orbits of other sequences; step, min_step: of the arclength of the branch."""

    def __init__(self, problem: OrbitProblem, step: float, min_step: float) -> None:
        self.problem, self.step, self.min_step = problem, step, min_step

    def find(self, last: CurvePoint, step: float) -> tuple[CurvePoint | None, str]:
        """Return an orbit beyond a change of sequence and how it was found."""
        for size in self.step * 10.0 ** np.arange(-3.0, -7.0, -1.0):
            y = last.y + size * last.tangent
            passage = self.problem.passage(y)
            if passage is not None and passage.sequence != last.passage.sequence:
                point = self._beside(last, y, passage)
                if point is not None:
                    return replace(point, row=(point.y - last.y) / np.linalg.norm(point.y - last.y)), ""
        for factor in (1.0, 2.0, 4.0):
            point = corrected(last, factor * step)
            if point is not None:
                return point, f", stepped over by {factor * step:.2g}"
        return None, ""

    def past_the_start(self, last: CurvePoint) -> tuple[CurvePoint, list[Located]] | None:
        """Return an orbit beyond the last one, where an event passes the start, and the bifurcations on the way.

        The branch is followed from where no event is near, to the end of the range at most. None where no event passes
        the start.
        """
        times = self.problem.at(last.y).times(last.passage)
        if not times or min(times[0], (length := self.problem.map.length) - times[-1]) > _AT_START:
            return None
        apart = np.diff([*times, times[0] + length])
        later = float(times[int(apart.argmax())] + 0.5 * apart.max()) % length
        begin = (self.problem.map.begin + later) % min(length, 1.0)
        there = replace(self.problem, map=replace(self.problem.map, begin=begin, earlier=[]), _maps={}, _passages={})
        head = _moved(last, there, later)
        if head is None:
            return None
        events, step = list[Located](), self.step
        for _ in range(_STEPS):
            point = reached(head, step)
            if point is None:
                step /= 4
                continue
            for each in bifurcations(head, point):
                y = _later(there, each.point.y, length - later)
                if y is not None:
                    moved = replace(each.point, problem=self.problem, zero=each.point.zero._replace(y=y))
                    events.append(each._replace(point=moved))
            before = (bisect(there.at(each.y).times(each.passage), length - later) for each in (head, point))
            passed = len(set(before)) > 1
            head = point
            if passed or not 0.0 < point.y[-1] < 1.0:
                back = _moved(point, self.problem, length - later)
                return None if back is None else (back, events)
        return None

    def passage(self, last: CurvePoint) -> Passage | None:
        """Return a passage of the next sequence of events, of a state close to the last orbit; None if none is near."""
        for size in self.step * 10.0 ** np.arange(-6.0, 0.0):
            passage = self.problem.passage(last.y + size * last.tangent)
            if passage is not None and passage.sequence != last.passage.sequence:
                return passage
        return None

    def centred(self, last: CurvePoint) -> CurvePoint | None:
        """Return the orbit with its neutral coordinates centred in its sequence's range; None if they already are.

        A body that may rest anywhere is at a wall, though its motion has free travel on the other side. The tangent
        takes it on along the middle.
        """
        y = self._amid(last.y, last)
        if y is None or np.linalg.norm(y - last.y) < self.min_step:
            return None
        point = self._at_parameter(y, last)
        if point is None:
            return None
        tangent = last.tangent
        for ahead in (0.1 * self.step, 1e-3 * self.step):
            other = self._at_parameter(y + ahead * last.tangent, last)
            moved = None if other is None else self._amid(other.y, last)
            if moved is not None:
                tangent = (moved - y) / np.linalg.norm(moved - y)
                break
        return replace(point, row=tangent)

    def _at_parameter(self, y: np.ndarray, last: CurvePoint) -> CurvePoint | None:
        """Return the point of the same sequence at the parameter of y; None without."""
        point = near(last, y, self.problem.row())
        return point if point is not None and point.passage.sequence == last.passage.sequence else None

    def _amid(self, y: np.ndarray, last: CurvePoint) -> np.ndarray | None:
        """Return y with its neutral coordinates centred in its sequence's range; None for an orbit without any."""
        neutral = null_space(last.orbit.derivative)
        for free in neutral:
            direction, base = np.append(free, 0.0), y

            def stays(at: float, base: np.ndarray = base, direction: np.ndarray = direction) -> bool:
                passage = self.problem.passage(base + at * direction)
                return passage is not None and passage.sequence == last.passage.sequence

            reaches = [_reach(stays, sign) for sign in (-1.0, 1.0)]
            if max(map(abs, reaches)) < _FARTHEST:
                y = y + sum(reaches) / 2 * direction
        return y if len(neutral) else None

    def _beside(self, last: CurvePoint, y: np.ndarray, passage: Passage) -> CurvePoint | None:
        """Return a point of another sequence that begins where the present one ends; None if none is found.

        y, passage: beyond the end, along the tangent. The new event adds v k to the residual, k a direction and v a
        measure of the event, such as the speed of a grazing impact: a root of the distance along the tangent, so that
        orbits lie at last.y + v alpha to first order, (D - 1) alpha = -k (Nordmark 1991). Terms of second order, as
        that distance, are a root along the tangent.
        """
        problem, sequence = self.problem, last.passage.sequence
        residual = problem.residual(y, passage)
        kick = float(np.linalg.norm(residual))
        if kick == 0.0:
            return None
        alpha = least_squares(np.vstack([last.slopes, last.tangent]), np.append(-residual / kick, 0.0))
        length, away = float(np.linalg.norm(alpha)), float(np.linalg.norm(y - last.y))
        for share in (1e-3, 1e-2, 1e-1, 1.0):
            measure = share * self.step / length
            base = last.y + measure * alpha
            distance = self._root(last, base, away * min(measure / kick, (measure / kick) ** 2), residual)
            if distance is None:
                continue
            guess = beginning(problem, base + distance * last.tangent, alpha / length)
            point = guess and near(guess, guess.y, guess.row, 2 * length * measure)
            if point is not None and point.passage.sequence != sequence:
                return point
        return None

    def _root(self, last: CurvePoint, base: np.ndarray, distance: float, residual: np.ndarray) -> float | None:
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


def _moved(point: CurvePoint, other: OrbitProblem, later: float) -> CurvePoint | None:
    """Return a point in another problem, some periods later; None if lost."""
    y, before = (_later(point.problem, at, later) for at in (point.y, point.y - _BEHIND * point.tangent))
    if y is None or before is None:
        return None
    return beginning(other, y, (y - before) / np.linalg.norm(y - before))


def _later(problem: OrbitProblem, y: np.ndarray, later: float) -> np.ndarray | None:
    """Return state and number (k + 1,) some periods later on the motion from y (k + 1,)."""
    image = problem.at(y).later(problem.state(y), later)
    return None if image is None else problem.pack(image[1], *problem.numbers(y))


def _reach(stays: Callable[[float], bool], sign: float) -> float:
    """Return how far a condition holds from 0 in a direction, at most some _FARTHEST."""
    low, high = 0.0, 1e-9
    while stays(sign * high) and high < _FARTHEST:
        low, high = high, 2 * high
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if stays(sign * middle) else (low, middle)
    return sign * low
