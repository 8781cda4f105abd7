"""The beginning of a run by equal steps of a scene with bodies in the plane."""

from __future__ import annotations

from vanedamp.coupling.methods.equations_of_motion import TimeGrid, time_grid
from vanedamp.coupling.response.restart import motion_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Motion, loads_of
from vanedamp.coupling.system.system import System, on_structure


def planar_start(scene: Scene, system: System, steps: int, begun: RestartState) -> tuple[System, Motion, TimeGrid]:
    """Return system, motion at time zero and the steps of a period.

    The slips of Jenkins elements are those of what draws their sliders.
    """
    signal = scene.excitation.signal
    loads = None if signal is None else loads_of(scene, signal)
    return on_structure(system), motion_of(system, begun), time_grid(system, steps, loads)
