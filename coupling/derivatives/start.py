"""The start of a passage: where the engine begins from a state, and the derivative of that."""

from __future__ import annotations

import math

from vanedamp.coupling.derivatives.constraints import applied, begun, explicit_of, left_of, presses
from vanedamp.coupling.derivatives.event_functions import generated
from vanedamp.coupling.derivatives.impact import impact, scaled
from vanedamp.coupling.derivatives.matrices import (
    dot,
    dot_abs,
    integers,
    inverse_of_rows,
    matrix,
    product,
    times,
    vector,
)
from vanedamp.coupling.derivatives.saltation import SHUT, SLOW, check_idle, closed_at, worsen
from vanedamp.coupling.derivatives.walking import GAPS, GIVEN, GRAZING, SPEEDS
from vanedamp.coupling.numerics.codes import HELD, OPEN, STICK
from vanedamp.coupling.numerics.compiler.jit import ZERO, counting

#: a force this close to its bound is at it: relative to its terms, and to what all loads together could make of it
_NEAR, _ROUND_OFF = 1e-9, 1e-13


@counting
def first_derivative(room, eq, turns, flows, walk, trace, start, f, z):
    """Return the derivative (2N, C) of z as segment `start` begins, in flow f, by the state there.

    Where that is not the first, at the end of a period, the motion only passes: what a run begun there does is no
    kink of it.
    """
    one, k = len(eq.unit), len(eq.scale)
    given = times(room, eq.from_state, walk.given)
    M = _placed(room, eq, turns, walk, trace, start, z)
    far = 0.0
    for i in range(eq.modes):
        far = max(far, eq.typical[i])
    for i in range(eq.modes):
        # of the largest mode: the bodies may move others by more than what the loads let expect of them
        if abs(z[i] - given[i]) > SHUT * far:
            worsen(walk, GRAZING)  # the structure would begin beyond a stop
    if start == 0:
        _begin_run(room, eq, turns, flows, walk, trace, f, z, given, M)
    for i in range(one):
        for c in range(M.shape[1]):
            walk.unheld[i, c] = M[i, c] * (eq.scale[c] if c < k else 1.0)
    M = applied(room, begun(room, eq, turns, trace.state[start], closed_at(room, eq, trace, start), z), M)
    idle = matrix(room, one, M.shape[1])
    for i in range(one):
        for c in range(M.shape[1]):
            idle[i, c] = eq.from_state[i, c] * eq.scale[c] if c < k else M[i, c]
            M[i, c] *= eq.scale[c] if c < k else 1.0
    check_idle(room, eq, turns, walk, trace, start, idle, z)
    return M


@counting
def _begin_run(room, eq, turns, flows, walk, trace, f, z, given, M):
    """Change the derivative M (2N, C) of the start, a state u `given` (2N,), as a run starts there.

    Notes whether other starts have a kink there.
    """
    size, k, meets = len(eq.root), len(eq.scale), False
    for h in range(trace.first[0], trace.first[1]):
        r = trace.struck[h]
        if trace.impulse[0, r] != 0.0:
            row = eq.speed[r, : len(eq.unit)]
            meets = meets or abs(dot(row, given)) > SLOW * dot_abs(row, given)
    if meets:
        worsen(walk, GRAZING)  # an impact at the very start, which another state has a period before
        v = vector(room, size)
        for i in range(size):
            v[i] = given[size + i] / eq.root[i]
        jump = impact(room, eq, turns, trace, ZERO, walk.law, v, trace.speed[0])
        rates, offset = scaled(room, eq, turns, jump, given[size:])
        moved = product(room, rates, M[size:])
        for i in range(size):
            for c in range(M.shape[1]):
                M[size + i, c] = moved[i, c] + (offset[i, c - k] if c >= k else 0.0)
    if _begins_at_event(room, eq, turns, flows, walk, trace, f, z, M) or _loose(
        room, eq, turns, flows, walk, trace, f, z, M
    ):
        worsen(walk, GRAZING)


