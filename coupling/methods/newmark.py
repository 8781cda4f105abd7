"""Implicit penalty method: Newmark's trapezoidal rule, or Hilber, Hughes and Taylor's, with springs for contacts.

Newmark (1959), Hilber, Hughes and Taylor (1977). The springs push and never pull, and friction is held between its
bounds: forces at the step's end are the exact solution of a small complementarity problem, not of Newton iterations.
Second order; without numerical damping (alpha = 0) the linear system is unconditionally stable, but contact makes and
loses energy.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import TimeGrid
from vanedamp.coupling.methods.penalty_forces import first_forces, net_load
from vanedamp.coupling.methods.step_problem import list_row, solve_rows
from vanedamp.coupling.methods.step_records import (
    apply_inverse,
    close_step,
    copy,
    damping_force,
    end_period,
    load_at,
    open_step,
    record_start,
    row_speed,
)
from vanedamp.coupling.numerics.codes import DONE, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.system.system import System


def newmark_matrices(
    system: System, times: TimeGrid, alpha: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return alpha, beta, gamma; inverse iteration matrix, (1 + alpha) times its product with J^T, mobility."""
    h, beta, gamma = times.step, (1 - alpha) ** 2 / 4, 0.5 - alpha
    matrix = np.diag(system.mass + (1 + alpha) * beta * h**2 * system.stiffness)
    inverse = np.linalg.inv(matrix + (1 + alpha) * gamma * h * system.damping)
    turned = (1 + alpha) * inverse @ system.J.T
    return np.array([alpha, beta, gamma]), inverse, turned, system.J @ turned


@entry
def march_newmark(
    system, times, motion, records, log, problem, parameters, inverse, turned, mobility, slow, until, budget, deepest
):
    """Step until this many steps are done. slow: (friction rows,) speed below which friction is viscous, or 0."""
    alpha, beta, gamma = parameters[0], parameters[1], parameters[2]
    size, rows, h, steps = len(motion.q), len(system.J), times.step, len(times.phase) - 1
    q, v, rhs, accel = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2], motion.coordinates[3]
    ahead, fast, listed = motion.coordinates[4], motion.coordinates[5], motion.listed
    impulse, speed, before, old = motion.rows[0], motion.rows[1], motion.rows[2, : system.friction_rows], motion.rows[3]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        first_forces(system, times, motion, slow)
        for i in range(size):
            motion.half[i] = net_load(system, times, motion, motion.q, motion.v, 0, i) / system.mass[i]
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        open_step(system, times, motion, records, k, q, v, before)
        copy(motion.force, old)
        for i in range(size):
            a = motion.half[i]
            ahead[i] = q[i] + h * v[i] + h * h * (0.5 - beta) * a
            fast[i] = v[i] + h * (1.0 - gamma) * a
        for i in range(size):
            new = load_at(system, times, k + 1, i) - damping_force(system, fast, i) - system.stiffness[i] * ahead[i]
            rhs[i] = (1.0 + alpha) * new
            if alpha != 0.0:
                rhs[i] -= alpha * net_load(system, times, motion, q, v, k, i)
        apply_inverse(inverse, system.proportional, rhs, accel)
        for i in range(size):
            ahead[i] += beta * h * h * accel[i]
            fast[i] += gamma * h * accel[i]
        count = _list_rows(system, times, motion, problem, listed, mobility, ahead, fast, q, slow, beta, gamma)
        if count > 0:
            motion.counters[SOLVES] += 1
            if not solve_rows(problem, count):
                return UNDECIDED
        for r in range(rows):
            motion.force[r] = 0.0
        for a in range(count):
            motion.force[listed[a]] = problem.force[a]
        for i in range(size):
            change = 0.0
            for a in range(count):
                change += turned[i, listed[a]] * problem.force[a]
            motion.half[i] = accel[i] + change
            motion.q[i] = ahead[i] + beta * h * h * change
            motion.v[i] = fast[i] + gamma * h * change
        for r in range(rows):
            speed[r] = row_speed(system, r, v)
            impulse[r] = 0.5 * h * (old[r] + motion.force[r])
            if r < system.friction_rows and system.spring[r] != math.inf and system.limit[r] > 0.0:
                motion.elongation[r] = -motion.force[r] / system.spring[r]
        code = close_step(system, times, motion, records, log, k, q, v, speed, impulse, before, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            code = end_period(system, times, motion, records, budget)
            if code != DONE:
                return code
    return DONE


@kernel
def _list_rows(system, times, motion, problem, listed, mobility, ahead, fast, q, slow, beta, gamma):
    """Set up the problem of the rows that may carry force. Return their number."""
    h, count = times.step, 0
    for r in range(len(system.J)):
        speed, displacement = row_speed(system, r, fast), row_speed(system, r, ahead)
        if r < system.friction_rows:
            if system.limit[r] == 0.0:
                continue
            low, high = -system.limit[r], system.limit[r]
            if system.spring[r] != math.inf:
                shift = (motion.elongation[r] + displacement - row_speed(system, r, q)) / (beta * h * h)
                soft = 1.0 / (system.spring[r] * beta * h * h)
            else:
                shift, soft = speed / (gamma * h), slow[r] / (system.limit[r] * gamma * h)
        else:
            gap = system.rest[r] + displacement
            if gap > 0.0:
                continue
            low, high = 0.0, np.inf
            stiff = system.spring[r] * beta * h * h + system.dashpot[r] * gamma * h
            shift = (system.spring[r] * gap + system.dashpot[r] * speed) / stiff
            soft = 1.0 / stiff
        list_row(problem, listed, mobility, count, r, shift, low, high, soft)
        count += 1
    return count
