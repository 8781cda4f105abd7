"""The largest and smallest values of each period, and how numbers change them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.series import Series, Trajectory
from vanedamp.coupling.sensitivity.integrands import Functionals
from vanedamp.coupling.tangents.dual import Dual

#: nodes within this fraction of the largest are followed to their summits: more than a summit may be from its node;
#: steps of Newton's method, its last one
_NEAR, _STEPS, _SMALL = 3e-2, 6, 1e-13
#: summits within this fraction are one height; their derivatives, relative to the largest, are then to agree
_SAME, _AGREE = 1e-9, 1e-6

#: values with their derivatives (P,)
Found = list[tuple[float, np.ndarray]]


class Height(NamedTuple):
    """A value with its derivatives (P,), and whether the motion is highest there.

    It is not where an event happens on its way up or down. Close to a summit such a height is as large, within what
    counts as one height, but moves with its event: neither are its derivatives those of the summit, nor do they make a
    kink.
    """

    value: float
    turns: np.ndarray
    summit: bool


def largest(heights: Found, number: int) -> tuple[Dual, bool]:
    """Return the largest, 0 of none, and whether others as large part from it: its derivatives hold on one side."""
    value, slope = max(heights, key=lambda each: each[0], default=(0.0, np.zeros(number)))
    turned = np.array([turns for each, turns in heights if each >= value - _SAME * abs(value)] or [slope])
    apart = np.ptp(turned, axis=0) > _AGREE * (np.abs(turned).max(initial=0.0) + abs(value))
    return Dual(value, slope), bool(apart.any())


def top_of(each: Dual) -> tuple[Dual, bool]:
    """Return the largest of some numbers (n,), as `largest` does."""
    return largest([*zip(each.value.tolist(), each.turns, strict=True)], each.turns.shape[-1])


class Swing:
    """A functional of the motion: its largest and smallest values in each period, and its integral over some.

    deflected: whether distances from its mean count, and not those from zero.
    """

    def __init__(self, functional: Functionals, deflected: bool) -> None:
        self.functional, self.deflected, self._number = functional, deflected, len(functional.slopes)
        #: values upwards and downwards of each period
        self.found: list[tuple[list[Height], list[Height]]] = []
        self.integral = Dual(0.0, np.zeros(self._number))

    def passed(
        self, period: int, series: Series, course: Trajectory, duration: float, begun: tuple[np.ndarray, np.ndarray],
        x: np.ndarray, ends: Iterable[tuple[float, np.ndarray, float]],
    ) -> None:  # fmt: skip
        """Take the values x (n,) of a course. begun: z (K,) and Z (K, P); ends: value, derivatives (P,), and rate."""
        while len(self.found) <= period:
            self.found.append(([], []))
        (begins, stops), row = ends, self.functional.rows[0]
        for sign, extremes in zip((1.0, -1.0), self.found[period], strict=True):
            start, end = (
                Height(sign * value, sign * turns, way * sign * rate >= 0.0)
                for way, (value, turns, rate) in ((-1.0, begins), (1.0, stops))
            )
            if extremes:  # the end of the segment before: to be highest there, the motion comes up and goes down
                start = start._replace(summit=start.summit and extremes[-1].summit)
                extremes[-1] = extremes[-1]._replace(summit=start.summit)
            extremes += [start, end]
        size = np.ptp(x) if self.deflected else np.abs(x).max(initial=0.0)
        for sign, extremes in zip((1.0, -1.0), self.found[period], strict=True):
            others = extremes if self.deflected else [*self.found[period][0], *self.found[period][1]]
            least = max((each.value for each in others), default=-np.inf) - _NEAR * size
            for at in _summits(sign * row, series, course, sign * x, duration, least):
                there = series.course(*begun, at, False)
                value, turns = self.functional.of(there.last[None], there.end[None])
                extremes.insert(-1, Height(sign * float(value[0, 0]), sign * turns[0, 0], True))

    def distances(self, mean: Dual, first: int = 0) -> tuple[Dual, bool]:
        """Return the largest distances (n,) from a value in periods from `first` on, and whether there are kinks."""
        maxima = []
        for up, down in self.found[first:]:
            each = [
                (value - way * float(mean.value), turns - way * mean.turns, summit)
                for way, heights in ((1.0, up), (-1.0, down)) for value, turns, summit in heights
            ]  # fmt: skip
            most = max((value for value, _, _ in each), default=0.0)
            highest = [(value, turns) for value, turns, summit in each if summit or value == most]
            maxima.append(largest(highest, self._number))
        return joined([height for height, _ in maxima], self._number), any(apart for _, apart in maxima)


def joined(parts: Iterable[Dual], number: int) -> Dual:
    """Return single numbers (n,) in one array."""
    each = list(parts)
    return Dual([one.value for one in each], np.reshape([one.turns for one in each], (-1, number)))


def _summits(
    row: np.ndarray, series: Series, course: Trajectory, x: np.ndarray, duration: float, least: float
) -> list[float]:
    """Return the times of the summits of a functional row (K,) within a segment, near nodes x (n,) above a value, s."""
    inner = np.flatnonzero((x[1:-1] >= x[:-2]) & (x[1:-1] >= x[2:])) + 1
    least = max(least, x.max() - _NEAR * np.ptp(x))
    near = [node for node in (*inner.tolist(), 0, len(x) - 1) if x[node] >= least]
    times = (_summit(row, series, course, node, duration) for node in near)
    return [at for at in times if at is not None]


def _summit(row: np.ndarray, series: Series, course: Trajectory, node: int, duration: float) -> float | None:
    """Return the time of the summit near a node by Newton's method, s; None if it lies beyond the segment."""
    at, z = float(course.time[node]), course.z[node]
    slope, bend = row @ series.X, row @ series.X @ series.X
    nothing = np.zeros((len(z), 0))
    for _ in range(_STEPS):
        curve = float(bend @ z)
        if curve == 0.0:
            return None
        step = -float(slope @ z) / curve
        if not 0.0 <= at + step <= duration:
            return None
        z, at = series.alone.course(z, nothing, step, False).last, at + step
        if abs(step) <= _SMALL * duration:
            break
    return at if float(bend @ z) < 0.0 else None
