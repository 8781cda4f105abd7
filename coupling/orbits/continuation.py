"""A branch of orbits over one number, over folds, bifurcations and changes of the event sequence.

Where the sequence changes a branch may have a kink, turn back or end: an orbit of the other sequence is sought there
(orbits.other_side).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.passage import change
from vanedamp.coupling.orbits.bifurcations import Located, bifurcations, leaps
from vanedamp.coupling.orbits.branch import Branch, SpecialPoint
from vanedamp.coupling.orbits.curve import CurvePoint, Path, beginning
from vanedamp.coupling.orbits.newton import PeriodicOrbit, with_symmetry
from vanedamp.coupling.orbits.other_side import CENTRED, OtherSide
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: scaled distance of an orbit from itself half of its periods later, where it is known by its root
_SAME = 1e-4


class BranchPath(Path):
    """A branch while it is followed; source: the branch and the special point that it was switched from."""

    named = SpecialPoint
    edge, closed = "the end of the parameter's range", "closed: back at its first orbit"

    def __init__(self, table: Table, head: CurvePoint, source: tuple[int, int] | None = None) -> None:
        super().__init__(table, head, table.max_points)
        self.source, self._other_side = source, OtherSide(head.problem, table.step, table.min_step)

    @classmethod
    def resume(
        cls, problem: OrbitProblem, table: Table, branch: Branch, head: np.ndarray, step: float
    ) -> BranchPath | None:
        """Return a branch that was interrupted, from where it continues (Diagram.place); None if that is no orbit."""
        if (last := beginning(problem, *head[:2])) is None:
            return None
        resumed = cls(table, last, branch.source)
        resumed.points, resumed.special = branch.rows, list(branch.special)
        resumed.first = problem.pack(branch.state[0], float(branch.parameter[0]))
        resumed.step, resumed.end, resumed.trail = step, branch.end, list(head[2:])
        return resumed

    @property
    def branch(self) -> Branch:
        """The record of the branch, whole or not."""
        branch, special = self.source or (-1, -1)
        return Branch.of(
            self.points, periods=self.problem.map.periods, special=tuple(self.special), end=self.end,
            source_branch=branch, source_special=special,
        )  # fmt: skip

    def _kept(self, point: CurvePoint) -> dict[str, Any]:
        return data_of(with_symmetry(point.orbit))

    def _end(self, why: str, point: CurvePoint) -> None:
        self._note(point, "end", why)
        super()._end(why, point)

    def _leaps(self, before: CurvePoint, point: CurvePoint) -> bool:
        return leaps(before, point)

    def _passed(self, before: CurvePoint, point: CurvePoint) -> CurvePoint | None:
        return None if self._ends_on(bifurcations(before, point)) else point

    def _ends_on(self, located: Iterable[Located]) -> bool:
        """Note bifurcations on the way. Returns whether the branch has ended on one: joined another."""
        for special in located:
            # where a branch meets its own mirror image it turns, so that it looks like a fold, too
            turns = special.kind in ("fold", "pitchfork")
            if turns and (why := self._joined(special.point.orbit)):
                self._note(special.point, "pitchfork", "branches meet")
                self._end(why, special.point)
                return True
            self._note(*special)
        return False

    def _joined(self, orbit: PeriodicOrbit) -> str:
        """Say on which branch of more symmetric orbits this one ends; "" if it does not."""
        if not self.points[-1]["symmetric"] and with_symmetry(orbit).symmetric:
            return "joins a branch of symmetric orbits"
        periods = self.problem.map.periods
        if periods % 2 == 0 and not _repeats(self.head.orbit) and _repeats(orbit):
            return f"joins a branch of orbits of {periods // 2} period{'s' if periods > 2 else ''}"
        return ""

    # -- changes of the event sequence

    def _cross(self, step: float, last: CurvePoint, beyond: CurvePoint | None, lost: bool) -> None:
        if last is not self.head and self._passed(self.head, last) is None:
            return
        point = beyond
        how, passed = "", None
        if (centred := self._other_side.centred(last)) is not None:
            point, how = centred, CENTRED
        elif (passed := self._other_side.past_the_start(last)) is not None:
            point, how = passed[0], " at the start of the period"
        elif lost:
            self.step = max(step / 4, self.table.min_step)
            return self._onward(last)
        elif point is None:
            point, how = self._other_side.find(last, step)
        if point is not None and passed is None and point.tangent[-1] * last.tangent[-1] < 0:
            how += ": the branch turns"
        after = self._other_side.passage(last) if point is None or how == CENTRED else point.passage
        kind, words = change(last.passage, after)
        self._note(last, kind, f"{words}{how}")
        if point is None:
            self._end(self._refusal(last, step) or f"{words}; no orbit found beyond", last)
        elif passed is None or not self._ends_on(passed[1]):
            self._add(last if passed is None else point, point)  # at the start of the period the state jumps
            self.step = max(self.table.step / 8, self.table.min_step)

    def _refusal(self, last: CurvePoint, step: float) -> str:
        """Say why values of the parameter beyond a point make no scene; "" if they do."""
        try:
            self.problem.at(last.y + step * last.tangent)
        except InputError as error:
            return str(error)
        return ""


def data_of(orbit: PeriodicOrbit) -> dict[str, Any]:
    """Return a branch's data of an orbit."""
    names = ("parameter", "state", "multipliers", "neutral", "stable", "symmetric", "undetermined", "quantities")
    return {name: getattr(orbit, name) for name in names} | {"sequence": "; ".join(orbit.passage.sequence)}


def _repeats(orbit: PeriodicOrbit) -> bool:
    """Say whether an orbit repeats after half of its periods."""
    assert orbit.map is not None
    passage = orbit.map.over(orbit.periods // 2)(orbit.state, False)
    return bool(np.abs((passage.state - orbit.state) / orbit.scale).max() < _SAME)
