"""Gaps that ride are differences of slips: slips are the state, and bodies that touch have the same to the last bit.

A slip is the sum of two doubles, so that a rebound of a billionth of a billionth of the gap is still resolved.
"""

from __future__ import annotations

import math

from vanedamp.coupling.exact.state import OPEN
from vanedamp.coupling.numerics.jit import inlined, kernel

#: gaps closed to this share of the free travel are closed at the same instant
SIMULTANEOUS = 1e-12
#: speeds below this share of the largest are round-off
ROUND_OFF = 1e-13
#: share of the free travel below which a gap is about to close
_NEAR = 1e-6


@inlined
def measure_gaps(system, st):
    """Displacement and velocity of the gaps that ride, from the slips."""
    for r in range(system.friction_rows, len(st.state)):
        if system.moves_with_floor[r]:
            half = system.rest[r]
            before, after = system.left_body[r], system.right_body[r]
            right, far, faster = half, 0.0, 0.0
            if after >= 0:
                right, far, faster = st.displacement[after], st.low[after], st.velocity[after]
            left, near, slower = -half, 0.0, 0.0
            if before >= 0:
                left, near, slower = st.displacement[before], st.low[before], st.velocity[before]
            st.displacement[r], st.velocity[r] = (right - left) + (far - near), faster - slower


@inlined
def align_gaps(system, st, y):
    """Take open gaps to walls that move apart from the floor anew from slips and structure: round-off would add up.

    y: (2n,) p and p' of the structure. A gap about to close is left alone: it must not change sides.
    """
    n = len(st.constant)
    for r in range(system.friction_rows, len(st.state)):
        scale = system.free_travel[r]
        if system.moves_with_floor[r] or st.state[r] != OPEN or st.displacement[r] < _NEAR * scale:
            continue
        k, sign = (system.left_body[r], -1.0) if system.left_body[r] >= 0 else (system.right_body[r], 1.0)
        place, speed = 0.0, 0.0
        if k >= 0:  # a stop has no body
            place, speed = sign * (st.displacement[k] + st.low[k]), sign * st.velocity[k]
        for i in range(n):
            apart = system.J[r, i]
            if k >= 0:
                apart += sign * system.floor[k, i]
            place += apart * y[i]
            speed += apart * y[n + i]
        st.displacement[r], st.velocity[r] = system.rest[r] + place, speed


@inlined
def shift_slip(st, r, shift):
    """Add to the displacement of row r without loss (Knuth's exact sum of two doubles)."""
    old = st.displacement[r]
    new = old + shift
    part = new - old
    low = st.low[r] + ((old - (new - part)) + (shift - part))
    st.displacement[r] = new + low
    st.low[r] = low - (st.displacement[r] - new)


@inlined
def only(work, r):
    """Mark contact r alone for join and join_speeds."""
    for i in range(len(work.shut)):
        work.shut[i] = i == r


@inlined
def join(system, st, work):
    """Put bodies that touch (work.shut of their contacts) exactly where they touch, from the walls inwards."""
    slip, low, friction = st.displacement, st.low, system.friction_rows
    for r in range(friction, len(st.state)):
        before, after = system.left_body[r], system.right_body[r]
        if work.shut[r] and system.moves_with_floor[r] and after >= 0:
            slip[after] = slip[before] if before >= 0 else -system.rest[r]
            low[after] = low[before] if before >= 0 else 0.0
    anchored = False
    for r in range(len(st.state) - 1, friction - 1, -1):
        before, after = system.left_body[r], system.right_body[r]
        anchored = work.shut[r] and system.moves_with_floor[r] and before >= 0 and (anchored or after < 0)
        if anchored:
            slip[before] = slip[after] if after >= 0 else system.rest[r]
            low[before] = low[after] if after >= 0 else 0.0


@kernel
def join_speeds(system, st, work):
    """Give bodies that rest against each other or at a wall (work.shut of their contacts) exactly the same speed."""
    speed, friction = st.velocity, system.friction_rows
    for r in range(friction, len(st.state)):
        if work.shut[r] and system.moves_with_floor[r]:
            before, after = system.left_body[r], system.right_body[r]
            if before < 0 or after < 0 or speed[before] == 0.0 or speed[after] == 0.0:
                if before >= 0:
                    speed[before] = 0.0
                if after >= 0:
                    speed[after] = 0.0
            else:
                speed[after] = speed[before]
    for r in range(len(st.state) - 1, friction - 1, -1):
        before, after = system.left_body[r], system.right_body[r]
        if work.shut[r] and system.moves_with_floor[r] and before >= 0 and after >= 0:
            speed[before] = speed[after]


@inlined
def close(system, st, work):
    """Put the bodies of all rigid contacts that touch, to round-off, exactly there. Lists them; returns how many."""
    count, tiny, friction = 0, slowest(system, st), system.friction_rows
    for r in range(friction, len(st.state)):
        near = st.displacement[r] <= SIMULTANEOUS * system.free_travel[r] and st.velocity[r] <= tiny
        work.shut[r] = rigid(system, r) and (st.displacement[r] == 0.0 or near)
        if work.shut[r]:
            work.listed[count] = r
            count += 1
            if not system.moves_with_floor[r]:
                st.displacement[r] = 0.0
    join(system, st, work)
    measure_gaps(system, st)
    return count


@inlined
def slowest(system, st):
    """Speed below which a relative motion is round-off, m/s."""
    fastest = st.fastest[0]
    for r in range(system.friction_rows):
        fastest = max(fastest, abs(st.velocity[r]))
    return ROUND_OFF * fastest


@inlined
def rigid(system, r):
    """Whether row r is a constraint while it is closed, not a spring."""
    return system.spring[r] == math.inf
