"""Forced responses: the steady motion at each measured frequency."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from vanedamp.coupling.quantities.amplitude import phase
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Followers, Steady
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
        self.followers = Followers(self.runs, study.paths, count, self._before())

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by runs; those that go up or down begin with the state of their neighbour."""
        return self._predicted(self.followers.run(self._points(values)))

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by runs, which begin with the last orbits where motions repeat."""
        return self._predicted(self.followers.follow(self._points(values)))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives: of orbits exact ones, of means of runs differences."""
        return self._by_channel(np.array([self._slopes(values, place) for place in range(len(self.measured.at))]))

    def rough_derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives of the runs that `predict` made, and let the next ones begin with these.

        They are differences to one side where motions repeat.
        """
        motions = [follower.motion for follower in self.followers.each]
        of = np.zeros((len(motions), len(self._measures), len(values)))
        rough = {place: motion for place, motion in enumerate(motions) if motion is not None and motion.repeats}
        here = np.array([self._figures(motion)[0] for motion in rough.values()])
        if rough:
            of[list(rough)] = self.differences(values, partial(self._beside, rough), _EXACT, here)
        for place, follower in enumerate(self.followers.each):
            if place in rough:
                follower.lead()
            else:
                of[place] = self._slopes(values, place)
        return self._by_channel(of)

    def _by_channel(self, of: np.ndarray) -> Values:
        """Return derivatives (n, c, P) by the names of the channels."""
        return {channel.name: of[:, number] for number, channel in enumerate(self.measured.channels)}

    def _before(self) -> list[int | None]:
        """Return the place, of each, from which it was reached when it was measured; None for no other one."""
        direction, at = np.array(self.measured.direction), self.measured.at
        found = list[int | None]([None] * len(at))
        for way in ("up", "down"):
            places = np.flatnonzero(direction == way)
            places = places[np.argsort(-at[places] if way == "down" else at[places], kind="stable")]
            for one, other in itertools.pairwise(places.tolist()):
                found[other] = one
        return found

    def _slopes(self, values: np.ndarray, place: int) -> np.ndarray:
        """Return derivatives (c, P) of the channels at a place."""
        follower = self.followers.each[place]
        found, motion = follower.sensitivity(), follower.motion
        if found is not None and all(one.key in found.derivatives for one in self._measures):
            return np.array([found.derivatives[one.key] for one in self._measures])
        if motion is None:
            return np.zeros((len(self._measures), len(values)))
        figures = partial(self._beside, {place: motion})
        return self.differences(values, figures, _EXACT if motion.repeats else _MEAN)[0]

    def _beside(self, motions: Mapping[int, Steady], moved: np.ndarray) -> np.ndarray:
        """Return the measured quantities (n, c) with values (P,) of the numbers near those of motions, by place.

        Runs begin with what leads the followers, or with the motions; where one has no end its motion stays.
        """
        leaders = [
            None if place not in motions else follower.leader or motions[place]
            for place, follower in enumerate(self.followers.each)
        ]
        found = self.followers.beside(self._points(moved), leaders)
        return np.array([self._figures(found[place] or motion)[0] for place, motion in motions.items()])

    def _points(self, values: np.ndarray) -> list[dict[str, float]]:
        """Return the numbers of every place by their paths."""
        return [self._at(values, place) for place in range(len(self.measured.at))]

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
