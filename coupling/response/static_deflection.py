"""The static deflection that loads of the bodies hold, and the motion about it."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.records import Records
from vanedamp.coupling.system.system import System

#: static deflections below this fraction of that under the excitation's amplitudes are round-off of directions
_ROUND_OFF = 1e-9


def deflects(system: System, functionals: np.ndarray, loads: np.ndarray) -> bool:
    """Return whether static loads on the structure move the response.

    functionals: (k, n) of the modal coordinates on which loads (k,) act, N, or N m for rotations.
    """
    modes = system.of_structure
    yields = np.abs(modes.response) / np.where(modes.stiffness > 0.0, modes.stiffness, np.inf)
    static = yields @ (np.abs(functionals).T @ np.abs(loads))
    return bool(static > _ROUND_OFF * (yields @ np.abs(modes.load).sum(axis=0)))


def about_mean(records: Records, window: slice, period: float) -> tuple[float, np.ndarray]:
    """Return the static deflection over a window of periods, m, and the periods' peaks (n,) about it, m.

    The static deflection is the motion's own mean position over the window. Over many periods the mean force of a body
    on the structure is its load, whether the body is stuck, rests on a wall or strikes both; only where the force acts
    differs (floor, walls, a tilted body's corners). The mean position includes that, the linear static solution with
    all loads on the floors does not: close to it, and wrong by more than the oscillation under a large pull. Without
    such loads the deflection is zero by definition, and the peaks are those of |x|, also where stops or the excitation
    shift the mean.
    """
    peaks = records.peak[window]
    if not len(records.swing) or not len(peaks):
        return 0.0, peaks
    swing = records.swing[window]
    mean = float(swing[:, 2].sum() / (len(peaks) * period))
    return mean, np.maximum(swing[:, 0] - mean, mean - swing[:, 1])
