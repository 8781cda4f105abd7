"""Impacts: times and speeds in the steady motion at the scene's frequency."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from vanedamp.coupling.derivatives.passage import Crossing
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Followers, Steady, map_of
from vanedamp.studies.identification.study import IdentificationStudy


class Impacts(Model):
    """Measured impacts, each compared with the model's nearest in time. Motions that do not repeat say nothing."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self.followers = Followers(self.runs, study.paths, count)

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by the motion in which a run from the scene's own start ends."""
        return self._of(*self.followers.run([self.numbers(values)]))

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by the motion near the last one, or that of the scene's own start."""
        return self._of(*self.followers.follow([self.numbers(values)]))

    def _of(self, motion: Steady | None) -> Predicted:
        """Return the prediction by a motion."""
        if motion is not None and motion.orbit is not None and motion.orbit.map is not None:
            return self._predicted(motion.orbit.passage.impacts, _length(motion.orbit.map))
        if motion is None or (passages := map_of(self.runs, motion)) is None:
            return self._predicted((), math.nan)
        self.count["passages"] += 1
        return self._predicted(passages[0](passages[1], False).impacts, _length(passages[0]))

    def _predicted(self, struck: Sequence[Crossing], period: float) -> Predicted:
        """Return the prediction by the impacts of a motion that repeats after a period, s."""
        size = len(self.measured.at)
        if not struck:
            return Predicted(
                {name: np.full(size, np.nan) for name in ("speed", "time")}, np.zeros(size), np.zeros(size, bool)
            )
        time, speed = np.array([(one.time, abs(one.speed)) for one in struck]).T
        place, off = self._nearest(time, period)
        return Predicted({"speed": speed[place], "time": self.measured.at + off}, np.zeros(size), np.ones(size, bool))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives."""
        found, nothing = self.followers.each[0].sensitivity(), np.zeros((len(self.measured.at), len(values)))
        orbit = self.followers.each[0].orbit()
        if orbit is None or orbit.map is None or found is None or not len(found.impact_time):
            return {"speed": nothing, "time": nothing}
        place, _ = self._nearest(found.impact_time, _length(orbit.map))
        return {"speed": found.impact_speed_derivative[place], "time": found.impact_time_derivative[place]}

    def _nearest(self, time: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
        """Return numbers (n,) of the impacts at times, s, nearest to the measured ones, and how much later they are."""
        off = np.remainder(time - self.measured.at[:, None] + 0.5 * period, period) - 0.5 * period
        place = np.argmin(np.abs(off), axis=1)
        return place, off[np.arange(len(place)), place]


def _length(passages: PeriodMap) -> float:
    """Return the time that a passage takes, s."""
    return passages.periods / passages.scene.frequency
