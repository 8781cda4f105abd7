"""A diagram of branches: the first one, and those bifurcating at its period doublings and pitchforks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vanedamp.coupling.orbits.bifurcations import SWITCHES, direction
from vanedamp.coupling.orbits.branch import Branch, SpecialPoint
from vanedamp.coupling.orbits.continuation import BranchPath
from vanedamp.coupling.orbits.curve import CurvePoint, beginning
from vanedamp.coupling.orbits.first_orbit import Starts
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import WAVE, OrbitStatus, Zero, solve
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.orbits.waves import find_wave, of_waves
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: branches, and periods of their orbits, that are followed
_MOST_BRANCHES, _MOST_PERIODS = 32, 64
#: how often the first step onto another branch, `step`, is quartered
_QUARTERS = 6
#: distance of two special points that are one, as a fraction of the range and of the coordinates' scale
_SAME = 1e-3

_MEANING = {
    OrbitStatus.NOT_CONVERGED: "Newton's method does not converge",
    OrbitStatus.FORBIDDEN: "every step of Newton's method leads to another sequence of events, which forbids the orbit",
    OrbitStatus.STOPPED: "the engine does not come to the end of the period",
    OrbitStatus.UNDETERMINED: "the motion has no derivative: events meet at one instant, or laws leave forces open",
}


class Diagram:
    """The branches of a period map, found in turn.

    table: how to follow them; low, to: range of the parameter, to: None for a single orbit; starts: returns the states
    from which the first orbit is sought; notes: failures.
    """

    def __init__(
        self, period_map: PeriodMap, table: Table, low: float, to: float | None, starts: Callable[[], Starts]
    ) -> None:
        self.map, self.table, self.low, self.to, self.starts = period_map, table, low, to, starts
        self.problems: dict[int, OrbitProblem] = {}
        self.finished: list[Branch] = []
        self.current: BranchPath | None = None
        self.notes: list[str] = []
        self._before = 0

    @property
    def branches(self) -> list[Branch]:
        """The branches found so far, the last one perhaps unfinished."""
        return self.finished + ([] if self.current is None else [self.current.branch])

    @property
    def iterations(self) -> int:
        """Iterations of Newton's method so far."""
        return self._before + sum(problem.count["iterations"] for problem in self.problems.values())

    @property
    def place(self) -> tuple[np.ndarray, float]:
        """Last y, its row and y of points before it (r, k + 1), and step, with which the last branch continues."""
        if self.current is None:
            return np.zeros((2, len(self.map.scale) + 1)), 0.0
        head = self.current.head
        return np.stack([head.y, head.row, *self.current.trail]), self.current.step

    def resume(self, branches: Sequence[Branch], head: np.ndarray, step: float, iterations: int) -> None:
        """Resume from an interrupted search."""
        *self.finished, last = branches
        self._before = iterations
        self.current = BranchPath.resume(self._problem(last.periods), self.table, last, head, step)
        if self.current is None:
            raise InputError("the last orbit of the checkpoint is none any more; delete the checkpoint to start again")

    def follow(self, changed: Callable[[int, int], None]) -> None:
        """Find all branches; changed: called with orbits found and possible."""
        while True:
            current = self.current = self.current or self._next()
            if current is None:
                return
            if self.to is None:
                current.end = "a single orbit: `to` is not given"
            while True:
                done = sum(len(branch.parameter) for branch in self.finished) + len(current.points)
                changed(done, self.table.max_points * (len(self.finished) + 1))
                if current.end:
                    break
                current.advance()
            self.finished.append(current.branch)
            self.current = None

    def _next(self) -> BranchPath | None:
        """Return the next branch to follow; None without."""
        if not self.finished:
            return self._first()
        if not self.table.switch:
            return None
        for number, branch in enumerate(self.finished):
            for index, point in enumerate(branch.special):
                if point.kind not in SWITCHES or self._known(number, index, branch, point):
                    continue
                if len(self.finished) >= _MOST_BRANCHES:
                    self.notes.append(f"only the first {_MOST_BRANCHES} branches were followed")
                    return None
                if (path := self._switched(number, index, branch, point)) is not None:
                    return path
        return None

    def _first(self) -> BranchPath:
        """Return the branch through the first orbit. Raises InputError if there is none."""
        starts = self.starts()
        first, failed = self._solved(starts)
        if first is not None:
            return first
        remedy = starts.remedy
        if starts.run is not None:
            of_run = starts.run()
            point, more = self._solved(of_run)
            if point is None:
                remedy = f'start = "run" finds none either ({"; ".join(more)}): {of_run.remedy}'
            else:
                order = point.problem.map.periods
                remedy = f'start = "run" finds an orbit of {order} period(s)'
        periods = " or ".join(map(str, dict.fromkeys(start.periods for start in starts.candidates)))
        raise InputError(
            f"orbit: no orbit of {periods} excitation period(s) at {self.table.parameter} = {self.low:g}: "
            f"{'; '.join(failed)}; {remedy}"
        )

    def _solved(self, starts: Starts) -> tuple[BranchPath | None, list[str]]:
        """Return the branch through the first orbit found from some starts, and why none is found from others."""
        failed = dict[str, None]()
        for start in starts.candidates:
            problem = self._problem(start.periods)
            row = problem.row()
            if self.table.wave and self.to is None:
                zero = Zero.of(problem, find_wave(problem.map, start.state), self.low)
            else:
                zero = solve(problem, problem.pack(start.state, self.low), row)
            problem.count["iterations"] += zero.iterations
            if zero.status is OrbitStatus.OK:
                return BranchPath(self.table, CurvePoint(problem, zero, row)), list(failed)
            failed[_MEANING[zero.status]] = None
            if zero.status is OrbitStatus.UNDETERMINED and problem.map.travelling is not None:
                failed[WAVE] = None
        return None, list(failed)

    @property
    def _span(self) -> float:
        """Range of the parameter, with its sign; 1 for a single orbit."""
        return 1.0 if self.to is None else self.to - self.low

    def _problem(self, periods: int) -> OrbitProblem:
        if periods not in self.problems:
            along = self.map.over(periods)
            along = of_waves(along) if self.table.wave and self.to is not None else along
            self.problems[periods] = OrbitProblem.along(along, self.low, self._span)
        return self.problems[periods]

    def _known(self, number: int, index: int, branch: Branch, point: SpecialPoint) -> bool:
        """Say whether a bifurcation's other branch was followed already, from here or to here."""
        scale, span = self.map.scale, self._span
        periods = branch.periods * (2 if point.kind == "period doubling" else 1)
        for other in self.finished:
            last = other.special[-1]
            if other.source == (number, index):
                return True
            if other.source is None or other.periods != periods or not last.note.startswith("joins"):
                continue
            away = max(abs((last.parameter - point.parameter) / span), np.abs((last.state - point.state) / scale).max())
            if away < _SAME:
                return True
        return point.note == "branches meet" and branch.special[-1].note.startswith("joins")

    def _switched(self, number: int, index: int, branch: Branch, point: SpecialPoint) -> BranchPath | None:
        """Return the branch that starts at a bifurcation; None, with a note, if no orbit of it is found."""
        doubled = point.kind == "period doubling"
        periods = branch.periods * (2 if doubled else 1)
        if periods > _MOST_PERIODS:
            return None
        parent, problem = self._problem(branch.periods), self._problem(periods)
        y = problem.pack(point.state, point.parameter)
        here = parent.passage(y)
        regular = parent.passage(parent.pack(branch.state[point.index], float(branch.parameter[point.index])))
        if here is None or regular is None:
            return None
        scaled = problem.map.scale / problem.map.scale[:, None]
        neutral = null_space(regular.derivative * scaled)
        row = np.append(direction(here.derivative * scaled, point.kind, neutral), 0.0)
        for quarters in range(_QUARTERS):
            step = self.table.step / 4.0**quarters
            start = y + step * row
            if (guess := beginning(problem, start, row)) is None:
                continue
            # the slope at the bifurcation itself says nothing of the other branch
            zero = solve(problem, start, row, guess.slopes)
            problem.count["iterations"] += zero.iterations
            onward = zero.y - y
            if zero.status is OrbitStatus.OK and np.linalg.norm(onward) < 3 * step:
                return BranchPath(
                    self.table, CurvePoint(problem, zero, onward / np.linalg.norm(onward)), (number, index)
                )
        self.notes.append(
            f"no orbit found on the other branch at the {point.kind} at {self.table.parameter} = {point.parameter:.9g}"
        )
        return None
