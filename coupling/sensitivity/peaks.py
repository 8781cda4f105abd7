"""The largest displacement of each period, and how numbers change it."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.derivatives.series import Course, Series
from vanedamp.coupling.sensitivity.integrands import Functionals

#: nodes within this fraction of the largest are followed to their summits; steps of Newton's method, its last one
_NEAR, _STEPS, _SMALL = 1e-2, 6, 1e-13
#: summits within this fraction are one height; their derivatives, relative to the largest, are then to agree
_SAME, _AGREE = 1e-9, 1e-6


class Peak:
    """The summits of |x| in one period: the best so far and those as high."""

    def __init__(self) -> None:
        self._found: list[tuple[float, np.ndarray]] = []

    def add(self, value: float, turns: np.ndarray) -> None:
        """Add a displacement (m) with its derivatives (P,) where it may be the largest."""
        self._found.append((abs(value), np.sign(value) * turns))

    @property
    def value(self) -> float:
        """The largest, m."""
        return max((value for value, _ in self._found), default=0.0)

    def derivatives(self, number: int) -> tuple[np.ndarray, bool]:
        """Return the derivatives (P,), and whether summits of one height part: then they hold on one side."""
        best = [turns for value, turns in self._found if value >= (1.0 - _SAME) * self.value]
        if not best:
            return np.zeros(number), False
        apart = np.ptp(best, axis=0) > _AGREE * (np.abs(best).max() + self.value)
        return best[0], bool(apart.any())


def summits(
    response: Functionals, series: Series, z: np.ndarray, Z: np.ndarray, course: Course, duration: float
) -> list[tuple[float, np.ndarray]]:
    """Return the summits of |x| within a segment: displacements and their derivatives (P,). z, Z: at its start."""
    x = np.abs(course.z @ response.rows[0])
    inner = np.flatnonzero((x[1:-1] >= x[:-2]) & (x[1:-1] >= x[2:])) + 1
    ends = [0, len(x) - 1]
    best, found = x.max(initial=0.0), []
    for node in [*inner, *ends]:
        if x[node] < (1.0 - _NEAR) * best:
            continue
        at = _summit(response.rows[0], series, course, int(node), duration)
        if at is not None:
            there = series.course(z, Z, at, False)
            value, turns = response.of(there.last[None], there.end[None])
            found.append((float(value[0, 0]), turns[0, 0]))
    return found


def _summit(row: np.ndarray, series: Series, course: Course, node: int, duration: float) -> float | None:
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
    return at if float(row @ z) * float(bend @ z) < 0.0 else None
