"""The misfit of a scene's numbers to measurements, as a sum of squares, and its minimum near a start."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from vanedamp.studies.identification.data import Channel, Measured
from vanedamp.studies.identification.decay import Decay
from vanedamp.studies.identification.forced import Forced
from vanedamp.studies.identification.impacts import Impacts
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Follower, Steady
from vanedamp.studies.identification.study import IdentificationStudy

_MODELS: dict[str, type[Model]] = {"forced": Forced, "decay": Decay, "impacts": Impacts}
#: residual, in standard deviations, of a value of which the model says nothing, and the largest of others
_NOTHING = 30.0
#: relative standard deviation that is assumed before the residuals tell it
_ASSUMED = 0.05
#: changes of the sum of squares, relative, and of the coordinates at which the minimum is found; most predictions
_CLOSE, _STILL, _MOST = 1e-5, 1e-7, 60
#: the largest such changes, where motions do not repeat and predictions scatter
_LEAST_CLOSE, _LEAST_STILL = 0.1, 1e-3
_TINY = float(np.finfo(float).tiny)
#: change of the residuals, in standard deviations together, over which their derivatives are the same
_STRAIGHT = 0.5


class OutOfTime(Exception):
    """The time that a search may take is over."""


class _Settled(Exception):
    """A step of a search can bring no more than the change at which the minimum is found."""


class Minimum(NamedTuple):
    """Where a search has ended: coordinates (P,), sum of squares, and whether it converged."""

    z: np.ndarray
    misfit: float
    converged: bool


class Fit:
    """Predictions of all measurements, and their weighted residuals (N,) with derivatives (N, P).

    Numbers are given by coordinates z (P,) from 0 to 1 between their bounds (IdentificationStudy.coordinates).
    deviations: standard deviation of each channel; until: when the search must end, s on the monotonic clock; count: of
    engine runs and passages.
    """

    def __init__(
        self, study: IdentificationStudy, deviations: Sequence[float] | None = None, until: float = math.inf
    ) -> None:
        self.study, self.until, self.count = study, until, Counter[str]()
        self.models = [_MODELS[one.kind](study, one, self.count) for one in study.measured]
        self.channels: list[Channel] = [channel for one in study.measured for channel in one.channels]
        self.deviations = list(map(_assumed, self.channels) if deviations is None else map(float, deviations))
        self._priors = [(place, one.prior) for place, one in enumerate(study.numbers.values()) if one.prior]
        self._last: tuple[np.ndarray, list[Predicted]] | None = None
        self._kept: list[Steady | None] = []

    @property
    def estimated(self) -> list[bool]:
        """Which channels have deviations from the residuals."""
        return [channel.deviation is None for channel in self.channels]

    def quick(self, z: np.ndarray) -> float:
        """Return the sum of squares by runs from the scene's own start."""
        values = self.study.values(z)
        residual = self._residual(values, [model.quick(values) for model in self.models])
        return float(residual @ residual)

    def predict(self, z: np.ndarray) -> list[Predicted]:
        """Return the predictions of all measurements. Raises OutOfTime."""
        if self._last is None or not np.array_equal(self._last[0], z):
            if time.monotonic() > self.until:
                raise OutOfTime
            values = self.study.values(z)
            self._last = np.array(z), [model.predict(values) for model in self.models]
        return self._last[1]

    def remember(self, z: np.ndarray) -> None:
        """Keep the motions at z for `recall`."""
        self.predict(z)
        self._kept = [follower.leader for follower in self._followers]

    def recall(self) -> None:
        """Begin with the motions that were kept last: what follows depends on no place in between."""
        for follower, leader in zip(self._followers, self._kept, strict=True):
            follower.leader = leader
        self._last = None

    def forget(self) -> None:
        """Let motions begin with the scene's own start again: what follows depends on no place before."""
        for follower in self._followers:
            follower.motion = follower.leader = None
        self._last = None

    @property
    def _followers(self) -> list[Follower]:
        return [follower for model in self.models for follower in model.followers.each]

    def widening(self, z: np.ndarray) -> float:
        """Return the sum of the logarithms of standard deviations with the errors of runs over those without."""
        wider = [
            np.log(np.hypot(deviation, np.nan_to_num(error)) / deviation).sum()
            for (_, _, error), deviation in zip(self._pairs(self.predict(z)), self.deviations, strict=True)
        ]
        return float(np.sum(wider))

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Return the residuals (N,), in standard deviations: of channels, then of priors."""
        return self._residual(self.study.values(z), self.predict(z))

    def compared(self, z: np.ndarray) -> list[tuple[Measured, Channel, np.ndarray, np.ndarray]]:
        """Return each channel with its measurement, the model's values (n,), and whether its motions repeat (n,)."""
        return [
            (measured, channel, one.values[channel.name], one.repeats)
            for measured, one in zip(self.study.measured, self.predict(z), strict=True) for channel in measured.channels
        ]  # fmt: skip

    def by_channel(self, z: np.ndarray) -> list[np.ndarray]:
        """Return the differences (n,) of the channels, not weighted; nan where the model says nothing."""
        return [channel.difference(values) for channel, values, _ in self._pairs(self.predict(z))]

    def jacobian(self, z: np.ndarray, rough: bool = False) -> np.ndarray:
        """Return the derivatives (N, P) of the residuals by the coordinates; rough: as they lead a search."""
        values, found = self.study.values(z), self.predict(z)
        slope, rows = self.study.slope(values), list[np.ndarray]()
        of = [model.rough_derivative(values) if rough else model.derivative(values) for model in self.models]
        for (channel, model, error), derivative, deviation in zip(
            self._pairs(found), self._each(of), self.deviations, strict=True
        ):
            row = channel.slope(model, derivative) * slope / np.hypot(deviation, error)[:, None]
            rows.append(np.where(np.isfinite(row), row, 0.0))
        rows += [np.eye(len(z))[[place]] * slope[place] / prior.deviation for place, prior in self._priors]
        return np.concatenate(rows)

    def sensitivity(self, z: np.ndarray) -> list[np.ndarray]:
        """Return the derivatives (n, P) of the channels' values by the coordinates."""
        values = self.study.values(z)
        self.predict(z)
        return [each * self.study.slope(values) for each in self._each([m.derivative(values) for m in self.models])]

    def minimum(self, z: np.ndarray, held: Sequence[int] = (), close: float = _CLOSE, most: int = _MOST) -> Minimum:
        """Return the minimum near a start, some coordinates held; the lowest place so far if the time is over.

        Raises OutOfTime before the first prediction.
        """
        free = np.setdiff1d(np.arange(len(z)), held)
        if not len(free):
            residual = self.residual(z)
            return Minimum(np.array(z), float(residual @ residual), True)

        def full(part: np.ndarray) -> np.ndarray:
            whole = np.array(z)
            whole[free] = part
            return whole

        slopes, lowest, tolerance = _Slopes(self), list[Minimum](), 0.0
        residual = np.zeros(0)  # of the lowest

        def off(part: np.ndarray) -> np.ndarray:
            nonlocal residual
            here, found = full(part), self.residual(full(part))
            misfit, moved = float(found @ found), bool(lowest) and not np.array_equal(here, lowest[0].z)
            # least_squares itself ends on a step that lowers the misfit by little, but not on one that raises it so
            settled = moved and _gain(residual, found) <= tolerance * lowest[0].misfit
            if not lowest or misfit < lowest[0].misfit:
                lowest[:], residual = [Minimum(here, misfit, False)], found
            if settled:
                raise _Settled
            return found

        start = np.clip(z[free], 1e-9, 1 - 1e-9)
        try:
            off(start)
            rough = self.scatter(full(start)) / max(lowest[0].misfit, _TINY)  # of which nothing better can be found
            tolerance = min(max(close, rough), _LEAST_CLOSE)
            found = least_squares(
                off, start, lambda part: slopes.at(full(part))[:, free], bounds=(0.0, 1.0), ftol=tolerance,
                xtol=_LEAST_STILL if rough else _STILL, gtol=1e-12, max_nfev=most,
            )  # fmt: skip
        except OutOfTime:
            if not lowest:
                raise
            return lowest[0]
        except _Settled:
            return lowest[0]._replace(converged=True)
        return Minimum(full(found.x), float(2.0 * found.cost), bool(found.status > 0))

    def estimate(self, z: np.ndarray) -> bool:
        """Take the deviations that are not given from the residuals at z. Returns whether any changed by 2 %."""
        share = 1.0 - len(z) / max(sum(len(channel.values) for channel in self.channels), len(z) + 1)
        changed = False
        for place, (channel, off) in enumerate(zip(self.channels, self.by_channel(z), strict=True)):
            off = off[np.isfinite(off)]
            if channel.deviation is None and len(off):
                floor = 1e-9 * channel.size
                own = max(float(np.sqrt(off @ off / (len(off) * share))), floor)
                changed = changed or abs(own / self.deviations[place] - 1.0) > 0.02
                self.deviations[place] = own
        return changed

    def scatter(self, z: np.ndarray) -> float:
        """Return the standard deviation of the sum of squares by those of means of runs; 0 where all motions repeat."""
        found, residual = self.predict(z), self.residual(z)
        errors = [
            error / np.hypot(deviation, error)
            for (_, _, error), deviation in zip(self._pairs(found), self.deviations, strict=True)
        ]
        own = np.nan_to_num(np.concatenate(errors)) * residual[: sum(map(len, errors))]
        return 2.0 * float(np.linalg.norm(own))

    def _residual(self, values: np.ndarray, found: list[Predicted]) -> np.ndarray:
        rows = []
        for (channel, model, error), deviation in zip(self._pairs(found), self.deviations, strict=True):
            row = channel.difference(model) / np.hypot(deviation, error)
            rows.append(np.where(np.isfinite(row), row, _NOTHING))
        rows += [np.array([(values[place] - prior.mean) / prior.deviation]) for place, prior in self._priors]
        return np.concatenate(rows)

    def _pairs(self, found: list[Predicted]) -> list[tuple[Channel, np.ndarray, np.ndarray]]:
        """Return each channel with the model's values (n,) and their own errors in its terms (n,)."""
        pairs = []
        for measured, one in zip(self.study.measured, found, strict=True):
            for channel in measured.channels:
                values = one.values[channel.name]
                size = np.abs(values) if channel.compare == "difference" else 1.0
                pairs.append((channel, values, one.errors * size))
        return pairs

    def _each(self, of: list[Values]) -> list[np.ndarray]:
        """Return arrays by channel in the order of the channels."""
        return [
            arrays[channel.name] for measured, arrays in zip(self.study.measured, of, strict=True)
            for channel in measured.channels
        ]  # fmt: skip


def _gain(before: np.ndarray, after: np.ndarray) -> float:
    """Return by how much sums of squares fall at most from one end of a step to anywhere on it, from residuals (N,).

    If these were straight over the step: |r + t d|^2 with d the change is lowest amid ends of one height.
    """
    moved = after - before
    return abs(float(after @ after - before @ before)) + 0.25 * float(moved @ moved)


class _Slopes:
    """Derivatives of residuals on the way to a minimum, where residuals are nearly straight those of a place before."""

    def __init__(self, fit: Fit) -> None:
        self._fit = fit
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def at(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives (N, P)."""
        if self._last is None or float(np.linalg.norm(self._last[1] @ (z - self._last[0]))) > _STRAIGHT:
            self._last = np.array(z), self._fit.jacobian(z, rough=True)
        return self._last[1]


def _assumed(channel: Channel) -> float:
    if channel.deviation is not None:
        return channel.deviation
    return _ASSUMED * (1.0 if channel.compare == "angle" else channel.size)
