"""Impacts: times and speeds in the steady motion at the scene's frequency."""

from __future__ import annotations

from collections import Counter

import numpy as np

from vanedamp.coupling.orbits.newton import Orbit
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Follower
from vanedamp.studies.identification.study import IdentificationStudy


class Impacts(Model):
    """Measured impacts, each compared with the model's nearest in time. Motions that do not repeat say nothing."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self.followers = [Follower(self.runs, study.paths, count)]

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by a run."""
        self.followers = [Follower(self.runs, self.paths, self.count)]
        return self.predict(values)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by the orbit near the last one, or by a run."""
        self.followers[0].follow(self.numbers(values))
        orbit, size = self.followers[0].orbit(), len(self.measured.at)
        struck = () if orbit is None else orbit.passage.impacts
        if orbit is None or not struck:
            return Predicted(
                {name: np.full(size, np.nan) for name in ("speed", "time")}, np.zeros(size), np.zeros(size, bool)
            )
        time, speed = np.array([(one.time, abs(one.speed)) for one in struck]).T
        place, off = self._nearest(orbit, time)
        return Predicted({"speed": speed[place], "time": self.measured.at + off}, np.zeros(size), np.ones(size, bool))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives."""
        found, nothing = self.followers[0].sensitivity(), np.zeros((len(self.measured.at), len(values)))
        orbit = self.followers[0].orbit()
        if orbit is None or found is None or not len(found.impact_time):
            return {"speed": nothing, "time": nothing}
        place, _ = self._nearest(orbit, found.impact_time)
        return {"speed": found.impact_speed_derivative[place], "time": found.impact_time_derivative[place]}

    def _nearest(self, orbit: Orbit, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return numbers (n,) of the impacts at times, s, nearest to the measured ones, and how much later they are."""
        period = orbit.periods / orbit.map.scene.frequency  # type: ignore[union-attr]
        off = np.remainder(time - self.measured.at[:, None] + 0.5 * period, period) - 0.5 * period
        place = np.argmin(np.abs(off), axis=1)
        return place, off[np.arange(len(place)), place]
