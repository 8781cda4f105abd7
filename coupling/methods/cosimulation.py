"""Co-simulation: structure and bodies are separate units that exchange motion and forces once a macro-step.

The structure's unit is exact between two exchanges (matrix exponential); the bodies' unit takes smaller steps of
central differences with penalty contacts. Each extrapolates the values of the other by a constant (hold 0) or a line
(hold 1); the structure gets the mean force of a macro-step, so that no impulse is lost. Jacobi: both units start from
the last exchange; Gauss-Seidel: bodies use the structure's new motion. Kuebler and Schiehlen (2000);
Gomes and others, Co-simulation: a survey (2018).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from scipy.linalg import expm

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.penalty_forces import PenaltyLaws, PenaltyOptions, first_forces, penalty_laws, set_forces
from vanedamp.coupling.methods.step_records import close_step, copy, open_step, set_gaps
from vanedamp.coupling.methods.time_stepping import SteppedRun, TimeGrid, loads_at, start, time_grid
from vanedamp.coupling.numerics.codes import DONE, STEPS
from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import LEFT, RIGHT, System, on_structure
from vanedamp.coupling.system.unit_kinematics import row_speed
from vanedamp.files.toml_input import InputError, Whole

VARIANTS = (
    Variant("co-simulation, Jacobi, hold 0", "#7e22ce", "v", {"exchange": "jacobi", "hold": 0}),
    Variant("co-simulation, Gauss-Seidel, hold 1", "#be185d", "<", {"exchange": "gauss_seidel", "hold": 1}),
)
WAVEFORMS = True
SOFT_WALLS = True
#: by how much the spectral radius of a stable macro-step may exceed 1, as that of a body without a force does
_UNSTABLE = 1e-9


class Options(PenaltyOptions):
    """Options of co-simulation."""

    method: Literal["cosim"] = "cosim"
    """"cosim": structure and bodies exchange motion and forces once a macro-step, which `steps_per_period` counts"""
    exchange: Literal["jacobi", "gauss_seidel"] = "gauss_seidel"
    """"gauss_seidel": the bodies know the structure's new motion; "jacobi": both start from the last exchange"""
    hold: Annotated[Whole, Field(ge=0, le=1)] = 1
    """order of the extrapolation within a macro-step"""
    substeps: Annotated[Whole, Field(gt=0, le=10_000)] = 2
    """steps of the bodies in a macro-step"""

    @property
    def smallest_steps(self) -> int:
        """Steps of the bodies in a period."""
        return self.steps_per_period * self.substeps


def begin(scene: Scene, system: System, records: Records, events: bool, begun: RestartState) -> Run:
    """Return a run. Raises InputError for a rigid contact of restitution 0."""
    options: Any = scene.solver
    times = time_grid(scene, system, options.steps_per_period)
    laws = penalty_laws(system, times.step, options)
    soft, motion = start(system, begun, laws.spring, records)
    matrix, excited = cosimulation_matrices(scene, soft, times)
    angles = 2 * np.pi * np.arange(options.smallest_steps) / options.smallest_steps
    fine = np.ascontiguousarray(loads_at(scene, soft)(angles))
    memory = np.zeros((3, 4 * soft.modes + 2 * len(soft.J)))
    march = partial(
        march_cosimulation, soft, times, motion, records, matrix, excited, fine, memory, laws,
        options.exchange == "gauss_seidel", options.hold, options.substeps,
    )  # fmt: skip
    return SteppedRun(system, march, motion, records, events, options)


def run_warnings(scene: Scene) -> Iterator[str]:
    """Yield a warning if the macro-step is unstable while contacts are closed; of a scene that cannot run none."""
    largest = ("", 0.0)
    with contextlib.suppress(InputError):
        largest = max(macro_step_radii(scene), key=lambda found: found[1], default=largest)
    if largest[1] > 1.0 + _UNSTABLE:
        yield (
            f"solver.steps_per_period: the macro-step is unstable while {largest[0]} are closed: it multiplies errors "
            f"by {largest[1]:.6g}; take more steps per period, or a smaller contact_stiffness"
        )


