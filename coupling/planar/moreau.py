"""Moreau-Jean time stepping of bodies with extent: a witness that shares no solver with the exact engine.

Jean (1999); Acary and Brogliato (2008), chapter 10. The theta method for the smooth part; a contact takes part in a
step if its gap, half a step ahead, is closed: Newton's law on its normal velocity, Coulomb's on its slip. The impulses
of a step are found by projected Gauss-Seidel iteration (Jourdan, Alart and Jean 1998), one impulse after the other. An
impact that others bring about within a step is a problem of its own, after theirs, as in methods.moreau.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    COUNTERS,
    DIVERGED,
    DONE,
    EVENT_BUDGET,
    IMPACTS,
    LOGGED,
    PENETRATION,
    PERIOD,
    SOLVES,
    STEPS,
    UNDECIDED,
)
from vanedamp.coupling.numerics.jit import entry, inlined, kernel
from vanedamp.coupling.planar.constraints import FLOOR, PlanarMotion, PlanarSystem
from vanedamp.coupling.planar.contact_decisions import gap, row_speed
from vanedamp.coupling.planar.recorder import note_tilts, put_sample, record_section
from vanedamp.coupling.response.recorder import cubic_peak
from vanedamp.coupling.response.records import ENERGIES, EXCITATION, FRICTION, IMPACT, IMPACT_LOSS, VISCOUS, Records
from vanedamp.coupling.system.restitution import restitution_at

#: problems that a step may take, the last with all contacts at once
_TURNS = 20
#: share of the speeds in a scene by which a sweep may still change one, and below which a contact counts as at rest
_TOLERANCE, _AT_REST = 1e-13, 1e-10
#: sweeps that a problem may take
_SWEEPS = 100_000
#: share of the play by which round-off may open a gap
_ROUND_OFF = 1e-12
#: a motion above this, in m or m/s, has no physical meaning
_BOUND = 1e30


class SteppedMotion(NamedTuple):
    """The state of a run, advanced in place. Sizes as in constraints.PlanarSystem."""

    # changes in every step
    q: np.ndarray  # (N,)
    v: np.ndarray  # (N,)
    counters: np.ndarray  # int (numerics.codes)
    ledger: np.ndarray  # (6,) J
    deepest: np.ndarray  # (1,) largest penetration relative to the play
    tilt: np.ndarray  # (periods + 1, b) largest |tilt| in the cavity in each period, rad
    lifted: np.ndarray  # (periods + 1, b) time without an impulse at the floor, s
    sampled: np.ndarray  # (samples, N) coordinates
    shut: np.ndarray  # (samples, u) int: whether contacts carry force

    # changes with the contacts
    active: np.ndarray  # (u,) int: contacts that carry force
    speed: np.ndarray  # (u,) at the beginning of the present contact, m/s
    begun: np.ndarray  # (u,) time of that, s
    total: np.ndarray  # (2u,) impulse since then, N s
    lost: np.ndarray  # (u,) energy that it took since then, J

    # scratch
    start: np.ndarray  # (2, N) coordinates and velocities as the step begins
    free: np.ndarray  # (2, N) right-hand side; velocities at the step's end with the impulses found so far
    before: np.ndarray  # (2u,) speeds as the step begins
    slowest: np.ndarray  # (1,) speed below which a contact counts as at rest, m/s
    impulse: np.ndarray  # (2u,) of the step
    more: np.ndarray  # (2u,) that the present problem adds
    least: np.ndarray  # (u,) normal impulse that it asks for, at least: in expansion
    approach: np.ndarray  # (u,) speed of approach before its impact, m/s
    left: np.ndarray  # (2u,) its speeds, less what restitution asks for
    closed: np.ndarray  # (u,) int: whether a contact takes part in the step
    listed: np.ndarray  # (u,) int: units of the problem


def start_steps(system: PlanarSystem, initial: PlanarMotion, records: Records) -> SteppedMotion:
    """Return the motion at time zero."""
    u, size, of_bodies = len(system.rest), len(system.mass), (len(records.peak), len(system.along))
    samples = len(records.samples)
    return SteppedMotion(
        q=initial.q.copy(), v=initial.v.copy(), counters=np.zeros(COUNTERS, np.int64), ledger=np.zeros(len(ENERGIES)),
        deepest=np.zeros(1), tilt=np.zeros(of_bodies), lifted=np.zeros(of_bodies),
        sampled=np.zeros((samples, size)), shut=np.zeros((samples, u), np.int8),
        active=np.zeros(u, np.int64), speed=np.zeros(u), begun=np.zeros(u), total=np.zeros(2 * u), lost=np.zeros(u),
        start=np.zeros((2, size)), free=np.zeros((2, size)), before=np.zeros(2 * u), slowest=np.zeros(1),
        impulse=np.zeros(2 * u), more=np.zeros(2 * u), least=np.zeros(u), approach=np.zeros(u),
        left=np.zeros(2 * u), closed=np.zeros(u, np.int64), listed=np.zeros(u, np.int64),
    )  # fmt: skip


def step_matrices(system: PlanarSystem, step: float, theta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse of the iteration matrix (N, N), its product with J^T (N, 2u), and the mobility (2u, 2u)."""
    matrix = np.diag(system.mass) + step * theta * (system.damping + step * theta * system.stiffness)
    inverse = np.linalg.inv(matrix)
    turned = inverse @ system.J.T
    return inverse, turned, system.J @ turned


