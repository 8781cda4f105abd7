"""Moreau-Jean time stepping: velocities and impulses over a step, contacts and friction by one exact small problem.

Jean (1999); Acary and Brogliato (2008), chapter 10. The theta method for the smooth part, Newton's law and Coulomb's on
velocities; a contact takes part in a step if its gap, half a step ahead, is closed. Second order where no row is
active (theta = 1/2), first order over impacts. An impact that others bring about within a step is a problem of its own,
after theirs. Springs of compliant contacts and Jenkins elements enter the same problem, implicitly.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.equations_of_motion import Motion, TimeGrid, line_grid, start
from vanedamp.coupling.methods.planar.start import planar_start
from vanedamp.coupling.methods.step_problem import list_row, solve_rows
from vanedamp.coupling.methods.step_records import (
    apply_inverse,
    close_step,
    damping_force,
    end_period,
    load_at,
    open_step,
    record_start,
    row_speed,
)
from vanedamp.coupling.methods.time_stepping import SteppedRun
from vanedamp.coupling.numerics.codes import DONE, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.numerics.complementarity import new_problem
from vanedamp.coupling.planar.recorder import plane_of
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.event_log import rows_of_line, rows_of_units
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PlanarOptions, SteppingOptions
from vanedamp.coupling.system.line_system import LineSystem, line_system
from vanedamp.coupling.system.restitution import restitution_at
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import Real

VARIANTS = (Variant("Moreau-Jean", "#c2410c", "o"),)
WAVEFORMS = True
PLANAR_LAWS = ("two_phases", "depends_on_speed")

#: problems that a step may take, the last with all contacts at once, and the share of a speed that is round-off
_TURNS, _ROUND_OFF = 20, 1e-12
#: row of Motion.rows: whether a rigid contact is closed
_CLOSED = 4


class Options(SteppingOptions, PlanarOptions):
    """Options of Moreau-Jean's method."""

    method: Literal["moreau"] = "moreau"
    """"moreau": time stepping by Moreau and Jean, with impulses"""
    theta: Annotated[Real, Field(ge=0.5, le=1)] = 0.5
    """weight of a step's end in the smooth forces; 0.5 is of second order, 1 damps [-]"""


def begin(scene: Scene, system: System, records: Records, events: bool, begun: RestartState) -> Run:
    """Return a run. Raises InputError for bodies that overlap at the start."""
    options: Any = scene.solver
    if scene.planar:
        return _begin_planar(scene, system, options, records, events, begun)
    line = line_system(system)
    times, theta, problem = line_grid(scene, line, options.steps_per_period), options.theta, new_problem(len(line.J))
    matrices = moreau_matrices(line, times, theta)
    budget, deepest = options.max_events, options.penetration

    def march(motion: Motion, log: np.ndarray, until: int) -> int:
        return march_moreau(line, times, motion, records, log, problem, *matrices, theta, until, budget, deepest)

    rows = rows_of_line(system)
    return SteppedRun(system, rows, march, start(line, begun), records, events, options.smallest_steps)


def _begin_planar(
    scene: Scene, whole: System, options: Any, records: Records, events: bool, begun: RestartState
) -> Run:
    """Return a run of bodies in the plane."""
    from vanedamp.coupling.methods.planar import moreau as planar  # its kernels are loaded when they are wanted
    from vanedamp.coupling.methods.planar.step_records import SteppedMotion, start_steps

    system, initial, times = planar_start(scene, whole, options.steps_per_period, begun)
    theta, budget, deepest = options.theta, options.max_events, options.penetration
    matrices = planar.step_matrices(system, times.step, theta)

    def march(motion: SteppedMotion, log: np.ndarray, until: int) -> int:
        return planar.march(system, times, motion, records, log, *matrices, theta, until, budget, deepest)

    motion, steps = start_steps(system, initial, records), options.smallest_steps
    plane = plane_of(system, motion, options.linearisation)
    return SteppedRun(system, rows_of_units(system), march, motion, records, events, steps, plane)


