"""Pseudo-arclength continuation of a branch of orbits, over folds, bifurcations and changes of the event sequence.

Between events the period map is smooth, and so is a branch as long as the sequence of events along the orbit stays.
Where the sequence changes a branch may have a kink, turn back or end. That point is located from the side where the
branch comes from; then an orbit of the other sequence is looked for: along the branch, along the tangent that the map
has on the other side, in both directions, and in the images of both (an event that passes the start of the period).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.orbits.bifurcations import Located, bifurcations
from vanedamp.coupling.orbits.branch import SpecialPoint
from vanedamp.coupling.orbits.newton import (
    Orbit,
    OrbitStatus,
    Point,
    Problem,
    point_of,
    solve,
    tangent_of,
    with_symmetry,
)
from vanedamp.coupling.orbits.sequence_changes import change, forecast
from vanedamp.coupling.scene.orbit import Orbit as Table

#: corrections of a point before its step is shortened
_ITERATIONS, _HALVINGS = 8, 3
#: iterations up to which, and cosines of the angle between tangents from which, steps grow; and are good enough
_QUICK, _STRAIGHT, _BENT = 3, 0.985, 0.9
#: relative error of the parameter where the sequence changes
_CLOSE = 1e-10
#: attempts at the place of a change of sequence, at least every third one a bisection
_ATTEMPTS = 120


@dataclass(eq=False)
class Trace:
    """A branch while it is followed: its orbits, where it is, and its next step.

    source: the branch and the special point that it was switched from; first: y of its first point; end: why it is not
    followed further, "" while it is.
    """

    orbits: list[Orbit]
    special: list[SpecialPoint]
    head: Point
    first: np.ndarray
    step: float
    source: tuple[int, int] | None = None
    end: str = ""


class Follower:
    """Continuation of the branches of one problem, within its range of the parameter."""

    def __init__(self, problem: Problem, table: Table) -> None:
        self.problem, self.table = problem, table

    def begin(self, orbit: Orbit, row: np.ndarray, source: tuple[int, int] | None = None) -> Trace:
        """Return a branch of one orbit that goes on in the direction of `row` (k + 1,)."""
        orbit = with_symmetry(self.problem, orbit)
        head = point_of(self.problem, orbit, row)
        return Trace([orbit], [], head, head.y, self.table.step, source)

    def advance(self, trace: Trace) -> None:
        """Add the next point to a branch, with the special points before it, or end it."""
        if len(trace.orbits) >= self.table.max_points:
            self._end(trace, f"max_points ({self.table.max_points}) reached")
            return
        head, step = trace.head, trace.step
        while step >= self.table.min_step:
            point = self._reach(head, step)
            if point is None:
                step /= 2
                continue
            if point.orbit.passage.sequence != head.orbit.passage.sequence:
                break
            if point.tangent @ head.tangent > _BENT or step <= 2 * self.table.min_step:
                self._search(trace, head, point)
                self._accept(trace, head, point)
                quick = point.orbit.iterations <= _QUICK and point.tangent @ head.tangent > _STRAIGHT
                trace.step = min(1.5 * step, self.table.max_step) if quick else max(step, self.table.min_step)
                return
            step /= 2
        self._cross(trace, max(step, self.table.min_step))

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
        orbit = solve(self.problem, predicted, row, slope, _ITERATIONS, _HALVINGS)
        self.problem.count["iterations"] += orbit.iterations
        if orbit.status is not OrbitStatus.OK:
            return None
        off = np.linalg.norm(self.problem.pack(orbit.state, orbit.parameter) - predicted)
        return orbit if off <= distance else None

    def _accept(self, trace: Trace, before: Point, point: Point) -> None:
        """Add a point, and the end if it is one."""
        trace.orbits.append(with_symmetry(self.problem, point.orbit))
        trace.head = point
        share = point.y[-1]
        if share >= 1.0 or share <= 0.0:
            self._end(trace, "the end of the parameter's range")
        elif len(trace.orbits) > 3 and self._returned(trace, before, point):
            self._end(trace, "closed: back at its first orbit")

    def _search(self, trace: Trace, before: Point, point: Point) -> None:
        for found in bifurcations(self.problem, before, point, self._corrected):
            self._note(trace, found)

    def _note(self, trace: Trace, found: Located) -> None:
        orbit = found.orbit
        trace.special.append(
            SpecialPoint(len(trace.orbits) - 1, orbit.parameter, found.kind, found.note, orbit.state)
        )  # fmt: skip

    def _returned(self, trace: Trace, before: Point, point: Point) -> bool:
        """Say whether the branch passes its first orbit between two points."""
        piece = point.y - before.y
        share = (trace.first - before.y) @ piece / max(float(piece @ piece), np.finfo(float).tiny)
        away = np.linalg.norm(trace.first - before.y - share * piece)
        return bool(0.0 <= share < 1.0 and away < 0.05 * np.linalg.norm(piece))

    def _end(self, trace: Trace, why: str) -> None:
        last = trace.orbits[-1]
        trace.special.append(SpecialPoint(len(trace.orbits) - 1, last.parameter, "end", why, last.state))
        trace.end = why

    # -- changes of the event sequence

    def _cross(self, trace: Trace, step: float) -> None:
        """Go on with the next sequence of events from where the present one ends, within a step; or end the branch."""
        head = trace.head
        last, point = self._last(head, step)
        if last is not head:
            self._search(trace, head, last)
        how = ""
        if point is None:
            point, how = self._other_side(last, step)
        kind, what = change(last.orbit.passage, None if point is None else point.orbit.passage)
        self._note(trace, Located(last.orbit, kind, f"{what}{how}"))
        if point is None:
            self._end(trace, f"{what}; no orbit found beyond")
            return
        self._accept(trace, last, point)
        trace.step = max(min(step, self.table.step) / 4, self.table.min_step)

    def _last(self, head: Point, step: float) -> tuple[Point, Point | None]:
        """Return the last point of the present sequence within a step, and the first beyond it, None if none is near.

        Test functions that vanish where sequences change (speeds of crossings, clearances, times between events) say
        where to look; bisection makes it sure.
        """
        low, high, seen = 0.0, step, [(0.0, head.orbit)]
        beyond: Orbit | None = None
        close = _CLOSE * min(1.0, abs(head.orbit.parameter) / self.problem.span or 1.0)
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
        sequence, sizes = last.orbit.passage.sequence, step * 10.0 ** np.arange(-4.0, 1.0)
        for size in sizes:
            # the map's derivative on the other side, where the branch's continuation is no orbit
            y = last.y + size * last.tangent
            passage = self.problem.passage(y)
            if passage is None:
                continue
            starts = [(y, passage)]
            image = self.problem.pack(passage.state, self.problem.parameter(y))
            if (again := self.problem.passage(image)) is not None:
                starts.append((image, again))
            for (start, found), sign in itertools.product(starts, (1.0, -1.0)):
                if start is y and found.sequence == sequence:
                    continue
                jump = start is not y
                slope = self.problem.slope(start, found)
                row = sign * tangent_of(self.problem, found, slope, last.tangent)
                predicted = start if jump else last.y + size * row
                if jump and sign < 0:
                    continue
                orbit = self._near(predicted, row, slope, size)
                if orbit is not None and (jump or orbit.passage.sequence != sequence):
                    turned = " the branch turns" if row[-1] * last.tangent[-1] < 0 else ""
                    how = ", at the start of the period" if jump else turned and f":{turned}"
                    return point_of(self.problem, orbit, row), how
        for factor in (1.0, 2.0, 4.0):
            orbit = self._corrected(last, factor * step)
            if orbit is not None:
                return point_of(self.problem, orbit, last.tangent), f", stepped over by {factor * step:.2g}"
        return None, ""
