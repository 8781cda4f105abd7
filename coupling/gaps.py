"""Gaps that ride are differences of slips: slips are the state, and bodies that touch have the same to the last bit.

A slip is the sum of two doubles, so that a rebound of a billionth of a billionth of the gap is still resolved.
"""

from __future__ import annotations

import math

from coupling.compiled import inlined, kernel
from coupling.state import CLOSED, OPEN, STICK, TOUCHING

#: gaps closed to this share of the free travel are closed at the same instant
SIMULTANEOUS = 1e-12
#: speeds below this share of the largest are round-off
ROUND_OFF = 1e-13
#: share of the free travel below which a gap is about to close
_NEAR = 1e-6


@inlined
def measure_gaps(rows, st):
    """Displacement and velocity of the gaps that ride, from the slips."""
    for r in range(rows.friction_rows, len(st.state)):
        if rows.rides[r]:
            half = 0.5 * rows.gap[r - rows.friction_rows]
            before, after = rows.before[r], rows.after[r]
            right, far, faster = half, 0.0, 0.0
            if after >= 0:
                right, far, faster = st.displacement[after], st.low[after], st.velocity[after]
            left, near, slower = -half, 0.0, 0.0
            if before >= 0:
                left, near, slower = st.displacement[before], st.low[before], st.velocity[before]
            st.displacement[r], st.velocity[r] = (right - left) + (far - near), faster - slower


@kernel
def align_gaps(rows, st, y):
    """Take open gaps to walls that move apart from the floor anew from slips and structure: round-off would add up.

    y: (2n,) p and p' of the structure. A gap about to close is left alone: it must not change sides.
    """
    _follow_walls(rows, st, y)
    for r in range(rows.friction_rows, len(st.state)):
        scale = rows.gap[r - rows.friction_rows]
        if rows.rides[r] or st.state[r] != OPEN or st.displacement[r] < _NEAR * scale:
            continue
        k, sign = (rows.before[r], -1.0) if rows.before[r] >= 0 else (rows.after[r], 1.0)
        place, speed = _wall(rows, r, k, sign, y)
        st.displacement[r] = 0.5 * scale + (sign * (st.displacement[k] + st.low[k]) + place)
        st.velocity[r] = sign * st.velocity[k] + speed


@inlined
def _follow_walls(rows, st, y):
    """Put bodies that rest at a wall that moves apart from the floor where it is, and with them all that touches them.

    Their speeds were equal to round-off when they came to rest: what was missing would add up as long as they rest.
    What sticks on the floor has its place there.
    """
    friction, count = rows.friction_rows, len(st.state)
    follows = False
    for r in range(friction, count):
        before, after = rows.before[r], rows.after[r]
        if before < 0:
            follows = _rests(rows, st, r) and not rows.rides[r] and st.state[after] < STICK
            if follows:
                place, speed = _wall(rows, r, after, 1.0, y)
                st.displacement[after] = -0.5 * rows.gap[r - friction] - place
                st.low[after], st.velocity[after] = 0.0, -speed
        elif after >= 0:
            follows = follows and st.displacement[r] == 0.0 and st.state[after] < STICK
            if follows:
                _join(rows, st, r, before, after)
    follows = False
    for r in range(count - 1, friction - 1, -1):
        before, after = rows.before[r], rows.after[r]
        if after < 0:
            follows = _rests(rows, st, r) and not rows.rides[r] and st.state[before] < STICK
            if follows:
                place, speed = _wall(rows, r, before, -1.0, y)
                st.displacement[before] = 0.5 * rows.gap[r - friction] + place
                st.low[before], st.velocity[before] = 0.0, speed
        elif before >= 0:
            follows = follows and st.displacement[r] == 0.0 and st.state[before] < STICK
            if follows:
                _join(rows, st, r, after, before)


@inlined
def _rests(rows, st, r):
    """Whether the bodies of contact r rest against each other."""
    return rigid(rows, r) and (st.state[r] == CLOSED or st.state[r] == TOUCHING)


@inlined
def _join(rows, st, r, one, other):
    """Put a body where another is that it touches in contact r; one that rests against it has its speed."""
    st.displacement[other], st.low[other] = st.displacement[one], st.low[one]
    if _rests(rows, st, r):
        st.velocity[other] = st.velocity[one]


@inlined
def _wall(rows, r, k, sign, y):
    """How far and how fast the wall of contact r has moved apart from the floor under body k: their part of the gap."""
    n = len(rows.stiffness)
    place, speed = 0.0, 0.0
    for i in range(n):
        apart = rows.structure[r, i] + sign * rows.floor[k, i]
        place += apart * y[i]
        speed += apart * y[n + i]
    return place, speed


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
def join(rows, st, work):
    """Put bodies that touch (work.shut of their contacts) exactly where they touch, from the walls inwards."""
    slip, low, friction = st.displacement, st.low, rows.friction_rows
    for r in range(friction, len(st.state)):
        before, after = rows.before[r], rows.after[r]
        if work.shut[r] and rows.rides[r] and after >= 0:
            slip[after] = slip[before] if before >= 0 else -0.5 * rows.gap[r - friction]
            low[after] = low[before] if before >= 0 else 0.0
    anchored = False
    for r in range(len(st.state) - 1, friction - 1, -1):
        before, after = rows.before[r], rows.after[r]
        anchored = work.shut[r] and rows.rides[r] and before >= 0 and (anchored or after < 0)
        if anchored:
            slip[before] = slip[after] if after >= 0 else 0.5 * rows.gap[r - friction]
            low[before] = low[after] if after >= 0 else 0.0


@kernel
def join_speeds(rows, st, work):
    """Give bodies that rest against each other or at a wall (work.shut of their contacts) exactly the same speed."""
    speed, friction = st.velocity, rows.friction_rows
    for r in range(friction, len(st.state)):
        if work.shut[r] and rows.rides[r]:
            before, after = rows.before[r], rows.after[r]
            if before < 0 or after < 0 or speed[before] == 0.0 or speed[after] == 0.0:
                if before >= 0:
                    speed[before] = 0.0
                if after >= 0:
                    speed[after] = 0.0
            else:
                speed[after] = speed[before]
    for r in range(len(st.state) - 1, friction - 1, -1):
        before, after = rows.before[r], rows.after[r]
        if work.shut[r] and rows.rides[r] and before >= 0 and after >= 0:
            speed[before] = speed[after]


@inlined
def close(rows, st, work):
    """Put the bodies of all rigid contacts that touch, to round-off, exactly there. Lists them; returns how many."""
    count, tiny, friction = 0, slowest(rows, st), rows.friction_rows
    for r in range(friction, len(st.state)):
        near = st.displacement[r] <= SIMULTANEOUS * rows.gap[r - friction] and st.velocity[r] <= tiny
        work.shut[r] = rigid(rows, r) and (st.displacement[r] == 0.0 or near)
        if work.shut[r]:
            work.rows[count] = r
            count += 1
            if not rows.rides[r]:
                st.displacement[r] = 0.0
    join(rows, st, work)
    measure_gaps(rows, st)
    return count


@inlined
def slowest(rows, st):
    """Speed below which a relative motion is round-off, m/s."""
    fastest = st.fastest[0]
    for r in range(rows.friction_rows):
        fastest = max(fastest, abs(st.velocity[r]))
    return ROUND_OFF * fastest


@inlined
def rigid(rows, r):
    """Whether row r is a constraint while it is closed, not a spring."""
    return rows.spring[r] == math.inf