def macro_step_radii(scene: Scene) -> list[tuple[str, float]]:
    """Return sets of closed contacts and the spectral radius of the linear macro-step with each, without friction.

    inf: beyond doubles. Raises InputError as `begin`.
    """
    options: Any = scene.solver
    system = on_structure(assemble(scene))
    times = time_grid(scene, system, options.steps_per_period)
    laws, sides = penalty_laws(system, times.step, options), system.surface[: system.contacts]
    matrix, radii = cosimulation_matrices(scene, system, times)[0], []
    for name, left_out in (("all contacts but those at right walls", RIGHT), ("all but those at left walls", LEFT)):
        closed = np.flatnonzero(sides != left_out)
        if len(closed):
            with np.errstate(over="ignore", invalid="ignore"):
                step = linear_macro_step(system, laws, times.step, matrix, closed, options)
            finite = bool(np.isfinite(step).all())
            radii.append((name, float(np.abs(np.linalg.eigvals(step)).max()) if finite else np.inf))
    return radii


def linear_macro_step(
    system: System, laws: PenaltyLaws, h: float, matrix: np.ndarray, closed: np.ndarray, options: Any
) -> np.ndarray:
    """Return the matrix of a macro-step (s, s) with some contacts (c,) closed and no others; s = 3 n + 2 b + 3 c.

    State: p, p' and p' a macro-step ago, the bodies' x and its rate half a step later, forces now and mean forces of
    the last two macro-steps.
    """
    n, b, c = system.modes, system.bodies, len(closed)
    on_structure, on_bodies = system.J[closed, :n], system.J[np.ix_(closed, system.along)]
    state = np.eye(3 * n + 2 * b + 3 * c)
    p, rate, before, x, half, force, mean, older = np.split(state, np.cumsum([n, n, n, b, b, c, c]))
    slope, small = options.hold * (mean - older) / h, h / options.substeps
    loads = on_structure.T @ np.vstack([mean + 0.5 * h * slope, slope]).reshape(2, c, -1)
    moved, rate_then = np.split(matrix @ np.vstack([p, rate, *loads]), 2)
    ahead, impulse = options.exchange == "gauss_seidel", np.zeros_like(force)
    speed = (moved - p) / h if ahead and not options.hold else rate
    bend = options.hold * (rate_then - rate if ahead else rate - before) / h
    wall, speed, bend = (on_structure @ part for part in (p, speed, bend))
    for k in range(1, options.substeps + 1):
        x = x + small * half
        position, pace = wall + k * small * (speed + 0.5 * k * small * bend), speed + k * small * bend
        last = force
        force = -laws.spring[closed, None] * (position + on_bodies @ x) - laws.dashpot[closed, None] * (
            pace + on_bodies @ half
        )
        impulse += 0.5 * small * (last + force)
        half = half + small * (on_bodies.T @ force) / system.mass[system.along, None]
    return np.vstack([moved, rate_then, rate, x, half, force, impulse / h, mean])


