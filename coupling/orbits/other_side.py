"""Orbits beyond the place where the sequence of events along a branch ends.

An orbit of another sequence is sought where the branch would continue, at the root of the distance along it where a
new impact grazes, and where an event passes the start of the period: there the state at the start jumps, by what the
event does, while the orbit continues as if nothing had happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Passage
from vanedamp.coupling.orbits.curve import Point, beginning, corrected, near
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import least_squares
from vanedamp.coupling.orbits.problem import Problem

#: note on a body that reaches a wall and has free travel on the other side
CENTRED = ": a body that may rest anywhere is moved to the middle of where it does not"
#: scaled distance within which a neutral coordinate is sought an end
_FARTHEST = 10.0
#: how often the search for the place of a new event is widened
_WIDENINGS = 6
#: periods from the start of one within which an event passes it; scaled distances of states beside it, and how much
#: farther one is that has jumped
_AT_START, _NEXT, _FARTHER = 1e-3, (1e-7, 1e-6), 1e3


def changed(head: Point, distances: Iterable[float]) -> Iterator[tuple[np.ndarray, Passage]]:
    """Yield states and numbers at distances along the tangent, and their passages, that have another sequence."""
    for distance in distances:
        y = head.y + distance * head.tangent
        passage = head.problem.passage(y)
        if passage is not None and passage.sequence != head.passage.sequence:
            yield y, passage


def jumped(head: Point) -> Iterator[tuple[np.ndarray, Passage]]:
    """Yield states and numbers, and their passages, next to where an orbit has jumped as an event passes the start.

    That is how a passage ends that begins next to the orbit, with the event at both of its ends.
    """
    problem = head.problem
    for size in _NEXT:
        for direction in np.eye(problem.size, len(head.y)):
            for way in (size, -size):
                y = head.y + size * head.tangent + way * direction
                if (passage := problem.passage(y)) is None:
                    continue
                image = np.append(passage.state / problem.weight, y[problem.size :])
                beyond = problem.passage(image) if np.linalg.norm(image - y) > _FARTHER * size else None
                if beyond is not None:
                    yield image, beyond


class OtherSide:
    """The search for orbits of other sequences; step, min_step: of the arclength of the branch."""

    def __init__(self, problem: Problem, step: float, min_step: float) -> None:
        self.problem, self.step, self.min_step = problem, step, min_step

    def find(self, last: Point, step: float) -> tuple[Point | None, str]:
        """Return an orbit beyond a change of sequence and how it was found."""
        for y, passage in changed(last, self.step * 10.0 ** np.arange(-3.0, -7.0, -1.0)):
            if (point := self._beside(last, y, passage)) is not None:
                return replace(point, row=(point.y - last.y) / np.linalg.norm(point.y - last.y)), ""
        for factor in (1.0, 2.0, 4.0):
            point = corrected(last, factor * step)
            if point is not None:
                return point, f", stepped over by {factor * step:.2g}"
        return None, ""

    def past_the_start(self, last: Point) -> Point | None:
        """Return the orbit beyond the last one where an event passes the start; None where none does."""
        times = self.problem.at(last.y).times(last.passage)
        if not times or min(times[0], self.problem.map.length - times[-1]) > _AT_START:
            return None
        for y, _ in jumped(last):
            beside = beginning(self.problem, y, last.tangent)
            point = beside and near(beside, y, last.tangent, 1e-2 * self.step)
            if point is not None:  # the number goes on, wherever the state has jumped
                return replace(point, row=np.copysign(1.0, last.tangent[-1]) * self.problem.row())
        return None

    def passage(self, last: Point) -> Passage | None:
        """Return a passage of the next sequence of events, of a state close to the last orbit; None if none is near."""
        return next((passage for _, passage in changed(last, self.step * 10.0 ** np.arange(-6.0, 0.0))), None)

    def centred(self, last: Point) -> Point | None:
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

    def _at_parameter(self, y: np.ndarray, last: Point) -> Point | None:
        """Return the point of the same sequence at the parameter of y; None if there is none."""
        point = near(last, y, self.problem.row())
        return point if point is not None and point.passage.sequence == last.passage.sequence else None

    def _amid(self, y: np.ndarray, last: Point) -> np.ndarray | None:
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

    def _beside(self, last: Point, y: np.ndarray, passage: Passage) -> Point | None:
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
            beside = beginning(problem, base + distance * last.tangent, alpha / length)
            point = beside and near(beside, beside.y, beside.row, 2 * length * measure)
            if point is not None and point.passage.sequence != sequence:
                return point
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
