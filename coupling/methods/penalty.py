"""`solver.method = "penalty"`: springs and dashpots for contacts, by central differences, Newmark or HHT.

Central differences (Belytschko, Liu, Moran and Elkhodary 2014, chapter 6): viscous damping of the structure is taken at
the step's middle (exact second order); dashpots of contacts and friction, at the speed half a step earlier. Stable for
steps below 2 / omega_max, of which a contact's pair has sqrt(k (1/m + 1/m_i)), and below 2 v_reg m* / (mu N) for
friction, which is held by mu times the normal force at the same instant.

Newmark's trapezoidal rule (1959), and that of Hilber, Hughes and Taylor (1977): the springs push and never pull, and
friction is held between its bounds: forces at the step's end are the exact solution of a small complementarity problem,
not of Newton iterations. Second order; without numerical damping (alpha = 0) the linear system is unconditionally
stable, but contact makes and loses energy.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.penalty_forces import (
    PenaltyOptions,
    first_forces,
    first_share,
    net_load,
    penalty_laws,
    set_forces,
    set_rows,
)
from vanedamp.coupling.methods.step_problem import list_row, list_slip, new_step_problem, solve_rows
from vanedamp.coupling.methods.step_records import close_step, copy, drag_sliders, open_step, product, set_gaps
from vanedamp.coupling.methods.time_stepping import Sparse, SteppedRun, sparse, start, time_grid
from vanedamp.coupling.numerics.codes import DONE, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import ZERO, entry, kernel
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PlanarOptions
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_kinematics import elongation, gap, row_speed
from vanedamp.files.toml_input import InputError, Real

VARIANTS = (
    Variant("penalty, central differences", "#15803d", "s"),
    Variant("penalty, Newmark", "#65a30d", "D", {"scheme": "newmark"}),
    Variant("penalty, HHT", "#0e7490", "^", {"scheme": "hht"}),
)
WAVEFORMS = True
SOFT_WALLS = True
PLANAR_LAWS = ("yields",)
RUBBING_WARNING = (
    "impacts of planar bodies on springs that rub leave other speeds than Newton's law, with any number of steps; "
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
    soft, motion = start(system, begun, laws.spring, records)
    if options.scheme == "central_difference":
        inverse = sparse(np.linalg.inv(np.diag(soft.mass) + 0.5 * times.step * soft.damping))
        march = partial(march_central_difference, soft, times, motion, records, inverse, laws)
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
        march = partial(march_newmark, soft, times, motion, records, problem, parameters, inverse, turned, laws)
    return SteppedRun(system, march, motion, records, events, options)


@entry
def march_central_difference(system, times, motion, records, inverse, laws, log, until, budget, deepest):
    """Step until this many steps are done. Return the code of numerics.codes."""
    size, h, half = len(motion.q), times.step, motion.half
    rhs = motion.coordinates[0]
    if motion.counters[STEPS] == 0:
        first_forces(system, times, motion, laws)
        for i in range(size):
            half[i] = motion.v[i] + 0.5 * h * half[i]
    while motion.counters[STEPS] < until:
        k = open_step(system, times, motion, records, 1)
        for i in range(size):
            motion.q[i] += h * half[i]
        set_rows(system, motion, motion.q, half)
        set_forces(system, laws, motion, motion.gap[0], motion.rows[0], motion.before, h)
        net_load(system, times, motion, motion.q, half, k + 1, rhs)
        for i in range(size):
            change = h * product(inverse, i, rhs)
            motion.v[i] = half[i] + 0.5 * change
            half[i] += change
        code = close_step(system, times, motion, records, log, k, budget, deepest)
        if code != DONE:
            return code
    return DONE


def newmark_matrices(system: System, step: float, alpha: float) -> tuple[np.ndarray, Sparse, np.ndarray, np.ndarray]:
    """Return alpha, beta, gamma; inverse iteration matrix, (1 + alpha) times its product with J^T, mobility (2u, 2u).

    Coordinates without mass, the sliders, have no row of J and stay where they are.
    """
    beta, gamma = (1 - alpha) ** 2 / 4, 0.5 - alpha
    matrix = np.diag(system.mass) + (1 + alpha) * beta * step**2 * system.stiffness
    inverse = np.linalg.inv(matrix + (1 + alpha) * gamma * step * system.damping)
    turned = (1 + alpha) * inverse @ system.J.T
    return np.array([alpha, beta, gamma]), sparse(inverse), turned, system.J @ turned


@entry
def march_newmark(
    system, times, motion, records, problem, parameters, inverse, turned, laws, log, until, budget, deepest
):
    """Step until this many steps are done. Return the code of numerics.codes."""
    if motion.counters[STEPS] == 0:
        first_forces(system, times, motion, laws)
    while motion.counters[STEPS] < until:
        k = open_step(system, times, motion, records, 1)
        count = _predict(system, times, motion, problem, parameters, inverse, laws, k)
        if count > 0:
            motion.counters[SOLVES] += 1
            if not solve_rows(problem, count, 0.0, 0.0):
                return UNDECIDED
        _correct(system, times, motion, problem, parameters, turned, count)
        code = close_step(system, times, motion, records, log, k, budget, deepest)
        if code != DONE:
            return code
    return DONE


@kernel
def _predict(system, times, motion, problem, parameters, inverse, laws, k):
    """Set the step without forces of the rows, and the problem of those that may carry some. Return their number."""
    alpha, beta, gamma = parameters[0], parameters[1], parameters[2]
    h, q, v, size = times.step, motion.start[0], motion.start[1], len(motion.q)
    accel, ahead, fast = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2]
    rhs, last = motion.coordinates[3], motion.coordinates[4]
    for i in range(size):
        a = motion.half[i]
        ahead[i] = q[i] + h * v[i] + h * h * (0.5 - beta) * a
        fast[i] = v[i] + h * (1.0 - gamma) * a
    if alpha != 0.0:
        net_load(system, times, motion, q, v, k, last)
    for i in range(size):
        bound = product(times.damping, i, fast) + product(times.stiffness, i, ahead)
        rhs[i] = (1.0 + alpha) * (times.load[k + 1, i] + system.weight[i] - bound) - alpha * last[i]
    for i in range(size):
        accel[i] = product(inverse, i, rhs)
        ahead[i] += beta * h * h * accel[i]
        fast[i] += gamma * h * accel[i]
    return _list_rows(system, problem, laws, h, ahead, fast, motion.force, beta, gamma)


@kernel
def _correct(system, times, motion, problem, parameters, turned, count):
    """Apply the problem's forces in the step; their means give the impulses."""
    beta, gamma, h, force = parameters[1], parameters[2], times.step, problem.box.force
    accel, ahead, fast = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2]
    copy(motion.force, motion.impulse)
    for row in range(len(motion.force)):
        motion.force[row] = 0.0
    for a in range(count):
        motion.force[problem.row[a]] = force[a]
    for i in range(len(motion.q)):
        change = 0.0
        for a in range(count):
            change += turned[i, problem.row[a]] * force[a]
        motion.half[i] = accel[i] + change
        motion.q[i] = ahead[i] + beta * h * h * change
        motion.v[i] = fast[i] + gamma * h * change
    drag_sliders(system, motion.q)
    set_gaps(system, motion)
    for r in range(system.contacts):
        motion.before[r] = row_speed(system, r, motion.start[1])
    for row in range(len(motion.force)):
        motion.impulse[row] = 0.5 * h * (motion.impulse[row] + motion.force[row])


