"""Pseudo-arclength continuation of a curve: orbits over one number, or over two with a condition on them.

A point is predicted along the tangent and corrected in the plane normal to it (Keller 1977), or away from folds at one
value of the number, whose scene is assembled once. Events on the way are zeros of test functions, seen by their signs
and located by their roots. Between events of the motion the period map is smooth, and so is a curve as long as the
sequence of events along its orbits stays; where it ends is located from there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import KroghInterpolator
from scipy.linalg import svd
from scipy.optimize import brentq

from vanedamp.coupling.derivatives.passage import Passage, forecast
from vanedamp.coupling.orbits.conditions import Condition
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit, Zero, least_squares, solve
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.orbits.waves import whole
from vanedamp.coupling.scene.orbit import Orbit as Table

#: corrections of a point before its step is shortened, which is better than many; how often one is halved; up to how
#: many a step grows: without a condition, and with one, whose slopes are learnt on the way
_EFFORT = ((8, 3, 3), (16, 10, 9))
#: cosines of the angle between tangents from which steps grow, and are good enough
_STRAIGHT, _BENT = 0.985, 0.9
#: distance from the tangent, relative to the step, up to which steps grow where they are predicted on a curve
_NEAR = 0.01
#: fraction of the numbers in a tangent below which it is at a turn of both; from which on it is away from folds
_FLAT, _STEEP = 0.05, 0.2
#: distances by which a prediction is moved to where the sequence of events is still that of the condition
_LIFTS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
#: relative error of numbers where an event is, or the sequence changes; and scaled one of a range's end
_CLOSE, _EDGE = 1e-10, 1e-9
#: attempts at a change of sequence, at least every third one a bisection
_ATTEMPTS = 120
#: a test function that is larger than this fraction of its ends' at its root has jumped there, and has no zero
_ZERO = 1e-3


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of a curve: a zero of a problem, and of the condition that a curve over two numbers has.

    zero: the orbit; row: (k + m,) direction in which the curve is followed; given: the condition, of the point before.
    """

    problem: OrbitProblem
    zero: Zero
    row: np.ndarray
    given: Condition | None = None

    @property
    def y(self) -> np.ndarray:
        """State and numbers (k + m,), scaled."""
        return self.zero.y

    @property
    def passage(self) -> Passage:
        """Of its orbit."""
        return self.zero.passage

    @cached_property
    def condition(self) -> Condition | None:
        """The condition with references taken from here."""
        return None if self.given is None else self.given.renewed(self.y, self.passage)

    @cached_property
    def orbit(self) -> PeriodicOrbit:
        """The record of its orbit."""
        orbit = self.zero.orbit(self.problem)
        return whole(orbit) if self.problem.map.wave else orbit

    @cached_property
    def columns(self) -> np.ndarray:
        """Derivative (k, m) of the residual by the numbers; nan where it is unknown."""
        return self.problem.by_numbers(self.y)

    @cached_property
    def gradient(self) -> np.ndarray:
        """Gradient (k + m,) of the condition among orbits, by differences; nan where it is unknown."""
        condition = self.condition
        assert condition is not None
        derivative = np.hstack([self.problem.by_state(self.passage), self.columns])
        if not np.isfinite(derivative).all():
            return np.full(len(self.y), np.nan)
        plane = svd(derivative)[2][-2:]
        slopes = plane.T @ [condition.slope(self.y, self.passage, direction) for direction in plane]
        return slopes if slopes.any() else np.full(len(slopes), np.nan)

    @cached_property
    def slopes(self) -> np.ndarray:
        """Derivative (k, k + m) of the residual by y, and below it the unit gradient of the condition."""
        columns = self.columns
        if self.given is None and not np.isfinite(columns).all():
            columns = np.zeros(columns.shape)
        orbit = np.hstack([self.problem.by_state(self.passage), columns])
        return orbit if self.given is None else np.vstack([orbit, self.gradient / np.linalg.norm(self.gradient)])

    @cached_property
    def tangent(self) -> np.ndarray:
        """Unit tangent (k + m,) on the side of the row, without neutral coordinates; nan where it is unknown."""
        if not np.isfinite(self.slopes).all():
            return np.full(len(self.y), np.nan)
        tangent = least_squares(np.vstack([self.slopes, self.row]), np.eye(len(self.y))[-1])
        length = float(np.linalg.norm(tangent))
        return tangent / length if length > 0.0 else self.row

    @property
    def exact(self) -> np.ndarray:
        """State and numbers where the condition is exact, from which its zero may be away by its level."""
        if self.condition is None or not self.condition.level:
            return self.y
        return np.asarray(self.y - self.condition.level * self.gradient / (self.gradient @ self.gradient))


