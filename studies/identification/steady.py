"""Steady motions of a scene whose numbers change little by little: each is found from one before."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity
from vanedamp.coupling.sweep.runs import Ran, Runs

#: ends of runs whose figures count, with their confidence interval
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN)
#: runs until a motion repeats itself, amplitudes that tell it, and their difference, relative, that is none
_MORE, _REPEATED, _SAME = 8, ("amplitude_mean", "amplitude_max", "amplitude_harmonic"), 1e-12


class Steady(NamedTuple):
    """A steady motion of a scene with some numbers, by their paths: an orbit, or else what a run has."""

    numbers: Mapping[str, float]
    orbit: Orbit | None
    response: Ran | Response | None

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

    runs: of the scene; paths: of the numbers; motion: the last one found, None before and where there is none; leader:
    the motion that runs begin with, if any; count: of engine runs.
    Runs are followed rather than orbits: a passage of the period map, which has derivatives, takes about as long as
    a thousand periods without.
    """

    def __init__(self, runs: Runs, paths: tuple[str, ...], count: Counter[str]) -> None:
        self._runs, self.paths, self._count = runs, paths, count
        self.motion: Steady | None = None
        self.leader: Steady | None = None

    def follow(self, numbers: Mapping[str, float], before: RestartState | None = None) -> Steady | None:
        """Return the motion with numbers: a run from one that repeats, or else from a state or the scene's own start.

        That one changes with `lead` and `sensitivity`, and where a run from it has no end, such as in a narrower gap.
        """
        self.motion = None if self.leader is None else self.beside(numbers)
        if self.motion is None:
            self.motion = repeated(self._runs, run(self._runs, numbers, before, self._count), self._count)
            self.lead()
        return self.motion

    def lead(self) -> None:
        """Let runs begin with the last motion from now on, if it repeats."""
        self.leader = self.motion if self.motion is not None and self.motion.repeats else None

    def orbit(self) -> Orbit | None:
        """Return the last motion as an orbit, which leads; None where it is none."""
        self.motion = settled(self._runs, self.motion, self._count)
        self.lead()
        return None if self.motion is None else self.motion.orbit

    def sensitivity(self) -> Sensitivity | None:
        """Return the derivatives of the last motion, as an orbit, which leads; None where it has none."""
        if (orbit := self.orbit()) is None:
            return None
        self._count["derivatives"] += 1
        found = sensitivity(orbit, self.paths)
        return found if found.complete else None

    def beside(self, numbers: Mapping[str, float]) -> Steady | None:
        """Return the motion with numbers that differ little from those of the last one, which stays the last one."""
        leader = self.leader or self.motion
        return None if leader is None else run(self._runs, numbers, leader.restart, self._count)


def run(runs: Runs, numbers: Mapping[str, float], start: RestartState | None, count: Counter[str]) -> Steady | None:
    """Return the motion in which a run ends, from a start or the scene's own; None if it has no end."""
    count["runs"] += 1
    response = runs.run(numbers, start)
    return Steady(numbers, None, response) if response is not None and response.status in _USABLE else None


def repeated(runs: Runs, steady: Steady | None, count: Counter[str]) -> Steady | None:
    """Return the motion in which a run has ended, after more runs until these repeat it; its orbit where they do not.

    A thousand periods take less than one passage of Newton's method.
    """
    for _ in range(_MORE):
        if steady is None or steady.response is None or not steady.repeats or steady.response.final is None:
            return steady
        again = run(runs, steady.numbers, steady.response.final, count)
        if again is None or again.response is None or not again.repeats:
            break
        same = all(
            abs(getattr(again.response, name) - getattr(steady.response, name))
            <= _SAME * abs(again.response.amplitude_max)
            for name in _REPEATED
        )
        steady = again
        if same:
            return steady
    return settled(runs, steady, count)


def map_of(runs: Runs, steady: Steady) -> tuple[PeriodMap, np.ndarray] | None:
    """Return the period map of the motion in which a run has ended, and its state (k,); None if it does not repeat."""
    response, scene = steady.response, runs.scene(steady.numbers)
    periods = None if response is None else periods_of(response.classification)
    if response is None or response.final is None or periods is None or scene is None:
        return None
    passages = map_along(replace(scene, orbit=Table(periods=periods)))
    return passages, passages.state_of(response.final)


def settled(runs: Runs, steady: Steady | None, count: Counter[str]) -> Steady | None:
    """Return the orbit in which a run has ended; the run itself if its motion does not repeat."""
    if steady is None or steady.orbit is not None or (passages := map_of(runs, steady)) is None:
        return steady
    orbit = newton.find_orbit(*passages)
    count["passages"] += orbit.iterations + 1
    good = orbit.status is OrbitStatus.OK and (orbit.undetermined or orbit.stable)
    return Steady(steady.numbers, orbit, None) if good else steady
