"""Decays: the amplitudes of a ring-down at the measured times."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.studies.identification.model import Model, Predicted, Values

#: step of differences over the range of a number
_STEP = 1e-5


class Decay(Model):
    """A measured decay. Between half cycles amplitudes are interpolated as exponentials."""

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction."""
        return self.predict(values)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction."""
        count = len(self.measured.at)
        return Predicted({"amplitude": self._amplitudes(values)}, np.zeros(count), np.ones(count, bool))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives."""
        return {"amplitude": np.nan_to_num(self.differences(values, self._amplitudes, _STEP))}

    def _amplitudes(self, values: np.ndarray) -> np.ndarray:
        """Return the amplitudes (n,), m, nan where the scene does not ring down."""
        nothing, scene = np.full(len(self.measured.at), np.nan), self.scene(values)
        if scene is None:
            return nothing
        self.count["runs"] += 1
        found = ring_down(scene)
        half = found.half_cycles
        moving = half.amplitude > 0.0
        if found.status is not Status.OK or np.count_nonzero(moving) < 2:
            return nothing
        return interpolated(self.measured.at, half.time[moving], np.log(half.amplitude[moving]))


def interpolated(at: np.ndarray, time: np.ndarray, logarithm: np.ndarray) -> np.ndarray:
    """Return exponentials (n,) between values known at times (k,) by their logarithms, and beyond the ends."""
    place = np.clip(np.searchsorted(time, at) - 1, 0, len(time) - 2)
    share = (at - time[place]) / (time[place + 1] - time[place])
    return np.asarray(np.exp(logarithm[place] + share * (logarithm[place + 1] - logarithm[place])))
