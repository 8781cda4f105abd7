"""Pseudo-arclength continuation of a branch of orbits, over folds, bifurcations and changes of the event sequence.

Between events the period map is smooth, and so is a branch as long as the sequence of events along the orbit stays.
Where the sequence changes a branch may have a kink, turn back or end. That point is located from the side where the
branch comes from; then an orbit of the other sequence is looked for: along the branch, in the direction in which the
event grows, and in the image of both (an event that passes the start of the period).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from vanedamp.coupling.orbits.bifurcations import Located, bifurcations
from vanedamp.coupling.orbits.branch import Branch, BranchPoint, SpecialPoint
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import (
    Orbit,
    OrbitStatus,
    Point,
    Problem,
    bordered,
    least_squares,
    point_of,
    solve,
    tangent_of,
    with_symmetry,
)
from vanedamp.coupling.orbits.passage import Passage
from vanedamp.coupling.orbits.period_start import past_the_start
from vanedamp.coupling.orbits.sequence_changes import change, forecast
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: corrections of a point before its step is shortened
_ITERATIONS, _HALVINGS = 8, 3
#: iterations up to which, and cosines of the angle between tangents from which, steps grow; and are good enough
_QUICK, _STRAIGHT, _BENT = 3, 0.985, 0.9
#: scaled distance of an orbit from itself half of its periods later, where it is known by its root
_SAME = 1e-4
#: relative error of the parameter where the sequence changes
_CLOSE = 1e-10
#: what happens to a body that comes to a wall and has room on the other side
_CENTRED = ": a body that may rest anywhere is moved to the middle of where it does not"
#: scaled distance within which a neutral coordinate is looked for an end
_FARTHEST = 10.0
#: how often the search for the place of a new event is widened
_WIDENINGS = 6
#: attempts at the place of a change of sequence, at least every third one a bisection
_ATTEMPTS = 120


@dataclass(eq=False)
class Trace:
    """A branch while it is followed: its orbits, the last of them with its tangent, and the next step.

    source: the branch and the special point that it was switched from; end: why it is not followed further, "" while
    it is.
    """

    points: list[BranchPoint]
    special: list[SpecialPoint]
    head: Point
    step: float
    source: tuple[int, int] | None = None
    end: str = ""


class Follower:
    """Continuation of the branches of one problem, within its range of the parameter."""

    def __init__(self, problem: Problem, table: Table) -> None:
        self.problem, self.table = problem, table

    def begin(self, orbit: Orbit, row: np.ndarray, source: tuple[int, int] | None = None) -> Trace:
        """Return a branch of one orbit that goes on in the direction of `row` (k + 1,)."""
        head = point_of(self.problem, orbit, row)
        return Trace([BranchPoint.of(with_symmetry(self.problem, orbit))], [], head, self.table.step, source)

    def resume(self, branch: Branch, tangent: np.ndarray, step: float) -> Trace | None:
        """Return a branch that was interrupted, from its last point and the tangent there; None if that is no orbit."""
        last = branch.points[-1]
        y = self.problem.pack(last.state, last.parameter)
        passage = self.problem.passage(y)
        if passage is None:
            return None
        missed = float(np.abs(self.problem.residual(y, passage)).max(initial=0.0))
        orbit = Orbit(
            OrbitStatus.OK, last.parameter, last.state, branch.periods, self.problem.map.scale, passage, missed, 0
        )
        head = Point(y, orbit, self.problem.slope(y, passage), tangent)
        return Trace(branch.points, list(branch.special), head, step, branch.source, branch.end)

    def branch(self, trace: Trace) -> Branch:
        """Return the record of a branch, whole or not."""
        return Branch.of(trace.points, self.problem.map.periods, trace.special, trace.end, trace.source)

    def advance(self, trace: Trace) -> None:
        """Add the next point to a branch, with the special points before it, or end it."""
        if len(trace.points) >= self.table.max_points:
            self._end(trace, f"max_points ({self.table.max_points}) reached", trace.head.orbit)
            return
        head, step, failed = trace.head, trace.step, trace.step
        while step >= self.table.min_step:
            point = self._reach(head, step)
            if point is None:
                failed, step = step, step / 4
                continue
            if point.orbit.passage.sequence != head.orbit.passage.sequence:
                failed = step
                break
            if point.tangent @ head.tangent > _BENT or step <= 2 * self.table.min_step:
                if not self._search(trace, head, point):
                    self._accept(trace, head, point)
                quick = point.orbit.iterations <= _QUICK and point.tangent @ head.tangent > _STRAIGHT
                trace.step = min(1.5 * step, self.table.max_step) if quick else max(step, self.table.min_step)
                return
            step /= 2
        self._cross(trace, failed)

    # -- smooth pieces

    def _reach(self, head: Point, step: float) -> Point | None:
        """Return the point at an arclength from another, at most the end of the range; None if there is none."""
        orbit = self._corrected(head, step)
        if orbit is None:
            return None
        y = self.problem.pack(orbit.state, orbit.parameter)
        edge = 1.0 if y[-1] > 1.0 else 0.0
        if not 0.0 <= y[-1] <= 1.0 and 0.0 <= head.y[-1] <= 1.0:
            share = (edge - head.y[-1]) / (y[-1] - head.y[-1])
            start = head.y + share * (y - head.y)
            start[-1] = edge
            row = np.append(np.zeros(self.problem.size), 1.0)
            at_edge = solve(self.problem, start, row, head.slope, _ITERATIONS, _HALVINGS)
            if at_edge.status is OrbitStatus.OK:
                orbit = at_edge
        return point_of(self.problem, orbit, head.tangent)

    def _corrected(self, head: Point, step: float) -> Orbit | None:
        """Return the orbit in the plane normal to the tangent, at a distance along it; None if there is none near."""
        return self._near(head.y + step * head.tangent, head.tangent, head.slope, abs(step))

    def _near(self, predicted: np.ndarray, row: np.ndarray, slope: np.ndarray, distance: float) -> Orbit | None:
        """Return the orbit in the plane through a point; with the slope there, if the one given does not serve."""
        for renewed in (False, True):
            if renewed:
                if (passage := self.problem.passage(predicted)) is None:
                    return None
                slope = self.problem.slope(predicted, passage)
            orbit = solve(self.problem, predicted, row, slope, _ITERATIONS, _HALVINGS)
            self.problem.count["iterations"] += orbit.iterations
            if orbit.status is OrbitStatus.OK:
                off = np.linalg.norm(self.problem.pack(orbit.state, orbit.parameter) - predicted)
                return orbit if off <= distance else None
        return None

    def _accept(self, trace: Trace, before: Point, point: Point) -> None:
        """Add a point, and the end if it is one."""
        trace.points.append(BranchPoint.of(with_symmetry(self.problem, point.orbit)))
        trace.head = point
        share = point.y[-1]
        if share >= 1.0 or share <= 0.0:
            self._end(trace, "the end of the parameter's range", point.orbit)
        elif len(trace.points) > 3 and self._returned(trace, before, point):
            self._end(trace, "closed: back at its first orbit", point.orbit)

    def _search(self, trace: Trace, before: Point, point: Point) -> bool:
        """Note the bifurcations between two points. Returns whether the branch has ended on one: joined another."""
        length = float(np.linalg.norm(point.y - before.y))

        def near(predicted: np.ndarray) -> Orbit | None:
            return self._near(predicted, before.tangent, before.slope, length)

        for found in bifurcations(self.problem, before, point, near):
            # where a branch meets its own mirror image it turns, so that it looks like a fold, too
            turns = found.kind in ("fold", "pitchfork")
            if turns and (why := self._joined(trace, found.orbit)):
                self._note(trace, Located(found.orbit, "pitchfork", "branches meet"))
                self._end(trace, why, found.orbit)
                return True
            self._note(trace, found)
        return False

    def _joined(self, trace: Trace, orbit: Orbit) -> str:
        """Say on which branch of more symmetric orbits this one ends; "" if it does not."""
        if not trace.points[-1].symmetric and with_symmetry(self.problem, orbit).symmetric:
            return "joins a branch of symmetric orbits"
        periods = self.problem.map.periods
        if periods % 2 == 0 and not self._repeats(trace.head.orbit) and self._repeats(orbit):
            return f"joins a branch of orbits of {periods // 2} period{'s' if periods > 2 else ''}"
        return ""

    def _repeats(self, orbit: Orbit) -> bool:
        """Say whether an orbit repeats after half of its periods."""
        passage = self.problem.at(orbit.parameter).over(orbit.periods // 2)(orbit.state)
        return bool(np.abs((passage.state - orbit.state) / orbit.scale).max() < _SAME)

    def _note(self, trace: Trace, found: Located) -> None:
        orbit = found.orbit
        trace.special.append(
            SpecialPoint(len(trace.points) - 1, orbit.parameter, found.kind, found.note, orbit.state)
        )  # fmt: skip

    def _returned(self, trace: Trace, before: Point, point: Point) -> bool:
        """Say whether the branch passes its first orbit between two points."""
        piece = point.y - before.y
        first = self.problem.pack(trace.points[0].state, trace.points[0].parameter)
        share = (first - before.y) @ piece / max(float(piece @ piece), np.finfo(float).tiny)
        away = np.linalg.norm(first - before.y - share * piece)
        return bool(0.0 <= share < 1.0 and away < 0.05 * np.linalg.norm(piece))

    def _end(self, trace: Trace, why: str, orbit: Orbit) -> None:
        self._note(trace, Located(orbit, "end", why))
        trace.end = why

    # -- changes of the event sequence

    def _cross(self, trace: Trace, step: float) -> None:
        """Go on with the next sequence of events from where the present one ends, within a step; or end the branch."""
        head = trace.head
        last, point = self._last(head, step)
        if last is not head and self._search(trace, head, last):
            return
        how = ""
        if point is None:
            point, how = past_the_start(self.problem, last, self._near), " at the start of the period"
        if point is None:
            point, how = self._other_side(last, step)
        if point is not None and point.tangent[-1] * last.tangent[-1] < 0:
            how += ": the branch turns"
        after = self._passage_beyond(last) if point is None or how == _CENTRED else point.orbit.passage
        kind, what = change(last.orbit.passage, after)
        self._note(trace, Located(last.orbit, kind, f"{what}{how}"))
        if point is None:
            self._end(trace, self._refusal(last, step) or f"{what}; no orbit found beyond", last.orbit)
            return
        self._accept(trace, last, point)
        trace.step = max(self.table.step / 8, self.table.min_step)

    def _refusal(self, last: Point, step: float) -> str:
        """Say why values of the parameter beyond a point make no scene; "" if they do."""
        try:
            self.problem.at(self.problem.parameter(last.y + step * last.tangent))
        except InputError as error:
            return str(error)
        return ""

    def _last(self, head: Point, step: float) -> tuple[Point, Point | None]:
        """Return the last point of the present sequence within a step, and the first beyond it, None if none is near.

        Test functions that vanish where sequences change (speeds of crossings, clearances, times between events) say
        where to look; bisection makes it sure.
        """
        low, high, seen = 0.0, step, [(0.0, head.orbit)]
        beyond: Orbit | None = None
        close = _CLOSE * min(1.0, abs(head.orbit.parameter / self.problem.span) or 1.0)
        for attempt in range(_ATTEMPTS):
            if high - low <= close:
                break
            at, margin = (
                forecast([(where, found.passage) for where, found in seen[-2:]]),
                max(1e-3 * (high - low), close / 4),
            )
            middle = (low + high) / 2
            if at is None or attempt % 3 == 2:
                at = middle
            else:
                at = float(np.clip(at + (margin if attempt % 3 else -margin), low + margin / 2, high - margin / 2))
            orbit = self._corrected(head, at)
            if orbit is not None and orbit.passage.sequence == head.orbit.passage.sequence:
                low = at
                seen.append((at, orbit))
            else:
                high, beyond = at, orbit
        last = head if len(seen) == 1 else point_of(self.problem, seen[-1][1], head.tangent)
        return last, None if beyond is None else point_of(self.problem, beyond, head.tangent)

    def _other_side(self, last: Point, step: float) -> tuple[Point | None, str]:
        """Return an orbit beyond a change of sequence and how it was found."""
        sequence = last.orbit.passage.sequence
        if (centred := self._centred(last)) is not None:
            return centred, _CENTRED
        for size in self.table.step * 10.0 ** np.arange(-3.0, -7.0, -1.0):
            y = last.y + size * last.tangent
            passage = self.problem.passage(y)
            if passage is None:
                continue
            if passage.sequence != sequence:
                orbit = self._beside(last, y, passage)
                if orbit is not None:
                    away = self.problem.pack(orbit.state, orbit.parameter) - last.y
                    return point_of(self.problem, orbit, away / np.linalg.norm(away)), ""
            # an event that passes the start of the period changes the state there, as the passage's end shows
            image = self.problem.pack(passage.state, self.problem.parameter(y))
            if np.linalg.norm(image - y) > 100 * size and (found := self.problem.passage(image)) is not None:
                row = tangent_of(self.problem, found, self.problem.slope(image, found), last.tangent)
                orbit = self._near(image, last.tangent, last.slope, size)
                if orbit is not None:
                    return point_of(self.problem, orbit, row), " at the start of the period"
        for factor in (1.0, 2.0, 4.0):
            orbit = self._corrected(last, factor * step)
            if orbit is not None:
                return point_of(self.problem, orbit, last.tangent), f", stepped over by {factor * step:.2g}"
        return None, ""

    def _passage_beyond(self, last: Point) -> Passage | None:
        """Return a passage of the next sequence of events, of a state close to the last orbit; None if none is near."""
        for size in self.table.step * 10.0 ** np.arange(-6.0, 0.0):
            passage = self.problem.passage(last.y + size * last.tangent)
            if passage is not None and passage.sequence != last.orbit.passage.sequence:
                return passage
        return None

    def _centred(self, last: Point) -> Point | None:
        """Return the orbit with its neutral coordinates amid those of its sequence; None if they are there already.

        A body that may rest anywhere has come to a wall, though its motion has room on the other side. The tangent
        takes it on along the middle.
        """
        y = self._amid(last.y, last)
        if y is None or np.linalg.norm(y - last.y) < self.table.min_step:
            return None
        orbit = self._at_parameter(y, last)
        if orbit is None:
            return None
        tangent = last.tangent
        for ahead in (0.1 * self.table.step, 1e-3 * self.table.step):
            other = self._at_parameter(y + ahead * last.tangent, last)
            moved = None if other is None else self._amid(self.problem.pack(other.state, other.parameter), last)
            if moved is not None:
                tangent = (moved - y) / np.linalg.norm(moved - y)
                break
        return point_of(self.problem, orbit, tangent)

    def _at_parameter(self, y: np.ndarray, last: Point) -> Orbit | None:
        """Return the orbit of the same sequence at the parameter of y; None if there is none."""
        row = np.append(np.zeros(self.problem.size), 1.0)
        orbit = solve(self.problem, y, row, last.slope, _ITERATIONS, _HALVINGS)
        same = orbit.passage.sequence == last.orbit.passage.sequence
        return orbit if orbit.status is OrbitStatus.OK and same else None

    def _amid(self, y: np.ndarray, last: Point) -> np.ndarray | None:
        """Return y with its neutral coordinates amid those of its sequence; None for an orbit without any."""
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
        orbits lie at last.y + v alpha to first order, (D - 1) alpha = -k (Nordmark 1991). What is of second order, as
        that distance is, is a root along the tangent.
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
            measure = share * self.table.step / length
            distance = self._root(
                last, last.y + measure * alpha, away * min(measure / kick, (measure / kick) ** 2), residual
            )
            if distance is None:
                continue
            start = last.y + measure * alpha + distance * last.tangent
            found = problem.passage(start)
            if found is None:
                continue
            orbit = self._near(start, alpha / length, problem.slope(start, found), 2 * length * measure)
            if orbit is not None and orbit.passage.sequence != sequence:
                return orbit
        return None

    def _root(self, last: Point, base: np.ndarray, distance: float, residual: np.ndarray) -> float | None:
        """Return how far along the tangent from `base` the residual has no part in another; None if nowhere near."""

        def part(at: float) -> float:
            passage = self.problem.passage(base + at * last.tangent)
            return (
                np.nan
                if passage is None
                else float(residual @ self.problem.residual(base + at * last.tangent, passage))
            )

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
