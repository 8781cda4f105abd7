"""The records of a step of any stepping method: energies, harmonic, peaks, impacts, penetration."""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.codes import DIVERGED, DONE, EVENT_BUDGET, IMPACTS, LOGGED, PENETRATION, PERIOD, STEPS
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.response.recorder import note_step, put_section
from vanedamp.coupling.response.records import CONTACT, EXCITATION, FRICTION, IMPACT, IMPACT_LOSS, VISCOUS

#: a motion above this, in m or m/s, has no physical meaning
_BOUND = 1e30


@inlined
def response_of(system, times, k, q):
    """Return the displacement at the response, at step k of the period."""
    x = times.table[k, 0]
    for i in range(system.modes):
        x += system.response[i] * q[i]
    return x


@inlined
def rate_of(system, times, k, v):
    """Return the velocity at the response, at step k of the period."""
    rate = times.table[k, 1]
    for i in range(system.modes):
        rate += system.response[i] * v[i]
    return rate


@inlined
def row_speed(system, r, v):
    """Return the velocity of row r."""
    speed = 0.0
    for i in range(len(v)):
        speed += system.J[r, i] * v[i]
    return speed


@kernel
def record_start(system, motion, records):
    """Record section and ledger at the start of a period."""
    n, b, springs, slip, speed = system.modes, system.bodies, 0.0, motion.rows[0], motion.rows[1]
    for k in range(b):
        slip[k], speed[k] = row_speed(system, k, motion.q), row_speed(system, k, motion.v)
    for r in range(len(system.J)):
        if system.spring[r] != math.inf:
            pressed = motion.elongation[r] if r < system.friction_rows else min(row_gap(system, r, motion.q), 0.0)
            springs += 0.5 * system.spring[r] * pressed * pressed
    put_section(
        system, records, motion.counters[PERIOD], motion.q[:n], motion.v[:n], slip[:b], speed[:b], springs,
        motion.losses,
    )  # fmt: skip


@inlined
def row_gap(system, r, q):
    """Return the displacement of row r."""
    return system.rest[r] + row_speed(system, r, q)


@inlined
def open_step(system, times, motion, records, k, q, v, before):
    """Keep the state at the start of step k of the period in q, v (N,) and before (friction rows,); take a sample."""
    copy(motion.q, q)
    copy(motion.v, v)
    copy(motion.elongation, before)
    record_sample(system, times, motion, records, k, q)


@inlined
def close_step(system, times, motion, records, log, k, q, v, speed, impulse, before, deepest):
    """Follow contacts and account for step k from the state that `open_step` kept; speed (r,) of the rows then.

    Returns DONE, DIVERGED or PENETRATION.
    """
    follow_contacts(system, times, motion, records, log, k, speed, impulse)
    return account_step(system, times, motion, records, k, q, v, impulse, before, deepest)


@inlined
def account_step(system, times, motion, records, k, q, v, impulse, before, deepest):
    """Account for step k of the period, from q, v to motion.q, motion.v, with the impulses (r,) of the rows.

    before: (friction rows,) elongations of Jenkins springs. Returns DONE, DIVERGED or PENETRATION.
    """
    h, n, p = times.step, system.modes, motion.counters[PERIOD]
    c0, s0, c1, s1 = times.phase[k, 0], times.phase[k, 1], times.phase[k + 1, 0], times.phase[k + 1, 1]
    x0, x1 = response_of(system, times, k, q), response_of(system, times, k + 1, motion.q)
    rate0, rate1 = rate_of(system, times, k, v), rate_of(system, times, k + 1, motion.v)
    _record_response(system, times, records, p, h, x0, x1, rate0, rate1, c0, s0, c1, s1, v, motion.v)
    size = abs(x1)
    for i in range(len(q)):
        moved = motion.q[i] - q[i]
        size = max(size, abs(motion.v[i]))
        motion.losses[EXCITATION] += 0.5 * (times.load[k, i] + times.load[k + 1, i]) * moved
        for j in range(n if i < n else 0):
            if system.damping[i, j] != 0.0:
                motion.losses[VISCOUS] += 0.5 * system.damping[i, j] * (v[j] + motion.v[j]) * moved
    deep = 0.0
    for r in range(len(system.J)):
        moved, now = 0.0, system.rest[r]
        contact = r >= system.friction_rows
        if impulse[r] == 0.0 and not contact:
            continue
        for i in range(len(q)):
            moved += system.J[r, i] * (motion.q[i] - q[i])
            now += system.J[r, i] * motion.q[i]
        loss = -impulse[r] / h * moved
        if contact:
            deep = max(deep, -now / times.travel[r])
            if system.spring[r] == math.inf:
                motion.losses[IMPACT_LOSS] += loss
            else:
                motion.losses[CONTACT] += loss - 0.5 * system.spring[r] * (
                    min(now, 0.0) ** 2 - min(now - moved, 0.0) ** 2
                )
        elif system.spring[r] == math.inf:
            motion.losses[FRICTION] += loss
        else:
            motion.losses[FRICTION] += loss - 0.5 * system.spring[r] * (motion.elongation[r] ** 2 - before[r] ** 2)
    motion.deepest[0] = max(motion.deepest[0], deep)
    motion.counters[STEPS] += 1
    if not size < _BOUND:
        return DIVERGED
    return PENETRATION if deep > deepest else DONE


