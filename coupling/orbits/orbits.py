"""Periodic orbits of scenes, and the branches that they form over one of the scene's numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.engine import simulate
from vanedamp.coupling.model_order.choices import choices_of, leaves_open, with_choices
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.bifurcations import SWITCHES, direction
from vanedamp.coupling.orbits.branch import Branch, Branches, SpecialPoint
from vanedamp.coupling.orbits.checkpoint import Checkpoint
from vanedamp.coupling.orbits.continuation import Follower, Trace
from vanedamp.coupling.orbits.multipliers import null_space
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus, Problem, solve
from vanedamp.coupling.orbits.passage import PeriodMap
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.paths import number_at
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

_FREQUENCY = "excitation.frequency"
#: tables whose numbers are none of the motion's equations
_NO_PARAMETERS = ("time", "solver", "continuation", "sweep", "orbit", "initial")
#: branches, and periods of their orbits, that are followed
_MOST_BRANCHES, _MOST_PERIODS = 32, 64
#: first step onto another branch, as a share of `step`, and how often it is quartered
_ONTO, _QUARTERS = 1.0, 6
#: distance of two special points that are one, as a share of the range and of the coordinates' scale
_SAME = 1e-3

_MEANING = {
    OrbitStatus.NOT_CONVERGED: "Newton's method does not converge",
    OrbitStatus.FORBIDDEN: "every step of Newton's method leads to another sequence of events, which forbids the orbit",
    OrbitStatus.STOPPED: "the engine does not come to the end of the period, or its derivative is undetermined",
}


def find_orbit(scene: Scene, start: RestartState | None = None) -> Orbit:
    """Return the periodic orbit of a scene that its [orbit] table describes, at the table's `from`.

    start: a state near it, in place of the table's `start`. Raises InputError for a scene that the exact engine cannot
    run, or a parameter that is no number of it; an orbit that is not found is a status of the result.
    """
    search = _Search(scene)
    state = search.start() if start is None else search.map.state_of(start)
    return replace(newton.find_orbit(search.map, state), parameter=search.low)


def orbits(
    scene: Scene,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Branches:
    """Follow the periodic orbits of a scene over a number of it, as its [orbit] table says.

    progress: called with the number of points found and of those that there may be; checkpoint: a file to which found
    points are written and from which an interrupted call goes on; the caller removes it once the result is safe
    (files.checkpoint_file.clear).
    Raises InputError for a scene without the table, one that the exact engine cannot run, a parameter that is no
    number of it, and a start from which no orbit is found.
    """
    if scene.orbit is None:
        raise InputError("orbit: missing; name the branch in a table [orbit], such as from = 95.0 and to = 105.0")
    search = _Search(scene)
    with Checkpoint(checkpoint, scene, provenance or {}) as kept:
        diagram = _Diagram(search, kept, dict(provenance or {}))
        diagram.follow(progress)
    return diagram.result()


class _Search:
    """A scene with its [orbit] table: the range of the parameter, and the period map at its begin."""

    def __init__(self, scene: Scene) -> None:
        """Raise InputError for a parameter that is no number of the motion's equations, or bad at an end."""
        self.scene, self.table = scene, scene.orbit or Table()
        path, self.to = self.table.parameter, self.table.to
        if path.split(".")[0] in _NO_PARAMETERS:
            raise InputError(
                f"orbit.parameter: {path} is no number of the motion's equations; take one such as {_FREQUENCY}"
            )
        try:
            given = number_at(scene.to_dict(), path)
        except InputError as error:
            raise InputError(f"orbit.parameter: {str(error).removeprefix('scene: ')}") from None
        self.low = given if self.table.from_ is None else self.table.from_
        if self.to == self.low:
            raise InputError(f"orbit.to: {self.to:g} is where the branch begins; give another value")
        base = replace(scene, sweep={}, orbit=None)
        if path == _FREQUENCY and self.to is not None and scene.excitation.resonance_near is None:
            # the level is that of one resonance along the branch, as in a sweep
            near = (min(self.low, self.to), max(self.low, self.to))
            base = replace(base, excitation=replace(base.excitation, resonance_near=near))
        ends = [_at(base, path, value) for value in (self.low, self.to) if value is not None]
        if leaves_open(base):
            choices = choices_of(ends)
            ends = [with_choices(end, choices).scene for end in ends]
        self.first = ends[0]
        self.map: PeriodMap = period_map(self.first, path, self.table.periods)

    @property
    def span(self) -> float:
        """Range of the parameter, with its sign; 1 for a single orbit."""
        return 1.0 if self.to is None else self.to - self.low

    def start(self) -> np.ndarray:
        """Return the state (k,) from which the first orbit is looked for. Raises InputError if the run ends early."""
        if self.table.start == "linear":
            return self.map.linear_orbit()
        response = simulate(self.first)
        if response.final is None:
            raise InputError(
                f'orbit.start: the run of the scene ends early ({response.status}); take start = "linear", or change '
                "the scene"
            )
        return self.map.state_of(response.final)

    def problem(self, periods: int) -> Problem:
        """Return the problem of orbits of some periods."""
        return Problem(self.map.over(periods), self.low, self.span)