@kernel
def _list_rows(system, problem, laws, h, ahead, fast, last, beta, gamma):
    """Set up the problem of the rows that may carry force. Return their number."""
    count, u = ZERO, len(system.rest)
    for rank in range(u):
        r = problem.order[rank]
        slip, soft = row_speed(system, u + r, fast) / (gamma * h), 0.0
        if system.slider[r] >= 0:
            slip = elongation(system, system.slider[r], ahead) / (beta * h * h)
            soft = 1.0 / (system.tangential[system.slider[r]] * beta * h * h)
        if r < system.contacts:
            opened = gap(system, r, ahead)
            if opened > 0.0:
                continue
            rate = row_speed(system, r, fast)
            dashpot = laws.dashpot[r] * first_share(opened, rate, last[r], h)
            stiff = laws.spring[r] * beta * h * h + dashpot * gamma * h
            shift = (laws.spring[r] * opened + dashpot * rate) / stiff
            list_row(problem, count, r, shift, 0.0, math.inf, 1.0 / stiff)
            count = list_slip(system, problem, count, r, slip, 0.0, 0.0, soft)
            continue
        if system.slider[r] < 0:
            soft = laws.slow[r] / (system.limit[r] * gamma * h)
        list_row(problem, count, u + r, slip, -system.limit[r], system.limit[r], soft)
        count += 1
    return count
