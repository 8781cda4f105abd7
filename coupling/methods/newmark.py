"""Implicit penalty method: Newmark's trapezoidal rule, or Hilber, Hughes and Taylor's, with springs for contacts.

Newmark (1959), Hilber, Hughes and Taylor (1977). The springs push and never pull, and friction is held between its
bounds: forces at the step's end are the exact solution of a small complementarity problem, not of Newton iterations.
Second order; without numerical damping (alpha = 0) the linear system is unconditionally stable, but contact makes and
loses energy.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import Sparse, sparse
from vanedamp.coupling.methods.penalty_forces import first_forces, net_load
from vanedamp.coupling.methods.step_problem import couple_row, list_row, solve_rows
from vanedamp.coupling.methods.step_records import (
    close_step,
    copy,
    drag_sliders,
    open_step,
    product,
    record_start,
    set_gaps,
)
from vanedamp.coupling.numerics.codes import DONE, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import ZERO, entry, kernel
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_kinematics import elongation, gap, has_friction, row_speed


def newmark_matrices(system: System, step: float, alpha: float) -> tuple[np.ndarray, Sparse, np.ndarray, np.ndarray]:
    """Return alpha, beta, gamma; inverse iteration matrix, (1 + alpha) times its product with J^T, mobility (2u, 2u).

    Coordinates without mass, the sliders of Jenkins elements, have no row of J and stay where they are.
    """
    beta, gamma = (1 - alpha) ** 2 / 4, 0.5 - alpha
    matrix = np.diag(system.mass) + (1 + alpha) * beta * step**2 * system.stiffness
    inverse = np.linalg.inv(matrix + (1 + alpha) * gamma * step * system.damping)
    turned = (1 + alpha) * inverse @ system.J.T
    return np.array([alpha, beta, gamma]), sparse(inverse), turned, system.J @ turned


@entry
def march_newmark(
    system, times, motion, records, log, problem, parameters, inverse, turned, laws, until, budget, deepest
):
    """Step until this many steps are done. Return the code of numerics.codes."""
    alpha, beta, gamma = parameters[0], parameters[1], parameters[2]
    size, h, steps = len(motion.q), times.step, len(times.phase) - 1
    scratch, q, v = motion.coordinates, motion.start[0], motion.start[1]
    rhs, accel, ahead, fast, last = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        first_forces(system, times, motion, laws)
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        open_step(system, times, motion, records, k)
        copy(motion.force, motion.impulse)
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
        count = _list_rows(system, problem, laws, h, ahead, fast, beta, gamma)
        if count > 0:
            motion.counters[SOLVES] += 1
            if not solve_rows(problem, count, 0.0, 0.0):
                return UNDECIDED
        for row in range(len(motion.force)):
            motion.force[row] = 0.0
        for a in range(count):
            motion.force[problem.row[a]] = problem.box.force[a]
        for i in range(size):
            change = 0.0
            for a in range(count):
                change += turned[i, problem.row[a]] * problem.box.force[a]
            motion.half[i] = accel[i] + change
            motion.q[i] = ahead[i] + beta * h * h * change
            motion.v[i] = fast[i] + gamma * h * change
        drag_sliders(system, motion.q)
        set_gaps(system, motion)
        for r in range(system.contacts):
            motion.before[r] = row_speed(system, r, v)
        for row in range(len(motion.force)):
            motion.impulse[row] = 0.5 * h * (motion.impulse[row] + motion.force[row])
        code = close_step(system, times, motion, records, log, k, budget, deepest)
        if code != DONE:
            return code
    return DONE


@kernel
def _list_rows(system, problem, laws, h, ahead, fast, beta, gamma):
    """Set up the problem of the rows that may carry force. Return their number."""
    count, u, first = ZERO, len(system.rest), len(system.rest) - len(system.tangential)
    for place in range(u):
        r = problem.order[place]
        low, high, normal = -system.limit[r], system.limit[r], -1
        if r >= first:
            spring = system.tangential[r - first] * beta * h * h
            shift = elongation(system, r - first, ahead) / (beta * h * h)
            list_row(problem, count, u + r, shift, low, high, 1.0 / spring)
            count += 1
            continue
        if r < system.contacts:
            opened = gap(system, r, ahead)
            if opened > 0.0:
                continue
            stiff = laws.spring[r] * beta * h * h + laws.dashpot[r] * gamma * h
            shift = (laws.spring[r] * opened + laws.dashpot[r] * row_speed(system, r, fast)) / stiff
            list_row(problem, count, r, shift, 0.0, math.inf, 1.0 / stiff)
            normal, count = count, count + 1
        if has_friction(system, r):
            slow = laws.slow[r] / (system.limit[r] * gamma * h) if normal < 0 else 0.0
            list_row(problem, count, u + r, row_speed(system, u + r, fast) / (gamma * h), low, high, slow)
            if normal >= 0:
                couple_row(problem, count, normal, system.friction[r])
            count += 1
    return count