def moreau_matrices(system: LineSystem, times: TimeGrid, theta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse of the iteration matrix (N, N), its product with J^T (N, r), and the rows' mobility (r, r)."""
    h = times.step
    matrix = np.diag(system.mass + (h * theta) ** 2 * system.stiffness) + h * theta * system.damping
    inverse = np.linalg.inv(matrix)
    turned = inverse @ system.J.T
    return inverse, turned, system.J @ turned


@entry
def march_moreau(
    system, times, motion, records, log, problem, inverse, turned, mobility, theta, until, budget, deepest
):
    """Step until this many steps are done. Return the code of numerics.codes."""
    size, rows, h, steps = len(motion.q), len(system.J), times.step, len(times.phase) - 1
    q, v, rhs, free = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2], motion.coordinates[3]
    impulse, speed, before = motion.rows[0], motion.rows[1], motion.rows[2, : system.friction_rows]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        open_step(system, times, motion, records, k, q, v, before)
        for i in range(size):
            load = theta * load_at(system, times, k + 1, i) + (1.0 - theta) * load_at(system, times, k, i)
            rhs[i] = h * (load - damping_force(system, v, i) - system.stiffness[i] * (q[i] + h * theta * v[i]))
        apply_inverse(inverse, system.proportional, rhs, free)
        for i in range(size):
            free[i] += v[i]
        for r in range(rows):
            speed[r], impulse[r] = row_speed(system, r, v), 0.0
        if not _impulses(system, times, motion, problem, mobility, turned, free, speed, impulse, theta):
            return UNDECIDED
        for i in range(size):
            motion.v[i] = free[i]
            motion.q[i] = q[i] + h * (theta * free[i] + (1.0 - theta) * v[i])
        for r in range(system.friction_rows):
            if system.spring[r] != math.inf and system.limit[r] > 0.0:
                motion.elongation[r] = -impulse[r] / (h * system.spring[r])
        code = close_step(system, times, motion, records, log, k, q, v, speed, impulse, before, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            code = end_period(system, times, motion, records, budget)
            if code != DONE:
                return code
    return DONE


@inlined
def _impulses(system, times, motion, problem, mobility, turned, free, speed, impulse, theta):
    """Set the impulses (r,) of a step; `free` (N,) becomes the velocity at its end. Returns False if undecided.

    A contact that parts as the step begins waits. Where impulses of others drive it together, it meets a second impact
    after theirs, at its new speed: in one problem with them it would end without rebound, and since nothing opens an
    overlap without speed, bodies in a row would fly as one ever after.
    """
    slowest = 0.0
    for r in range(system.friction_rows, len(system.J)):
        slowest = max(slowest, _ROUND_OFF * abs(speed[r]))
    for turn in range(_TURNS):
        last = turn == _TURNS - 1
        count = _list_rows(system, times, motion, problem, mobility, free, speed, impulse, theta, turn, slowest, last)
        if count == 0:
            return True
        motion.counters[SOLVES] += 1
        if not solve_rows(problem, count):
            return False
        for a in range(count):
            r = motion.listed[a]
            impulse[r] += problem.force[a]
            for i in range(len(free)):
                free[i] += turned[i, r] * problem.force[a]
        if not _approaching(system, motion, free, slowest):
            return True
    return True


@inlined
def _approaching(system, motion, free, slowest):
    """Whether a closed rigid contact still approaches."""
    for r in range(system.friction_rows, len(system.J)):
        if motion.rows[_CLOSED, r] > 0.0 and row_speed(system, r, free) < -slowest:
            return True
    return False


@kernel
def _list_rows(system, times, motion, problem, mobility, free, speed, impulse, theta, turn, slowest, last):
    """Set up the problem of the rows that take part in a turn. Return their number."""
    h, count, closed = times.step, 0, motion.rows[_CLOSED]
    for r in range(len(system.J)):
        low, high, shift, soft = 0.0, np.inf, 0.0, 0.0
        now = row_speed(system, r, free)
        if turn == 0:
            closed[r] = 0.0
        if r < system.friction_rows:
            if system.limit[r] == 0.0:
                continue
            low, high = -h * system.limit[r], h * system.limit[r]
            if system.spring[r] != math.inf:
                shift, soft = motion.elongation[r] / h, 1.0 / (h * h * system.spring[r])
        else:
            gap = system.rest[r] + row_speed(system, r, motion.q)
            if system.spring[r] == math.inf:
                if gap + 0.5 * h * speed[r] > 0.0:
                    continue
                closed[r] = 1.0
                before = speed[r] if turn == 0 else now
                if not last and before > slowest and now > -slowest:
                    continue
                shift = restitution_at(system, r, -before) * min(before, 0.0)
            else:
                if gap + h * min(speed[r], row_speed(system, r, free)) > 0.0:
                    continue
                k, c = system.spring[r], system.dashpot[r]
                stiff = theta * (k * h * theta + c)
                shift = (k * (gap + h * theta * (1.0 - theta) * speed[r]) + c * (1.0 - theta) * speed[r]) / stiff
                soft = 1.0 / (h * stiff)
        if system.spring[r] != math.inf or r < system.friction_rows:
            low, high, shift = low - impulse[r], high - impulse[r], shift + soft * impulse[r]
        list_row(problem, motion.listed, mobility, count, r, now + shift, low, high, soft)
        count += 1
    return count
