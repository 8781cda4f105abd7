"""Event functions of units as functionals of z, and their derivatives by numbers (system.unit_laws)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.equations import (
    CONSTANT,
    DASHPOT_FACTOR,
    DRAG,
    FRICTION_FACTOR,
    GAP,
    LIMIT_FACTOR,
    ONE,
    PUSH,
    RATE,
    SLIP,
    SPRING_FACTOR,
    WAY,
)
from vanedamp.coupling.derivatives.matrices import dot, dot_abs, matrix, vector
from vanedamp.coupling.numerics.codes import VELOCITY
from vanedamp.coupling.numerics.compiler.jit import counting, inlined, kernel

#: an event is tangential if its function would come back from beyond zero within this fraction of its scale
TANGENTIAL = 1e-12


class Guards(NamedTuple):
    """Event functions (g) right before an event: its own first, then simultaneous ones.

    gradient: (g, 2N) by u; explicit: (g, P) by numbers, where the motion stays; rate, bend: (g,) first and second
    derivatives in time; scale: (g,); part: (g,) of the system (Dynamics.part), `parts` of none; flight: (g,) time since
    the unit last took part in an event, s.
    """

    gradient: np.ndarray
    explicit: np.ndarray
    rate: np.ndarray
    bend: np.ndarray
    scale: np.ndarray
    part: np.ndarray
    flight: np.ndarray


@kernel
def generated(flows, f, z, rate):
    """Set rate (K,) to X z."""
    for i in range(len(rate)):
        rate[i] = 0.0
    for n in range(flows.counts[f, 0]):
        rate[flows.row[f, n]] += flows.x[f, n] * z[flows.column[f, n]]


@inlined
def factor_of(eq, r, way, code, term):
    """Return the factor of a term of an event function of unit r, which slips in a direction, or 0."""
    by = eq.terms[code, term, 1]
    if by == CONSTANT:
        return eq.factor[code, term]
    if by == WAY:
        return way
    if by == FRICTION_FACTOR:
        return eq.friction[r]
    if by == LIMIT_FACTOR:
        return eq.limit[r]
    if by == SPRING_FACTOR:
        return eq.spring[r]
    return eq.dashpot[r]


@inlined
def _turn_of_factor(turns, p, r, by):
    """Return the derivative of a factor by number p."""
    if by == FRICTION_FACTOR:
        return turns.friction[p, r]
    if by == LIMIT_FACTOR:
        return turns.limit[p, r]
    if by == SPRING_FACTOR:
        return turns.spring[p, r]
    if by == DASHPOT_FACTOR:
        return turns.dashpot[p, r]
    return 0.0


@kernel
def _add_signal(eq, flows, f, r, signal, factor, functional):
    """Add a signal of unit r, times a factor, to a functional (K,)."""
    units = len(eq.rest)
    if signal == ONE:
        functional[len(eq.unit)] += factor / eq.size
        return
    row = (
        eq.gap[r] if signal == GAP else eq.speed[r] if signal == RATE else eq.speed[units + r] if signal == SLIP
        else flows.forces[f, r] if signal == PUSH else flows.forces[f, units + r]
    )  # fmt: skip
    for i in range(len(functional)):
        functional[i] += factor * row[i]


@inlined
def _turn_of_signal(turns, flows, f, p, r, signal, z):
    """Return the derivative by number p of a signal of unit r at z."""
    units = turns.gap.shape[1]
    if signal == GAP:
        return dot(turns.gap[p, r], z)
    if signal == RATE:
        return dot(turns.speed[p, r], z)
    if signal == SLIP:
        return dot(turns.speed[p, units + r], z)
    if signal == PUSH:
        return dot(flows.of_forces[f, p, r], z)
    if signal == DRAG:
        return dot(flows.of_forces[f, p, units + r], z)
    return 0.0


@counting
def function_of(room, eq, flows, f, r, code):
    """Return the event function `code` of unit r in flow f: a functional (K,) that falls through zero at its event."""
    functional = vector(room, len(eq.typical))
    for term in range(eq.terms.shape[1]):
        if eq.terms[code, term, 0] >= 0:
            factor = factor_of(eq, r, flows.way[f, r], code, term)
            _add_signal(eq, flows, f, r, eq.terms[code, term, 0], factor, functional)
    return functional


@kernel
def scale_of(eq, r, code):
    """Return the scale of an event function of unit r, inf without."""
    if eq.scaled[code, 0] < 0:
        return math.inf
    scale = 1.0
    for term in range(eq.scaled.shape[1]):
        by = eq.scaled[code, term]
        if by >= 0:
            scale *= eq.play[r] if by == 0 else eq.spring[r] if by == 1 else eq.limit[r]
    return scale if scale != 0.0 else math.inf


@counting
def turn_of_function(room, eq, turns, flows, f, r, code, p, z):
    """Return the explicit derivative of an event function at z by number p."""
    change, signal = 0.0, vector(room, len(eq.typical))
    for term in range(eq.terms.shape[1]):
        kind, by = eq.terms[code, term, 0], eq.terms[code, term, 1]
        if kind < 0:
            continue
        change += factor_of(eq, r, flows.way[f, r], code, term) * _turn_of_signal(turns, flows, f, p, r, kind, z)
        turned = _turn_of_factor(turns, p, r, by)
        if turned != 0.0:
            for i in range(len(signal)):
                signal[i] = 0.0
            _add_signal(eq, flows, f, r, kind, turned, signal)
            change += dot(signal, z)
    return change


@inlined
def harmonic_turns(eq, turns, p, h, time):
    """Return derivatives by number p of cosine and sine of harmonic h in z at a time since the passage's start, s."""
    angle, moved = eq.frequency[h] * time, eq.size * time * turns.frequency[p, h]
    return -math.sin(angle) * moved, math.cos(angle) * moved