def cosimulation_matrices(scene: Scene, system: System, times: TimeGrid) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact step of the structure: (2n, 4n) on p, p', constant and linear modal loads, (steps, 2n) parts of
    the excitation at each step of a period. Loads that are no harmonics are linear over a macro-step.
    """
    sampled = scene.excitation.signal is not None
    n, e, steps = system.modes, 0 if sampled else len(system.frequency), len(times.phase) - 1
    rate = np.zeros((4 * n + 2 * e, 4 * n + 2 * e))
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, :n] = -np.diag(system.squares)
    rate[n : 2 * n, n : 2 * n] = -system.viscous
    rate[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
    rate[2 * n : 3 * n, 3 * n : 4 * n] = np.eye(n)
    # cos and sin of each harmonic
    load, frequency = system.of_structure.load[:e].T, np.diag(system.frequency[:e])
    rate[n : 2 * n, 4 * n : 4 * n + e], rate[n : 2 * n, 4 * n + e :] = load.real, -load.imag
    rate[4 * n : 4 * n + e, 4 * n + e :] = -frequency
    rate[4 * n + e :, 4 * n : 4 * n + e] = frequency
    exact = expm(rate * times.step)[: 2 * n]
    if sampled:
        held = times.load[:, :n]
        excited = np.hstack([held[:-1], np.diff(held, axis=0) / times.step]) @ exact[:, 2 * n :].T
    else:
        phases = system.phases(2 * np.pi * np.arange(steps) / steps)
        excited = np.hstack([phases.real, phases.imag]) @ exact[:, 4 * n :].T
    return np.ascontiguousarray(exact[:, : 4 * n]), np.ascontiguousarray(excited)


@entry
def march_cosimulation(
    system, times, motion, records, matrix, excited, loads, memory, laws, gauss_seidel, hold, substeps, log, until,
    budget, deepest,
):  # fmt: skip
    """Step until the bodies have done this many steps.

    loads: (steps * substeps, N) of the excitation on the bodies' grid; memory: (3, 4n + 4u) last velocities and mean
    forces; earlier ones; scratch.
    """
    n, size, rows, h = system.modes, len(motion.q), len(system.J), times.step
    q, v, known, impulse = motion.start[0], motion.start[1], memory[2], motion.rows[3]
    last_speed, last_force, older_force = memory[0, :n], memory[0, n : n + rows], memory[1, :rows]
    if motion.counters[STEPS] == 0:
        first_forces(system, times, motion, laws)
        for i in range(n, size):
            motion.half[i] = motion.v[i] + 0.5 * h / substeps * motion.half[i]
        copy(motion.v, last_speed)
        copy(motion.force, last_force)
        copy(motion.force, older_force)
    while motion.counters[STEPS] < until:
        k = open_step(system, times, motion, records, substeps)
        _structure(system, times, motion, matrix, excited, known, last_force, older_force, hold, k)
        for a in range(len(motion.live)):
            row, position, rate, bend = motion.live[a], 0.0, 0.0, 0.0
            motion.before[row], impulse[row] = row_speed(system, row, v), 0.0
            for i in range(n):
                position += system.J[row, i] * q[i]
                rate += system.J[row, i] * ((motion.q[i] - q[i]) / h if gauss_seidel and hold == 0 else v[i])
                if hold == 1:
                    change = motion.v[i] - v[i] if gauss_seidel else v[i] - last_speed[i]
                    bend += system.J[row, i] * change / h
            motion.rows[0, row], motion.rows[1, row], motion.rows[2, row] = position, rate, bend
        copy(v, last_speed)
        _bodies(system, times, motion, loads, laws, substeps, k, memory[2, :rows], memory[2, rows : 2 * rows])
        copy(last_force, older_force)
        for row in range(rows):
            motion.impulse[row], last_force[row] = impulse[row], impulse[row] / h
        code = close_step(system, times, motion, records, log, k, budget, deepest)
        if code != DONE:
            return code
    return DONE


@kernel
def _structure(system, times, motion, matrix, excited, known, force, older, hold, k):
    """Advance the structure by a macro-step under the forces of the bodies' last ones."""
    n, h = system.modes, times.step
    for i in range(n):
        known[i], known[n + i] = motion.start[0, i], motion.start[1, i]
        constant, slope = 0.0, 0.0
        for a in range(len(motion.live)):
            row = motion.live[a]
            constant += system.J[row, i] * force[row]
            if hold == 1:
                slope += system.J[row, i] * (force[row] - older[row]) / h
        # the mean belongs to the middle of the last macro-step
        known[2 * n + i], known[3 * n + i] = constant + 0.5 * h * slope, slope
    for i in range(n):
        p, rate = excited[k, i], excited[k, n + i]
        for j in range(4 * n):
            p += matrix[i, j] * known[j]
            rate += matrix[n + i, j] * known[j]
        motion.q[i], motion.v[i] = p, rate


@kernel
def _bodies(system, times, motion, loads, laws, substeps, k, position, rate):
    """Advance the bodies by a macro-step on walls of known motion; add up the impulses of the rows.

    motion.rows: displacement, speed and acceleration (2u,) of the rows by the structure's motion, and their impulses.
    position, rate: (2u,) scratch.
    """
    n, size, small = system.modes, len(motion.q), times.step / substeps
    for j in range(substeps):
        t = (j + 1) * small
        for i in range(n, size):
            motion.q[i] += small * motion.half[i]
        for a in range(len(motion.live)):
            row = motion.live[a]
            speed, bend = motion.rows[1, row], motion.rows[2, row]
            position[row], rate[row] = motion.rows[0, row] + t * (speed + 0.5 * t * bend), speed + t * bend
            for i in range(n, size):
                position[row] += system.J[row, i] * motion.q[i]
                rate[row] += system.J[row, i] * motion.half[i]
        for r in range(system.contacts):
            position[r] += system.rest[r]
        set_forces(system, laws, motion, position, position, rate, small)
        for a in range(len(motion.live)):
            motion.rows[3, motion.live[a]] += motion.impulse[motion.live[a]]
        for i in range(n, size):
            force = system.weight[i] + loads[(k * substeps + j + 1) % len(loads), i]
            for a in range(len(motion.live)):
                force += system.J[motion.live[a], i] * motion.force[motion.live[a]]
            change = small * force / system.mass[i]
            motion.v[i] = motion.half[i] + 0.5 * change
            motion.half[i] += change
    motion.counters[STEPS] += substeps - 1
    set_gaps(system, motion)
