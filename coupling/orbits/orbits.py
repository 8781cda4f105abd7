"""Periodic orbits of scenes, and the branches that they form over one of the scene's numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from vanedamp.coupling.model_order.choices import choices_of, leaves_open, with_choices
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.checkpoint import Checkpoint
from vanedamp.coupling.orbits.diagram import Diagram
from vanedamp.coupling.orbits.first_orbit import Start, Starts, of_linear_motion, of_run
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.paths import number_at
from vanedamp.coupling.scene.rotation import FREQUENCY, hertz_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: tables whose numbers do not enter the equations of motion
_NO_PARAMETERS = ("time", "solver", "continuation", "sweep", "orbit", "ramp", "ring_down", "initial")


def find_orbit(scene: Scene, start: RestartState | None = None) -> Orbit:
    """Return the periodic orbit of a scene that its [orbit] table describes, at the table's `from`.

    start: a state near it, in place of the table's `start`. Raises InputError for a scene that the exact engine cannot
    run, or a parameter that is no number of it; an orbit that is not found is a status of the result.
    """
    search = _Search(scene)
    if start is not None:
        candidates = [Start(search.map.state_of(at_speed_of(search.first, start)), search.map.periods)]
    else:
        candidates = list(search.starts().candidates)
    for state, periods in candidates:
        found = newton.find_orbit(search.map.over(periods), state)
        if found.status is OrbitStatus.OK:
            break
    return replace(found, parameter=search.low)


def orbits(
    scene: Scene,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Branches:
    """Follow the periodic orbits of a scene over a number of it, as its [orbit] table says.

    progress: called with the number of points found and of those that there may be; checkpoint: a file to which found
    points are written and from which an interrupted call resumes; the caller removes it once the result is safe
    (files.checkpoint_file.clear).
    Raises InputError for a scene without the table, one that the exact engine cannot run, a parameter that is no
    number of it, and a start from which no orbit is found.
    """
    if scene.orbit is None:
        raise InputError("orbit: missing; name the branch in a table [orbit], such as from = 95.0 and to = 105.0")
    search = _Search(scene)
    diagram = Diagram(search.map, search.table, search.low, search.to, search.starts)
    described = replace(scene, orbit=search.table)
    data = dict(provenance or {})

    def found() -> Branches:
        notes = (*warnings_of(search.first), *dict.fromkeys(diagram.notes))
        names, scale = tuple(search.map.names), frozen(search.map.scale)
        return Branches(described, names, scale, tuple(diagram.branches), diagram.iterations, notes, data)

    with Checkpoint(checkpoint, scene, data, lambda: (found(), *diagram.place)) as kept:
        if kept.found is not None:
            diagram.resume(kept.found.branches, kept.tangent, kept.step, kept.found.iterations)

        def changed(done: int, total: int) -> None:
            kept.changed()
            if progress is not None:
                progress(done, total)

        diagram.follow(changed)
    return found()


def orbit_at(branches: Branches, branch: int = 0, point: int = 0) -> Orbit:
    """Return an orbit of branches, by the numbers of its branch and of its point there, with its period map.

    Raises InputError where branches have no such point.
    """
    if not 0 <= branch < len(branches.branches) or not 0 <= point < len(branches.branches[branch].parameter):
        points = ", ".join(str(len(each.parameter)) for each in branches.branches)
        raise InputError(f"branch {branch}, point {point}: there are branches of {points} points, counted from 0")
    own = branches.branches[branch]
    found = map_along(branches.scene).over(own.periods).at(float(own.parameter[point]))
    return replace(newton.find_orbit(found, own.state[point]), parameter=float(own.parameter[point]))


def map_along(scene: Scene) -> PeriodMap:
    """Return the period map at the `from` of a scene's [orbit] table: orbits of its branches are fixed points of it."""
    return _Search(scene).map


class _Search:
    """A scene with its [orbit] table: the range of the parameter, and the period map at its begin."""

    def __init__(self, scene: Scene) -> None:
        """Raise InputError for a parameter that is no number of the motion's equations, or bad at an end."""
        self.scene, self.table = scene, scene.orbit or Table()
        path, self.to = self.table.parameter, self.table.to
        if path.split(".")[0] in _NO_PARAMETERS:
            raise InputError(
                f"orbit.parameter: {path} is no number of the motion's equations; take one such as {FREQUENCY}"
            )
        try:
            given = number_at(scene.to_dict(), path)
        except InputError as error:
            raise InputError(f"orbit.parameter: {str(error).removeprefix('scene: ')}") from None
        self.low = given if self.table.from_ is None else self.table.from_
        if self.to == self.low:
            raise InputError(f"orbit.to: {self.to:g} is where the branch begins; give another value")
        base = replace(scene, sweep={}, orbit=None)
        hertz = hertz_of(path, scene.excitation.engine_order)
        if math.isfinite(hertz) and self.to is not None and scene.excitation.resonance_near is None:
            # the level refers to one resonance along the branch, as in a sweep
            near = (hertz * min(self.low, self.to), hertz * max(self.low, self.to))
            base = replace(base, excitation=replace(base.excitation, resonance_near=near))
        ends = [_at(base, path, value) for value in (self.low, self.to) if value is not None]
        if leaves_open(base):
            choices = choices_of(ends)
            ends = [with_choices(end, choices).scene for end in ends]
        self.first = ends[0]
        self.map: PeriodMap = period_map(self.first, path, self.table.periods or 1)

    def starts(self) -> Starts:
        """Return the states from which the first orbit is sought. Raises InputError if the run ends early."""
        if self.table.start == "linear":
            return of_linear_motion(self.map, self.first, self.table.periods)
        return of_run(self.map, simulate(self.first), self.table.periods)


def _at(scene: Scene, path: str, value: float) -> Scene:
    try:
        return scene.replace({path: value})
    except InputError as error:
        raise InputError(f"orbit: at {path} = {value:g}: {str(error).removeprefix('scene: ')}") from None
