"""Moreau-Jean time stepping: velocities and impulses over a step, contacts and friction by one exact small problem.

Jean (1999); Acary and Brogliato (2008), chapter 10. The theta method for the smooth part, Newton's law and Coulomb's on
velocities; a contact takes part in a step if its gap, half a step ahead, is closed. Second order where no row is
active (theta = 1/2), first order over impacts. Springs of compliant contacts and Jenkins elements enter the same
problem, implicitly.
"""

from __future__ import annotations

import math

import numpy as np

from coupling.compiled import entry, kernel
from coupling.complementarity import solve_box
from coupling.system import DONE, PERIOD, SOLVES, UNDECIDED, System
from coupling.tally import (
    copy,
    damped,
    end_period,
    follow_contacts,
    load_at,
    record_start,
    row_speed,
    sample,
    solve_inverse,
    tally,
)


def moreau_matrices(system: System, theta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse of the iteration matrix (N, N), its product with J^T (N, r), and the rows' mobility (r, r)."""
    h = system.step
    matrix = np.diag(system.mass + (h * theta) ** 2 * system.stiffness) + h * theta * system.damping
    inverse = np.linalg.inv(matrix)
    turned = inverse @ system.J.T
    return inverse, turned, system.J @ turned


@entry
def march_moreau(system, motion, records, log, problem, inverse, turned, mobility, theta, periods, budget, deepest):
    """Step to the end of `periods`. Returns one of the codes of coupling.system."""
    size, rows, h, steps = len(motion.q), len(system.J), system.step, len(system.phase) - 1
    q, v, rhs, free = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2], motion.coordinates[3]
    impulse, speed, before = motion.rows[0], motion.rows[1], motion.rows[2, : system.friction_rows]
    listed = motion.listed
    if motion.counters[PERIOD] == 0:
        record_start(system, motion, records)
    while motion.counters[PERIOD] < periods:
        for k in range(steps):
            copy(motion.q, q)
            copy(motion.v, v)
            copy(motion.elongation, before)
            sample(system, motion, records, k, q)
            for i in range(size):
                load = theta * load_at(system, k + 1, i) + (1.0 - theta) * load_at(system, k, i)
                rhs[i] = h * (load - damped(system, v, i) - system.stiffness[i] * (q[i] + h * theta * v[i]))
            solve_inverse(inverse, system.proportional, rhs, free)
            for i in range(size):
                free[i] += v[i]
            for r in range(rows):
                speed[r], impulse[r] = row_speed(system, r, v), 0.0
            count = _list_rows(system, motion, problem, listed, mobility, free, speed, theta)
            if count > 0:
                motion.counters[SOLVES] += 1
                if not _solve(problem, count):
                    return UNDECIDED
            for a in range(count):
                impulse[listed[a]] = problem.force[a]
            for i in range(size):
                for a in range(count):
                    free[i] += turned[i, listed[a]] * problem.force[a]
                motion.v[i] = free[i]
                motion.q[i] = q[i] + h * (theta * free[i] + (1.0 - theta) * v[i])
            for r in range(system.friction_rows):
                if system.spring[r] != math.inf and system.limit[r] > 0.0:
                    motion.elongation[r] = -impulse[r] / (h * system.spring[r])
            follow_contacts(system, motion, records, log, k, speed, impulse)
            code = tally(system, motion, records, k, q, v, impulse, before, deepest)
            if code != DONE:
                return code
        code = end_period(system, motion, records, budget)
        if code != DONE:
            return code
    return DONE


@kernel
def _list_rows(system, motion, problem, listed, mobility, free, speed, theta):
    """Set up the problem of the rows that take part in a step. Returns how many they are."""
    h, count = system.step, 0
    for r in range(len(system.J)):
        low, high, shift, soft = 0.0, np.inf, 0.0, 0.0
        if r < system.friction_rows:
            if system.limit[r] == 0.0:
                continue
            low, high = -h * system.limit[r], h * system.limit[r]
            if system.spring[r] != math.inf:
                shift, soft = motion.elongation[r] / h, 1.0 / (h * h * system.spring[r])
        else:
            gap = system.offset[r] + row_speed(system, r, motion.q)
            if system.spring[r] == math.inf:
                if gap + 0.5 * h * speed[r] > 0.0:
                    continue
                shift = system.restitution[r] * min(speed[r], 0.0)
            else:
                if gap + h * min(speed[r], row_speed(system, r, free)) > 0.0:
                    continue
                k, c = system.spring[r], system.dashpot[r]
                stiff = theta * (k * h * theta + c)
                shift = (k * (gap + h * theta * (1.0 - theta) * speed[r]) + c * (1.0 - theta) * speed[r]) / stiff
                soft = 1.0 / (h * stiff)
        listed[count] = r
        problem.b[count] = row_speed(system, r, free) + shift
        problem.low[count], problem.high[count], problem.forced[count] = low, high, 0
        for a in range(count + 1):
            problem.matrix[count, a] = mobility[r, listed[a]]
            problem.matrix[a, count] = problem.matrix[count, a]
        problem.matrix[count, count] += soft
        count += 1
    return count


@kernel
def _solve(problem, count):
    """Solve the problem; one row alone in closed form."""
    if count > 1:
        return solve_box(problem, count, 0.0)
    problem.force[0] = min(max(-problem.b[0] / problem.matrix[0, 0], problem.low[0]), problem.high[0])
    return True