@counting
def new_guards(room, eq, turns, count):
    """Return room for the event functions of an event."""
    parts = vector(room, count)
    return Guards(
        matrix(room, count, len(eq.unit)), matrix(room, count, turns.numbers), vector(room, count), vector(room, count),
        vector(room, count), parts, vector(room, count),
    )  # fmt: skip


@counting
def set_guard(room, eq, turns, flows, f, z, moving, bending, guards, g, r, code, met, fastest, time, flight):
    """Set event function g: of unit r in flow f at z (K,), with known first and second time derivatives.

    met: its rate as the engine has it, or nan; fastest: speed of the scene, m/s; time: since the passage's start, s.
    """
    functional, scale, one = function_of(room, eq, flows, f, r, code), scale_of(eq, r, code), len(eq.unit)
    if scale == math.inf:
        scale = fastest if eq.order[code] == VELOCITY else dot_abs(functional, z)
    rate = dot(functional, moving)
    guards.rate[g], guards.bend[g] = met if met == met else rate, dot(functional, bending)
    guards.scale[g], guards.flight[g], guards.part[g] = scale, flight, eq.parts
    for i in range(one):
        guards.gradient[g, i] = functional[i]
        if functional[i] != 0.0 and guards.part[g] == eq.parts:
            guards.part[g] = eq.part[i % len(eq.root)]
    for p in range(turns.numbers):
        change = turn_of_function(room, eq, turns, flows, f, r, code, p, z)
        for h in range(len(eq.frequency)):
            cosine, sine = harmonic_turns(eq, turns, p, h, time)
            change += functional[one + 1 + h] * cosine + functional[one + 1 + len(eq.frequency) + h] * sine
        guards.explicit[g, p] = change


@counting
def along(room, guards, g, M):
    """Return the derivative (k + P,) of event function g along the motion, M (2N, k + P)."""
    derivative, first = vector(room, M.shape[1]), M.shape[1] - guards.explicit.shape[1]
    for i in range(M.shape[0]):
        if guards.gradient[g, i] != 0.0:
            for c in range(M.shape[1]):
                derivative[c] += guards.gradient[g, i] * M[i, c]
    for p in range(guards.explicit.shape[1]):
        derivative[first + p] += guards.explicit[g, p]
    return derivative


@kernel
def is_tangential(guards, g):
    """Return whether an event function vanishes, to round-off, only to come back."""
    rate, bend = guards.rate[g], guards.bend[g]
    # the last flights of a chatter are as steep as the first ones for their height
    height = min(guards.scale[g], 0.5 * abs(bend) * guards.flight[g] ** 2)
    return rate <= 0.0 and bend >= 0.0 and rate**2 <= 2.0 * TANGENTIAL * height * abs(bend)
