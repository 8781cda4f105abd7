"""The least minimum of functionals of a linear motion."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

#: most points at which it is sought; relative round-off of a slope; steps of Newton's method, and their last size
_POINTS, _ROUND_OFF, _STEPS, _SMALL = 240, 1e-9, 8, 1e-12


def least_minimum(
    X: np.ndarray, functionals: np.ndarray, z: np.ndarray, duration: float, step: float
) -> tuple[float, int]:
    """Return the smallest minimum of functionals (m, K) of z(t) = exp(X t) z within a duration, and which it is.

    Minima between points about a step apart are found by their slopes, where these pass through zero by more than
    round-off; (inf, -1) without any.
    """
    if duration <= 0.0 or not len(functionals):
        return np.inf, -1
    steps = min(max(int(np.ceil(duration / step)), 2), _POINTS)
    step = duration / steps
    power, motion = expm(X * step), np.empty((steps + 1, len(X)))
    motion[0] = z
    for i in range(steps):
        motion[i + 1] = power @ motion[i]
    slopes = functionals @ X
    value, slope = functionals @ motion.T, slopes @ motion.T
    noise = _ROUND_OFF * np.abs(slopes) @ np.abs(motion).max(axis=0)
    side = np.where(np.abs(slope) > noise[:, None], np.sign(slope), 0.0)
    last = np.maximum.accumulate(np.where(side[:, :-1] != 0.0, np.arange(steps), 0), axis=1)
    side[:, :-1] = np.take_along_axis(side, last, axis=1)  # without a sign of its own, the one before
    which, cell = np.nonzero((side[:, :-1] < 0.0) & (side[:, 1:] > 0.0))
    if not len(which):
        return np.inf, -1
    # where the slope's chord vanishes, for a choice; then Newton's method on the motion itself
    one, other = np.minimum(slope[which, cell], 0.0), slope[which, cell + 1]
    ahead = one / (one - other)
    best = int(np.argmin(value[which, cell] + 0.5 * one * ahead * step))
    row, at, low, high = int(which[best]), float(ahead[best] * step), 0.0, step
    for _ in range(_STEPS):
        now = expm(X * at) @ motion[cell[best]]
        tilt, bend = float(slopes[row] @ now), float(slopes[row] @ X @ now)
        low, high = (at, high) if tilt < 0.0 else (low, at)
        move = at - tilt / bend if bend > 0.0 else low
        if abs(move - at) <= _SMALL * step:
            break
        at = move if low < move < high else 0.5 * (low + high)
    return float(functionals[row] @ now), row
