"""The motion and the records of a step of methods for bodies with extent: energies, peaks, impacts, tilts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    COUNTERS,
    DIVERGED,
    DONE,
    IMPACTS,
    LOGGED,
    PENETRATION,
    PERIOD,
    STEPS,
)
from vanedamp.coupling.numerics.compiler.jit import inlined
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.planar.contact_decisions import elongation, gap
from vanedamp.coupling.planar.recorder import note_tilts, put_sample, record_section
from vanedamp.coupling.response.recorder import note_step
from vanedamp.coupling.response.records import (
    CONTACT,
    ENERGIES,
    EXCITATION,
    FRICTION,
    IMPACT,
    IMPACT_LOSS,
    VISCOUS,
    Records,
)
from vanedamp.coupling.system.assembly import Motion
from vanedamp.coupling.system.system import FLOOR, System

#: a motion above this, in m or m/s, has no physical meaning
_BOUND = 1e30


@record
class SteppedMotion(NamedTuple):
    """The state of a run, advanced in place. Sizes as in constraints.System."""

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

    # constant
    spring: np.ndarray  # (u,) stiffness of contacts by penalty, N/m; 0: rigid

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
    now: np.ndarray  # (2u,) speeds that the loads and the problems before leave
    asked: np.ndarray  # (u,) speed that restitution asks for, less than zero
    left: np.ndarray  # (2u,) its speeds, less what restitution asks for
    closed: np.ndarray  # (u,) int: whether a contact takes part in the step
    listed: np.ndarray  # (u,) int: units of the problem


def start_steps(system: System, initial: Motion, records: Records, spring: np.ndarray | None = None) -> SteppedMotion:
    """Return the motion at time zero. spring: (u,) as in SteppedMotion, rigid contacts unless given."""
    u, size, of_bodies = len(system.rest), len(system.mass), (len(records.peak), len(system.along))
    samples = len(records.samples)
    return SteppedMotion(
        q=initial.q.copy(), v=initial.v.copy(), counters=np.zeros(COUNTERS, np.int64), ledger=np.zeros(len(ENERGIES)),
        deepest=np.zeros(1), tilt=np.zeros(of_bodies), lifted=np.zeros(of_bodies),
        sampled=np.zeros((samples, size)), shut=np.zeros((samples, u), np.int8),
        spring=np.zeros(u) if spring is None else spring,
        active=np.zeros(u, np.int64), speed=np.zeros(u), begun=np.zeros(u), total=np.zeros(2 * u), lost=np.zeros(u),
        start=np.zeros((2, size)), free=np.zeros((2, size)), before=np.zeros(2 * u), slowest=np.zeros(1),
        impulse=np.zeros(2 * u), more=np.zeros(2 * u), least=np.zeros(u), approach=np.zeros(u),
        now=np.zeros(2 * u), asked=np.zeros(u), left=np.zeros(2 * u), closed=np.zeros(u, np.int64),
        listed=np.zeros(u, np.int64),
    )  # fmt: skip


@inlined
def _response(system, times, k, q, v):
    """Return displacement and velocity of the response at step k of the period."""
    x, rate = times.table[k, 0], times.table[k, 1]
    for i in range(len(q)):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
    return x, rate


@inlined
def record_start(system, motion, records):
    """Record section, energies and ledger at the start of a period, those of all springs included."""
    springs = 0.0
    for r in range(system.contacts):
        if motion.spring[r] > 0.0:
            springs += 0.5 * motion.spring[r] * min(gap(system, r, motion.q), 0.0) ** 2
    for j in range(len(system.tangential)):
        springs += 0.5 * system.tangential[j] * elongation(system, j, motion.q) ** 2
    record_section(system, motion, records, springs)


@inlined
def drag_slider(system, j, q):
    """Let the slider of a Jenkins element follow, in q, where the spring would go beyond its bound."""
    most = system.limit[len(system.limit) - len(system.tangential) + j] / system.tangential[j]
    stretched = elongation(system, j, q)
    q[len(q) - len(system.tangential) + j] += stretched - min(max(stretched, -most), most)


@inlined
def account_step(system, times, motion, records, k, deepest):
    """Account for step k of the period: energies by midpoints, response. Returns DONE, DIVERGED or PENETRATION."""
    h, u, p, q, v = times.step, len(system.rest), motion.counters[PERIOD], motion.start[0], motion.start[1]
    x0, rate0 = _response(system, times, k, q, v)
    x1, rate1 = _response(system, times, k + 1, motion.q, motion.v)
    c0, s0, c1, s1 = times.phase[k, 0], times.phase[k, 1], times.phase[k + 1, 0], times.phase[k + 1, 1]
    note_step(records, p, h, x0, x1, rate0, rate1)
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
                motion.ledger[_loss_of(system, motion, r, row, hit)] -= motion.impulse[row] / h * moved
                motion.lost[r] -= motion.impulse[row] / h * moved
        if r < system.contacts:
            now = gap(system, r, motion.q)
            deep = max(deep, -now / system.play[r])
            if motion.spring[r] > 0.0:
                stored = min(now, 0.0) ** 2 - min(gap(system, r, q), 0.0) ** 2
                motion.ledger[CONTACT] -= 0.5 * motion.spring[r] * stored
    for j in range(len(system.tangential)):
        stored = elongation(system, j, motion.q) ** 2 - elongation(system, j, q) ** 2
        motion.ledger[FRICTION] -= 0.5 * system.tangential[j] * stored
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
    """Whether a rigid contact that approached has pushed in this step: what contacts take is then an impact's loss."""
    hit = False
    for r in range(system.contacts):
        pushed = motion.impulse[r] > 0.0 and motion.spring[r] == 0.0
        hit = hit or (pushed and motion.before[r] < -motion.slowest[0])
    return hit


@inlined
def _loss_of(system, motion, unit, row, hit):
    """Return the entry of the ledger for what the force of a row takes."""
    if row == unit:
        return CONTACT if motion.spring[unit] > 0.0 else IMPACT_LOSS
    return IMPACT_LOSS if hit and unit < system.contacts else FRICTION


@inlined
def _stands(system, motion, b):
    """Whether the floor pushes a body in this step."""
    for r in range(system.contacts):
        if system.body[r] == b and system.surface[r] == FLOOR and motion.impulse[r] > 0.0:
            return True
    return False


@inlined
def follow_contacts(system, times, motion, records, log, k):
    """Count contacts that begin to carry force, and log those that have ended, as planar.impacts.log_event does."""
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
def record_sample(system, times, motion, records, k):
    """Keep a sample if step k of the period begins at one."""
    each = len(records.samples) // max(len(records.peak) - 1, 1)
    if each == 0 or k % ((len(times.phase) - 1) // each) != 0:
        return
    row = motion.counters[PERIOD] * each + k // ((len(times.phase) - 1) // each)
    x, _ = _response(system, times, k, motion.q, motion.v)
    put_sample(system, motion, records, row, x, motion.q, motion.active, 0)
