"""The period map of a scene, by the engine that runs it."""

from __future__ import annotations

from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.passage import PeriodMap
from vanedamp.coupling.orbits.slider_passage import slider_map
from vanedamp.coupling.orbits.speed_map import SpeedMap
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError


def period_map(scene: Scene, parameter: str = "excitation.frequency", periods: int = 1) -> PeriodMap:
    """Return the map of a scene over excitation periods, with a number of it as parameter (dotted path).

    What the scene leaves open is chosen first. Raises InputError for a scene that the exact engine cannot run.
    """
    if scene.solver.method != "exact":
        raise InputError(
            f'solver.method: orbits are those of the exact engine, not of "{scene.solver.method}"; take "exact"'
        )
    chosen = choose(scene).scene
    if chosen.planar:
        from vanedamp.coupling.orbits.planar_passage import planar_map

        made: PeriodMap = planar_map(chosen, parameter, periods)
    else:
        made = slider_map(chosen, parameter, periods)
    turns = parameter in SPEEDS and isinstance(chosen.structure, Rom)
    return SpeedMap(made, chosen.speed) if turns else made
