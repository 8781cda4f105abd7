"""Impacts: times and speeds in the steady motion at the scene's frequency."""

from __future__ import annotations

from collections import Counter

import numpy as np

from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Steady, found_near, run, settled
from vanedamp.studies.identification.study import IdentificationStudy

#: step of differences over the range of a number
_STEP = 1e-5


class Impacts(Model):
    """Measured impacts, each compared with the model's nearest in time. Motions that do not repeat say nothing."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self._motion: Steady | None = None

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by a run."""
        self._motion = None
        return self.predict(values)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by the orbit near the last one, or by a run."""
        scene, last = self.scene(values), self._motion
        steady = None if scene is None or last is None else found_near(scene, last, self.count)
        if steady is None and scene is not None:
            found = run(scene, None, self.count)
            steady = None if found is None else settled(found, self.count)
        self._motion = steady
        speed, time = self._nearest(steady)
        return Predicted({"speed": speed, "time": time}, np.zeros(len(speed)), np.isfinite(speed))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives."""

        def figures(moved: np.ndarray) -> np.ndarray:
            scene, own = self.scene(moved), self._motion
            near = None if scene is None or own is None else found_near(scene, own, self.count)
            return np.concatenate(self._nearest(near))

        speed, time = np.split(np.nan_to_num(self.differences(values, figures, _STEP)), 2)
        return {"speed": speed, "time": time}

    def _nearest(self, steady: Steady | None) -> tuple[np.ndarray, np.ndarray]:
        """Return speeds and times (n,) of the impacts nearest to the measured ones, nan where there are none."""
        at = self.measured.at
        nothing = np.full(len(at), np.nan)
        if steady is None or steady.orbit is None:
            return nothing, nothing
        found = [(each.time, abs(each.speed)) for each in steady.orbit.passage.crossings if "impact " in each.name]
        if not found:
            return nothing, nothing
        times, speeds = np.array(found).T
        period = steady.orbit.periods / steady.scene.frequency
        off = np.remainder(times - at[:, None] + 0.5 * period, period) - 0.5 * period
        place = np.argmin(np.abs(off), axis=1)
        return speeds[place], at + off[np.arange(len(at)), place]