@counting
def _placed(room, eq, turns, walk, trace, start, z):
    """Return the derivative (2N, k + P) of u that a run begins with: bodies in walls are moved out of them.

    Springs of friction dampers are unloaded to their bounds.
    """
    k, P, one, bodies = len(eq.scale), turns.numbers, len(eq.unit), len(eq.along)
    of_states, offset = matrix(room, k, k + P), matrix(room, one, P)
    for s in range(k):
        of_states[s, s] = 1.0
        for p in range(P):
            of_states[s, k + p] = walk.turns[s, p]
    state = times(room, eq.to_state, z[:one])
    for p in range(P):
        for i in range(one):
            offset[i, p] = dot(turns.from_state[p, i], state)
    pushed, count = integers(room, bodies), 0
    for b in range(bodies):
        slip, s = trace.q[start, eq.along[b]] - dot(eq.floor[b], trace.q[start]), 2 * eq.modes + b
        if abs(slip - walk.given[s]) > SHUT * eq.travel[b]:
            pushed[count] = s
            count += 1
    if count > 0:
        _push(room, eq, turns, trace, start, z, of_states, offset, pushed[:count])
    for j in range(len(eq.sprung)):
        _unload(room, eq, turns, walk, j, z, of_states, offset)
    derivative = product(room, eq.from_state, of_states)
    for i in range(one):
        for p in range(P):
            derivative[i, k + p] += offset[i, p]
    return derivative


@counting
def _unload(room, eq, turns, walk, j, z, of_states, offset):
    """Let the elongation of a spring before a slider, a state, be that of its bound where it would be longer."""
    k, at, r, force, opened = len(eq.scale), len(eq.scale) - len(eq.sprung) + j, eq.sprung[j], 0.0, 0.0
    if r < eq.contacts:
        opened = min(dot(eq.gap[r], z), 0.0)
        force = -eq.spring[r] * opened
    longest = (eq.limit[r] + eq.friction[r] * force) / eq.tangential[j]
    if abs(walk.given[at]) <= longest:
        return
    way = math.copysign(1.0 / eq.tangential[j], walk.given[at])
    gap = vector(room, of_states.shape[1])
    if opened < 0.0:
        for i in range(len(eq.unit)):
            if eq.gap[r, i] != 0.0:
                for c in range(len(gap)):
                    moved = offset[i, c - k] if c >= k else 0.0
                    for s in range(k):
                        moved += eq.from_state[i, s] * of_states[s, c]
                    gap[c] += eq.gap[r, i] * moved
    for c in range(len(gap)):
        more, p = 0.0, c - k
        if opened < 0.0:
            more -= eq.friction[r] * eq.spring[r] * gap[c]
        if p >= 0:
            more += turns.limit[p, r] + turns.friction[p, r] * force - longest * turns.tangential[p, j]
            if opened < 0.0:
                more -= eq.friction[r] * (turns.spring[p, r] * opened + eq.spring[r] * dot(turns.gap[p, r], z))
        of_states[at, c] = way * more


@counting
def _push(room, eq, turns, trace, start, z, of_states, offset, pushed):
    """Let gaps of bodies that were pushed, states (m,) of their slips, stay closed where they are closed now."""
    k, one, shut = len(eq.scale), len(eq.unit), 0
    gap, rows = matrix(room, eq.contacts, k), integers(room, eq.contacts)
    for r in range(eq.contacts):
        for i in range(one):
            if eq.gap[r, i] != 0.0:
                for s in range(k):
                    gap[shut, s] += eq.gap[r, i] * eq.from_state[i, s]
        moves = False
        for m in range(len(pushed)):
            moves = moves or gap[shut, pushed[m]] != 0.0
        if moves and abs(eq.rest[r] + dot(eq.J[r], trace.q[start])) <= SHUT * eq.play[r]:
            rows[shut] = r
            shut += 1
        else:
            for s in range(k):
                gap[shut, s] = 0.0
    for m in range(len(pushed)):
        for c in range(of_states.shape[1]):
            of_states[pushed[m], c] = 0.0
    opened, of_pushed = product(room, gap[:shut], of_states), matrix(room, shut, len(pushed))
    for a in range(shut):
        for m in range(len(pushed)):
            of_pushed[a, m] = gap[a, pushed[m]]
        for p in range(turns.numbers):
            opened[a, k + p] += explicit_of(turns, p, rows[a], z, GAPS)
            for i in range(one):
                opened[a, k + p] += eq.gap[rows[a], i] * offset[i, p]
    moved = product(room, inverse_of_rows(room, of_pushed), opened)
    for m in range(len(pushed)):
        for c in range(of_states.shape[1]):
            of_states[pushed[m], c] = -moved[m, c]