@entry
def march(system, times, motion, records, log, inverse, turned, mobility, theta, periods, budget, deepest):
    """Step to the end of `periods`, on a grid of equations_of_motion.TimeGrid. Return the code of numerics.codes."""
    h, steps, size = times.step, len(times.phase) - 1, len(motion.q)
    q, v, rhs, free = motion.start[0], motion.start[1], motion.free[0], motion.free[1]
    if motion.counters[PERIOD] == 0:
        record_section(system, motion, records, 0.0)
    while motion.counters[PERIOD] < periods:
        for k in range(steps):
            for i in range(size):
                q[i], v[i] = motion.q[i], motion.v[i]
            _sample(system, times, motion, records, k)
            for i in range(size):
                rhs[i] = system.weight[i] + theta * times.load[k + 1, i] + (1.0 - theta) * times.load[k, i]
                for j in range(size):
                    rhs[i] -= system.damping[i, j] * v[j] + system.stiffness[i, j] * (q[j] + h * theta * v[j])
            for i in range(size):
                free[i] = v[i]
                for j in range(size):
                    free[i] += h * inverse[i, j] * rhs[j]
            if not _impulses(system, motion, mobility, turned, h):
                return UNDECIDED
            for i in range(size):
                motion.v[i] = free[i]
                motion.q[i] = q[i] + h * (theta * free[i] + (1.0 - theta) * v[i])
            _follow_contacts(system, times, motion, records, log, k)
            code = _account(system, times, motion, records, k, deepest)
            if code != DONE:
                return code
        motion.counters[PERIOD] += 1
        record_section(system, motion, records, 0.0)
        if motion.counters[IMPACTS] >= budget:
            return EVENT_BUDGET
    return DONE


@kernel
def _impulses(system, motion, mobility, turned, h):
    """Set the impulses of a step and the velocities (motion.free) that they leave. Returns False if undecided.

    A contact that parts as the step begins waits: where impulses of others drive it together, it meets an impact of its
    own after theirs.
    """
    u, free, fastest = len(system.rest), motion.free[1], 0.0
    for r in range(2 * u):
        motion.before[r], motion.impulse[r], size = row_speed(system, r, motion.v), 0.0, 0.0
        for i in range(len(free)):
            size += abs(system.J[r, i]) * max(abs(free[i]), abs(motion.v[i]))
        fastest = max(fastest, size)
    motion.slowest[0] = _AT_REST * fastest
    for r in range(system.contacts):
        ahead = gap(system, r, motion.q) + 0.5 * h * motion.before[r]
        motion.closed[r] = 1 if ahead <= _ROUND_OFF * system.play[r] else 0
    if system.two_phases:
        if not _two_phases(system, motion, mobility, h, _TOLERANCE * fastest):
            return False
        for r in range(2 * u):
            if motion.impulse[r] != 0.0:
                for i in range(len(free)):
                    free[i] += turned[i, r] * motion.impulse[r]
    for turn in range(_TURNS):
        count = _list_units(system, motion, turn)
        if count == 0:
            return True
        motion.counters[SOLVES] += 1
        if not _gauss_seidel(system, motion, mobility, count, h, _TOLERANCE * fastest):
            return False
        for p in range(count):
            for r in (motion.listed[p], u + motion.listed[p]):
                motion.impulse[r] += motion.more[r]
                for i in range(len(free)):
                    free[i] += turned[i, r] * motion.more[r]
        approaching = False
        for r in range(system.contacts):
            approaching = approaching or (motion.closed[r] == 1 and row_speed(system, r, free) < -motion.slowest[0])
        if not approaching:
            return True
    return True


