"""`solver.method = "penalty"`: springs and dashpots for contacts, by central differences, Newmark or HHT."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.central_difference import central_difference_matrix, march_central_difference
from vanedamp.coupling.methods.equations_of_motion import Motion, line_grid, start
from vanedamp.coupling.methods.newmark import march_newmark, newmark_matrices
from vanedamp.coupling.methods.penalty_forces import PenaltyOptions, with_penalty
from vanedamp.coupling.methods.planar.start import planar_start
from vanedamp.coupling.methods.time_stepping import SteppedRun
from vanedamp.coupling.numerics.complementarity import new_problem
from vanedamp.coupling.planar.recorder import plane_of
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.event_log import rows_of_line, rows_of_units
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PlanarOptions
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError, Real

VARIANTS = (
    Variant("penalty, central differences", "#15803d", "s"),
    Variant("penalty, Newmark", "#65a30d", "D", {"scheme": "newmark"}),
    Variant("penalty, HHT", "#0e7490", "^", {"scheme": "hht"}),
)
WAVEFORMS = True
PLANAR_LAWS: tuple[str, ...] = ()
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

    Raises InputError for a rigid contact of restitution 0, and in the plane for implicit schemes and for bodies that
    overlap at the start.
    """
    options: Any = scene.solver
    if scene.planar:
        return _begin_planar(scene, system, options, records, events, begun)
    line = line_system(system)
    times = line_grid(scene, line, options.steps_per_period)
    soft, slow = with_penalty(line, times, options)
    budget, deepest = options.max_events, options.penetration
    if options.scheme == "central_difference":
        inverse = central_difference_matrix(soft, times)

        def march(motion: Motion, log: np.ndarray, until: int) -> int:
            return march_central_difference(soft, times, motion, records, log, inverse, slow, until, budget, deepest)

    else:
        problem = new_problem(len(soft.J))
        matrices = newmark_matrices(soft, times, options.alpha if options.scheme == "hht" else 0.0)
        if options.slip_velocity is None:
            slow = np.zeros_like(slow)  # implicit: Coulomb's law as it is

        def march(motion: Motion, log: np.ndarray, until: int) -> int:
            return march_newmark(soft, times, motion, records, log, problem, *matrices, slow, until, budget, deepest)

    rows = rows_of_line(system)
    return SteppedRun(system, rows, march, start(soft, begun), records, events, options.smallest_steps)


def _begin_planar(
    scene: Scene, whole: System, options: Any, records: Records, events: bool, begun: RestartState
) -> Run:
    """Return a run of bodies in the plane."""
    from vanedamp.coupling.methods.planar import penalty as planar  # its kernels are loaded when they are wanted
    from vanedamp.coupling.methods.planar.step_records import SteppedMotion, start_steps

    if options.scheme != "central_difference":
        raise InputError(
            f'solver.scheme: "{options.scheme}" takes sliders only; bodies with extent, stiffness or dashpot take '
            '"central_difference"'
        )
    system, initial, times = planar_start(scene, whole, options.steps_per_period, begun)
    forces, inverse = planar.penalty_forces(system, times.step, options), planar.step_matrix(system, times.step)
    budget, deepest = options.max_events, options.penetration

    def march(motion: SteppedMotion, log: np.ndarray, until: int) -> int:
        return planar.march(system, times, motion, records, log, forces, inverse, until, budget, deepest)

    motion, steps = start_steps(system, initial, records, forces.spring), options.smallest_steps
    plane = plane_of(system, motion, options.linearisation)
    return SteppedRun(system, rows_of_units(system), march, motion, records, events, steps, plane)
