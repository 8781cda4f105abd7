"""Impacts: times and speeds in the steady motion at the scene's frequency."""

from __future__ import annotations

from collections import Counter

import numpy as np

from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Follower
from vanedamp.studies.identification.study import IdentificationStudy


class Impacts(Model):
    """Measured impacts, each compared with the model's nearest in time. Motions that do not repeat say nothing."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self._found: Sensitivity | None = None
        self.followers = [Follower(study.paths, count)]

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by a run."""
        self.followers = [Follower(self.paths, self.count)]
        return self.predict(values)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by the orbit near the last one, or by a run."""
        self.followers[0].follow(self.scene(values))
        self._found, size = self.followers[0].sensitivity(), len(self.measured.at)
        found = self._nearest()
        if found is None or self._found is None:
            return Predicted(
                {name: np.full(size, np.nan) for name in ("speed", "time")}, np.zeros(size), np.zeros(size, bool)
            )
        place, off = found
        of = {"speed": self._found.impact_speed[place], "time": self.measured.at + off}
        return Predicted(of, np.zeros(size), np.ones(size, bool))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives."""
        found, nothing = self._nearest(), np.zeros((len(self.measured.at), len(values)))
        if found is None or self._found is None:
            return {"speed": nothing, "time": nothing}
        place, _ = found
        return {"speed": self._found.impact_speed_derivative[place], "time": self._found.impact_time_derivative[place]}

    def _nearest(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return numbers (n,) of the impacts nearest to the measured ones and how much later they are, s; or None."""
        motion = self.followers[0].motion
        if self._found is None or motion is None or motion.orbit is None or not len(self._found.impact_time):
            return None
        period = motion.orbit.periods / motion.scene.frequency
        off = np.remainder(self._found.impact_time - self.measured.at[:, None] + 0.5 * period, period) - 0.5 * period
        place = np.argmin(np.abs(off), axis=1)
        return place, off[np.arange(len(place)), place]
