"""The records of a step of any stepping method: energies, harmonic, peaks, impacts, tilts, penetration."""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.codes import DIVERGED, DONE, EVENT_BUDGET, IMPACTS, LOGGED, PENETRATION, PERIOD, STEPS
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.response.recorder import note_outputs, note_step, note_tilts, put_sample, record_section
from vanedamp.coupling.response.records import CONTACT, EXCITATION, FRICTION, IMPACT, IMPACT_LOSS, VISCOUS
from vanedamp.coupling.system.system import FLOOR, LEFT, RIGHT
from vanedamp.coupling.system.unit_kinematics import elongation, gap, is_second, slider_bound

#: a motion above this, in m or m/s, has no physical meaning
_BOUND = 1e30


@inlined
def product(matrix, i, vector):
    """Return entry i of the product of a matrix (time_stepping.Sparse) and a vector."""
    total = 0.0
    for a in range(matrix.value.shape[1]):
        total += matrix.value[i, a] * vector[matrix.column[i, a]]
    return total


@inlined
def copy(source, target):
    """Copy as many numbers as the target has."""
    for i in range(len(target)):
        target[i] = source[i]


@inlined
def drag_sliders(system, q):
    """Let sliders follow, in q, where their springs would go beyond their bounds."""
    for r in range(len(system.rest)):
        j = system.slider[r]
        if j >= 0:
            most, stretched = slider_bound(system, r, q) / system.tangential[j], elongation(system, j, q)
            q[len(q) - len(system.tangential) + j] += stretched - min(max(stretched, -most), most)


@inlined
def set_gaps(system, motion):
    """Set the gaps at the end of a step; the last one's are where it began."""
    for r in range(system.contacts):
        motion.gap[1, r] = motion.gap[0, r]
        motion.gap[0, r] = gap(system, r, motion.q)


@kernel
def record_start(system, motion, records):
    """Record section, energies and ledger at the start of a period, all springs included."""
    springs = 0.0
    for r in range(system.contacts):
        motion.gap[0, r] = gap(system, r, motion.q)
        if motion.spring[r] > 0.0:
            springs += 0.5 * motion.spring[r] * min(motion.gap[0, r], 0.0) ** 2
    for j in range(len(system.tangential)):
        springs += 0.5 * system.tangential[j] * elongation(system, j, motion.q) ** 2
    record_section(system, records, motion.counters[PERIOD], motion.q, motion.v, springs, motion.ledger)


