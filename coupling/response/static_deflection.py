"""The static deflection that loads of the bodies hold, and the motion about it."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict, strict_entry
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

#: static deflections below this fraction of deflections under the excitation's amplitudes are round-off of directions
_ROUND_OFF = 1e-9


def deflects(scene: Scene, system: System) -> bool:
    """Return whether static loads of the bodies move the response of a scene."""
    n, modes = system.modes, system.of_structure
    extended = np.flatnonzero(system.tilt >= 0)
    pressed = np.zeros(system.bodies)
    pressed[extended] = system.weight[system.along[extended] + 1]
    arm = np.array([scene.cavity[name].gap for name in system.cavity])
    functionals = np.vstack([system.floor[:, :n], system.rise[:, :n], system.turn[:, :n]])
    loads = np.concatenate([system.of_bodies.weight, pressed, pressed * arm])
    yields = np.abs(modes.response) / np.where(modes.stiffness > 0.0, modes.stiffness, np.inf)
    static = yields @ (np.abs(functionals).T @ np.abs(loads))
    return bool(static > _ROUND_OFF * (yields @ np.abs(modes.load).sum(axis=0)))


def about_mean(records: Records, first: int, done: int, period: float) -> tuple[float, np.ndarray]:
    """Return the static deflection over periods from first to done, m, and their peaks (n,) about it, m.

    The static deflection is the motion's own mean position over the window. Over many periods the mean force of a body
    on the structure is its load, whether the body is stuck, rests on a wall or strikes both; only where the force acts
    differs (floor, walls, a tilted body's corners). The mean position includes that, the linear static solution with
    all loads on the floors does not: close to it, and wrong by more than the oscillation under a large pull. Without
    such loads the deflection is zero by definition, and the peaks are those of |x|, also where stops or the excitation
    shift the mean.
    """
    peaks = np.empty(done - first)
    return float(peaks_about_mean(records, first, done, period, peaks)), peaks


@strict_entry
def peaks_about_mean(records, first, done, period, peaks):
    """Set peaks (n,) of the periods from first to done about their static deflection, and return that (about_mean)."""
    mean = static_deflection(records, first, done, period)
    for i in range(first, done):
        peaks[i - first] = distance(records, i, mean)
    return mean


@strict
def static_deflection(records, first, done, period):
    """Return the static deflection over periods from first to done, m."""
    integral = 0.0
    if len(records.swing) > 0:
        for i in range(first, done):
            integral += records.swing[i, 2]
    return integral / (max(done - first, 1) * period)


@strict
def distance(records, i, mean):
    """Return the peak of period i about a static deflection, m."""
    if len(records.swing) == 0:
        return records.peak[i]
    return max(records.swing[i, 0] - mean, mean - records.swing[i, 1])
