"""The compiled walk along the course of a run: the derivative of where it leads, event by event."""

from __future__ import annotations

import math

from vanedamp.coupling.derivatives.event_functions import TANGENTIAL, harmonic_turns
from vanedamp.coupling.derivatives.matrices import copy, dot, empty, times, vector
from vanedamp.coupling.derivatives.near_misses import least_margin
from vanedamp.coupling.derivatives.saltation import (
    LAST_FLIGHT,
    SIMULTANEOUS,
    after_event,
    agrees,
    check_idle,
    find,
    start_of,
    state_at,
    worsen,
)
from vanedamp.coupling.derivatives.series import follow
from vanedamp.coupling.derivatives.start import first_derivative
from vanedamp.coupling.derivatives.walking import (
    COINCIDENT,
    FLOW,
    GRAZING,
    KEEPS,
    KNOWN,
    LAW_OF,
    LOST,
    NEAR_CODE,
    NEAR_UNIT,
    NEXT,
    REACHED,
    SEEKS,
    SHORT,
    SMOOTH,
    UNDETERMINED,
    UNTRUSTED,
    WANTS_FLOW,
    WANTS_LAW,
    WANTS_ROOM,
)
from vanedamp.coupling.engine.trace import COUNT
from vanedamp.coupling.numerics.compiler.jit import counting, counting_entry


@counting_entry
def walk_along(eq, turns, flows, trace, walk, room):
    """Continue along a course. Returns KNOWN at its present end, or what Python must find first (saltation)."""
    at = walk.at
    while at[NEXT] < trace.at[COUNT]:
        i = at[NEXT]
        outcome = _pass_segment(room, eq, turns, flows, walk, trace, i)
        if room.used[2] != 0:
            return WANTS_ROOM
        if outcome != KNOWN:
            return outcome
        at[NEXT] += 1
        if at[REACHED] and at[SHORT]:
            break
    return KNOWN


@counting
def _pass_segment(room, eq, turns, flows, walk, trace, i):
    """Take event i, and segment i with the motion and its derivative to its end."""
    one, k, columns, at = len(eq.unit), len(eq.scale), walk.M.shape[1], walk.at
    empty(room)
    f = find(flows, trace.state[i], trace.open_force[i])
    if f < 0:
        copy(walk.wanted, trace.state[i])
        copy(walk.wanted_force, trace.open_force[i])
        return WANTS_FLOW
    z, outcome = state_at(room, eq, trace, i), KNOWN
    walk.met[i] = math.nan
    if at[FLOW] >= 0:
        M, outcome = after_event(room, eq, turns, flows, walk, trace, i, f, z)
    else:
        if eq.law and i == 0 and at[LAW_OF] != 0 and trace.first[0] < trace.first[1]:
            return WANTS_LAW
        M = first_derivative(room, eq, turns, flows, walk, trace, i, f, z)
        outcome = KNOWN if at[SMOOTH] else UNTRUSTED
    if outcome > UNTRUSTED or room.used[2] != 0:
        return outcome
    if outcome == UNTRUSTED:
        worsen(walk, UNDETERMINED)
        at[LOST] = 1
    for n in range(one):
        for c in range(columns):
            walk.M[n, c] = math.nan if at[LOST] else M[n, c]
    walk.flows[i], at[FLOW] = f, f
    _part(room, eq, turns, flows, walk, trace, i, f, z)
    if at[REACHED] and at[SHORT]:
        return KNOWN
    if at[SEEKS]:
        least, row = least_margin(
            room, eq, flows, walk, f, z, trace.duration[i], trace.unit[i + 1], trace.what[i + 1]
        )  # fmt: skip
        if least < walk.clearance[0]:
            walk.clearance[0] = least
            at[NEAR_UNIT], at[NEAR_CODE] = flows.possible[f, row, 0], flows.possible[f, row, 1]
        # by a margin that would make it tangential if it happened
        if least <= TANGENTIAL and trace.duration[i] > LAST_FLIGHT * eq.period:
            worsen(walk, GRAZING)
    _begin(eq, turns, walk, trace, i, walk.end)
    copy(walk.z, z)
    follow(room, flows, f, k, walk.z, walk.end, trace.duration[i], walk.terms, walk.of_terms)
    if at[KEEPS]:
        copy(walk.z_ends[i], walk.z)
        copy(walk.shifts[i], walk.shift)
        for n in range(one):
            copy(walk.begins[i, n], walk.M[n])
            copy(walk.ends[i, n], walk.end[n])
    return KNOWN


@counting
def _begin(eq, turns, walk, trace, i, Z):
    """Set Z (K, C) to the derivative of z as segment i begins."""
    one, k, time = len(eq.unit), len(eq.scale), start_of(eq, trace, i)
    for n in range(Z.shape[0]):
        for c in range(Z.shape[1]):
            Z[n, c] = walk.M[n, c] if n < one else 0.0
    for p in range(turns.numbers):
        for h in range(len(eq.frequency)):
            at = one + 1 + h
            Z[at, k + p], Z[at + len(eq.frequency), k + p] = harmonic_turns(eq, turns, p, h, time)


@counting
def _part(room, eq, turns, flows, walk, trace, i, f, z):
    """Follow the motion to the time that is wanted, if it lies in segment i."""
    start = start_of(eq, trace, i)
    if (walk.at[REACHED] and walk.at[SHORT]) or not start <= walk.part[0] <= start + trace.duration[i]:
        return
    _begin(eq, turns, walk, trace, i, walk.reached)
    copy(walk.z_reached, z)
    follow(
        room, flows, f, len(eq.scale), walk.z_reached, walk.reached, walk.part[0] - start, walk.terms, walk.of_terms
    )  # fmt: skip
    walk.at[REACHED] = i + 1


@counting_entry
def end_walk(eq, turns, flows, trace, walk, room, final, periods):
    """Compare the end of a passage with the engine's, a state (k,), and note kinks there. Returns if they agree."""
    empty(room)
    one, i = len(eq.unit), walk.at[NEXT] - 1
    before, start = times(room, eq.to_state, walk.z[:one]), vector(room, one)
    end = times(room, eq.from_state, final)
    for n in range(one):
        start[n] = dot(eq.from_state[n], before)
    if not agrees(room, eq, walk, start, end):
        worsen(walk, UNDETERMINED)
        return False
    if periods * eq.period - walk.last[0] <= SIMULTANEOUS * eq.period:
        worsen(walk, COINCIDENT)  # an event at the very end
    check_idle(room, eq, turns, walk, trace, i, walk.end[:one], walk.z)
    return True
