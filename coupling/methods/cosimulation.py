"""Co-simulation: structure and bodies are separate units that exchange motion and forces once a macro-step.

The structure's unit is exact between two exchanges (matrix exponential); the bodies' unit takes smaller steps of
central differences with penalty contacts. Each extrapolates the values of the other by a constant (hold 0) or a line
(hold 1); the structure gets the mean force of a macro-step, so that no impulse is lost. Jacobi: both units start from
the last exchange; Gauss-Seidel: the bodies already know the structure's new motion. Kuebler and Schiehlen (2000);
Gomes and others, Co-simulation: a survey (2018).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from scipy.linalg import expm

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.equations_of_motion import Motion, TimeGrid, line_loads, start, time_grid
from vanedamp.coupling.methods.penalty_forces import PenaltyOptions, first_forces, net_load, row_force, with_penalty
from vanedamp.coupling.methods.step_records import close_step, copy, end_period, open_step, record_start, row_speed
from vanedamp.coupling.methods.time_stepping import SteppedRun
from vanedamp.coupling.numerics.codes import DONE, STEPS
from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Loads
from vanedamp.coupling.system.line_system import LineSystem, line_system
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import Whole

VARIANTS = (
    Variant("co-simulation, Jacobi, hold 0", "#7e22ce", "v", {"exchange": "jacobi", "hold": 0}),
    Variant("co-simulation, Gauss-Seidel, hold 1", "#be185d", "<", {"exchange": "gauss_seidel", "hold": 1}),
)
WAVEFORMS = True


class Options(PenaltyOptions):
    """Options of co-simulation."""

    method: Literal["cosim"] = "cosim"
    """"cosim": structure and bodies exchange motion and forces once a macro-step, which `steps_per_period` counts"""
    exchange: Literal["jacobi", "gauss_seidel"] = "gauss_seidel"
    """"gauss_seidel": the bodies know the structure's new motion; "jacobi": both start from the last exchange"""
    hold: Annotated[Whole, Field(ge=0, le=1)] = 1
    """order of the extrapolation within a macro-step"""
    substeps: Annotated[Whole, Field(gt=0, le=10_000)] = 10
    """steps of the bodies in a macro-step"""

    @property
    def smallest_steps(self) -> int:
        """Steps of the bodies in a period."""
        return self.steps_per_period * self.substeps


def begin(scene: Scene, system: System, records: Records, events: bool, begun: RestartState) -> Run:
    """Return a run. Raises InputError for a rigid contact of restitution 0."""
    options: Any = scene.solver
    line = line_system(system)
    loads = line_loads(scene, line)
    times = time_grid(line, options.steps_per_period, loads)
    soft, slow = with_penalty(line, times, options)
    gauss_seidel, hold, substeps = options.exchange == "gauss_seidel", options.hold, options.substeps
    matrices = cosimulation_matrices(soft, times, substeps, loads)
    memory = np.zeros((3, 4 * soft.modes + len(soft.J)))
    budget, deepest = options.max_events, options.penetration

    def march(motion: Motion, log: np.ndarray, until: int) -> int:
        return march_cosimulation(
            soft, times, motion, records, log, *matrices, memory, slow, gauss_seidel, hold, substeps, until, budget,
            deepest,
        )  # fmt: skip

    rows = rows_of_line(system)
    return SteppedRun(system, rows, march, start(soft, begun), records, events, options.smallest_steps)


