"""Moreau-Jean time stepping: velocities and impulses over a step, contacts and friction by one small problem.

Jean (1999); Acary and Brogliato (2008), chapter 10. The theta method for the smooth part, Newton's law on normal
velocities and Coulomb's on slips; a contact takes part in a step if its gap, half a step ahead, is closed. Second order
where no row is active (theta = 1/2), first order over impacts. An impact that others bring about within a step is a
problem of its own, after theirs. Springs of compliant contacts and before sliders enter the same problem, by their
mean force over the step. In the plane impulses never bring energy (Kane's paradox): all coefficients of restitution are
smaller by one factor then, as in engine.plane.impacts.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vanedamp.coupling.methods import Variant
from vanedamp.coupling.methods.step_problem import list_row, list_slip, new_step_problem, solve_rows
from vanedamp.coupling.methods.step_records import close_step, drag_sliders, open_step, product, set_gaps
from vanedamp.coupling.methods.time_stepping import Sparse, SteppedRun, sparse, start, time_grid
from vanedamp.coupling.numerics.codes import DONE, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import ZERO, entry, inlined, kernel
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import PlanarOptions, SteppingOptions
from vanedamp.coupling.system.restitution import restitution_at
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_kinematics import elongation, has_friction, is_rigid, row_speed
from vanedamp.files.toml_input import Real

VARIANTS = (Variant("Moreau-Jean", "#c2410c", "o"),)
WAVEFORMS = True
PLANAR_LAWS = ("yields", "two_phases", "depends_on_speed")

#: problems that a step may take, the last with all contacts at once
_TURNS = 20
#: times the speeds in a scene: by how much a sweep may still change one, and below which a contact counts as at rest
_TOLERANCE, _AT_REST = 1e-13, 1e-10
#: bisections of the factor of the coefficients; energy that impulses may add, times what they move
_HALVINGS, _GAIN = 40, 1e-10
#: round-off of a gap, times the play
_ROUND_OFF = 1e-12
#: row of Motion.coordinates: velocities at the step's end; rows of Motion.rows, by units
_FREE, _CLOSED, _APPROACH = 0, 0, 1


class Options(SteppingOptions, PlanarOptions):
    """Options of Moreau-Jean's method."""

    method: Literal["moreau"] = "moreau"
    """"moreau": time stepping by Moreau and Jean, with impulses"""
    theta: Annotated[Real, Field(ge=0.5, le=1)] = 0.5
    """weight of a step's end in the smooth forces; 0.5 is of second order, 1 damps [-]"""
    contacts: Literal["exact", "gauss_seidel"] | None = None
    """solver of the impulses of a step: "exact", by pivots, or "gauss_seidel", by projected iteration (default: "exact"
    for sliders, "gauss_seidel" for bodies in the plane)"""


def begin(scene: Scene, system: System, records: Records, events: bool, begun: RestartState) -> Run:
    """Return a run. Raises InputError for bodies that overlap at the start."""
    options: Any = scene.solver
    rigid = np.isinf(system.spring)
    moving, motion = start(system, begun, np.where(rigid, 0.0, system.spring), records)
    times, theta = time_grid(scene, system, options.steps_per_period), options.theta
    inverse, turned, mobility = moreau_matrices(moving, times.step, theta)
    exact = not system.in_plane if options.contacts is None else options.contacts == "exact"
    problem = new_step_problem(moving, mobility, exact)
    march = partial(march_moreau, moving, times, motion, records, problem, inverse, turned, theta)
    return SteppedRun(system, march, motion, records, events, options)


def moreau_matrices(system: System, step: float, theta: float) -> tuple[Sparse, np.ndarray, np.ndarray]:
    """Return the inverse of the iteration matrix, its product with J^T (N, 2u), and the rows' mobility (2u, 2u)."""
    matrix = np.diag(system.mass) + (step * theta) ** 2 * system.stiffness + step * theta * system.damping
    inverse = np.linalg.inv(matrix)
    turned = inverse @ system.J.T
    return sparse(inverse), turned, system.J @ turned


@entry
def march_moreau(system, times, motion, records, problem, inverse, turned, theta, log, until, budget, deepest):
    """Step until this many steps are done. Return the code of numerics.codes."""
    size, h = len(motion.q), times.step
    q, v, free = motion.start[0], motion.start[1], motion.coordinates[_FREE]
    load, ahead = motion.coordinates[1], motion.coordinates[2]
    while motion.counters[STEPS] < until:
        k = open_step(system, times, motion, records, 1)
        for i in range(size):
            ahead[i] = q[i] + h * theta * v[i]
        for i in range(size):
            mean = theta * times.load[k + 1, i] + (1.0 - theta) * times.load[k, i] + system.weight[i]
            load[i] = h * (mean - product(times.damping, i, v) - product(times.stiffness, i, ahead))
        for i in range(size):
            free[i] = v[i] + product(inverse, i, load)
        if not _impulses(system, motion, problem, turned, h, theta):
            return UNDECIDED
        for i in range(size):
            motion.v[i] = free[i]
            motion.q[i] = q[i] + h * (theta * free[i] + (1.0 - theta) * v[i])
        drag_sliders(system, motion.q)
        set_gaps(system, motion)
        code = close_step(system, times, motion, records, log, k, budget, deepest)
        if code != DONE:
            return code
    return DONE


