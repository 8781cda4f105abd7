"""Explicit penalty method: central differences with springs for contacts and regularised friction.

Belytschko, Liu, Moran and Elkhodary (2014), chapter 6. Viscous damping of the structure is taken at the step's middle
(exact second order); dashpots of contacts and friction, at the speed half a step earlier. Stable for steps below
2 / omega_max, of which a contact's pair has sqrt(k (1/m + 1/m_i)), and below 2 v_reg m* / (mu N) for friction, which is
held by mu times the normal force at the same instant.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import Sparse, sparse
from vanedamp.coupling.methods.penalty_forces import first_forces, net_load, set_forces, set_rows
from vanedamp.coupling.methods.step_records import close_step, open_step, product, record_start
from vanedamp.coupling.numerics.codes import DONE, STEPS
from vanedamp.coupling.numerics.compiler.jit import entry
from vanedamp.coupling.system.system import System


def central_difference_matrix(system: System, step: float) -> Sparse:
    """Return the inverse (N, N) of the mass with half a step of damping."""
    return sparse(np.linalg.inv(np.diag(system.mass) + 0.5 * step * system.damping))


@entry
def march_central_difference(system, times, motion, records, log, inverse, laws, until, budget, deepest):
    """Step until this many steps are done. Return the code of numerics.codes."""
    size, h, steps, half = len(motion.q), times.step, len(times.phase) - 1, motion.half
    rhs = motion.coordinates[0]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        first_forces(system, times, motion, laws)
        for i in range(size):
            half[i] = motion.v[i] + 0.5 * h * half[i]
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        open_step(system, times, motion, records, k)
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