def _at(scene: Scene, path: str, value: float) -> Scene:
    try:
        return scene.replace({path: value})
    except InputError as error:
        raise InputError(f"orbit: at {path} = {value:g}: {str(error).removeprefix('scene: ')}") from None


class _Diagram:
    """The branches of a search, found one after the other."""

    def __init__(self, search: _Search, kept: Checkpoint, provenance: dict[str, Any]) -> None:
        self.search, self.kept, self.provenance = search, kept, provenance
        self.problems: dict[int, Problem] = {}
        self.finished: list[Branch] = []
        self.before = 0
        self.notes: list[str] = []
        self.current: tuple[Follower, Trace] | None = None
        kept.current = self._state

    def follow(self, progress: Callable[[int, int], None] | None) -> None:
        """Find all branches, beginning with what was kept."""
        table = self.search.table
        while True:
            self.current = self._next()
            if self.current is None:
                return
            follower, trace = self.current
            if self.search.to is None:
                trace.end = "a single orbit: `to` is not given"
            while True:
                self.kept.changed()
                if progress is not None:
                    done = sum(len(branch.parameter) for branch in self.finished) + len(trace.points)
                    progress(done, table.max_points * (len(self.finished) + 1))
                if trace.end:
                    break
                follower.advance(trace)
            self.finished.append(follower.branch(trace))
            self.current = None

    def _next(self) -> tuple[Follower, Trace] | None:
        """Return the next branch, which may have begun before an interruption; None if there is none."""
        if not self.finished:
            return self._kept() or self._first()
        if not self.search.table.switch:
            return None
        for number, branch in enumerate(self.finished):
            for place, point in enumerate(branch.special):
                if point.kind not in SWITCHES or self._known(number, place, branch, point):
                    continue
                if len(self.finished) >= _MOST_BRANCHES:
                    self.notes.append(f"only the first {_MOST_BRANCHES} branches were followed")
                    return None
                if (found := self._switched(number, place, branch, point)) is not None:
                    return found
        return None

    def _kept(self) -> tuple[Follower, Trace] | None:
        """Take up the branches of the checkpoint."""
        found = self.kept.found
        if found is None:
            return None
        *self.finished, last = found.branches
        self.before = found.iterations
        follower = self._follower(last.periods)
        trace = follower.resume(last, self.kept.tangent, self.kept.step)
        if trace is None:
            raise InputError("the checkpoint's last orbit is none any more; delete the checkpoint to start again")
        return follower, trace

    def _first(self) -> tuple[Follower, Trace]:
        """Return the branch through the first orbit. Raises InputError if there is none."""
        follower = self._follower(self.search.table.periods)
        problem = follower.problem
        start, row = problem.pack(self.search.start(), self.search.low), _along_parameter(problem)
        orbit = solve(problem, start, row, np.zeros(problem.size))
        problem.count["iterations"] += orbit.iterations
        if orbit.status is not OrbitStatus.OK:
            other = '"linear"' if self.search.table.start == "run" else '"run"'
            raise InputError(
                f"orbit: no orbit of {problem.map.periods} excitation period(s) at {self.search.table.parameter} = "
                f"{self.search.low:g}: {_MEANING[orbit.status]}; try other periods, another `from`, or start = {other}"
            )
        return follower, follower.begin(orbit, row)

    def _follower(self, periods: int) -> Follower:
        problem = self.problems.setdefault(periods, self.search.problem(periods))
        return Follower(problem, self.search.table)

    def _known(self, number: int, place: int, branch: Branch, point: SpecialPoint) -> bool:
        """Say whether a bifurcation's other branch was followed already, from here or to here."""
        scale, span = self.search.map.scale, self.search.span
        periods = branch.periods * (2 if point.kind == "period doubling" else 1)
        for other in self.finished:
            last = other.special[-1]
            if other.source == (number, place):
                return True
            if other.source is None or other.periods != periods or not last.note.startswith("joins"):
                continue
            away = max(abs((last.parameter - point.parameter) / span), np.abs((last.state - point.state) / scale).max())
            if away < _SAME:
                return True
        return point.note == "branches meet" and branch.special[-1].note.startswith("joins")

    def _switched(self, number: int, place: int, branch: Branch, point: SpecialPoint) -> tuple[Follower, Trace] | None:
        """Return the branch that goes out from a bifurcation; None, with a note, if no orbit of it is found."""
        doubled = point.kind == "period doubling"
        periods = branch.periods * (2 if doubled else 1)
        if periods > _MOST_PERIODS:
            return None
        parent, follower = self._follower(branch.periods).problem, self._follower(periods)
        problem, y = follower.problem, follower.problem.pack(point.state, point.parameter)
        here, passage = parent.passage(y), problem.passage(y)
        regular = parent.passage(parent.pack(branch.state[point.index], float(branch.parameter[point.index])))
        if here is None or passage is None or regular is None:
            return None
        scaled = problem.map.scale / problem.map.scale[:, None]
        neutral = null_space(regular.derivative * scaled)
        row = np.append(direction(here.derivative * scaled, point.kind, neutral), 0.0)
        slope = problem.slope(y, passage)
        for quarters in range(_QUARTERS):
            step = _ONTO * self.search.table.step / 4.0**quarters
            orbit = solve(problem, y + step * row, row, slope)
            problem.count["iterations"] += orbit.iterations
            if orbit.status is OrbitStatus.OK:
                onward = problem.pack(orbit.state, orbit.parameter) - y
                if np.linalg.norm(onward) < 3 * step:
                    return follower, follower.begin(orbit, onward / np.linalg.norm(onward), (number, place))
        self.notes.append(
            f"no orbit found on the other branch at the {point.kind} at {self.search.table.parameter} = "
            f"{point.parameter:.9g}"
        )
        return None

    def result(self) -> Branches:
        """Return what was found so far."""
        branches = list(self.finished)
        if self.current is not None:
            branches.append(self.current[0].branch(self.current[1]))
        iterations = self.before + sum(problem.count["iterations"] for problem in self.problems.values())
        scene = replace(self.search.scene, orbit=self.search.table)
        return Branches(
            scene, tuple(self.search.map.names), frozen(self.search.map.scale), tuple(branches), iterations,
            (*warnings_of(self.search.first), *dict.fromkeys(self.notes)), self.provenance,
        )  # fmt: skip

    def _state(self) -> tuple[Branches, np.ndarray, float]:
        if self.current is None:
            size = len(self.search.map.scale) + 1
            return self.result(), np.zeros(size), 0.0
        trace = self.current[1]
        return self.result(), trace.head.tangent, trace.step


def _along_parameter(problem: Problem) -> np.ndarray:
    return np.append(np.zeros(problem.size), 1.0)


def map_along(scene: Scene) -> PeriodMap:
    """Return the period map at the `from` of a scene's [orbit] table: orbits of its branches are fixed points of it."""
    return _Search(scene).map