@kernel
def _impulses(system, motion, problem, turned, h, theta):
    """Set the impulses of a step and the velocities that they leave. Returns False if undecided.

    A contact that parts as the step begins waits. Where impulses of others drive it together, it meets a second impact
    after theirs, at its new speed: in one problem with them it would end without rebound, and since nothing opens an
    overlap without speed, bodies in a row would fly as one ever after.
    """
    u, free, closed, shut = len(system.rest), motion.coordinates[_FREE], motion.rows[_CLOSED], False
    for r in range(u):
        motion.impulse[r], motion.impulse[u + r], motion.before[r], closed[r] = 0.0, 0.0, 0.0, 0.0
        if has_friction(system, r):
            motion.before[u + r] = row_speed(system, u + r, motion.v)
        if r < system.contacts:
            motion.before[r] = row_speed(system, r, motion.v)
            if is_rigid(system, r):
                ahead = motion.gap[0, r] + 0.5 * h * motion.before[r]
                closed[r] = 1.0 if ahead <= _ROUND_OFF * system.play[r] else 0.0
                shut = shut or closed[r] > 0.0
    fastest = _speeds(system, motion) if shut or problem.exact is None else 0.0
    motion.slowest[0] = _AT_REST * fastest
    if system.two_phases and shut and not _two_phases(system, motion, problem, turned, _TOLERANCE * fastest):
        return False
    for turn in range(_TURNS):
        count = _list_rows(system, motion, problem, h, theta, turn)
        if count == 0:
            return True
        motion.counters[SOLVES] += 1
        if not _rebound(system, motion, problem, count, turn, _TOLERANCE * fastest):
            return False
        _push(system, motion, problem, count, turned)
        approaching = False
        for r in range(system.contacts):
            approaching = approaching or (closed[r] > 0.0 and row_speed(system, r, free) < -motion.slowest[0])
        if not approaching:
            return True
    return True


@kernel
def _speeds(system, motion):
    """Return the largest sum of the parts of a row's speed as the step begins or ends, m/s."""
    fastest, free = 0.0, motion.coordinates[_FREE]
    for row in range(len(system.J)):
        size = 0.0
        for i in range(len(free)):
            size += abs(system.J[row, i]) * max(abs(free[i]), abs(motion.v[i]))
        fastest = max(fastest, size)
    return fastest


@kernel
def _push(system, motion, problem, count, turned):
    """Let the impulses of a problem act."""
    free = motion.coordinates[_FREE]
    for a in range(count):
        row, impulse = problem.row[a], problem.box.force[a]
        motion.impulse[row] += impulse
        for i in range(len(free)):
            free[i] += turned[i, row] * impulse


@kernel
def _two_phases(system, motion, problem, turned, tolerance):
    """Let the impulses of impacts act, compression and expansion, which the loads of the step come after.

    In one problem with the loads, what they press would expand as well: a body at rest would hop. Returns False if
    they are not found.
    """
    u, box, approach = len(system.rest), problem.box, motion.rows[_APPROACH]
    for turn in range(_TURNS):
        count, approaching = ZERO, False
        for r in range(system.contacts):
            if motion.rows[_CLOSED, r] == 0.0:
                continue
            speed, slip = motion.before[r], motion.before[u + r]
            for row in range(2 * u):
                speed += problem.mobility[r, row] * motion.impulse[row]
                slip += problem.mobility[u + r, row] * motion.impulse[row]
            approaching = approaching or speed < -motion.slowest[0]
            if speed <= motion.slowest[0] or turn == _TURNS - 1:
                list_row(problem, count, r, speed, 0.0, math.inf, 0.0)
                approach[r] = -speed
                count = list_slip(system, problem, count, r, slip, 0.0, 0.0, 0.0)
        if not approaching:
            return True
        for phase in range(2):
            if not solve_rows(problem, count, 1.0, tolerance):
                return False
            _push(system, motion, problem, count, turned)
            for a in range(count):
                problem.now[a] = box.acceleration[a]
            if phase == 0:
                _expand(system, problem, count, approach)
                _push(system, motion, problem, count, turned)
    return True


