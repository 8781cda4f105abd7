"""`solver.method = "exact"`: the event-driven engine (coupling.exact)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.scene.solver_options import PlanarOptions, SolverOptions

if TYPE_CHECKING:  # a scene takes the options without the engine
    from vanedamp.coupling.response.evaluation import Run
    from vanedamp.coupling.response.records import Records
    from vanedamp.coupling.response.restart_state import RestartState
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.system.assembly import InitialMotion
    from vanedamp.coupling.system.system import System

VARIANTS = (Variant("exact engine", "#1d4f91", "*", setting=None),)
RESTARTS = True
PLANAR_LAWS = ("yields", "two_phases", "depends_on_speed")


class Options(PlanarOptions):
    """No options of its own."""

    method: Literal["exact"] = "exact"
    """"exact": event by event, without time steps"""


def begin(system: System, options: SolverOptions, initial: InitialMotion, records: Records, events: bool) -> Run:
    """Return a run by the engine."""
    from vanedamp.coupling.exact.event_driven import EngineRun  # its kernels are loaded when they are wanted

    return EngineRun(system, initial, records, events, options.max_events)


def begin_planar(
    scene: Scene, system: System, options: SolverOptions, records: Records, events: bool,
    start: RestartState | None = None,
) -> Run:  # fmt: skip
    """Return a run by the engine for bodies in the plane."""
    from vanedamp.coupling.planar.planar_run import begin_run

    return begin_run(scene, system, records, events, options.max_events, getattr(options, "linearisation", 0.01), start)