@kernel
def _two_phases(system, motion, mobility, h, tolerance):
    """Add the impulses of impacts, compression and expansion, which the loads of the step come after.

    In one problem with the loads, what they press would expand as well: a body at rest would hop. Returns False if
    they do not converge.
    """
    u = len(system.rest)
    for turn in range(_TURNS):
        count, approaching = 0, False
        for r in range(system.contacts):
            if motion.closed[r] == 0:
                continue
            motion.left[r], motion.left[u + r] = motion.before[r], motion.before[u + r]
            for row in range(2 * u):
                motion.left[r] += mobility[r, row] * motion.impulse[row]
                motion.left[u + r] += mobility[u + r, row] * motion.impulse[row]
            approaching = approaching or motion.left[r] < -motion.slowest[0]
            if motion.left[r] <= motion.slowest[0] or turn == _TURNS - 1:
                motion.listed[count], motion.approach[r] = r, -motion.left[r]
                count += 1
        if not approaching:
            return True
        for phase in range(2):
            if not _gauss_seidel(system, motion, mobility, count, h, tolerance):
                return False
            for p in range(count):
                r = motion.listed[p]
                motion.impulse[r] += motion.more[r]
                motion.impulse[u + r] += motion.more[u + r]
                motion.least[r] = restitution_at(system, r, motion.approach[r]) * motion.more[r] if phase == 0 else 0.0
    return True


@inlined
def _list_units(system, motion, turn):
    """List the units that take part in a turn, with what Newton's law leaves of their speeds. Return their number."""
    u, count, free, slowest = len(system.rest), 0, motion.free[1], motion.slowest[0]
    for r in range(u):
        if r < system.contacts:
            if motion.closed[r] == 0:
                continue
            now = row_speed(system, r, free)
            before = motion.before[r] if turn == 0 and not system.two_phases else now
            if turn < _TURNS - 1 and before > slowest and now > -slowest:
                continue
            motion.left[r] = now
            if not system.two_phases:
                motion.left[r] += restitution_at(system, r, -before) * min(before, 0.0)
        motion.left[u + r] = row_speed(system, u + r, free)
        motion.listed[count] = r
        count += 1
    return count


@kernel
def _gauss_seidel(system, motion, mobility, count, h, tolerance):
    """Find the impulses (motion.more) of the listed units. Returns False if they do not converge."""
    u, more = len(system.rest), motion.more
    for p in range(count):
        more[motion.listed[p]], more[u + motion.listed[p]] = 0.0, 0.0
    for _ in range(_SWEEPS):
        largest = 0.0
        for p in range(count):
            r = motion.listed[p]
            if r < system.contacts:
                largest = max(largest, _push(system, motion, mobility, count, r, motion.least[r], math.inf))
                bound = system.friction[r] * more[r]
                low, high = -bound, bound
            else:
                low, high = -h * system.limit[r] - motion.impulse[u + r], h * system.limit[r] - motion.impulse[u + r]
            if r >= system.contacts or system.friction[r] > 0.0:
                largest = max(largest, _push(system, motion, mobility, count, u + r, low, high))
        if largest <= tolerance:
            return True
    return False


@inlined
def _push(system, motion, mobility, count, row, low, high):
    """Bring a row to rest, or its impulse to a bound. Return by how much that changes its speed."""
    u, own = len(system.rest), mobility[row, row]
    wanted = min(max(motion.more[row] - motion.left[row] / own, low), high)
    change = wanted - motion.more[row]
    if change != 0.0:
        motion.more[row] = wanted
        for p in range(count):
            r = motion.listed[p]
            motion.left[r] += mobility[r, row] * change
            motion.left[u + r] += mobility[u + r, row] * change
    return abs(change) * own


@inlined
def _response(system, times, k, q, v):
    """Return displacement and velocity of the response at step k of the period."""
    x, rate = times.table[k, 0], times.table[k, 1]
    for i in range(len(q)):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
    return x, rate


