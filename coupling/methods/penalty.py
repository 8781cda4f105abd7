"""`solver.method = "penalty"`: springs and dashpots for contacts, by central differences, Newmark or HHT."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.central_difference import central_difference_matrix, march_central_difference
from vanedamp.coupling.methods.equations_of_motion import start, time_grid
from vanedamp.coupling.methods.newmark import march_newmark, newmark_matrices
from vanedamp.coupling.methods.penalty_forces import PenaltyOptions, penalty_laws
from vanedamp.coupling.methods.step_problem import new_step_problem
from vanedamp.coupling.methods.time_stepping import SteppedRun
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PlanarOptions
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError, Real

VARIANTS = (
    Variant("penalty, central differences", "#15803d", "s"),
    Variant("penalty, Newmark", "#65a30d", "D", {"scheme": "newmark"}),
    Variant("penalty, HHT", "#0e7490", "^", {"scheme": "hht"}),
)
WAVEFORMS = True
PLANAR_LAWS = ("yields",)
RUBBING_WARNING = (
    "impacts of bodies with extent on springs that rub leave other speeds than Newton's law, with any number of steps; "
    'take "exact" or "moreau" for amplitudes'
)


class Options(PenaltyOptions, PlanarOptions):
    """Options of penalty methods."""

    method: Literal["penalty"] = "penalty"
    """"penalty": springs in place of rigid contacts"""
    scheme: Literal["central_difference", "newmark", "hht"] = "central_difference"
    """"central_difference": explicit; "newmark", "hht" (Hilber, Hughes and Taylor): implicit time steps"""
    alpha: Annotated[Real, Field(ge=-1 / 3, le=0)] = -0.1
    """numerical damping of scheme = "hht" [-]"""

    @model_validator(mode="after")
    def _check_alpha(self) -> Options:
        if "alpha" in self.model_fields_set and self.scheme != "hht":
            raise ValueError('alpha: is for scheme = "hht"')
        return self


def begin(scene: Scene, system: System, records: Records, events: bool, begun: RestartState) -> Run:
    """Return a run.

    Raises InputError for a rigid contact of restitution 0, for implicit schemes with viscous friction of contacts whose
    normal force is unknown, and for bodies that overlap at the start.
    """
    options: Any = scene.solver
    times = time_grid(scene, system, options.steps_per_period)
    laws = penalty_laws(system, times.step, options)
    soft, motion = start(system, begun, records, laws.spring)
    budget, deepest = options.max_events, options.penetration
    if options.scheme == "central_difference":
        inverse = central_difference_matrix(soft, times.step)

        def march(log: np.ndarray, until: int) -> int:
            return march_central_difference(soft, times, motion, records, log, inverse, laws, until, budget, deepest)

    else:
        if options.slip_velocity is None:
            laws = laws._replace(slow=np.zeros_like(laws.slow))  # implicit: Coulomb's law as it is
        elif system.friction.any():
            raise InputError(
                f'solver.slip_velocity: scheme = "{options.scheme}" takes it of sliders only; leave it out for '
                'Coulomb\'s law as it is, or take scheme = "central_difference"'
            )
        alpha = options.alpha if options.scheme == "hht" else 0.0
        parameters, inverse, turned, mobility = newmark_matrices(soft, times.step, alpha)
        problem = new_step_problem(soft, mobility)

        def march(log: np.ndarray, until: int) -> int:
            return march_newmark(
                soft, times, motion, records, log, problem, parameters, inverse, turned, laws, until, budget, deepest
            )

    return SteppedRun(system, march, motion, records, events, options)
