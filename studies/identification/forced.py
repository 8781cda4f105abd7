"""Forced responses: the steady motion at each measured frequency."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from vanedamp.coupling.quantities.amplitude import phase
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Follower, Steady, run
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.measure import Measure

#: steps of differences over the range of a number: of motions that are exact, and of means of runs
_EXACT, _MEAN = 1e-5, 2e-2
#: half width of a 95 % confidence interval over the standard deviation
_NORMAL = 1.96
_TINY = float(np.finfo(float).tiny)


class Forced(Model):
    """A measured forced response."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        names, scene = [measured.measure, phase.name][: len(measured.channels)], study.base.replace(measured.changes)
        self._measures = [Measure.of_runs(scene, name, "measure") for name in names]
        self.followers = [Follower(self.runs, study.paths, count) for _ in measured.at]

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by runs; those that go up or down begin with the state of their neighbour."""
        motions: list[Steady | None] = [None] * len(self.followers)
        before: RestartState | None = None
        for place, linked in self._order():
            motions[place] = run(self.runs, self._at(values, place), before if linked else None, self.count)
            before = _end(motions[place])
        return self._predicted(motions)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by runs, which begin with the last orbits where motions repeat."""
        before: RestartState | None = None
        for place, linked in self._order():
            found = self.followers[place].follow(self._at(values, place), before if linked else None)
            before = _end(found)
        return self._predicted([follower.motion for follower in self.followers])

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives: of orbits exact ones, of means of runs differences."""
        of = np.array([self._slopes(values, place) for place in range(len(self.followers))]).transpose(1, 0, 2)
        return {channel.name: of[number] for number, channel in enumerate(self.measured.channels)}

    def rough_derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives of the runs that `predict` made, and let the next ones begin with these."""
        of = np.array([self._rough_slopes(values, place) for place in range(len(self.followers))]).transpose(1, 0, 2)
        return {channel.name: of[number] for number, channel in enumerate(self.measured.channels)}

    def _order(self) -> Iterator[tuple[int, bool]]:
        """Yield places as they were measured, and whether each was reached from the one before."""
        direction, at = np.array(self.measured.direction), self.measured.at
        for way in ("", "up", "down"):
            places = np.flatnonzero(direction == way)
            places = places[np.argsort(-at[places] if way == "down" else at[places], kind="stable")]
            for number, place in enumerate(places.tolist()):
                yield place, bool(way) and number > 0

    def _slopes(self, values: np.ndarray, place: int) -> np.ndarray:
        """Return derivatives (c, P) of the channels at a place."""
        follower = self.followers[place]
        found, motion = follower.sensitivity(), follower.motion
        if found is not None and all(one.key in found.derivatives for one in self._measures):
            return np.array([found.derivatives[one.key] for one in self._measures])
        if motion is None:
            return np.zeros((len(self._measures), len(values)))
        return self.differences(values, partial(self._beside, place, motion), _EXACT if motion.repeats else _MEAN)

    def _rough_slopes(self, values: np.ndarray, place: int) -> np.ndarray:
        """Return derivatives (c, P) of the channels at a place, by differences of runs to one side."""
        follower = self.followers[place]
        if (motion := follower.motion) is None or not motion.repeats:
            return self._slopes(values, place)
        here, figures = self._figures(motion)[0], partial(self._beside, place, motion)
        found = self.differences(values, figures, _EXACT, here)
        follower.lead()
        return found

    def _beside(self, place: int, motion: Steady, moved: np.ndarray) -> np.ndarray:
        """Return the measured quantities (c,) with values (P,) of the numbers near those of a motion."""
        return self._figures(self.followers[place].beside(self._at(moved, place)) or motion)[0]

    def _at(self, values: np.ndarray, place: int) -> dict[str, float]:
        levels = {path: float(each[place]) for path, each in self.measured.levels.items()}
        return self.numbers(values) | levels | {FREQUENCY: float(self.measured.at[place])}

    def _figures(self, steady: Steady) -> tuple[np.ndarray, float]:
        """Return the measured quantities (c,) of a motion, and the relative error, taken as that of the amplitude."""
        self.count["passages"] += steady.orbit is not None
        figures = np.array([one.value(steady.orbit or steady.response) for one in self._measures])
        if steady.repeats or steady.response is None:
            return figures, 0.0
        error = steady.response.amplitude_mean_confidence or 0.0
        return figures, error / _NORMAL / max(steady.response.amplitude_mean, _TINY)

    def _predicted(self, motions: Sequence[Steady | None]) -> Predicted:
        nothing = np.full(len(self._measures), np.nan), 0.0
        figures, errors = zip(*(nothing if one is None else self._figures(one) for one in motions), strict=True)
        of = dict(zip((channel.name for channel in self.measured.channels), np.transpose(figures), strict=True))
        repeats = [one is not None and not error for one, error in zip(motions, errors, strict=True)]
        return Predicted(of, np.array(errors), np.array(repeats))


def _end(steady: Steady | None) -> RestartState | None:
    return None if steady is None else steady.restart