@inlined
def _account(system, times, motion, records, k, deepest):
    """Account for step k of the period: energies by midpoints, response. Returns DONE, DIVERGED or PENETRATION."""
    h, u, p, q, v = times.step, len(system.rest), motion.counters[PERIOD], motion.start[0], motion.start[1]
    x0, rate0 = _response(system, times, k, q, v)
    x1, rate1 = _response(system, times, k + 1, motion.q, motion.v)
    c0, s0, c1, s1 = times.phase[k, 0], times.phase[k, 1], times.phase[k + 1, 0], times.phase[k + 1, 1]
    records.peak[p] = max(records.peak[p], abs(x1), cubic_peak(h, x0, x1, rate0, rate1))
    records.square[p] += h * (x0 * x0 + x1 * x1) / 2.0
    records.harmonic[p] += h / 2.0 * complex(x0 * c0 + x1 * c1, -x0 * s0 - x1 * s1)
    m0, m1 = 0.0, 0.0
    for b in range(len(system.along)):
        m0 += system.mass[system.along[b]] * v[system.along[b]]
        m1 += system.mass[system.along[b]] * motion.v[system.along[b]]
    records.momentum[p] += h / 2.0 * complex(m0 * c0 + m1 * c1, -m0 * s0 - m1 * s1)
    size, deep = abs(x1), 0.0
    for i in range(len(q)):
        moved = motion.q[i] - q[i]
        size = max(size, abs(motion.v[i]))
        motion.ledger[EXCITATION] += 0.5 * (times.load[k, i] + times.load[k + 1, i]) * moved
        for j in range(len(q)):
            motion.ledger[VISCOUS] += 0.5 * system.damping[i, j] * (v[j] + motion.v[j]) * moved
    hit = _collided(system, motion)
    for r in range(u):
        for row in (r, u + r):
            if motion.impulse[row] != 0.0:
                moved = 0.0
                for i in range(len(q)):
                    moved += system.J[row, i] * (motion.q[i] - q[i])
                lost = row < u or (hit and r < system.contacts)
                motion.ledger[IMPACT_LOSS if lost else FRICTION] -= motion.impulse[row] / h * moved
                motion.lost[r] -= motion.impulse[row] / h * moved
        if r < system.contacts:
            deep = max(deep, -gap(system, r, motion.q) / system.play[r])
    motion.deepest[0] = max(motion.deepest[0], deep)
    note_tilts(system, motion, motion.q, p)
    for b in range(len(system.along)):
        if system.tilt[b] >= 0 and not _stands(system, motion, b):
            motion.lifted[p, b] += h
    motion.counters[STEPS] += 1
    if not size < _BOUND:
        return DIVERGED
    return PENETRATION if deep > deepest else DONE


@inlined
def _collided(system, motion):
    """Whether a contact that approached has pushed in this step: what contacts take is then the loss of an impact."""
    hit = False
    for r in range(system.contacts):
        hit = hit or (motion.impulse[r] > 0.0 and motion.before[r] < -motion.slowest[0])
    return hit


@inlined
def _stands(system, motion, b):
    """Whether the floor pushes a body in this step."""
    for r in range(system.contacts):
        if system.body[r] == b and system.surface[r] == FLOOR and motion.impulse[r] > 0.0:
            return True
    return False


@inlined
def _follow_contacts(system, times, motion, records, log, k):
    """Count contacts that begin to carry force, and log those that have ended, as impacts.log_event does."""
    u, p = len(system.rest), motion.counters[PERIOD]
    for r in range(system.contacts):
        pushed, before = motion.impulse[r] > 0.0, motion.before[r]
        if pushed and motion.active[r] == 0 and before < 0.0:
            motion.counters[IMPACTS] += 1
            records.impacts[p] += 1
            records.collided[p] += 0.5 * before * before / system.delassus[r, r]
            motion.speed[r], motion.total[r], motion.total[u + r], motion.lost[r] = before, 0.0, 0.0, 0.0
            motion.begun[r] = (p * (len(times.phase) - 1) + k) * times.step
        if pushed:
            motion.total[r] += motion.impulse[r]
            motion.total[u + r] += motion.impulse[u + r]
        elif motion.active[r] == 1 and motion.counters[LOGGED] < len(log):
            entry = log[motion.counters[LOGGED]]
            entry[0], entry[1], entry[2], entry[3] = motion.begun[r], IMPACT, r, motion.speed[r]
            entry[4], entry[5], entry[6], entry[7] = before, motion.total[r], motion.total[u + r], motion.lost[r]
            motion.counters[LOGGED] += 1
        motion.active[r] = 1 if pushed else 0


@inlined
def _sample(system, times, motion, records, k):
    """Keep a sample if step k of the period begins at one."""
    each = len(records.samples) // max(len(records.peak) - 1, 1)
    if each == 0 or k % ((len(times.phase) - 1) // each) != 0:
        return
    row = motion.counters[PERIOD] * each + k // ((len(times.phase) - 1) // each)
    x, _ = _response(system, times, k, motion.q, motion.v)
    put_sample(system, motion, records, row, x, motion.q, motion.active, 0)
