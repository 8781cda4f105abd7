"""Moreau-Jean time stepping of bodies with extent: a witness that shares no solver with the exact engine.

Jean (1999); Acary and Brogliato (2008), chapter 10. The theta method for the smooth part; a contact takes part in a
step if its gap, half a step ahead, is closed: Newton's law on its normal velocity, Coulomb's on its slip. The impulses
of a step are found by projected Gauss-Seidel iteration (Jourdan, Alart and Jean 1998), one impulse after the other. An
impact that others bring about within a step is a problem of its own, after theirs, as in methods.moreau. Where impulses
would bring energy (Kane's paradox), all coefficients are smaller by one factor, as in planar.impacts.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.methods.planar.step_records import (
    account_step,
    drag_slider,
    follow_contacts,
    record_sample,
    record_start,
)
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET, IMPACTS, PERIOD, SOLVES, STEPS, UNDECIDED
from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.planar.constraints import PlanarSystem
from vanedamp.coupling.planar.contact_decisions import elongation, gap, row_speed
from vanedamp.coupling.system.restitution import restitution_at

#: problems that a step may take, the last with all contacts at once
_TURNS = 20
#: share of the speeds in a scene by which a sweep may still change one, and below which a contact counts as at rest
_TOLERANCE, _AT_REST = 1e-13, 1e-10
#: sweeps that a problem may take
_SWEEPS = 100_000
#: bisections of the factor of the coefficients; energy that impulses may bring, as a share of what they move
_HALVINGS, _GAIN = 40, 1e-10
#: share of the play by which round-off may open a gap
_ROUND_OFF = 1e-12


def step_matrices(system: PlanarSystem, step: float, theta: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inverse of the iteration matrix (N, N), its product with J^T (N, 2u), and the mobility (2u, 2u).

    The mobility of a Jenkins element has its spring's part: the force is its mean over a step, as that of all springs.
    """
    matrix = np.diag(system.mass) + step * theta * (system.damping + step * theta * system.stiffness)
    inverse = np.linalg.inv(matrix)
    turned = inverse @ system.J.T
    mobility = system.J @ turned
    sliders = np.arange(len(mobility) - len(system.tangential), len(mobility))
    mobility[sliders, sliders] += 1 / (step * theta) ** 2 / system.tangential
    return inverse, turned, mobility


@entry
def march(system, times, motion, records, log, inverse, turned, mobility, theta, until, budget, deepest):
    """Step until this many steps are done, on a grid of equations_of_motion.TimeGrid. Return the code of a status."""
    h, steps, size = times.step, len(times.phase) - 1, len(motion.q)
    q, v, rhs, free = motion.start[0], motion.start[1], motion.free[0], motion.free[1]
    if motion.counters[STEPS] == 0:
        record_start(system, motion, records)
    while motion.counters[STEPS] < until:
        k = motion.counters[STEPS] % steps
        for i in range(size):
            q[i], v[i] = motion.q[i], motion.v[i]
        record_sample(system, times, motion, records, k)
        for i in range(size):
            rhs[i] = system.weight[i] + theta * times.load[k + 1, i] + (1.0 - theta) * times.load[k, i]
            for j in range(size):
                rhs[i] -= system.damping[i, j] * v[j] + system.stiffness[i, j] * (q[j] + h * theta * v[j])
        for i in range(size):
            free[i] = v[i]
            for j in range(size):
                free[i] += h * inverse[i, j] * rhs[j]
        if not _impulses(system, motion, mobility, turned, h, theta):
            return UNDECIDED
        for i in range(size):
            motion.v[i] = free[i]
            motion.q[i] = q[i] + h * (theta * free[i] + (1.0 - theta) * v[i])
        for j in range(len(system.tangential)):
            drag_slider(system, j, motion.q)
        follow_contacts(system, times, motion, records, log, k)
        code = account_step(system, times, motion, records, k, deepest)
        if code != DONE:
            return code
        if k == steps - 1:
            motion.counters[PERIOD] += 1
            record_start(system, motion, records)
            if motion.counters[IMPACTS] >= budget:
                return EVENT_BUDGET
    return DONE


@kernel
def _impulses(system, motion, mobility, turned, h, theta):
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
        count = _list_units(system, motion, turn, h, theta)
        if count == 0:
            return True
        motion.counters[SOLVES] += 1
        if not _rebound(system, motion, mobility, count, h, turn, _TOLERANCE * fastest):
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
def _list_units(system, motion, turn, h, theta):
    """List the units that take part in a turn, their speeds and what Newton's law asks for. Return their number."""
    u, count, free, slowest = len(system.rest), 0, motion.free[1], motion.slowest[0]
    first = u - len(system.tangential)
    for r in range(u):
        if r < system.contacts:
            if motion.closed[r] == 0:
                continue
            now = row_speed(system, r, free)
            before = motion.before[r] if turn == 0 and not system.two_phases else now
            if turn < _TURNS - 1 and before > slowest and now > -slowest:
                continue
            motion.now[r], motion.asked[r] = now, 0.0
            if not system.two_phases:
                motion.asked[r] = restitution_at(system, r, -before) * min(before, 0.0)
        motion.now[u + r] = row_speed(system, u + r, free)
        if r >= first:  # at rest is a spring whose mean force over the step is the impulse
            j, ahead = r - first, theta * h
            stretched = elongation(system, j, motion.q) + (1.0 - theta) * ahead * motion.before[u + r]
            motion.now[u + r] += (stretched + motion.impulse[u + r] / (h * system.tangential[j])) / (theta * ahead)
        motion.listed[count] = r
        count += 1
    return count


@kernel
def _rebound(system, motion, mobility, count, h, turn, tolerance):
    """Find the impulses (motion.more) of a turn, with the largest factor of the coefficients that brings no energy.

    Returns False if they do not converge.
    """
    low, high, share = 0.0, 1.0, 1.0
    for _ in range(_HALVINGS):
        if not _newton(system, motion, mobility, count, h, share, tolerance):
            return False
        if _brings_energy(system, motion, count, turn, share):
            high = share
        elif share == 1.0:
            return True
        else:
            low = share
        share = 0.5 * (low + high)
    return _newton(system, motion, mobility, count, h, low, tolerance)


@inlined
def _newton(system, motion, mobility, count, h, share, tolerance):
    """Find impulses (motion.more) by Newton's law with this share of the coefficients. Returns False if that fails."""
    u = len(system.rest)
    for p in range(count):
        r = motion.listed[p]
        motion.left[r], motion.left[u + r] = motion.now[r] + share * motion.asked[r], motion.now[u + r]
    return _gauss_seidel(system, motion, mobility, count, h, tolerance)


@inlined
def _brings_energy(system, motion, count, turn, share):
    """Whether the impulses (motion.more) of contacts bring energy, by the speeds before and after the step's loads.

    The loads alone may let it seem so by one of them: where they pull a contact open, or turn a slip round.
    """
    u, early, late, terms = len(system.rest), 0.0, 0.0, 0.0
    for p in range(count):
        r = motion.listed[p]
        if r < system.contacts:
            for row in (r, u + r):
                after = motion.left[row] - (share * motion.asked[r] if row == r else 0.0)
                now = motion.now[row]
                before = motion.before[row] if turn == 0 else now
                early += 0.5 * motion.more[row] * (before + after)
                late += 0.5 * motion.more[row] * (now + after)
                terms += abs(motion.more[row]) * (abs(before) + abs(now) + abs(after))
    return min(early, late) > _GAIN * terms


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