@inlined
def open_step(system, times, motion, records, substeps):
    """Keep the state as a step begins in motion.start; take a sample. Return the number of the step in its period.

    substeps: of which motion.counters counts so many per step.
    """
    k = motion.counters[STEPS] // substeps % (len(times.phase) - 1)
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
    copy(motion.q, motion.start[0])
    copy(motion.v, motion.start[1])
    if k == 0:
        motion.response[0], motion.response[1] = _response(system, times, k, motion.q, motion.v)
    each = len(records.samples) // max(len(records.peak) - 1, 1)
    if each > 0 and k % ((len(times.phase) - 1) // each) == 0:
        row = motion.counters[PERIOD] * each + k // ((len(times.phase) - 1) // each)
        put_sample(system, records, row, motion.response[0], motion.q, motion.active, 0)
    return k


@inlined
def close_step(system, times, motion, records, log, k, budget, deepest):
    """Follow contacts and add up step k of the period, with motion.impulse and gap; close the last one's period.

    Returns DONE, DIVERGED, PENETRATION or EVENT_BUDGET.
    """
    _follow_contacts(system, times, motion, records, log, k)
    code = _account(system, times, motion, records, k, deepest)
    if code != DONE or k < len(times.phase) - 2:
        return code
    total = 0.0
    for i in range(len(motion.ledger)):
        total += abs(motion.ledger[i])
    if not total < math.inf:
        return DIVERGED
    motion.counters[PERIOD] += 1
    record_start(system, motion, records)
    return EVENT_BUDGET if motion.counters[IMPACTS] >= budget else DONE


@inlined
def _response(system, times, k, q, v):
    """Return displacement and velocity of the response at step k of the period."""
    x, rate = times.table[k, 0], times.table[k, 1]
    for i in range(system.modes):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
    return x, rate


@kernel
def _account(system, times, motion, records, k, deepest):
    """Add up step k of the period: energies by midpoints, response. Returns DONE, DIVERGED or PENETRATION."""
    h, p, q, v = times.step, motion.counters[PERIOD], motion.start[0], motion.start[1]
    x1 = _record_response(system, times, motion, records, k)
    size, deep, hit = abs(x1), 0.0, False
    work, viscous = 0.0, 0.0
    for i in range(len(q)):
        moved = motion.q[i] - q[i]
        size = max(size, abs(motion.v[i]))
        work += 0.5 * (times.load[k, i] + times.load[k + 1, i]) * moved
        viscous += 0.5 * (product(times.damping, i, v) + product(times.damping, i, motion.v)) * moved
    motion.ledger[EXCITATION] += work
    motion.ledger[VISCOUS] += viscous
    for r in range(system.contacts):
        now = motion.gap[0, r]
        deep = max(deep, -now / times.travel[r])
        if motion.spring[r] > 0.0:
            stored = min(now, 0.0) ** 2 - min(motion.gap[1, r], 0.0) ** 2
            motion.ledger[CONTACT] -= 0.5 * motion.spring[r] * stored
        elif motion.impulse[r] > 0.0 and motion.before[r] < -motion.slowest[0]:
            hit = True
    _add_losses(system, motion, h, hit)
    for j in range(len(system.tangential)):
        stored = elongation(system, j, motion.q) ** 2 - elongation(system, j, q) ** 2
        motion.ledger[FRICTION] -= 0.5 * system.tangential[j] * stored
    motion.deepest[0] = max(motion.deepest[0], deep)
    note_tilts(system, records, motion.q, p)
    for b in range(len(system.along)):
        if system.tilt[b] >= 0 and not _stands(system, motion, b):
            records.lifted[p, b] += h
    motion.counters[STEPS] += 1
    if not size < _BOUND:
        return DIVERGED
    return PENETRATION if deep > deepest else DONE


@inlined
def _record_response(system, times, motion, records, k):
    """Record peak, mean square, harmonic and momentum of step k of the period. Return the response at its end."""
    h, p, v = times.step, motion.counters[PERIOD], motion.start[1]
    x0, rate0 = motion.response[0], motion.response[1]
    x1, rate1 = _response(system, times, k + 1, motion.q, motion.v)
    motion.response[0], motion.response[1] = x1, rate1
    c0, s0, c1, s1 = times.phase[k, 0], times.phase[k, 1], times.phase[k + 1, 0], times.phase[k + 1, 1]
    note_step(records, p, h, x0, x1, rate0, rate1)
    if records.outputs.shape[1] > 0:
        note_outputs(system, records, p, h, motion.start[0], motion.start[1], motion.q, motion.v)
    records.square[p] += h * (x0 * x0 + x1 * x1) / 2.0
    records.harmonic[p] += h / 2.0 * complex(x0 * c0 + x1 * c1, -x0 * s0 - x1 * s1)
    m0, m1 = 0.0, 0.0
    for b in range(len(system.along)):
        m0 += system.mass[system.along[b]] * v[system.along[b]]
        m1 += system.mass[system.along[b]] * motion.v[system.along[b]]
    records.momentum[p] += h / 2.0 * complex(m0 * c0 + m1 * c1, -m0 * s0 - m1 * s1)
    return x1


@inlined
def _add_losses(system, motion, h, hit):
    """Enter the rows' losses. hit: whether rigid contacts that approached have pushed in this step.

    What contacts take is then an impact's loss. Impulses of rigid contacts work at the mean of the speeds before and
    after, springs and friction elements along the step's displacement: both differ for theta above 1/2.
    """
    u = len(system.rest)
    for a in range(len(motion.live)):
        row = motion.live[a]
        if motion.impulse[row] != 0.0:
            mean, unit = 0.0, row - u if row >= u else row
            rigid = unit < system.contacts and motion.spring[unit] == 0.0
            for i in range(len(motion.q)):
                moved = (motion.q[i] - motion.start[0, i]) / h
                mean += system.J[row, i] * (0.5 * (motion.start[1, i] + motion.v[i]) if rigid else moved)
            loss = -motion.impulse[row] * mean
            if row == unit:
                entry = CONTACT if motion.spring[unit] > 0.0 else IMPACT_LOSS
            else:
                entry = IMPACT_LOSS if hit and unit < system.contacts else FRICTION
            motion.ledger[entry] += loss
            motion.lost[unit] += loss


@inlined
def _stands(system, motion, b):
    """Whether the floor pushes a body in this step."""
    for r in range(system.contacts):
        if system.body[r] == b and system.surface[r] == FLOOR and motion.impulse[r] > 0.0:
            return True
    return False


@kernel
def _follow_contacts(system, times, motion, records, log, k):
    """Count contacts that begin to carry force by an impact, and log those that have ended."""
    u, p = len(system.rest), motion.counters[PERIOD]
    for r in range(system.contacts):
        pushed, before = motion.impulse[r] > 0.0, motion.before[r]
        if pushed and motion.active[r] == 0:
            if before < 0.0 and not is_second(system, r):
                motion.counters[IMPACTS] += 1
                records.impacts[p] += 1
                if system.surface[r] == LEFT or system.surface[r] == RIGHT:
                    records.walls[p, system.body[r]] += 1
                records.collided[p] += 0.5 * before * before / system.delassus[r, r]
            motion.speed[r], motion.total[r], motion.total[u + r], motion.lost[r] = before, 0.0, 0.0, 0.0
            motion.begun[r] = (p * (len(times.phase) - 1) + k) * times.step
        if pushed:
            motion.total[r] += motion.impulse[r]
            motion.total[u + r] += motion.impulse[u + r]
        elif motion.active[r] == 1 and motion.speed[r] < 0.0 and motion.counters[LOGGED] < len(log):
            entry = log[motion.counters[LOGGED]]
            entry[0], entry[1], entry[2], entry[3] = motion.begun[r], IMPACT, r, motion.speed[r]
            entry[4], entry[5], entry[6], entry[7] = before, motion.total[r], motion.total[u + r], motion.lost[r]
            motion.counters[LOGGED] += 1
        motion.active[r] = 1 if pushed else 0
