"""Penalties instead of constraints: springs for contacts, viscous friction below a slip speed, and their forces."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from vanedamp.coupling.methods.step_records import product, set_gaps
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.coupling.scene.solver_options import SteppingOptions
from vanedamp.coupling.system.system import SURFACES, System
from vanedamp.coupling.system.unit_kinematics import has_friction, row_speed
from vanedamp.files.toml_input import InputError, NonNegative, Positive, Real, Whole


class PenaltyOptions(SteppingOptions):
    """The options of methods with penalties. Their defaults are those of `penalty_laws`.

    10,000 steps keep steady amplitudes of the scenes of `vanedamp bench work-precision` within 2 % (docs/accuracy.md).
    """

    steps_per_period: Annotated[Whole, Field(ge=4, le=10_000_000)] = 10_000
    """equal steps in a period of the excitation"""
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


@record
class PenaltyLaws(NamedTuple):
    """The laws of the units (u,)."""

    spring: np.ndarray  # (u,) of contacts, N/m; 0: none
    dashpot: np.ndarray  # (u,) N s/m
    slow: np.ndarray  # (u,) slip speed below which friction is viscous, m/s; nan: as drag says
    drag: np.ndarray  # (u,) of that dashpot along the contact, N s/m


def penalty_laws(system: System, step: float, options: PenaltyOptions) -> PenaltyLaws:
    """Return rigid contacts as springs and dashpots, and the slip speeds of regularised friction.

    A spring makes a contact of its own mobility last `contact_steps` steps: unless given, 0.7 steps^(1/3), at least 4.
    The errors of a contact that is too soft and of one resolved by too few steps then fall alike. The dashpot
    gives an isolated collision its restitution; where both corners of a face hit at once, the contact is shorter and
    its restitution another one. Raises InputError for a restitution of 0, and for one that depends on the speed.
    """
    if system.restitution_at:
        raise InputError(
            "contact.law: its restitution depends on the speed, but a dashpot has one restitution; "
            f'take solver.method = "exact", "moreau" or "solve_ivp", not "{options.method}"'
        )
    u, mobility = len(system.rest), np.diag(system.delassus)
    spring, dashpot = np.where(np.isinf(system.spring), 0.0, system.spring), system.dashpot.copy()
    duration = (options.contact_steps or max(0.7 * options.steps_per_period ** (1 / 3), 4.0)) * step
    for r in np.flatnonzero(np.isinf(system.spring[: system.contacts])):
        reduced = 1 / mobility[r]
        spring[r] = options.contact_stiffness or reduced * (np.pi / duration) ** 2
        try:
            dashpot[r] = 2 * damping_ratio(float(system.restitution[r])) * np.sqrt(spring[r] * reduced)
        except InputError as error:
            owner = SURFACES[system.surface[r]] if system.without_body[r] else "damper"
            raise InputError(f"{owner}[{system.body[r]}].{error}") from None
    slow = np.full(u, np.nan if options.slip_velocity is None else options.slip_velocity)
    with np.errstate(divide="ignore"):
        # a quarter of the dashpot at which an explicit step becomes unstable (docs/accuracy.md)
        return PenaltyLaws(spring=spring, dashpot=dashpot, slow=slow, drag=1 / (2 * mobility[u:] * step))


@inlined
def first_share(gap, rate, last, h):
    """Return by how much the dashpot of a closed contact counts in a step of h: 1, except in a contact's first.

    Its force jumps as the contact closes, and a step's force stands for half a step before and after it: in the first,
    for the time since then and half a step. Without this restitution scatters by the contact's instant in its step.
    last: force of the step before, N.
    """
    if last > 0.0 or rate >= 0.0 or h == 0.0:
        return 1.0
    return 0.5 + min(gap / (rate * h), 1.0)


@inlined
def set_forces(system, laws, motion, gap, drawn, rate, h):
    """Set the forces of all rows by their laws, at gaps (u,) and rates (2u,) of the rows, and their impulses.

    drawn: (2u,) displacement of the drivers of sliders, by their rows. They follow in motion.q where their springs
    would go beyond their bounds. h: time since the last forces, s.
    """
    u, sliders, q = len(system.rest), len(system.tangential), motion.q
    for r in range(u):
        bound = system.limit[r]
        if r < system.contacts:
            push = 0.0
            if gap[r] < 0.0:
                dashpot = laws.dashpot[r] * first_share(gap[r], rate[r], motion.force[r], h)
                push = max(-laws.spring[r] * gap[r] - dashpot * rate[r], 0.0)
            _put(motion, r, push, h)
            bound = system.friction[r] * push
        if system.slider[r] >= 0:
            at, spring = len(q) - sliders + system.slider[r], system.tangential[system.slider[r]]
            stretched = min(max(drawn[u + r] - q[at], -bound / spring), bound / spring)
            q[at] = drawn[u + r] - stretched
            _put(motion, u + r, -spring * stretched, h)
        elif has_friction(system, r):
            drag, slip, slow = 0.0, rate[u + r], laws.slow[r]
            if bound > 0.0 and slow > 0.0:
                drag = bound * slip / slow
            elif bound > 0.0:
                drag = bound * np.sign(slip) if slow == 0.0 else laws.drag[r] * slip
            _put(motion, u + r, -min(max(drag, -bound), bound), h)


@inlined
def _put(motion, row, force, h):
    """Set the force of a row, and its impulse by the mean of that and the last one."""
    motion.impulse[row] = 0.5 * h * (motion.force[row] + force)
    motion.force[row] = force


@inlined
def set_rows(system, motion, q, v):
    """Set gaps and speeds (motion.before) of the rows that may have forces, at coordinates q and velocities v.

    motion.rows[0]: displacements of the drivers of sliders.
    """
    u = len(system.rest)
    set_gaps(system, motion)
    for r in range(u):
        if r < system.contacts:
            motion.before[r] = row_speed(system, r, v)
        if has_friction(system, r):
            motion.before[u + r] = row_speed(system, u + r, v)
        if system.slider[r] >= 0:
            motion.rows[0, u + r] = row_speed(system, u + r, q)


@kernel
def first_forces(system, times, motion, laws):
    """Set the forces as a run begins, and the accelerations (motion.half) that they and the loads give."""
    set_rows(system, motion, motion.q, motion.v)
    set_forces(system, laws, motion, motion.gap[0], motion.rows[0], motion.before, 0.0)
    net_load(system, times, motion, motion.q, motion.v, 0, motion.half)
    for i in range(len(motion.q)):
        motion.half[i] /= system.mass[i]


@inlined
def net_load(system, times, motion, q, v, k, load):
    """Set the sum (N,) of the forces on the coordinates at step k of the period."""
    for i in range(len(q)):
        bound = product(times.damping, i, v) + product(times.stiffness, i, q)
        load[i] = times.load[k, i] + system.weight[i] - bound
    for a in range(len(motion.live)):
        row = motion.live[a]
        if motion.force[row] != 0.0:
            for i in range(len(q)):
                load[i] += system.J[row, i] * motion.force[row]