def near(head: CurvePoint, predicted: np.ndarray, row: np.ndarray, distance: float = np.inf) -> CurvePoint | None:
    """Return the point of a head's curve in the plane through `predicted` (k + m,) normal to `row` (k + m,).

    None if there is none within a distance. Without a condition it may have another sequence of events.
    """
    problem, condition, slopes = head.problem, head.condition, head.slopes
    start, function = predicted, None
    iterations, halvings, _ = _EFFORT[condition is not None]
    if condition is not None:
        size = float(np.linalg.norm(head.gradient))
        for lift in _LIFTS:
            start = predicted + lift * head.gradient / size
            passage = problem.passage(start)
            if passage is not None and passage.sequence == head.passage.sequence:
                break
        else:
            return None

        def function(y: np.ndarray, passage: Passage) -> float:
            return condition.value(y, passage) / size

    for _ in range(2):
        zero = solve(problem, start, row, slopes, iterations, halvings, float(row @ predicted), function)
        problem.count["iterations"] += zero.iterations
        if zero.status is OrbitStatus.OK:
            return CurvePoint(problem, zero, row, condition) if np.linalg.norm(zero.y - predicted) <= distance else None
        # the slopes there, if the head's do not serve
        if condition is not None or (guess := beginning(problem, predicted, row)) is None:
            return None
        if np.array_equal(guess.columns, head.columns):
            return None
        slopes = guess.slopes
    return None


def beginning(
    problem: OrbitProblem, y: np.ndarray, row: np.ndarray, condition: Condition | None = None
) -> CurvePoint | None:
    """Return a point from whose slopes a zero near it may be found; None without a passage."""
    passage = problem.passage(y)
    return None if passage is None else CurvePoint(problem, Zero(OrbitStatus.OK, y, passage, np.nan, 0), row, condition)


