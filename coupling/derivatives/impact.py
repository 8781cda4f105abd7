"""Jumps of the speeds in impacts, and their derivatives.

Which contacts push, stick and slip is known from the engine's impulses; for these the complementarity problem of an
impact is a set of linear equations: the jump is a linear map while they stay the same. Speeds of approach are the
engine's: as differences of the coordinates' rates they would lose their digits. Derivatives are by the N speeds before,
and behind these by the P numbers of the scene, if there are any.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.matrices import (
    add_product,
    copied,
    copy,
    dot,
    integers,
    matrix,
    product,
    pseudo_inverse,
    times,
    vector,
)
from vanedamp.coupling.numerics.compiler.jit import ZERO, counting, inlined, kernel

#: a speed after an impact below this fraction of the fastest of its contacts counts as zero: the end of a chatter
PLASTIC = 1e-9
#: energy that an impact may add, as a fraction of the present energy
_GAIN = 1e-12
#: fraction of its bound by which friction is short of it where a contact sticks; of a slip that is round-off
_EDGE, _ROUND_OFF = 1e-9, 1e-13
#: slips that count as none, as a fraction of the fastest speed
_SLOW = 1e-11


class Jump(NamedTuple):
    """Speeds (N,) after a jump, and their derivative (N, N + P) with respect to those before, and by numbers."""

    v: np.ndarray
    derivative: np.ndarray


class _Roles(NamedTuple):
    """Contacts in a blow: those that push (a,), those that stick (s,), and friction (u,) that goes with each push."""

    hit: np.ndarray
    sticks: np.ndarray
    drag: np.ndarray


class _Blow(NamedTuple):
    """A jump with the normal impulses (a,) that made it, and their derivatives (a, N + P)."""

    v: np.ndarray
    derivative: np.ndarray
    normal: np.ndarray
    slope: np.ndarray


class _Approach(NamedTuple):
    """Speeds of approach (u,) with their derivatives (u, N + P), and restitutions (u,) with theirs."""

    speed: np.ndarray
    slope: np.ndarray
    restitution: np.ndarray
    steep: np.ndarray


@inlined
def fastest_of(trace, e):
    """Return the fastest speed of the contacts struck in event e, before or after."""
    fastest = 0.0
    for h in range(trace.first[e], trace.first[e + 1]):
        fastest = max(fastest, max(abs(trace.before[h]), abs(trace.after[h])))
    return fastest


@counting
def impact(room, eq, turns, trace, e, law, v, speed):
    """Return the jump of speeds v (N,) by event e, of contacts with the engine's impulses.

    law: (3, u) restitutions, and their derivatives by speed and by coefficient, where they depend on speeds; speed: the
    fastest of the scene, m/s.
    """
    size = len(v)
    begun = Jump(v, matrix(room, size, size + turns.numbers))
    for i in range(size):
        begun.derivative[i, i] = 1.0
    met = _approach(room, eq, turns, trace, e, law, begun)
    if not eq.two_phases:
        return _newton(room, eq, turns, trace, e, begun, met, speed)
    compression, left = trace.compression[e], vector(room, len(eq.J))
    for r in range(len(left)):
        left[r] = trace.impulse[e, r] - compression[r]
    roles = _roles(room, eq, v, compression, speed)
    hit = len(roles.hit)
    still = matrix(room, hit, size + turns.numbers)
    pressed = _blow(room, eq, turns, begun.v, begun.derivative, roles, vector(room, hit), still)
    given, steep = vector(room, len(met.speed)), matrix(room, len(met.speed), size + turns.numbers)
    for a in range(hit):
        r = roles.hit[a]
        given[r] = met.restitution[r] * pressed.normal[a]
        for c in range(steep.shape[1]):
            steep[r, c] = met.restitution[r] * pressed.slope[a, c] + pressed.normal[a] * met.steep[r, c]
    later = _roles(room, eq, pressed.v, left, speed)
    return _expand(room, eq, turns, pressed, later, given, steep, left, speed)


@counting
def _approach(room, eq, turns, trace, e, law, begun):
    """Return how the contacts meet."""
    units, size, columns = len(eq.rest), len(begun.v), begun.derivative.shape[1]
    approach = _Approach(
        vector(room, units), matrix(room, units, columns), vector(room, units), matrix(room, units, columns)
    )
    for r in range(units):
        approach.speed[r] = -dot(eq.J[r], begun.v)
        for i in range(size):
            approach.slope[r, i] = -eq.J[r, i]
        for p in range(turns.numbers):
            approach.slope[r, size + p] = -dot(turns.J[p, r], begun.v)
    for h in range(trace.first[e], trace.first[e + 1]):
        approach.speed[trace.struck[h]] = -trace.before[h]
    fastest = fastest_of(trace, e)
    for h in range(trace.first[e], trace.first[e + 1]):
        r = trace.struck[h]
        if not abs(trace.after[h]) > PLASTIC * fastest:
            continue
        approach.restitution[r], by_speed, by_coefficient = eq.restitution[r], 0.0, 1.0
        if eq.law:
            approach.restitution[r], by_speed, by_coefficient = law[0, r], law[1, r], law[2, r]
        for c in range(columns):
            approach.steep[r, c] = by_speed * approach.slope[r, c]
        for p in range(turns.numbers):
            approach.steep[r, size + p] += by_coefficient * turns.restitution[p, r]
    return approach


@counting
def _roles(room, eq, v, impulse, speed):
    """Return who takes part in a blow of impulses (2u,) on speeds v (N,)."""
    units, hits, sticks = len(eq.rest), 0, 0
    drag, kind, after = vector(room, units), integers(room, units), vector(room, len(v))
    for i in range(len(v)):
        after[i] = v[i]
        for r in range(2 * units):
            after[i] += eq.J[r, i] * impulse[r] / eq.mass[i]
    for r in range(units):
        slip, mobility, bound = dot(eq.J[units + r], v), eq.mobility[units + r], eq.friction[r] * impulse[r]
        # where contacts depend on each other, friction may be at its bound without slip; it has the slip's round-off
        noise = _EDGE * bound * mobility + _ROUND_OFF * abs(slip)
        slides = abs(dot(eq.J[units + r], after)) > _SLOW * speed
        slides = slides or (bound - abs(impulse[units + r])) * mobility <= noise
        if slides and impulse[units + r] != 0.0:
            drag[r] = -math.copysign(eq.friction[r], impulse[units + r])
        if impulse[r] != 0.0:
            kind[r] = 2 if eq.friction[r] > 0.0 and not slides else 1
            hits += 1
            sticks += kind[r] == 2
    roles = _Roles(integers(room, hits), integers(room, sticks), drag)
    a, s = 0, 0
    for r in range(units):
        if kind[r] > 0:
            roles.hit[a] = r
            a += 1
        if kind[r] == 2:
            roles.sticks[s] = r
            s += 1
    return roles


@counting
def _levers(room, eq, hit, drag, sticks):
    """Return speeds by unit impulses: on contacts that push (m,), with friction (u,), on slips that stick (n,)."""
    units, size = len(eq.rest), len(eq.mass)
    levers = matrix(room, size, len(hit) + len(sticks))
    for i in range(size):
        for a in range(len(hit)):
            r = hit[a]
            levers[i, a] = (eq.J[r, i] - drag[r] * eq.J[units + r, i]) / eq.mass[i]
        for s in range(len(sticks)):
            levers[i, len(hit) + s] = eq.J[units + sticks[s], i] / eq.mass[i]
    return levers


@kernel
def _turn_of_levers(eq, turns, p, hit, drag, sticks, lever, impulse, change):
    """Set change (N,): derivative by number p of levers (N, m + n) times impulses (m + n,)."""
    units = len(eq.rest)
    for i in range(len(change)):
        change[i] = 0.0
        for a in range(len(hit)):
            r = hit[a]
            moved = turns.J[p, r, i] - drag[r] * turns.J[p, units + r, i]
            if eq.friction[r] > 0.0:
                moved -= drag[r] / eq.friction[r] * turns.friction[p, r] * eq.J[units + r, i]
            change[i] += moved / eq.mass[i] * impulse[a]
        for s in range(len(sticks)):
            change[i] += turns.J[p, units + sticks[s], i] / eq.mass[i] * impulse[len(hit) + s]
        change[i] -= dot(lever[i], impulse) * turns.mass[p, i] / eq.mass[i]


@counting
def _blow(room, eq, turns, v, derivative, roles, target, steep):
    """Return the blow that gives contacts that push normal speeds `target` (a,), with derivatives (a, N + P).

    Those that stick lose their slips. v, derivative: of the speeds so far.
    """
    units, size, hit = len(eq.rest), len(v), len(roles.hit)
    count, columns = hit + len(roles.sticks), derivative.shape[1]
    lever = _levers(room, eq, roles.hit, roles.drag, roles.sticks)
    rows, acting, scale = matrix(room, count, size), integers(room, count), vector(room, count)
    for a in range(count):
        acting[a] = roles.hit[a] if a < hit else units + roles.sticks[a - hit]
        copy(rows[a], eq.J[acting[a]])
        mobility = eq.mobility[acting[a]]
        scale[a] = 1.0 / math.sqrt(mobility) if mobility > 0.0 else 1.0
    moved = product(room, rows, lever)
    for a in range(count):
        for b in range(count):
            moved[a, b] *= scale[a] * scale[b]
    solve = pseudo_inverse(room, moved)  # the least where rows depend on each other
    for a in range(count):
        for b in range(count):
            solve[a, b] *= scale[a] * scale[b]
    asked, slope = vector(room, count), matrix(room, count, columns)
    for a in range(count):
        asked[a] = (target[a] if a < hit else 0.0) - dot(rows[a], v)
        for c in range(columns):
            slope[a, c] = steep[a, c] if a < hit else 0.0
            for i in range(size):
                slope[a, c] -= rows[a, i] * derivative[i, c]
    impulse, after = times(room, solve, asked), vector(room, size)
    for i in range(size):
        after[i] = v[i] + dot(lever[i], impulse)
    of_lever = matrix(room, turns.numbers, size)
    for p in range(turns.numbers):
        _turn_of_levers(eq, turns, p, roles.hit, roles.drag, roles.sticks, lever, impulse, of_lever[p])
        for a in range(count):
            slope[a, size + p] -= dot(turns.J[p, acting[a]], after) + dot(rows[a], of_lever[p])
    of_impulse, of_after = product(room, solve, slope), copied(room, derivative)
    add_product(of_after, lever, of_impulse)
    for p in range(turns.numbers):
        for i in range(size):
            of_after[i, size + p] += of_lever[p, i]
    return _Blow(after, of_after, impulse[:hit], of_impulse[:hit])


@counting
def _expand(room, eq, turns, pressed, roles, given, steep, impulse, speed):
    """Return the jump of an expansion with given normal impulses (u,), their derivatives (u, N + P), and the rest.

    impulse: (2u,) of the expansion, as the engine has it; speed: the fastest of the scene, m/s.
    """
    units, size, columns = len(eq.rest), len(pressed.v), steep.shape[1]
    every, none, slides, more = integers(room, units), integers(room, ZERO), vector(room, units), 0
    for r in range(units):
        every[r], slides[r] = r, roles.drag[r]
    for s in range(len(roles.sticks)):
        slides[roles.sticks[s]] = 0.0
    lever = _levers(room, eq, every, slides, none)
    begun, moved = Jump(vector(room, size), copied(room, pressed.derivative)), vector(room, size)
    add_product(begun.derivative, lever, steep)
    for i in range(size):
        begun.v[i] = pressed.v[i] + dot(lever[i], given)
    for p in range(turns.numbers):
        _turn_of_levers(eq, turns, p, every, slides, none, lever, given, moved)
        for i in range(size):
            begun.derivative[i, size + p] += moved[i]
    chosen = integers(room, len(roles.hit))
    for a in range(len(roles.hit)):
        r = roles.hit[a]
        actual, asked = impulse[r] * eq.mobility[r], given[r] * eq.mobility[r]
        if actual - asked > _EDGE * actual + _ROUND_OFF * speed:
            chosen[more] = r
            more += 1
    pushing = _Roles(chosen[:more], roles.sticks, roles.drag)
    blow = _blow(
        room, eq, turns, begun.v, begun.derivative, pushing, vector(room, more), matrix(room, more, columns)
    )  # fmt: skip
    return Jump(blow.v, blow.derivative)


@counting
def _newton(room, eq, turns, trace, e, begun, met, speed):
    """Return the jump by Newton's law.

    Where restitutions would bring energy, with the fraction of all that brings none: it depends on the speeds.
    """
    size, columns = len(begun.v), begun.derivative.shape[1]
    roles = _roles(room, eq, begun.v, trace.impulse[e], speed)
    hit = len(roles.hit)
    target, moved, first, bounces = vector(room, hit), matrix(room, hit, columns), 0, False
    for a in range(hit):
        r = roles.hit[a]
        if met.speed[r] > _ROUND_OFF * speed:
            target[a] = met.restitution[r] * met.speed[r]
            bounces = bounces or met.restitution[r] != 0.0
            for c in range(columns):
                moved[a, c] = met.restitution[r] * met.slope[r, c] + met.speed[r] * met.steep[r, c]
        if target[a] > target[first]:
            first = a
    if not trace.reduced[e] or not bounces:
        blow = _blow(room, eq, turns, begun.v, begun.derivative, roles, target, moved)
        return Jump(blow.v, blow.derivative)
    left, n, P = 0.0, size, turns.numbers
    for i in range(n):
        gained = 0.0
        for r in range(len(eq.J)):
            gained += eq.J[r, i] * trace.impulse[e, r] / eq.mass[i]
        left += eq.J[roles.hit[first], i] * (begun.v[i] + gained)
    share = left / target[first]
    for a in range(hit):
        target[a] *= share
        for c in range(columns):
            moved[a, c] *= share
    reduced = _blow(room, eq, turns, begun.v, begun.derivative, roles, target, moved)
    still = matrix(room, hit, columns)
    none = _blow(room, eq, turns, begun.v, begun.derivative, roles, vector(room, hit), still)
    # the impulses add the allowed energy, m (v+^2 - v^2) = GAIN m v^2:  m v+ dv+ = (1 + GAIN) m v dv
    by_share, along, gain = vector(room, n), vector(room, columns), 0.0
    for i in range(n):
        by_share[i] = (reduced.v[i] - none.v[i]) / share
        gain += eq.mass[i] * reduced.v[i] * by_share[i]
        for c in range(columns):
            along[c] += (1.0 + _GAIN) * eq.mass[i] * begun.v[i] * begun.derivative[i, c]
            along[c] -= eq.mass[i] * reduced.v[i] * reduced.derivative[i, c]
        for p in range(P):
            along[n + p] += 0.5 * turns.mass[p, i] * ((1.0 + _GAIN) * begun.v[i] ** 2 - reduced.v[i] ** 2)
    for i in range(n):
        for c in range(columns):
            reduced.derivative[i, c] += by_share[i] * along[c] / gain
    return Jump(reduced.v, reduced.derivative)


@counting
def scaled(room, eq, turns, jump, w):
    """Return the derivatives of w (N,) after a jump of speeds by w before (N, N), and by numbers (N, P): w = root v."""
    n = len(w)
    after, offset = matrix(room, n, n), matrix(room, n, turns.numbers)
    for i in range(n):
        for k in range(n):
            after[i, k] = eq.root[i] * jump.derivative[i, k] / eq.root[k]
    for p in range(turns.numbers):
        for i in range(n):
            offset[i, p] = eq.root[i] * jump.derivative[i, n + p] + turns.root[p, i] * jump.v[i]
            for k in range(n):
                offset[i, p] -= after[i, k] * turns.root[p, k] * w[k] / eq.root[k]
    return after, offset
