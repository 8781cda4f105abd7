"""Periodic orbits of scenes, and the branches that they form over one of the scene's numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from vanedamp.coupling.derivatives.numbers import number_of_motion
from vanedamp.coupling.model_order.choices import choices_of, leaves_open, with_choices
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.borders import Borders
from vanedamp.coupling.orbits.branch import Branches, unknown
from vanedamp.coupling.orbits.checkpoint import BranchCheckpoint
from vanedamp.coupling.orbits.diagram import Diagram
from vanedamp.coupling.orbits.first_orbit import Start, Starts, of_linear_motion, of_run
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit
from vanedamp.coupling.orbits.period_map import PeriodMap, centred, period_map
from vanedamp.coupling.orbits.waves import find_wave, of_waves
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.paths import namesake
from vanedamp.coupling.scene.rotation import FREQUENCY, hertz_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: tables whose numbers move no orbit, though they move a run
_STARTS = ("initial",)


def find_orbit(scene: Scene, start: RestartState | None = None) -> PeriodicOrbit:
    """Return the periodic orbit of a scene that its [orbit] table describes, at the table's `from`.

    start: a state near it, instead of the table's `start`. Raises InputError for a scene that the exact engine cannot
    run, or a parameter that is no number of it; an orbit that is not found is a status of the result.
    """
    search = _Search(scene)
    if start is not None:
        candidates = [Start(search.map.state_of(at_speed_of(search.first, start)), search.map.periods)]
    else:
        candidates = list(search.starts().candidates)
    for state, periods in candidates:
        orbit = (find_wave if search.table.wave else newton.find_orbit)(search.map.over(periods), state)
        if orbit.status is OrbitStatus.OK:
            break
    return replace(orbit, parameter=search.low)


def settled_orbit(scene: Scene) -> PeriodicOrbit | None:
    """Return the orbit on which the run of a scene settles; None if it does not."""
    response = simulate(scene)
    periods = periods_of(response.classification)
    if response.final is None or periods is None:
        return None
    turns = scene.rotation if scene.excitation.engine_order is not None else None
    parameter = FREQUENCY if turns is None else f"rotation.{'speed' if turns.rpm is None else 'rpm'}"
    orbit = find_orbit(replace(scene, orbit=Table(parameter=parameter, periods=periods)), response.final)
    return orbit if orbit.status is OrbitStatus.OK else None


def orbits(
    scene: Scene,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Branches:
    """Follow the periodic orbits of a scene over a number of it, by its [orbit] table.

    progress: called with points found and possible; checkpoint: a file to which found
    points are written and from which an interrupted call resumes; the caller removes it once the result is safe
    (files.checkpoint_file.clear).
    Raises InputError for a scene without the table, one that the exact engine cannot run, a parameter that is no
    number of it, and a start from which no orbit is found.
    """
    if scene.orbit is None:
        raise InputError("orbit: missing; name the branch in a table [orbit], such as from = 95.0 and to = 105.0")
    search = _Search(scene)
    diagram = Diagram(search.map, search.table, search.low, search.to, search.starts)
    borders = search.borders()
    described = replace(scene, orbit=search.table)
    spots = hot_spots_in_file(search.first.structure)
    data = dict(provenance or {}) | ({"hot_spots": spots} if spots else {})

    def found() -> Branches:
        known = (
            f"branch {number}: {note}" for number, branch in enumerate(diagram.branches) if (note := unknown(branch))
        )
        notes = (*search.warnings, *dict.fromkeys([*diagram.notes, *(borders.notes if borders else ()), *known]))
        names, scale = tuple(search.map.names), frozen(search.map.scale)
        return Branches(
            described, names, scale, tuple(diagram.branches), diagram.iterations, notes, data,
            () if borders is None else tuple(borders.finished),
        )  # fmt: skip

    with BranchCheckpoint(checkpoint, scene, data, lambda: (found(), *diagram.place)) as saved:
        if saved.found is not None:
            diagram.resume(saved.found.branches, saved.head, saved.step, saved.found.iterations)
            if borders is not None:
                borders.resume(saved.found.borders)

        def changed(done: int, total: int) -> None:
            saved.changed()
            if progress is not None:
                progress(done, total)

        diagram.follow(changed)
        if borders is not None:
            points = sum(len(branch.parameter) for branch in diagram.branches)
            borders.follow(diagram.branches, lambda done, total: changed(points + done, points + total))
    return found()


def orbit_at(branches: Branches, branch: int = 0, point: int = 0) -> PeriodicOrbit:
    """Return an orbit of branches, by the numbers of its branch and of its point there, with its period map.

    Raises InputError where branches have no such point.
    """
    if not 0 <= branch < len(branches.branches) or not 0 <= point < len(branches.branches[branch].parameter):
        points = ", ".join(str(len(each.parameter)) for each in branches.branches)
        raise InputError(f"branch {branch}, point {point}: there are branches of {points} points, counted from 0")
    along = branches.branches[branch]
    map_ = map_along(branches.scene).over(along.periods).at(float(along.parameter[point]))
    return replace(newton.find_orbit(map_, along.state[point]), parameter=float(along.parameter[point]))


def map_along(scene: Scene) -> PeriodMap:
    """Return the period map at the `from` of a scene's [orbit] table: orbits of its branches are fixed points of it."""
    return _Search(scene).map


