"""The least minimum of functionals of a linear motion."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.derivatives.series import Series
from vanedamp.coupling.numerics.compiler.jit import entry

#: most points at which it is sought; relative round-off of a slope; steps of Newton's method, and their last size
_POINTS, _ROUND_OFF, _STEPS, _SMALL = 240, 1e-9, 8, 1e-12


def least_minimum(
    series: Series, functionals: np.ndarray, slopes: np.ndarray, z: np.ndarray, duration: float, step: float,
    without: int = -1,
) -> tuple[float, int]:  # fmt: skip
    """Return the smallest minimum of functionals (m, K) of z(t) = exp(X t) z within a duration, and which it is.

    slopes: functionals X; without: number of one that does not count. Minima between points about a step apart are
    found by their slopes, where these pass through zero by more than round-off; (inf, -1) without any.
    """
    if duration <= 0.0 or not len(functionals):
        return np.inf, -1
    steps = min(max(math.ceil(duration / step), 2), _POINTS)
    step = duration / steps
    motion = np.empty((steps + 1, len(z)))
    row, cell, ahead = _coarse(series.power(step), functionals, slopes, z, step, without, motion)
    if row < 0:
        return np.inf, -1
    at, low, high = ahead * step, 0.0, step
    bends, nothing = slopes[row] @ series.X, np.zeros((len(z), 0))
    for _ in range(_STEPS):
        now = series.alone.course(motion[cell], nothing, at, False).last
        tilt, bend = float(slopes[row] @ now), float(bends @ now)
        low, high = (at, high) if tilt < 0.0 else (low, at)
        move = at - tilt / bend if bend > 0.0 else low
        if abs(move - at) <= _SMALL * step:
            break
        at = move if low < move < high else 0.5 * (low + high)
    return float(functionals[row] @ now), int(row)


@entry
def _coarse(power, functionals, slopes, z, step, without, motion):  # type: ignore[no-untyped-def]
    """Set the motion (n + 1, K) at points a step apart, and choose a minimum where a slope's chord vanishes.

    Returns its functional (-1: none), the point before it, and the part of a step to it.
    """
    points, size = motion.shape
    row, cell, share, least = -1, -1, 0.0, math.inf
    for i in range(size):
        motion[0, i] = z[i]
    for p in range(1, points):
        for i in range(size):
            total = 0.0
            for k in range(size):
                total += power[i, k] * motion[p - 1, k]
            motion[p, i] = total
    for m in range(len(functionals)):
        if m == without:
            continue
        noise = 0.0
        for i in range(size):
            largest = 0.0
            for p in range(points):
                largest = max(largest, abs(motion[p, i]))
            noise += abs(slopes[m, i]) * largest
        noise *= _ROUND_OFF
        side, before = 0, 0.0  # without a sign of its own, that of the point before
        for p in range(points):
            slope = 0.0
            for i in range(size):
                slope += slopes[m, i] * motion[p, i]
            if slope > noise and side < 0:
                value, one = 0.0, min(before, 0.0)
                for i in range(size):
                    value += functionals[m, i] * motion[p - 1, i]
                ahead = one / (one - slope)
                value += 0.5 * one * ahead * step
                if value < least:
                    row, cell, share, least = m, p - 1, ahead, value
            if abs(slope) > noise:
                side = 1 if slope > 0.0 else -1
            before = slope
    return row, cell, share
