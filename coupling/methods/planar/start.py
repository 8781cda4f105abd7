"""The beginning of a run by equal steps of a scene with bodies in the plane."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import TimeGrid, time_grid
from vanedamp.coupling.planar.constraints import (
    PlanarMotion,
    PlanarSystem,
    on_structure,
    planar_motion,
    planar_system,
)
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Loads, assemble, with_sine
from vanedamp.coupling.system.system import System


def planar_start(scene: Scene, flat: System, steps: int) -> tuple[PlanarSystem, PlanarMotion, TimeGrid]:
    """Return system, motion at time zero and the steps of a period. flat: the scene with every body as a slider.

    The slips of Jenkins elements are those of what draws their sliders. Raises InputError for what bodies with extent
    do not allow.
    """
    system, signal = on_structure(planar_system(scene, flat)), scene.excitation.signal
    if signal is None:
        return system, planar_motion(scene, flat, system), time_grid(flat, steps, _harmonics(flat, system))
    sine = with_sine(scene)
    level = -planar_system(sine, assemble(sine)).load[0].imag  # Re(load exp(i omega t)) = level sin(omega t)
    times = time_grid(flat, steps, lambda angle: np.outer(signal.sampled(angle), level))
    return system, planar_motion(scene, flat, system), times


def _harmonics(flat: System, system: PlanarSystem) -> Loads:
    return lambda angle: (flat.phases(angle) @ system.load).real