def predicted(head: CurvePoint, at: float, known: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Return where a curve is expected (k + m,) at a distance along the tangent.

    That is on the tangent, or on the curve of least order that has it and passes the two nearest of some known points
    (k + m,). Next to an event that grazes, with a speed v, a state may be away from its orbit by some v^3 before its
    own sequence is another: there the tangent serves for steps of v^1.5 only.
    """
    places = {float((y - head.y) @ head.tangent): y for y in known}
    nearest = sorted(places.keys() - {0.0}, key=lambda t: abs(t - at))[:2]
    curve = KroghInterpolator([0.0, 0.0, *nearest], [head.y, head.tangent, *(places[t] for t in nearest)])
    return np.asarray(curve(at))


def corrected(
    head: CurvePoint, step: float, known: Sequence[np.ndarray] = (), row: np.ndarray | None = None
) -> CurvePoint | None:
    """Return the point in a plane, by default normal to the tangent, at a distance along it; None without."""
    return near(head, predicted(head, step, known), head.tangent if row is None else row, abs(step))


def _row(head: CurvePoint) -> np.ndarray:
    """Return the normal (k + m,) of the plane in which the next point is sought.

    Away from folds of a curve over one number that is its own: Newton's method then stays in one scene.
    """
    if head.given is not None or abs(head.tangent[-1]) < _STEEP:
        return head.tangent
    return np.copysign(1.0, head.tangent[-1]) * head.problem.row()


def reached(head: CurvePoint, step: float, known: Sequence[np.ndarray] = ()) -> CurvePoint | None:
    """Return the point at an arclength from another, at most at the ends of the ranges; None without.

    known: points (k + m,) from which it is predicted; where they lead to none of its sequence the tangent may.
    """
    row = _row(head)
    point = corrected(head, step, known, row)
    if point is None and row is not head.tangent:
        point = corrected(head, step, known)
    if known and (point is None or point.passage.sequence != head.passage.sequence):
        other = corrected(head, step, (), row)
        point = other if other and other.passage.sequence == head.passage.sequence else point
    if point is None:
        return None
    for number in range(head.problem.size, len(head.y)):
        y, edge = point.y, float(np.clip(point.y[number], 0.0, 1.0))
        if y[number] != edge and 0.0 <= head.y[number] <= 1.0 and abs(head.y[number] - edge) > _EDGE:
            ahead = y[number] - head.y[number]
            along = (edge - head.y[number]) / ahead * (y - head.y) @ head.tangent
            start = predicted(head, float(along), [y, *known])
            start[number] = edge
            point = near(head, start, np.copysign(1.0, ahead) * head.problem.row(number), step) or point
    return regular(point)


def regular(point: CurvePoint | None) -> CurvePoint | None:
    """Return a point if its tangent is known, else None."""
    return point if point is not None and np.isfinite(point.tangent).all() else None


def located(
    before: CurvePoint, after: CurvePoint, tests: Callable[[CurvePoint], Mapping[str, float]]
) -> list[tuple[float, str, CurvePoint]]:
    """Return arclengths, names and points of zeros of test functions between two points, in order."""
    low, high, zeros = tests(before), tests(after), list[tuple[float, str, CurvePoint]]()
    for name in [name for name in low if low[name] * high[name] < 0.0]:

        def function(point: CurvePoint, name: str = name) -> float:
            return tests(point)[name]

        if (zero := _root(before, after, function, max(abs(low[name]), abs(high[name])))) is not None:
            zeros.append((zero[0], name, zero[1]))
    return sorted(zeros, key=lambda entry: entry[0])


def _root(
    before: CurvePoint, after: CurvePoint, function: Callable[[CurvePoint], float], size: float
) -> tuple[float, CurvePoint] | None:
    """Return arclength and point of a test function's zero between two points; None if it jumps.

    Points are predicted from those that are known: near a pitchfork Newton's method, whose derivative is singular
    there, has only a small part of its way left for it. Where even that is too much, a branch's zero is the chord's.
    """
    length = float((after.y - before.y) @ before.tangent)
    points: dict[float, CurvePoint] = {0.0: before, length: after}

    def value(at: float) -> float:
        if at not in points:
            point = corrected(before, at, [point.y for point in points.values()])
            if point is None or point.passage.sequence != before.passage.sequence:
                raise _Lost
            points[at] = point
        return function(points[at])

    try:
        root = brentq(value, 0.0, length, xtol=before.problem.close(before.y, _CLOSE), maxiter=100)
        value(root)
    except _Lost:
        if before.given is not None or (chord := _on_chord(points, function)) is None:
            return None
        root = chord
    except (ValueError, RuntimeError):
        return None
    return (root, points[root]) if abs(function(points[root])) <= _ZERO * size else None


class _Lost(Exception):
    """No point was found where one was sought."""


def _on_chord(points: dict[float, CurvePoint], function: Callable[[CurvePoint], float]) -> float | None:
    """Add a test function's zero on the chord of the two points next to it. Returns its arclength, None without one."""
    one, other = sorted(points, key=lambda at: abs(function(points[at])))[:2]
    near, far = points[one], points[other]
    share = function(near) / (function(near) - function(far))
    root, y = one + share * (other - one), near.y + share * (far.y - near.y)
    if (passage := near.problem.passage(y)) is None:
        return None
    points[root] = replace(near, zero=near.zero._replace(y=y, passage=passage))
    return root


class Path:
    """A curve while it is followed from a point one way, within the ranges of its numbers.

    head: the last point; trail: y (k + m,) of some of its sequence before it; points: data of all; special: its
    named points; step: the next one; end: why it is not followed further, "" while it is. What a curve watches, keeps
    and does where its sequence ends is said by its kind.
    """

    #: record of a named point; why a path ends at the end of a range, and where it began
    named: ClassVar[Callable[..., Any]]
    edge: ClassVar[str]
    closed: ClassVar[str]

    def __init__(self, table: Table, head: CurvePoint, most: int) -> None:
        self.table, self.head, self.most, self.problem = table, head, most, head.problem
        self.first, self.step, self.end, self.trail = head.y, table.step, "", list[np.ndarray]()
        self.points, self.special = [self._kept(head)], list[Any]()

    def advance(self) -> None:
        """Add the next point, with the named points before it, or end the path."""
        if len(self.points) >= self.most:
            self._end(f"max_points ({self.most}) reached", self.head)
            return
        head, step, failed, least = self.head, self.step, self.step, self.table.min_step
        while step >= least:
            point = reached(head, step, self.trail)
            if point is None:
                failed, step = step, step / 4
                continue
            if point.passage.sequence != head.passage.sequence:
                failed = step
                break
            cosine = float(point.tangent @ head.tangent)
            if step <= 2 * least or (cosine > _BENT and not self._leaps(head, point)):
                bend = float(np.linalg.norm(point.y - head.y - step * head.tangent))
                quick = point.zero.iterations <= _EFFORT[point.given is not None][2] and cosine > _STRAIGHT
                quick = quick and (not self.trail or bend <= _NEAR * step)
                self.step = min(1.5 * step, self._longest(point)) if quick else max(step, least)
                if (last := self._passed(head, point)) is not None:
                    self._onward(last)
                return
            step /= 2
        self._cross(failed, *self._last(head, failed))

    def _longest(self, point: CurvePoint) -> float:
        """Return the longest step: with a condition states may change fast, and it is the numbers' that is bounded."""
        numbers = point.tangent[self.problem.size :]
        return self.table.max_step / (1.0 if point.given is None else max(float(np.linalg.norm(numbers)), _FLAT))

    def _add(self, before: CurvePoint, point: CurvePoint) -> None:
        """Add a point, and the end if it is one."""
        self.head, self.trail = point, []
        self.points.append(self._kept(point))
        if not self.end and (why := self._ending(before, point)):
            self._end(why, point)

    def _onward(self, point: CurvePoint) -> None:
        """Add the next point of a smooth piece.

        Shorter steps are better with a condition, whose slopes are learnt on the way, and where a body may rest
        anywhere, which would creep along a wall: then nothing is predicted from points before.
        """
        alone = point.given is not None or point.orbit.neutral
        trail = [] if alone else [*self.trail[-1:], self.head.y]
        self._add(self.head, point)
        self.trail = trail

    def _ending(self, before: CurvePoint, point: CurvePoint) -> str:
        """Say why the path ends at a point that was added; "" if it does not."""
        numbers = point.y[self.problem.size :]
        if np.any((numbers <= _EDGE) | (numbers >= 1.0 - _EDGE)):
            return self.edge
        return self.closed if len(self.points) > 3 and self._returned(before, point) else ""

    def _returned(self, before: CurvePoint, point: CurvePoint) -> bool:
        """Say whether the path passes its first point between two."""
        piece, first = point.y - before.y, self.first - before.y
        share = first @ piece / max(float(piece @ piece), np.finfo(float).tiny)
        return bool(0.0 <= share < 1.0 and np.linalg.norm(first - share * piece) < 0.05 * np.linalg.norm(piece))

    def _last(self, head: CurvePoint, step: float) -> tuple[CurvePoint, CurvePoint | None, bool]:
        """Return the last point of the present sequence within a step, and the first beyond it, None if none is near.

        And whether it is Newton's method that comes no further from the head, for nothing vanishes there: of orbits
        that may not be moved, as others meet unknown walls.

        Test functions that vanish where sequences change (speeds of crossings, clearances, times between events) say
        where to look; bisection makes it sure.
        """
        low, high, seen = 0.0, step, [(0.0, head)]
        beyond: CurvePoint | None = None
        close = self.problem.close(head.y, _CLOSE)
        for attempt in range(_ATTEMPTS):
            if high - low <= close:
                break
            at = forecast([(where, point.passage) for where, point in seen[-2:]])
            middle, margin = (low + high) / 2, max(1e-3 * (high - low), close / 4)
            if at is None or not low <= at <= high or attempt % 3 == 2:
                at = middle
            else:
                at = float(np.clip(at + (margin if attempt % 3 else -margin), low + margin / 2, high - margin / 2))
            point = corrected(head, at, [*self.trail, *(each.y for _, each in seen)])
            if point is not None and point.passage.sequence == head.passage.sequence:
                low = at
                seen.append((at, point))
            else:
                high, beyond = at, point
        end, least = forecast([(where, point.passage) for where, point in seen[-2:]]), self.table.min_step
        lost = low > least and (end is None or end - low > least) and not head.orbit.neutral
        return seen[-1][1], beyond, lost and regular(seen[-1][1]) is not None

    def _note(self, point: CurvePoint, kind: str, note: str) -> None:
        y = point.exact
        numbers, state = self.problem.numbers(y).tolist(), self.problem.state(y)
        self.special.append(self.named(len(self.points) - 1, kind, note, state, *numbers))

    # -- by kind of curve

    def _kept(self, point: CurvePoint) -> Any:
        """Return a point's data."""
        raise NotImplementedError

    def _leaps(self, before: CurvePoint, point: CurvePoint) -> bool:
        """Say whether a point lies on another sheet than the one before it."""
        return False

    def _passed(self, before: CurvePoint, point: CurvePoint) -> CurvePoint | None:
        """Note special points on the way to a point. Returns the point to add: another where the path ends, or None."""
        raise NotImplementedError

    def _cross(self, step: float, last: CurvePoint, beyond: CurvePoint | None, lost: bool) -> None:
        """Continue with another sequence of events, or with the last point where that is lost, or end the path.

        step: that leads from the head beyond the end of the sequence; last, beyond: points on both sides of it (_last).
        """
        raise NotImplementedError

    def _end(self, why: str, point: CurvePoint) -> None:
        """End the path at a point."""
        self.end = why
