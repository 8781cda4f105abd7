"""Penalties in place of constraints: springs for contacts, viscous friction below a slip speed, and their forces."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from vanedamp.coupling.methods.equations_of_motion import TimeGrid
from vanedamp.coupling.methods.step_records import damping_force, load_at, row_speed
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.coupling.scene.solver_options import SteppingOptions
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.files.toml_input import InputError, NonNegative, Positive, Real


class PenaltyOptions(SteppingOptions):
    """The options of methods with penalties. Their defaults are those of `with_penalty`."""

    contact_steps: Annotated[Real, Field(ge=4)] | None = None
    """duration of a rigid contact in time steps; or give `contact_stiffness` [-]"""
    contact_stiffness: Positive | None = None
    """stiffness of rigid contacts [N/m]"""
    slip_velocity: NonNegative | None = None
    """slip speed below which friction is viscous [m/s]"""

    @model_validator(mode="after")
    def _check_contact(self) -> PenaltyOptions:
        if self.contact_steps is not None and self.contact_stiffness is not None:
            raise ValueError("give one of contact_steps and contact_stiffness")
        return self


def with_penalty(system: LineSystem, times: TimeGrid, options: PenaltyOptions) -> tuple[LineSystem, np.ndarray]:
    """Return rigid contacts as springs and dashpots, and the slip speed (friction rows,) of regularised friction.

    Raises InputError for a restitution of 0, and for one that depends on the speed.
    """
    if system.restitution_at:
        raise InputError(
            "contact.law: its restitution depends on the speed, but a dashpot has one restitution; "
            f'take solver.method = "exact", "moreau" or "solve_ivp", not "{options.method}"'
        )
    spring, dashpot = system.spring.copy(), system.dashpot.copy()
    for r in range(system.friction_rows, len(spring)):
        if np.isinf(spring[r]):
            reduced = 1 / system.delassus[r, r]
            spring[r], dashpot[r] = contact_spring(reduced, system.restitution[r], times.step, options)
    slips = slice(0, system.friction_rows)
    # four times the speed at which an explicit step becomes unstable (docs/accuracy.md)
    slow = 2 * system.limit[slips] * np.diag(system.delassus)[slips] * times.step
    if options.slip_velocity is not None:
        slow = np.full(len(slow), options.slip_velocity)
    return system._replace(spring=spring, dashpot=dashpot), slow


def contact_spring(reduced: float, restitution: float, step: float, options: PenaltyOptions) -> tuple[float, float]:
    """Return stiffness and dashpot of a contact with a reduced mass (kg). Raises InputError for a restitution of 0.

    The spring makes a contact last `contact_steps` steps: unless given, 2 steps^(1/3) of them, which makes the error of
    a contact that is too soft and that of one resolved by too few steps fall alike. The dashpot gives an isolated
    collision its restitution.
    """
    duration = (options.contact_steps or 2 * options.steps_per_period ** (1 / 3)) * step
    spring = options.contact_stiffness or reduced * (np.pi / duration) ** 2
    return spring, 2 * damping_ratio(restitution) * np.sqrt(spring * reduced)


@kernel
def first_forces(system, times, motion, slow):
    """Set the forces of the rows by their laws (penalty contacts, regularised friction) at motion.q, motion.v."""
    for r in range(len(system.J)):
        row_force(system, motion, r, row_speed(system, r, motion.q), row_speed(system, r, motion.v), slow, 0.0)


@inlined
def row_force(system, motion, r, displacement, speed, slow, moved):
    """Set the force of row r by its law. moved: displacement of a Jenkins element since its last force."""
    if r >= system.friction_rows:
        gap = system.rest[r] + displacement
        push = -system.spring[r] * gap - system.dashpot[r] * speed
        motion.force[r] = max(push, 0.0) if gap < 0.0 else 0.0
    elif system.limit[r] == 0.0:
        motion.force[r] = 0.0
    elif system.spring[r] != math.inf:
        push = -system.spring[r] * (motion.elongation[r] + moved)
        motion.force[r] = min(max(push, -system.limit[r]), system.limit[r])
        motion.elongation[r] = -motion.force[r] / system.spring[r]
    elif slow[r] > 0.0:
        motion.force[r] = -system.limit[r] * min(max(speed / slow[r], -1.0), 1.0)
    else:
        motion.force[r] = -system.limit[r] * np.sign(speed)


@inlined
def net_load(system, times, motion, q, v, k, i):
    """Return the sum of the forces on coordinate i at step k of the period."""
    force = load_at(system, times, k, i) - damping_force(system, v, i) - system.stiffness[i] * q[i]
    for r in range(len(system.J)):
        if motion.force[r] != 0.0:
            force += system.J[r, i] * motion.force[r]
    return force