@kernel
def _expand(system, problem, count, approach):
    """Set the impulses of expansion after compression; the rest is the same problem besides."""
    box = problem.box
    for a in range(count):
        r = problem.row[a]
        box.force[a] = restitution_at(system, r, approach[r]) * box.force[a] if r < len(system.rest) else 0.0
    for a in range(count):
        for c in range(count):
            problem.now[a] += box.matrix[a, c] * box.force[c]
        if problem.friction[a] > 0.0:
            bound = problem.friction[a] * box.force[problem.normal[a]]
            box.low[a], box.high[a] = -bound, bound


@kernel
def _list_rows(system, motion, problem, h, theta, turn):
    """Set up the problem of the rows that take part in a turn. Return their number."""
    u, count, free, slowest = len(system.rest), ZERO, motion.coordinates[_FREE], motion.slowest[0]
    for rank in range(u):
        r = problem.order[rank]
        if r >= system.contacts:
            slip, yields = _slip(system, motion, r, h, theta)
            low, high = -h * system.limit[r] - motion.impulse[u + r], h * system.limit[r] - motion.impulse[u + r]
            list_row(problem, count, u + r, slip, low, high, yields)
            count += 1
            continue
        rigid = is_rigid(system, r)
        if rigid and motion.rows[_CLOSED, r] == 0.0:
            continue
        now = row_speed(system, r, free)
        if rigid:
            before = motion.before[r] if turn == 0 and not system.two_phases else now
            if turn < _TURNS - 1 and before > slowest and now > -slowest:
                continue
            list_row(problem, count, r, now, 0.0, math.inf, 0.0)
            if not system.two_phases:
                problem.asked[count] = restitution_at(system, r, -before) * min(before, 0.0)
            bound, had = 0.0, 0.0
        else:
            opened = motion.gap[0, r]
            if opened + h * min(motion.before[r], now) > 0.0:
                continue
            now, soft = _on_spring(
                h, theta, system.spring[r], system.dashpot[r], opened, motion.before[r], motion.impulse[r], now
            )
            list_row(problem, count, r, now, -motion.impulse[r], math.inf, soft)
            bound, had = system.friction[r] * motion.impulse[r], motion.impulse[u + r]
        slip, yields = _slip(system, motion, r, h, theta)
        count = list_slip(system, problem, count, r, slip, bound, had, yields)
    return count


@inlined
def _slip(system, motion, r, h, theta):
    """Return speed and compliance of the slip of a unit, which may have a spring and a slider behind it."""
    row, j = len(system.rest) + r, system.slider[r]
    slip, yields = row_speed(system, row, motion.coordinates[_FREE]), 0.0
    if j >= 0:
        slip, yields = _on_spring(
            h, theta, system.tangential[j], 0.0, elongation(system, j, motion.q), motion.before[row],
            motion.impulse[row], slip,
        )  # fmt: skip
    return slip, yields


@inlined
def _on_spring(h, theta, spring, dashpot, stretched, before, impulse, now):
    """Return speed and compliance of a row at whose rest the impulse of a step is the mean of spring and dashpot.

    stretched: elongation as the step begins, m; before, now: speeds then, and at its end without more impulses.
    """
    stiff = theta * (spring * h * theta + dashpot)
    soft = 1.0 / (h * stiff)
    begun = spring * (stretched + h * theta * (1.0 - theta) * before) + dashpot * (1.0 - theta) * before
    return now + begun / stiff + soft * impulse, soft


@kernel
def _rebound(system, motion, problem, count, turn, tolerance):
    """Find the impulses of a turn, in the plane with the largest factor of the coefficients that brings no energy.

    Returns False if they are not found.
    """
    low, high, factor = 0.0, 1.0, 1.0
    for _ in range(_HALVINGS):
        if not solve_rows(problem, count, factor, tolerance):
            return False
        if system.in_plane and _brings_energy(system, motion, problem, count, turn, factor):
            high = factor
        elif factor == 1.0:
            return True
        else:
            low = factor
        factor = 0.5 * (low + high)
    return solve_rows(problem, count, low, tolerance)


@kernel
def _brings_energy(system, motion, problem, count, turn, factor):
    """Whether the impulses of rigid contacts bring energy, by the speeds before and after the step's loads.

    The loads alone may let it seem so by one: where they pull a contact open, or turn a slip round.
    """
    u, early, late, terms = len(system.rest), 0.0, 0.0, 0.0
    for a in range(count):
        row = problem.row[a]
        r = row - u if row >= u else row
        if is_rigid(system, r):
            impulse, after = problem.box.force[a], problem.box.acceleration[a] - factor * problem.asked[a]
            now = problem.now[a]
            before = motion.before[row] if turn == 0 else now
            early += 0.5 * impulse * (before + after)
            late += 0.5 * impulse * (now + after)
            terms += abs(impulse) * (abs(before) + abs(now) + abs(after))
    return min(early, late) > _GAIN * terms
