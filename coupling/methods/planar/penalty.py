"""Explicit penalty method for bodies with extent: central differences with springs and dashpots for contacts.

As methods.central_difference for sliders. Friction is a dashpot along the contact, limited by Coulomb's bound of the
normal force at the same instant: below its slip speed it is viscous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.penalty_forces import PenaltyOptions, contact_spring
from vanedamp.coupling.methods.planar.step_records import (
    account_step,
    drag_slider,
    follow_contacts,
    record_sample,
    record_start,
)
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET, IMPACTS, PERIOD, STEPS
from vanedamp.coupling.numerics.compiler.jit import entry, inlined
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.planar.contact_decisions import elongation, gap, row_speed
from vanedamp.coupling.system.system import SURFACES, System
from vanedamp.files.toml_input import InputError


@record
class PenaltyForces(NamedTuple):
    """The laws of the units (u,), and the forces and half-step velocities that the steps leave."""

    spring: np.ndarray  # (u,) N/m
    dashpot: np.ndarray  # (u,) N s/m
    slow: np.ndarray  # (u,) speed below which friction is viscous, m/s; nan: as drag says
    drag: np.ndarray  # (u,) of that dashpot along the contact, N s/m

    half: np.ndarray  # (N,) velocity half a step later
    force: np.ndarray  # (2u,) N
    old: np.ndarray  # (2u,) forces as the step begins


def penalty_forces(system: System, step: float, options: PenaltyOptions) -> PenaltyForces:
    """Return the laws that the options ask for. Raises InputError for a contact of restitution 0.

    A contact's spring and dashpot are those of a slider of the same mobility: where both corners of a face hit at once,
    the contact is shorter and its restitution another one.
    """
    u, mobility = len(system.rest), np.diag(system.delassus)
    spring, dashpot = np.zeros(u), np.zeros(u)
    for r in range(system.contacts):
        try:
            spring[r], dashpot[r] = contact_spring(1 / mobility[r], float(system.restitution[r]), step, options)
        except InputError as error:
            owner = SURFACES[system.surface[r]] if system.without_body[r] else "damper"
            raise InputError(f"{owner}[{system.body[r]}].{error}") from None
    slow = np.full(u, np.nan if options.slip_velocity is None else options.slip_velocity)
    with np.errstate(divide="ignore"):
        # a quarter of the dashpot at which an explicit step becomes unstable, as for sliders
        drag = 1 / (2 * mobility[u:] * step)
    return PenaltyForces(
        spring=spring, dashpot=dashpot, slow=slow, drag=drag, half=np.zeros(len(system.mass)), force=np.zeros(2 * u),
        old=np.zeros(2 * u),
    )  # fmt: skip


def step_matrix(system: System, step: float) -> np.ndarray:
    """Return the inverse (N, N) of the mass with half a step of damping."""
    inverse: np.ndarray = np.linalg.inv(np.diag(system.mass) + 0.5 * step * system.damping)
    return inverse


@entry
def march(system, times, motion, records, log, penalty, inverse, until, budget, deepest):
    """Step until this many steps are done, on a grid of equations_of_motion.TimeGrid. Return the code of a status."""
    h, steps, u, size = times.step, len(times.phase) - 1, len(system.rest), len(motion.q)
    q, v, half, rhs = motion.start[0], motion.start[1], penalty.half, motion.free[0]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        _set_forces(system, penalty, motion.q, motion.v)
        _set_load(system, times, penalty, motion.q, motion.v, 0, rhs)
        for i in range(size):
            half[i] = motion.v[i] + 0.5 * h * rhs[i] / system.mass[i]
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        record_sample(system, times, motion, records, k)
        for i in range(size):
            q[i], v[i] = motion.q[i], motion.v[i]
            motion.q[i] += h * half[i]
        for r in range(2 * u):
            motion.before[r], penalty.old[r] = row_speed(system, r, half), penalty.force[r]
        _set_forces(system, penalty, motion.q, half)
        for r in range(2 * u):
            motion.impulse[r] = 0.5 * h * (penalty.old[r] + penalty.force[r])
        _set_load(system, times, penalty, motion.q, half, k + 1, rhs)
        for i in range(size):
            change = 0.0
            for j in range(size):
                change += inverse[i, j] * rhs[j]
            motion.v[i] = half[i] + 0.5 * h * change
            motion.free[1, i] = half[i] + h * change
        for i in range(size):
            half[i] = motion.free[1, i]
        follow_contacts(system, times, motion, records, log, k)
        code = account_step(system, times, motion, records, k, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            motion.counters[PERIOD] += 1
            record_start(system, motion, records)
            if motion.counters[IMPACTS] >= budget:
                return EVENT_BUDGET
    return DONE


@inlined
def _set_forces(system, penalty, q, v):
    """Set the forces of all units at coordinates q and velocities v; sliders of Jenkins elements follow in q."""
    u, sliders = len(system.rest), len(system.tangential)
    for j in range(sliders):
        drag_slider(system, j, q)
        penalty.force[2 * u - sliders + j] = -system.tangential[j] * elongation(system, j, q)
    for r in range(u - sliders):
        bound = system.limit[r]
        if r < system.contacts:
            overlap, push = -gap(system, r, q), 0.0
            if overlap > 0.0:
                push = max(penalty.spring[r] * overlap - penalty.dashpot[r] * row_speed(system, r, v), 0.0)
            penalty.force[r], bound = push, system.friction[r] * push
        if bound == 0.0:
            penalty.force[u + r] = 0.0
        else:
            slip, slow = row_speed(system, u + r, v), penalty.slow[r]
            if slow > 0.0:
                drag = bound * slip / slow
            elif slow == 0.0:
                drag = bound * np.sign(slip)
            else:
                drag = penalty.drag[r] * slip
            penalty.force[u + r] = -min(max(drag, -bound), bound)


@inlined
def _set_load(system, times, penalty, q, v, k, load):
    """Set the sum (N,) of all forces on the coordinates at step k of the period."""
    for i in range(len(q)):
        load[i] = times.load[k, i] + system.weight[i]
        for j in range(len(q)):
            load[i] -= system.stiffness[i, j] * q[j] + system.damping[i, j] * v[j]
        for r in range(len(penalty.force)):
            if penalty.force[r] != 0.0:
                load[i] += system.J[r, i] * penalty.force[r]