class _Search:
    """A scene with its [orbit] table: the range of the parameter, and the period map at its begin."""

    def __init__(self, scene: Scene) -> None:
        """Raise InputError for a parameter that is no number of the motion's equations, or bad at an end."""
        self.scene, self.table = scene, scene.orbit or Table()
        path, self.to, track = self.table.parameter, self.table.to, self.table.track
        given = number_of_motion(scene, path, "orbit.parameter", _STARTS)
        self.low = given if self.table.from_ is None else self.table.from_
        if track is not None:
            self.second = number_of_motion(scene, track.parameter, "orbit.track.parameter", _STARTS)
            if namesake(scene.to_dict(), track.parameter, [path]) is not None:
                raise InputError(f"orbit.track.parameter: {track.parameter} is orbit.parameter; take another number")
            self.first_second = self.second if track.from_ is None else track.from_
            if track.to == self.first_second or not 0.0 <= self._share(self.second) <= 1.0:
                raise InputError(
                    f"orbit.track: {track.parameter} = {self.second:g} of the scene must lie in a range from "
                    f"`from` ({self.first_second:g}) to `to` ({track.to:g})"
                )
        if self.to == self.low:
            raise InputError(f"orbit.to: {self.to:g} is where the branch begins; give another value")
        base = replace(scene, sweep={}, orbit=None)
        hertz = hertz_of(path, scene.excitation.engine_order)
        if math.isfinite(hertz) and self.to is not None and scene.excitation.resonance_near is None:
            # the level refers to one resonance along the branch, as in a sweep
            near = (hertz * min(self.low, self.to), hertz * max(self.low, self.to))
            base = replace(base, excitation=replace(base.excitation, resonance_near=near))
        ends = [_at(base, {path: value}) for value in (self.low, self.to) if value is not None]
        if track is not None and self.to is not None:
            corners = itertools.product((self.low, self.to), (self.first_second, track.to))
            ends += [_at(centred(base), {path: one, track.parameter: two}) for one, two in corners]
        self.first, self.warnings, choices = ends[0], warnings_of(ends[0]), None
        if leaves_open(base):
            choices = choices_of(ends, more=True)
            made = with_choices(ends[0], choices)
            self.first, self.warnings = made.scene, made.warnings
        second = "" if track is None else track.parameter
        self._periods = 1 if self.table.wave else self.table.periods
        self.map: PeriodMap = period_map(ends[0], path, self._periods or 1, second, choices)

    def _share(self, second: float) -> float:
        """Return where a value lies in the range of the second number, 0 to 1."""
        assert self.table.track is not None
        return (second - self.first_second) / (self.table.track.to - self.first_second)

    def borders(self) -> Borders | None:
        """Return the search for borders over the second number; None without one."""
        track = self.table.track
        if track is None or self.to is None:
            return None
        low, high = track.within or (self.low, self.to)
        origin, span = (low, self.first_second), (high - low, track.to - self.first_second)
        along = of_waves(self.map) if self.table.wave else self.map
        return Borders(along, self.table, origin, span, self.second)

    def starts(self) -> Starts:
        """Return the states from which the first orbit is sought. Raises InputError if the run ends early."""
        if self.table.start == "linear":
            return of_linear_motion(self.map, self.first, self._periods)
        return of_run(self.map, simulate(self.first), self._periods)


def _at(scene: Scene, values: Mapping[str, float]) -> Scene:
    try:
        return scene.replace(values)
    except InputError as error:
        where = " and ".join(f"{path} = {value:g}" for path, value in values.items())
        raise InputError(f"orbit: at {where}: {str(error).removeprefix('scene: ')}") from None