@counting
def _begins_at_event(room, eq, turns, flows, walk, trace, f, z, M):
    """Return whether a contact parts with a speed, or begins to slip, as the passage begins.

    M: (2N, C) of the start, which may keep what is to count.
    """
    units, moving, closed = len(eq.rest), vector(room, len(z)), closed_at(room, eq, trace, ZERO)
    generated(flows, f, z, moving)
    for r in range(units):
        parts = r < eq.contacts and trace.state[0, r] == OPEN and closed[r] == 0
        parts = parts and eq.rest[r] + dot(eq.J[r], trace.q[0]) <= SHUT * eq.play[r]
        way = flows.way[f, r]
        # one that stops at once has been at rest
        slips = (
            way != 0.0 and not flows.slips_held[f, r] and eq.rubs[r] and way * dot(eq.speed[units + r], moving) > 0.0
        )
        slips = slips and abs(dot(eq.J[units + r], trace.v[0])) <= SLOW * trace.speed[0]
        if parts and _turned(room, eq, turns, walk, r, z, M, GAPS):
            return True
        if slips and _turned(room, eq, turns, walk, units + r, z, M, SPEEDS):
            return True
    return False


@counting
def _turned(room, eq, turns, walk, row, z, M, kind):
    """Return whether motions that count change a functional at the start: any, or by numbers if the start is given."""
    if not walk.at[GIVEN]:
        return True
    functional = eq.speed[row] if kind == SPEEDS else eq.gap[row]
    moved, terms = left_of(room, eq, turns, M, z, row, kind), dot_abs(functional, eq.typical)
    most = 0.0
    for c in range(len(eq.scale), M.shape[1]):
        most = max(most, abs(moved[c]))
    return most > _NEAR * terms


@counting
def _loose(room, eq, turns, flows, walk, trace, f, z, M):
    """Return whether a unit begins at rest that nothing keeps there: closed without force, or stuck at its bound.

    A body that friction and a contact hold at once needs the contact for what its friction could not hold. M: as in
    _begins_at_event, and where friction could hold all, only what opens the contact counts.
    """
    units, bodies, grip = len(eq.rest), len(eq.along), 0.0
    force, noise, holds = vector(room, 2 * units), vector(room, 2 * units), integers(room, units)
    for r in range(2 * units):
        force[r] = dot(flows.forces[f, r], z)
        noise[r] = _NEAR * dot_abs(flows.forces[f, r], eq.typical) + _ROUND_OFF * flows.most[f, r]
    for r in range(units):
        state = trace.state[0, r]
        if eq.floor_unit[r] and (state == STICK or state == HELD):
            holds[r], grip = 1, max(grip, eq.limit[r])
    for r in range(eq.contacts):
        if not (eq.spring[r] == math.inf and presses(trace.state[0, r]) and eq.friction[r] == 0.0):
            continue
        least, touches = math.inf, False
        for b in range(bodies):
            lever = eq.J[r, eq.along[b]]
            if lever == 0.0:
                continue
            touches, limit, drag = True, 0.0, 0.0
            for other in range(units):
                if holds[other] and eq.body[other] == b:
                    limit, drag = limit + eq.limit[other], drag + force[units + other]
            least = min(least, limit - force[r] - drag * lever)
        least = least if touches else -force[r]
        edge = noise[r] + _NEAR * grip
        if least >= -edge and (least <= edge or _turned(room, eq, turns, walk, r, z, M, GAPS)):
            return True
    for r in range(eq.contacts, units):
        if eq.slider[r] >= 0 or not flows.stuck[f, r] or abs(force[units + r]) < (1.0 - _NEAR) * eq.limit[r]:
            continue
        pushed = False
        for other in range(eq.contacts if eq.floor_unit[r] else 0):
            closed = eq.spring[other] == math.inf and presses(trace.state[0, other])
            pushed = pushed or (closed and eq.J[other, eq.along[eq.body[r]]] != 0.0)
        if not pushed:
            return True
    return False
