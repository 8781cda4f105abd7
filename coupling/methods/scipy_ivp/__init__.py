"""`solver.method = "solve_ivp"`: scipy's DOP853, stopped at every event."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart import motion_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PERIOD_SECONDS, PlanarOptions, SteppingOptions
from vanedamp.coupling.system.system import System, on_structure
from vanedamp.files.toml_input import Positive, Real, Whole

PLANAR_LAWS = ("yields", "depends_on_speed")
VARIANTS = (Variant("solve_ivp, DOP853 with events", "#a16207", ">", setting="rtol", tolerance=True),)
#: processor time of a step, s
_STEP_SECONDS = 1e-3


class Options(SteppingOptions, PlanarOptions):
    """Options of scipy's integrators."""

    method: Literal["solve_ivp"] = "solve_ivp"
    """"solve_ivp": scipy's solve_ivp with events"""
    steps_per_period: Annotated[Whole, Field(ge=4, le=10_000_000)] = 32
    """least number of steps in a period of the excitation"""
    penetration: Positive = 1e-3
    rtol: Annotated[Real, Field(ge=3e-14, lt=1)] = 1e-9
    """relative tolerance of a step [-]"""
    complete_chatter: bool = True
    """end impacts that follow each other ever faster at once, in rest"""

    @property
    def seconds_per_period(self) -> float:
        """Return the processor time of an excitation period, s."""
        return PERIOD_SECONDS + _STEP_SECONDS * self.steps_per_period


def begin(scene: Scene, system: System, records: Records, events: bool, start: RestartState) -> Run:
    """Return a run."""
    from vanedamp.coupling.methods.scipy_ivp.run import IvpRun  # kernels are loaded when they are wanted

    options: Any = scene.solver
    return IvpRun(on_structure(system), options, motion_of(system, start), records, events)
