"""`solver.method = "exact"`: the event-driven engine (coupling.engine.line)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.scene.solver_options import PlanarOptions

if TYPE_CHECKING:  # a scene takes the options without the engine
    from vanedamp.coupling.response.evaluation import Run
    from vanedamp.coupling.response.records import Records
    from vanedamp.coupling.response.restart_state import RestartState
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.system.system import System

VARIANTS = (Variant("exact engine", "#1d4f91", "*", setting=None),)
RESTARTS = True
WEARS = True
COURSES = True
PLANAR_LAWS = ("yields", "two_phases", "depends_on_speed")


class Options(PlanarOptions):
    """No options of its own."""

    method: Literal["exact"] = "exact"
    """"exact": event by event, without time steps"""


def begin(scene: Scene, system: System, records: Records, events: bool, start: RestartState) -> Run:
    """Return a run by the engine, whose kernels are loaded on demand."""
    from vanedamp.coupling.engine.backends import engine_run

    options: Any = scene.solver
    return engine_run(system, start, records, events, options.max_events, options.linearisation)