@inlined
def _record_response(system, times, records, p, h, x0, x1, rate0, rate1, c0, s0, c1, s1, v, after):
    """Record peak, mean square, harmonic and momentum of a step."""
    note_step(records, p, h, x0, x1, rate0, rate1)
    records.square[p] += h * (x0 * x0 + x1 * x1) / 2.0
    records.harmonic[p] += h / 2.0 * complex(x0 * c0 + x1 * c1, -x0 * s0 - x1 * s1)
    m0, m1 = 0.0, 0.0
    for i in range(system.modes, len(v)):
        m0 += system.mass[i] * v[i]
        m1 += system.mass[i] * after[i]
    records.momentum[p] += h / 2.0 * complex(m0 * c0 + m1 * c1, -m0 * s0 - m1 * s1)


@inlined
def follow_contacts(system, times, motion, records, log, k, speed, impulse):
    """Count and log impacts: contacts that have begun to carry force, with the speeds (r,) at the step's start.

    An impact ends when its contact carries no force any more, which completes its entry in the log.
    """
    h, p = times.step, motion.counters[PERIOD]
    for r in range(system.friction_rows, len(system.J)):
        pushed = impulse[r] > 0.0
        if pushed and motion.active[r] == 0 and speed[r] < 0.0:
            motion.counters[IMPACTS] += 1
            records.impacts[p] += 1
            mobility = 0.0
            for i in range(len(system.mass)):
                mobility += system.J[r, i] ** 2 / system.mass[i]
            records.collided[p] += 0.5 * speed[r] ** 2 / mobility
            motion.speed[r], motion.impulse[r] = speed[r], 0.0
            motion.begun[r] = (p * (len(times.phase) - 1) + k) * h
        if pushed:
            motion.impulse[r] += impulse[r]
        elif motion.active[r] == 1 and motion.counters[LOGGED] < len(log):
            entry = log[motion.counters[LOGGED]]
            entry[0], entry[1], entry[2], entry[3] = motion.begun[r], IMPACT, r, motion.speed[r]
            entry[4], entry[5] = speed[r], motion.impulse[r]
            motion.counters[LOGGED] += 1
        motion.active[r] = 1 if pushed else 0


@inlined
def record_sample(system, times, motion, records, k, q):
    """Keep a sample if step k of the period begins at one."""
    steps, b = len(times.phase) - 1, system.bodies
    each = len(records.samples) // max(len(records.peak) - 1, 1)
    if each == 0:
        return
    stride = steps // each
    if k % stride == 0 and k // stride < each:
        row = motion.counters[PERIOD] * each + k // stride
        entry, p = records.samples[row], records.coordinates[row]
        entry[0] = response_of(system, times, k, q)
        for i in range(len(p)):
            p[i] = q[i]
        for i in range(b):
            entry[1 + i] = row_speed(system, i, q)


@inlined
def apply_inverse(inverse, diagonal, vector, result):
    """Set result = inverse vector; a diagonal inverse is used as such."""
    for i in range(len(vector)):
        if diagonal:
            result[i] = inverse[i, i] * vector[i]
        else:
            result[i] = 0.0
            for j in range(len(vector)):
                result[i] += inverse[i, j] * vector[j]


@inlined
def damping_force(system, v, i):
    """Return the viscous force on coordinate i."""
    if i >= system.modes:
        return 0.0
    force = 0.0
    for j in range(system.modes):
        force += system.damping[i, j] * v[j]
    return force


@inlined
def load_at(system, times, k, i):
    """Return the load on coordinate i at step k of the period, weight included, N."""
    return times.load[k, i] + system.weight[i]


@inlined
def copy(source, target):
    """Copy (N,) numbers."""
    for i in range(len(target)):
        target[i] = source[i]


@inlined
def end_period(system, times, motion, records, budget):
    """Close a period. Returns DONE, DIVERGED or EVENT_BUDGET."""
    total = 0.0
    for i in range(len(motion.losses)):
        total += abs(motion.losses[i])
    if not total < math.inf:
        return DIVERGED
    motion.counters[PERIOD] += 1
    record_start(system, motion, records)
    return EVENT_BUDGET if motion.counters[IMPACTS] >= budget else DONE