def cosimulation_matrices(
    system: LineSystem, times: TimeGrid, substeps: int, loads: Loads | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the exact step of the structure: (2n, 4n) on p, p', constant and linear modal loads, (steps, 2n) shares of
    the excitation at each step of a period; loads (steps * substeps + 1, N) of the excitation on the bodies' grid.
    Loads that are no harmonics (`loads`) are linear over a macro-step.
    """
    n, e, steps = system.modes, 0 if loads else len(system.frequency), len(times.phase) - 1
    rate = np.zeros((4 * n + 2 * e, 4 * n + 2 * e))
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, :n] = -np.diag(system.stiffness[:n])
    rate[n : 2 * n, n : 2 * n] = -system.damping[:n, :n]
    rate[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
    rate[2 * n : 3 * n, 3 * n : 4 * n] = np.eye(n)
    # cos and sin of each harmonic
    load, frequency = system.of_structure.load[:e].T, np.diag(system.frequency[:e])
    rate[n : 2 * n, 4 * n : 4 * n + e], rate[n : 2 * n, 4 * n + e :] = load.real, -load.imag
    rate[4 * n : 4 * n + e, 4 * n + e :] = -frequency
    rate[4 * n + e :, 4 * n : 4 * n + e] = frequency
    exact = expm(rate * times.step)[: 2 * n]
    if loads:
        held = times.load[:, :n]
        excited = np.hstack([held[:-1], np.diff(held, axis=0) / times.step]) @ exact[:, 2 * n :].T
    else:
        phases = system.phases(2 * np.pi * np.arange(steps) / steps)
        excited = np.hstack([phases.real, phases.imag]) @ exact[:, 4 * n :].T
    fine = time_grid(system, steps * substeps, loads).load
    return np.ascontiguousarray(exact[:, : 4 * n]), np.ascontiguousarray(excited), fine


@entry
def march_cosimulation(
    system, times, motion, records, log, matrix, excited, loads, memory, slow, gauss_seidel, hold, substeps, until,
    budget, deepest,
):  # fmt: skip
    """Step until the bodies have done this many steps.

    memory: (3, 4n + r) last velocities and mean forces; earlier ones; scratch.
    """
    n, size, rows = system.modes, len(motion.q), len(system.J)
    h, steps = times.step, len(times.phase) - 1
    q, v, known = motion.coordinates[0], motion.coordinates[1], memory[2]
    place, rate, bend, mean = motion.rows[4], motion.rows[5], motion.rows[6], motion.rows[7]
    impulse, speed, before = motion.rows[0], motion.rows[1], motion.rows[2, : system.friction_rows]
    last_speed, last_force, older_force = memory[0, :n], memory[0, n : n + rows], memory[1, :rows]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
        first_forces(system, times, motion, slow)
        for i in range(n, size):
            start = net_load(system, times, motion, motion.q, motion.v, 0, i) / system.mass[i]
            motion.half[i] = motion.v[i] + 0.5 * h / substeps * start
        copy(motion.v, last_speed)
        copy(motion.force, last_force)
        copy(motion.force, older_force)
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] // substeps % steps
        open_step(system, times, motion, records, k, q, v, before)
        _structure(system, times, motion, matrix, excited, known, last_force, older_force, hold, k, q, v)
        for r in range(rows):
            place[r], rate[r], bend[r] = 0.0, 0.0, 0.0
            speed[r], mean[r] = row_speed(system, r, v), 0.0
            for i in range(n):
                place[r] += system.J[r, i] * q[i]
                if gauss_seidel and hold == 0:
                    rate[r] += system.J[r, i] * (motion.q[i] - q[i]) / h
                else:
                    rate[r] += system.J[r, i] * v[i]
                if hold == 1:
                    change = motion.v[i] - v[i] if gauss_seidel else v[i] - last_speed[i]
                    bend[r] += system.J[r, i] * change / h
        copy(v, last_speed)
        _bodies(system, times, motion, loads, slow, substeps, k, place, rate, bend, mean)
        copy(last_force, older_force)
        copy(mean, last_force)
        for r in range(rows):
            impulse[r] = h * mean[r]
        code = close_step(system, times, motion, records, log, k, q, v, speed, impulse, before, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            code = end_period(system, times, motion, records, budget)
            if code != DONE:
                return code
    return DONE


@kernel
def _structure(system, times, motion, matrix, excited, known, force, older, hold, k, q, v):
    """Advance the structure by a macro-step under the forces of the bodies' last ones."""
    n, h = system.modes, times.step
    for i in range(n):
        known[i], known[n + i] = q[i], v[i]
        constant, slope = 0.0, 0.0
        for r in range(len(system.J)):
            constant += system.J[r, i] * force[r]
            if hold == 1:
                slope += system.J[r, i] * (force[r] - older[r]) / h
        # the mean belongs to the middle of the last macro-step
        known[2 * n + i], known[3 * n + i] = constant + 0.5 * h * slope, slope
    for i in range(n):
        p, rate = excited[k, i], excited[k, n + i]
        for j in range(4 * n):
            p += matrix[i, j] * known[j]
            rate += matrix[n + i, j] * known[j]
        motion.q[i], motion.v[i] = p, rate


@kernel
def _bodies(system, times, motion, loads, slow, substeps, k, place, rate, bend, mean):
    """Advance the bodies by a macro-step on walls of known motion; add up the mean forces of the rows."""
    n, size, rows = system.modes, len(motion.q), len(system.J)
    small = times.step / substeps
    for j in range(substeps):
        t = (j + 1) * small
        for i in range(n, size):
            motion.q[i] += small * motion.half[i]
        for r in range(rows):
            displacement, speed = place[r] + t * (rate[r] + 0.5 * t * bend[r]), rate[r] + t * bend[r]
            for i in range(n, size):
                displacement += system.J[r, i] * motion.q[i]
                speed += system.J[r, i] * motion.half[i]
            mean[r] += 0.5 * motion.force[r] / substeps
            row_force(system, motion, r, displacement, speed, slow, small * speed)
            mean[r] += 0.5 * motion.force[r] / substeps
        for i in range(n, size):
            force = system.weight[i] + loads[k * substeps + j + 1, i]
            for r in range(rows):
                force += system.J[r, i] * motion.force[r]
            change = small * force / system.mass[i]
            motion.v[i] = motion.half[i] + 0.5 * change
            motion.half[i] += change
    motion.counters[STEPS] += substeps - 1
