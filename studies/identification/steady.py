"""Steady motions of a scene whose numbers change little by little: each is found from the last one."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity, SensitivityStatus
from vanedamp.coupling.simulation import simulate

#: ends of runs whose figures count, with their confidence interval
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN)


class Steady(NamedTuple):
    """A steady motion: an orbit, or else the response of a run."""

    scene: Scene
    orbit: Orbit | None
    response: Response | None

    @property
    def restart(self) -> RestartState | None:
        """The state with which the motion continues."""
        if self.orbit is not None and self.orbit.map is not None:
            return self.orbit.map.restart_of(self.orbit.state)
        return None if self.response is None else self.response.final


class Follower:
    """The steady motion of a scene, followed as P numbers of it change.

    paths: of the numbers; motion: the last one found, None before and where there is none; count: of engine runs.
    """

    def __init__(self, paths: tuple[str, ...], count: Counter[str]) -> None:
        self.paths, self._count = paths, count
        self.motion: Steady | None = None
        self._at = np.zeros(len(paths))
        self._slope: np.ndarray | None = None

    def follow(self, scene: Scene | None, values: np.ndarray, before: RestartState | None = None) -> Steady | None:
        """Return the motion of the scene with values (P,) of the numbers: a stable orbit, or else a run.

        The orbit is sought from the last one, moved by its derivatives; the run begins with a state or the scene's own.
        """
        found = None if scene is None else self._near(scene, values)
        if found is None and scene is not None:
            found = settled(run(scene, before, self._count), self._count)
        self.motion, self._at, self._slope = found, values, None
        return found

    def sensitivity(self) -> Sensitivity | None:
        """Return the derivatives of the last motion; None where it has none."""
        if self.motion is None or self.motion.orbit is None:
            return None
        self._count["derivatives"] += 1
        found = sensitivity(self.motion.orbit, self.paths)
        if found.status is not SensitivityStatus.OK:
            return None
        self._slope = found.state_derivative
        return found

    def near(self, scene: Scene | None) -> Steady | None:
        """Return the motion of a scene that differs little from the last one, which stays the last one."""
        if scene is None or self.motion is None:
            return None
        return self._near(scene, self._at) or run(scene, self.motion.restart, self._count)

    def _near(self, scene: Scene, values: np.ndarray) -> Steady | None:
        if self.motion is None or self.motion.orbit is None:
            return None
        last = self.motion.orbit
        moved = 0.0 if self._slope is None else self._slope @ (values - self._at)
        return _orbit(scene, last.periods, last.state + moved, self._count)


def run(scene: Scene, start: RestartState | None, count: Counter[str]) -> Steady | None:
    """Return the motion in which a run ends, from a start or the scene's own; None if it has no end."""
    count["runs"] += 1
    response = simulate(scene, start=start)
    return Steady(scene, None, response) if response.status in _USABLE else None


def settled(steady: Steady | None, count: Counter[str]) -> Steady | None:
    """Return the orbit in which a run has ended; the run itself if its motion does not repeat."""
    response = None if steady is None else steady.response
    periods = None if response is None else periods_of(response.classification)
    if steady is None or response is None or response.final is None or periods is None:
        return steady
    return _orbit(steady.scene, periods, response.final, count) or steady


def _orbit(scene: Scene, periods: int, start: np.ndarray | RestartState, count: Counter[str]) -> Steady | None:
    """Return the stable orbit near a state; None if there is none."""
    passages = map_along(replace(scene, orbit=Table(periods=periods)))
    orbit = newton.find_orbit(passages, start if isinstance(start, np.ndarray) else passages.state_of(start))
    count["passages"] += orbit.iterations + 1
    good = orbit.status is OrbitStatus.OK and (orbit.undetermined or orbit.stable)
    return Steady(scene, orbit, None) if good else None


def over_orbit(steady: Steady, count: Counter[str]) -> Response:
    """Return the response of an orbit, from a run over it."""
    assert steady.orbit is not None
    count["passages"] += 1
    scene = replace(steady.scene, time=Time(periods=steady.orbit.periods, transient=0))
    return simulate(scene, start=steady.restart)
