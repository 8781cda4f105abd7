"""Explicit penalty method: central differences with springs for contacts and regularised friction.

Belytschko, Liu, Moran and Elkhodary (2014), chapter 6. Viscous damping of the structure is taken at the step's middle
(exact second order); dashpots of contacts and friction, at the speed half a step earlier. Stable for steps below
2 / omega_max, of which a contact's pair has sqrt(k (1/m + 1/m_i)), and below 2 v_reg m* / (mu N) for friction.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import TimeGrid
from vanedamp.coupling.methods.penalty_forces import first_forces, net_load, row_force
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
from vanedamp.coupling.numerics.codes import DONE, STEPS
from vanedamp.coupling.numerics.compiler.jit import entry
from vanedamp.coupling.system.system import System


def central_difference_matrix(system: System, times: TimeGrid) -> np.ndarray:
    """Return the inverse (N, N) of the mass with half a step of damping."""
    inverse: np.ndarray = np.linalg.inv(np.diag(system.mass) + 0.5 * times.step * system.damping)
    return inverse


@entry
def march_central_difference(system, times, motion, records, log, inverse, slow, until, budget, deepest):
    """Step until this many steps are done. slow: (friction rows,) speed below which friction is viscous, m/s."""
    size, rows, h, steps = len(motion.q), len(system.J), times.step, len(times.phase) - 1
    q, v, rhs, change = motion.coordinates[0], motion.coordinates[1], motion.coordinates[2], motion.coordinates[3]
    impulse, speed, before, old = motion.rows[0], motion.rows[1], motion.rows[2, : system.friction_rows], motion.rows[3]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        first_forces(system, times, motion, slow)
        for i in range(size):
            motion.half[i] = (
                motion.v[i] + 0.5 * h * net_load(system, times, motion, motion.q, motion.v, 0, i) / system.mass[i]
            )
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        open_step(system, times, motion, records, k, q, v, before)
        copy(motion.force, old)
        for i in range(size):
            motion.q[i] += h * motion.half[i]
        for r in range(rows):
            speed[r] = row_speed(system, r, motion.half)
            row_force(system, motion, r, row_speed(system, r, motion.q), speed[r], slow, h * speed[r])
            impulse[r] = 0.5 * h * (old[r] + motion.force[r])
        for i in range(size):
            rhs[i] = load_at(system, times, k + 1, i) - damping_force(system, motion.half, i)
            rhs[i] -= system.stiffness[i] * motion.q[i]
        for r in range(rows):
            if motion.force[r] != 0.0:
                for i in range(size):
                    rhs[i] += system.J[r, i] * motion.force[r]
        apply_inverse(inverse, system.proportional, rhs, change)
        for i in range(size):
            motion.v[i] = motion.half[i] + 0.5 * h * change[i]
            motion.half[i] += h * change[i]
        code = close_step(system, times, motion, records, log, k, q, v, speed, impulse, before, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            code = end_period(system, times, motion, records, budget)
            if code != DONE:
                return code
    return DONE
