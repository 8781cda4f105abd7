"""Steady motions of a scene whose numbers change little by little: each is found from one before."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity
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

    @property
    def repeats(self) -> bool:
        """Whether the motion repeats."""
        return self.response is None or periods_of(self.response.classification) is not None


class Follower:
    """The steady motion of a scene, followed as numbers of it change.

    paths: of the numbers; motion: the last one found, None before and where there is none; leader: the motion that runs
    begin with, if any; count: of engine runs.
    Runs are followed rather than orbits: a passage of the period map, which has derivatives, takes about as long as
    a thousand periods without.
    """

    def __init__(self, paths: tuple[str, ...], count: Counter[str]) -> None:
        self.paths, self._count = paths, count
        self.motion: Steady | None = None
        self.leader: Steady | None = None

    def follow(self, scene: Scene | None, before: RestartState | None = None) -> Steady | None:
        """Return the motion of a scene: a run from one that repeats, or else from a state or the scene's own start.

        That one changes with `lead` and `sensitivity`, and where a run from it has no end, such as in a narrower gap.
        """
        self.motion = None if self.leader is None else self.beside(scene)
        if self.motion is None and scene is not None:
            self.motion = settled(run(scene, before, self._count), self._count)
            self.lead()
        return self.motion

    def lead(self) -> None:
        """Let runs begin with the last motion from now on, if it repeats."""
        self.leader = self.motion if self.motion is not None and self.motion.repeats else None

    def sensitivity(self) -> Sensitivity | None:
        """Return the derivatives of the last motion, as an orbit, which leads; None where it has none."""
        self.motion = settled(self.motion, self._count)
        self.lead()
        if self.motion is None or self.motion.orbit is None:
            return None
        self._count["derivatives"] += 1
        found = sensitivity(self.motion.orbit, self.paths)
        return found if found.complete else None

    def beside(self, scene: Scene | None) -> Steady | None:
        """Return the motion of a scene that differs little from the last one, which stays the last one."""
        leader = self.leader or self.motion
        return None if scene is None or leader is None else run(scene, leader.restart, self._count)


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
    passages = map_along(replace(steady.scene, orbit=Table(periods=periods)))
    orbit = newton.find_orbit(passages, passages.state_of(response.final))
    count["passages"] += orbit.iterations + 1
    good = orbit.status is OrbitStatus.OK and (orbit.undetermined or orbit.stable)
    return Steady(steady.scene, orbit, None) if good else steady
