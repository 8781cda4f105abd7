"""Pseudo-arclength continuation of a branch of orbits, over folds, bifurcations and changes of the event sequence.

Between events the period map is smooth, and so is a branch as long as the sequence of events along the orbit stays.
Where the sequence changes a branch may have a kink, turn back or end. That point is located from the side where the
branch comes from; then an orbit of the other sequence is sought (orbits.other_side).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vanedamp.coupling.derivatives.passage import change, forecast
from vanedamp.coupling.orbits.bifurcations import Located, bifurcations
from vanedamp.coupling.orbits.border import SpecialPoint
from vanedamp.coupling.orbits.branch import Branch, BranchPoint
from vanedamp.coupling.orbits.newton import (
    Orbit,
    OrbitStatus,
    Point,
    Problem,
    corrected,
    passes,
    point_of,
    reached,
    with_symmetry,
)
from vanedamp.coupling.orbits.other_side import CENTRED, OtherSide
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: iterations up to which, and cosines of the angle between tangents from which, steps grow; and are good enough
_QUICK, _STRAIGHT, _BENT = 3, 0.985, 0.9
#: scaled distance of an orbit from itself half of its periods later, where it is known by its root
_SAME = 1e-4
#: relative error of the parameter where the sequence changes
_CLOSE = 1e-10
#: attempts at the place of a change of sequence, at least every third one a bisection
_ATTEMPTS = 120


class Continuation:
    """A branch while it is followed, within the range of its problem's parameter.

    points: its orbits; special: its special points; head: the last orbit with its tangent; step: the next one; source:
    the branch and the special point that it was switched from; end: why it is not followed further, "" while it is.
    """

    def __init__(
        self, problem: Problem, table: Table, points: list[BranchPoint], head: Point, source: tuple[int, int] | None
    ) -> None:
        self.problem, self.table, self.points, self.head, self.source = problem, table, points, head, source
        self.special, self.step, self.end = list[SpecialPoint](), table.step, ""
        self._other_side = OtherSide(problem, table.step, table.min_step)

    @classmethod
    def begin(
        cls, problem: Problem, table: Table, orbit: Orbit, row: np.ndarray, source: tuple[int, int] | None = None
    ) -> Continuation:
        """Return a branch of one orbit that continues in the direction of `row` (k + 1,)."""
        point = BranchPoint.of(with_symmetry(problem, orbit))
        return cls(problem, table, [point], point_of(problem, orbit, row), source)

    @classmethod
    def resume(
        cls, problem: Problem, table: Table, branch: Branch, tangent: np.ndarray, step: float
    ) -> Continuation | None:
        """Return a branch that was interrupted, from its last point and the tangent there; None if that is no orbit."""
        last = branch.points[-1]
        y = problem.pack(last.state, last.parameter)
        passage = problem.passage(y)
        if passage is None:
            return None
        missed = float(np.abs(problem.residual(y, passage)).max(initial=0.0))
        orbit = Orbit(
            OrbitStatus.OK, last.parameter, last.state, branch.periods, problem.map.scale, passage, missed, 0,
            map=problem.at(last.parameter),
        )  # fmt: skip
        head = Point(y, orbit, problem.slope(y), tangent)
        resumed = cls(problem, table, branch.points, head, branch.source)
        resumed.special, resumed.step, resumed.end = list(branch.special), step, branch.end
        return resumed

    @property
    def branch(self) -> Branch:
        """The record of the branch, whole or not."""
        return Branch.of(self.points, self.problem.map.periods, self.special, self.end, self.source)

    def advance(self) -> None:
        """Add the next point to the branch, with the special points before it, or end it."""
        if len(self.points) >= self.table.max_points:
            self._end(f"max_points ({self.table.max_points}) reached", self.head.orbit)
            return
        head, step, failed = self.head, self.step, self.step
        while step >= self.table.min_step:
            point = reached(self.problem, head, step)
            if point is None:
                failed, step = step, step / 4
                continue
            if point.orbit.passage.sequence != head.orbit.passage.sequence:
                failed = step
                break
            if point.tangent @ head.tangent > _BENT or step <= 2 * self.table.min_step:
                if not self._search(bifurcations(self.problem, head, point)):
                    self._accept(head, point)
                quick = point.orbit.iterations <= _QUICK and point.tangent @ head.tangent > _STRAIGHT
                self.step = min(1.5 * step, self.table.max_step) if quick else max(step, self.table.min_step)
                return
            step /= 2
        self._cross(failed)

    # -- smooth pieces

    def _accept(self, before: Point, point: Point) -> None:
        """Add a point, and the end if it is one."""
        self.points.append(BranchPoint.of(with_symmetry(self.problem, point.orbit)))
        self.head = point
        share, first = point.y[-1], self.problem.pack(self.points[0].state, self.points[0].parameter)
        if share >= 1.0 or share <= 0.0:
            self._end("the end of the parameter's range", point.orbit)
        elif len(self.points) > 3 and passes(before.y, point.y, first):
            self._end("closed: back at its first orbit", point.orbit)

    def _search(self, located: Iterable[Located]) -> bool:
        """Note bifurcations on the way. Returns whether the branch has ended on one: joined another."""
        for found in located:
            # where a branch meets its own mirror image it turns, so that it looks like a fold, too
            turns = found.kind in ("fold", "pitchfork")
            if turns and (why := self._joined(found.orbit)):
                self._note(found.orbit, "pitchfork", "branches meet")
                self._end(why, found.orbit)
                return True
            self._note(*found)
        return False

    def _joined(self, orbit: Orbit) -> str:
        """Say on which branch of more symmetric orbits this one ends; "" if it does not."""
        if not self.points[-1].symmetric and with_symmetry(self.problem, orbit).symmetric:
            return "joins a branch of symmetric orbits"
        periods = self.problem.map.periods
        if periods % 2 == 0 and not self._repeats(self.head.orbit) and self._repeats(orbit):
            return f"joins a branch of orbits of {periods // 2} period{'s' if periods > 2 else ''}"
        return ""

    def _repeats(self, orbit: Orbit) -> bool:
        """Say whether an orbit repeats after half of its periods."""
        passage = self.problem.at(orbit.parameter).over(orbit.periods // 2)(orbit.state, False)
        return bool(np.abs((passage.state - orbit.state) / orbit.scale).max() < _SAME)

    def _note(self, orbit: Orbit, kind: str, note: str) -> None:
        self.special.append(SpecialPoint(len(self.points) - 1, orbit.parameter, kind, note, orbit.state))

    def _end(self, why: str, orbit: Orbit) -> None:
        self._note(orbit, "end", why)
        self.end = why

    # -- changes of the event sequence

    def _cross(self, step: float) -> None:
        """Continue with the next sequence of events where the present one ends, within a step; or end the branch."""
        head = self.head
        last, point = self._last(head, step)
        if last is not head and self._search(bifurcations(self.problem, head, last)):
            return
        how, passed = "", None
        if (centred := self._other_side.centred(last)) is not None:
            point, how = centred, CENTRED
        elif (passed := self._other_side.past_the_start(last)) is not None:
            point, how = passed[0], " at the start of the period"
        elif point is None:
            point, how = self._other_side.find(last, step)
        if point is not None and passed is None and point.tangent[-1] * last.tangent[-1] < 0:
            how += ": the branch turns"
        after = self._other_side.passage(last) if point is None or how == CENTRED else point.orbit.passage
        kind, what = change(last.orbit.passage, after)
        self._note(last.orbit, kind, f"{what}{how}")
        if point is None:
            self._end(self._refusal(last, step) or f"{what}; no orbit found beyond", last.orbit)
            return
        if passed is not None and self._search(passed[1]):
            return
        self._accept(last, point)
        self.step = max(self.table.step / 8, self.table.min_step)

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
            at = forecast([(where, found.passage) for where, found in seen[-2:]])
            middle, margin = (low + high) / 2, max(1e-3 * (high - low), close / 4)
            if at is None or not low <= at <= high or attempt % 3 == 2:
                at = middle
            else:
                at = float(np.clip(at + (margin if attempt % 3 else -margin), low + margin / 2, high - margin / 2))
            orbit = corrected(self.problem, head, at)
            if orbit is not None and orbit.passage.sequence == head.orbit.passage.sequence:
                low = at
                seen.append((at, orbit))
            else:
                high, beyond = at, orbit
        last = head if len(seen) == 1 else point_of(self.problem, seen[-1][1], head.tangent)
        return last, None if beyond is None else point_of(self.problem, beyond, head.tangent)
