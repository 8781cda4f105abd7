"""Decays: amplitudes of a ring-down, or its motion, at the measured times."""

from __future__ import annotations

from collections import Counter

import numpy as np

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.studies.identification.data import MOTION, Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.study import IdentificationStudy

#: step of differences over the range of a number, where there are no exact derivatives
_STEP = 1e-5
#: speed over the largest one above which a coordinate has been turned by an impact
_TURNED = 1e-6


class Decay(Model):
    """A measured decay. Between half cycles amplitudes are interpolated as exponentials."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self._name = measured.channels[0].name
        self._last: RingDown | None = None
        self._slopes: tuple[RingDown, Sensitivity] | None = None

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction."""
        return self.predict(values)

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction."""
        self._last, count = self._released(values), len(self.measured.at)
        return Predicted({self._name: self._of(self._last)}, np.zeros(count), np.ones(count, bool))

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives, exact ones where the motion has them."""
        found = None if self._last is None else self._exact(self._last)
        if found is None:
            found = self.differences(values, lambda moved: self._of(self._released(moved)), _STEP)
        return {self._name: np.nan_to_num(found)}

    def _released(self, values: np.ndarray) -> RingDown | None:
        """Return the ring-down with values (P,) of the numbers; None where there is none."""
        scene = self.runs.scene(self.numbers(values))
        if scene is None:
            return None
        self.count["runs"] += 1
        found = ring_down(scene)
        return found if found.status is Status.OK else None

    def _of(self, found: RingDown | None) -> np.ndarray:
        """Return the measured quantity (n,) in a ring-down, nan where there is none."""
        nothing = np.full(len(self.measured.at), np.nan)
        if found is None:
            return nothing
        if self._name in MOTION:
            sampled = self._sampled(found).motion
            return sampled[:, MOTION.index(self._name)] if len(sampled) == len(nothing) else nothing
        half = found.half_cycles
        moving = half.amplitude > 0.0
        if np.count_nonzero(moving) < 2:
            return nothing
        return interpolated(self.measured.at, half.time[moving], np.log(half.amplitude[moving]))

    def _sampled(self, found: RingDown) -> Sensitivity:
        """Return the motion at the measured times, or at the turning points, with its derivatives."""
        if self._slopes is None or self._slopes[0] is not found:
            self.count["derivatives"] += 1
            times = self.measured.at.tolist() if self._name in MOTION else ()
            self._slopes = found, sensitivity(found, self.paths, times=times)
        return self._slopes[1]

    def _exact(self, found: RingDown) -> np.ndarray | None:
        """Return the derivatives (n, P); None where the motion has none."""
        slopes = self._sampled(found)
        if not slopes.complete:
            return None
        if self._name in MOTION:
            return np.asarray(slopes.motion_derivative[:, MOTION.index(self._name)])
        return _of_amplitudes(self.measured.at, found, slopes)


def _of_amplitudes(at: np.ndarray, found: RingDown, slopes: Sensitivity) -> np.ndarray | None:
    """Return the derivatives (n, P) of interpolated amplitudes; None if an impact has turned the motion.

    A turning point x moves by dx/dq at a fixed time, and its time by -(dv/dq)/a.
    """
    speed, half = np.abs(slopes.motion[:, 1]), found.half_cycles
    if len(slopes.time) != len(found.time) or np.any(speed[1:] > _TURNED * _fastest(found)):
        return None
    x, _, a = slopes.motion.T
    of_x, of_v, _ = slopes.motion_derivative.transpose(1, 0, 2)
    of_time = -of_v / a[:, None]
    of_time[0] = np.where(speed[0] > _TURNED * _fastest(found), 0.0, of_time[0])
    of_amplitude = 0.5 * np.sign(np.diff(x))[:, None] * np.diff(of_x, axis=0)
    of_logarithm, of_middle = of_amplitude / half.amplitude[:, None], 0.5 * (of_time[1:] + of_time[:-1])
    place, share, step, slope = _between(at, half.time, np.log(half.amplitude))
    value = np.exp(np.log(half.amplitude)[place] + share * step)[:, None]
    left, right = (of_logarithm[place + k] - slope[:, None] * of_middle[place + k] for k in (0, 1))
    return np.asarray(value * ((1.0 - share)[:, None] * left + share[:, None] * right))


def _fastest(found: RingDown) -> float:
    """Return about the largest speed of a ring-down, m/s."""
    half = found.half_cycles
    return float((2.0 * np.pi * half.frequency * half.amplitude).max())


def interpolated(at: np.ndarray, time: np.ndarray, logarithm: np.ndarray) -> np.ndarray:
    """Return exponentials (n,) between values known at times (k,) by their logarithms, and beyond the ends."""
    place, share, step, _ = _between(at, time, logarithm)
    return np.asarray(np.exp(logarithm[place] + share * step))


def _between(
    at: np.ndarray, time: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the knot before each of n times, where between it and the next it lies, the values' step and slope."""
    place = np.clip(np.searchsorted(time, at) - 1, 0, len(time) - 2)
    span, step = time[place + 1] - time[place], values[place + 1] - values[place]
    return place, (at - time[place]) / span, step, step / span
