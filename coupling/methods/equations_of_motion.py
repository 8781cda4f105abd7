"""The scene as matrices for methods that take time steps: M q'' + C q' + K q = loads + J^T lambda.

q = (p, x), the structure's modal coordinates and the positions of the bodies; rows of J are those of
system.constraints, and their gaps and slips are g = J q + offset. All motion is relative to the base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.contact_laws import damping_ratio
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.constraints import Rows

# counters of a run
PERIOD, STEPS, IMPACTS, SOLVES, LOGGED = range(5)
# what stepping kernels return
DONE, DIVERGED, UNDECIDED, PENETRATION, EVENT_BUDGET = range(5)


class System(NamedTuple):
    """Matrices of a scene. n modes, b bodies, N = n + b coordinates, r rows."""

    modes: int
    friction_rows: int
    mass: np.ndarray  # (N,)
    stiffness: np.ndarray  # (N,)
    damping: np.ndarray  # (N, N)
    load: np.ndarray  # (N, 2) real and imaginary part of the harmonic load's amplitude, N
    weight: np.ndarray  # (N,) constant load, N
    J: np.ndarray  # (r, N)
    offset: np.ndarray  # (r,)
    limit: np.ndarray  # (friction rows,) N
    spring: np.ndarray  # (r,) N/m, inf: rigid
    dashpot: np.ndarray  # (r,) N s/m
    restitution: np.ndarray  # (r,)
    gap: np.ndarray  # (r,) free travel of a rigid contact's cavity, m; inf: nothing to check
    response: np.ndarray  # (N,)
    table: np.ndarray  # (2,) amplitude of the base's motion where that is the response
    phase: np.ndarray  # (steps + 1, 2) cos and sin of omega t within a period
    step: float  # s
    omega: float
    proportional: bool  # whether matrices of the structure are diagonal


class Motion(NamedTuple):
    """The state of a run, advanced in place."""

    q: np.ndarray  # (N,)
    v: np.ndarray  # (N,)
    half: np.ndarray  # (N,) velocity half a step later (explicit), or acceleration (Newmark)
    force: np.ndarray  # (r,) of rows, N, at the last step; impulses over it (Moreau)
    elongation: np.ndarray  # (friction rows,) of Jenkins elements' springs, m
    active: np.ndarray  # (r,) int: contacts that carry force
    speed: np.ndarray  # (r,) at the beginning of the contact that is going on, m/s
    begun: np.ndarray  # (r,) time of that, s
    impulse: np.ndarray  # (r,) since then, N s
    deepest: np.ndarray  # (1,) penetration relative to the free travel
    losses: np.ndarray  # (6,) cumulative ledger, J
    counters: np.ndarray  # int
    coordinates: np.ndarray  # (6, N) scratch space
    rows: np.ndarray  # (8, r) scratch space
    listed: np.ndarray  # (r,) int, scratch space


def system_of(scene: Scene, rows: Rows) -> System:
    """Matrices of a scene; the offsets are those of `start`."""
    n, b, steps = len(rows.stiffness), len(rows.mass), scene.solver.steps
    damping = np.zeros((n + b, n + b))
    damping[:n, :n] = rows.damping
    load = np.concatenate([rows.force, rows.inertia])
    J = np.hstack([rows.structure, rows.bodies])
    angle = 2 * np.pi * np.arange(steps + 1) / steps
    return System(
        modes=n, friction_rows=rows.friction_rows, mass=np.concatenate([np.ones(n), rows.mass]),
        stiffness=np.concatenate([rows.stiffness, np.zeros(b)]), damping=damping,
        load=np.column_stack([load.real, load.imag]), weight=np.concatenate([np.zeros(n), rows.weight]),
        J=J, offset=np.zeros(len(J)), limit=rows.limit, spring=rows.spring.copy(), dashpot=rows.dashpot.copy(),
        restitution=np.concatenate([np.zeros(rows.friction_rows), rows.restitution]),
        gap=np.where(np.isinf(rows.spring), np.concatenate([np.full(rows.friction_rows, np.inf), rows.gap]), np.inf),
        response=np.concatenate([rows.response, np.zeros(b)]),
        table=np.array([rows.table.real, rows.table.imag]),
        phase=np.column_stack([np.cos(angle), np.sin(angle)]), step=rows.period / steps, omega=rows.omega,
        proportional=rows.proportional,
    )  # fmt: skip


def start(
    system: System, rows: Rows, displacement: np.ndarray, velocity: np.ndarray, p: np.ndarray, p_rate: np.ndarray
) -> tuple[System, Motion]:
    """The system with its gaps' offsets, and the motion at time zero.

    displacement, velocity: (r,) of the rows; p, p_rate: (n,) modal coordinates and their velocities.
    """
    n, b, r = system.modes, len(rows.mass), len(system.J)
    q = np.concatenate([p, displacement[:b] + rows.floor @ p])
    v = np.concatenate([p_rate, velocity[:b] + rows.floor @ p_rate])
    contacts = np.arange(r) >= system.friction_rows
    offset = np.where(contacts, displacement - system.J @ q, 0.0)
    motion = Motion(
        q=q, v=v, half=np.zeros(n + b), force=np.zeros(r), elongation=np.zeros(system.friction_rows),
        active=np.zeros(r, np.int64), speed=np.zeros(r), begun=np.zeros(r), impulse=np.zeros(r), deepest=np.zeros(1),
        losses=np.zeros(6), counters=np.zeros(5, np.int64),
        coordinates=np.zeros((6, n + b)), rows=np.zeros((8, r)), listed=np.zeros(r, np.int64),
    )  # fmt: skip
    return system._replace(offset=offset), motion


def with_penalty(system: System, rows: Rows, scene: Scene) -> tuple[System, np.ndarray]:
    """Rigid contacts as springs and dashpots, and the slip speed (friction rows,) below which friction is viscous.

    The spring makes a contact last `contact_steps` steps: unless given, 2 steps^(1/3) of them, which makes the error of
    a contact that is too soft and that of one resolved by too few steps fall alike. The dashpot gives an isolated
    collision its restitution.
    Raises InputError for a restitution of 0.
    """
    solver = scene.solver
    spring, dashpot = system.spring.copy(), system.dashpot.copy()
    for r in range(system.friction_rows, len(spring)):
        if np.isinf(spring[r]):
            reduced = 1 / rows.delassus[r, r]
            duration = (solver.contact_steps or 2 * solver.steps ** (1 / 3)) * system.step
            spring[r] = solver.contact_stiffness or reduced * (np.pi / duration) ** 2
            dashpot[r] = 2 * damping_ratio(system.restitution[r]) * np.sqrt(spring[r] * reduced)
    mobility = np.diag(rows.delassus)[: system.friction_rows]
    # four times the speed at which an explicit step becomes unstable (docs/accuracy.md)
    slow = 2 * system.limit * mobility * system.step
    if solver.slip_velocity is not None:
        slow = np.full(len(slow), solver.slip_velocity)
    return system._replace(spring=spring, dashpot=dashpot), slow
