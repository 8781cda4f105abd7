"""The beginning of a run by equal steps of a scene with bodies in the plane."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import TimeGrid, time_grid
from vanedamp.coupling.planar.constraints import PlanarMotion, PlanarSystem, planar_motion, planar_system
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import loads_of
from vanedamp.coupling.system.system import System


def planar_start(scene: Scene, flat: System, steps: int) -> tuple[PlanarSystem, PlanarMotion, TimeGrid]:
    """Return system, motion at time zero and the steps of a period. flat: the scene with every body as a slider.

    Raises InputError for what bodies with extent do not allow.
    """
    system, signal = planar_system(scene, flat), scene.excitation.signal
    coordinates = [*range(flat.modes), *system.along]

    def loads(angle: np.ndarray) -> np.ndarray:
        if signal is None:
            return (flat.phases(angle) @ system.load).real
        load = np.zeros((len(angle), len(system.mass)))
        load[:, coordinates] = loads_of(scene, signal)(angle)
        return load

    return system, planar_motion(scene, flat, system), time_grid(flat, steps, loads)
