"""Steady motions of a scene whose numbers change little by little: each is found from one before."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeGuard

import numpy as np

from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit
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
    orbit: PeriodicOrbit | None
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

    def lead(self) -> None:
        """Let runs begin with the last motion from now on, if it repeats."""
        self.leader = self.motion if self.motion is not None and self.motion.repeats else None

    def orbit(self) -> PeriodicOrbit | None:
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


class Followers:
    """The steady motions of a scene at several places, each followed; runs of all of them are one compiled call.

    before: the place, of each, with whose end a run without a leader begins; None for the scene's own start.
    """

    def __init__(
        self, runs: Runs, paths: tuple[str, ...], count: Counter[str], before: Sequence[int | None] = (None,)
    ) -> None:
        self._runs, self._count, self._before = runs, count, before
        self.each = [Follower(runs, paths, count) for _ in before]

    def run(self, points: Sequence[Mapping[str, float]]) -> list[Steady | None]:
        """Return the motions in which runs end that nothing leads, of numbers by place; None where one has no end."""
        found = list[Steady | None]([None] * len(points))
        self._in_turn(points, range(len(points)), found, lambda motions: motions)
        return found

    def follow(self, points: Sequence[Mapping[str, float]]) -> list[Steady | None]:
        """Return the motions with numbers by place: runs from those that lead, or else as `run`.

        The latter repeat themselves, and lead. What leads changes with Follower.lead and sensitivity, too, and where
        a run from it has no end, such as in a narrower gap.
        """
        found = self.beside(points, [follower.leader for follower in self.each])
        missing = [place for place, motion in enumerate(found) if motion is None]
        self._in_turn(points, missing, found, self._repeated)
        for place, follower in enumerate(self.each):
            follower.motion = found[place]
            if place in missing:
                follower.lead()
        return found

    def beside(self, points: Sequence[Mapping[str, float]], leaders: Sequence[Steady | None]) -> list[Steady | None]:
        """Return the motions with numbers by place that differ little from those of leaders; None without one."""
        found = list[Steady | None]([None] * len(points))
        led = {place: leader for place, leader in enumerate(leaders) if leader is not None}
        motions = self._run([points[place] for place in led], [leader.restart for leader in led.values()])
        for place, motion in zip(led, motions, strict=True):
            found[place] = motion
        return found

    def _in_turn(
        self, points: Sequence[Mapping[str, float]], places: Iterable[int], found: list[Steady | None],
        settle: Callable[[list[Steady | None]], list[Steady | None]],
    ) -> None:  # fmt: skip
        """Set the motions of some places, all those that no other of them comes before as one."""
        waiting = list(places)
        while waiting:
            ready = [place for place in waiting if self._before[place] not in waiting]
            others = [self._before[place] for place in ready]
            starts = [None if other is None else end_of(found[other]) for other in others]
            for place, motion in zip(ready, settle(self._run([points[p] for p in ready], starts)), strict=True):
                found[place] = motion
            waiting = [place for place in waiting if place not in ready]

    def _run(self, points: Sequence[Mapping[str, float]], starts: Sequence[RestartState | None]) -> list[Steady | None]:
        """Return the motions in which runs end, each from a start or the scene's own."""
        self._count["runs"] += len(points)
        return [
            Steady(numbers, None, ran) if ran is not None and ran.status in _USABLE else None
            for numbers, ran in zip(points, self._runs.run_all(points, starts), strict=True)
        ]

    def _repeated(self, motions: list[Steady | None]) -> list[Steady | None]:
        """Return the motions after more runs until these repeat them; orbits where they do not.

        A thousand periods take less than one passage of Newton's method.
        """
        found, waiting = list(motions), {place: motion for place, motion in enumerate(motions) if _goes_on(motion)}
        for _ in range(_MORE):
            again = self._run([one.numbers for one in waiting.values()], [one.restart for one in waiting.values()])
            for (place, one), more in zip(tuple(waiting.items()), again, strict=True):
                if more is None or not more.repeats:
                    found[place] = settled(self._runs, waiting.pop(place), self._count)
                    continue
                found[place] = waiting[place] = more
                if not _goes_on(more) or _same(one, more):
                    del waiting[place]
        for place, one in waiting.items():
            found[place] = settled(self._runs, one, self._count)
        return found


def end_of(steady: Steady | None) -> RestartState | None:
    """Return the state with which a motion continues; None without one."""
    return None if steady is None else steady.restart


def _goes_on(steady: Steady | None) -> TypeGuard[Steady]:
    """Return whether a motion is a run that repeats and that others may go on from."""
    return steady is not None and steady.response is not None and steady.repeats and steady.response.final is not None


def _same(one: Steady, other: Steady) -> bool:
    """Return whether the amplitudes of two runs are the same."""
    first, second = ([getattr(each.response, name) for name in _REPEATED] for each in (one, other))
    most = _SAME * abs(second[_REPEATED.index("amplitude_max")])
    return all(abs(before - after) <= most for before, after in zip(first, second, strict=True))


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
