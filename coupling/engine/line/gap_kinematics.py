"""Gaps at walls that move with the floor are computed from slips: bodies that touch have the same slip exactly.

A slip is the sum of two doubles, so that a rebound of a billionth of a billionth of the gap is still resolved.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.line.tolerances import CLOSING
from vanedamp.coupling.numerics.codes import OPEN
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS, SPEED_ROUND_OFF


@inlined
def measure_gaps(system, st):
    """Set displacement and velocity of the gaps that move with the floor, from the slips."""
    for r in range(system.friction_rows, len(st.state)):
        if system.moves_with_floor[r]:
            half = system.rest[r]
            left_body, right_body = system.left_body[r], system.right_body[r]
            right, far, faster = half, 0.0, 0.0
            if right_body >= 0:
                right, far, faster = st.displacement[right_body], st.low_word[right_body], st.velocity[right_body]
            left, near, slower = -half, 0.0, 0.0
            if left_body >= 0:
                left, near, slower = st.displacement[left_body], st.low_word[left_body], st.velocity[left_body]
            st.displacement[r], st.velocity[r] = (right - left) + (far - near), faster - slower


@inlined
def align_gaps(system, st, y):
    """Compute open gaps to walls that move apart from the floor from slips and structure: round-off would add up.

    y: (2n,) p and p' of the structure. A gap about to close is not changed: it must not change sides.
    """
    n = len(st.constant)
    for r in range(system.friction_rows, len(st.state)):
        scale = system.play[r]
        if system.moves_with_floor[r] or st.state[r] != OPEN or st.displacement[r] < CLOSING * scale:
            continue
        k, sign = (system.left_body[r], -1.0) if system.left_body[r] >= 0 else (system.right_body[r], 1.0)
        position, speed = 0.0, 0.0
        if k >= 0:  # a stop has no body
            position, speed = sign * (st.displacement[k] + st.low_word[k]), sign * st.velocity[k]
        for i in range(n):
            apart = system.J[r, i]
            if k >= 0:
                apart += sign * system.floor[k, i]
            position += apart * y[i]
            speed += apart * y[n + i]
        st.displacement[r], st.velocity[r] = system.rest[r] + position, speed


@inlined
def shift_slip(st, r, shift):
    """Add to the displacement of row r without loss (Knuth's exact sum of two doubles)."""
    old = st.displacement[r]
    new = old + shift
    change = new - old
    low = st.low_word[r] + ((old - (new - change)) + (shift - change))
    st.displacement[r] = new + low
    st.low_word[r] = low - (st.displacement[r] - new)


@inlined
def mark_only(scratch, r):
    """Mark contact r as the only one for join_places and join_speeds."""
    for i in range(len(scratch.touching)):
        scratch.touching[i] = i == r


@inlined
def join_places(system, st, scratch):
    """Put bodies with marked contacts (scratch.touching) exactly in touch, from the walls inwards."""
    slip, low, friction = st.displacement, st.low_word, system.friction_rows
    for r in range(friction, len(st.state)):
        left_body, right_body = system.left_body[r], system.right_body[r]
        if scratch.touching[r] and system.moves_with_floor[r] and right_body >= 0:
            slip[right_body] = slip[left_body] if left_body >= 0 else -system.rest[r]
            low[right_body] = low[left_body] if left_body >= 0 else 0.0
    anchored = False
    for r in range(len(st.state) - 1, friction - 1, -1):
        left_body, right_body = system.left_body[r], system.right_body[r]
        anchored = (
            scratch.touching[r] and system.moves_with_floor[r] and left_body >= 0 and (anchored or right_body < 0)
        )
        if anchored:
            slip[left_body] = slip[right_body] if right_body >= 0 else system.rest[r]
            low[left_body] = low[right_body] if right_body >= 0 else 0.0


@kernel
def join_speeds(system, st, scratch):
    """Give bodies with marked contacts (scratch.touching) exactly the same speed, or a wall's."""
    speed, friction = st.velocity, system.friction_rows
    for r in range(friction, len(st.state)):
        if scratch.touching[r] and system.moves_with_floor[r]:
            left_body, right_body = system.left_body[r], system.right_body[r]
            if left_body < 0 or right_body < 0 or speed[left_body] == 0.0 or speed[right_body] == 0.0:
                if left_body >= 0:
                    speed[left_body] = 0.0
                if right_body >= 0:
                    speed[right_body] = 0.0
            else:
                speed[right_body] = speed[left_body]
    for r in range(len(st.state) - 1, friction - 1, -1):
        left_body, right_body = system.left_body[r], system.right_body[r]
        if scratch.touching[r] and system.moves_with_floor[r] and left_body >= 0 and right_body >= 0:
            speed[left_body] = speed[right_body]


@inlined
def close_gaps(system, st, scratch):
    """Close the rigid contacts that touch to round-off exactly, and list them. Return their number."""
    count, tiny, friction = 0, slowest(system, st), system.friction_rows
    for r in range(friction, len(st.state)):
        near = st.displacement[r] <= SIMULTANEOUS * system.play[r] and st.velocity[r] <= tiny
        scratch.touching[r] = rigid(system, r) and (st.displacement[r] == 0.0 or near)
        if scratch.touching[r]:
            scratch.listed[count] = r
            count += 1
            if not system.moves_with_floor[r]:
                st.displacement[r] = 0.0
    join_places(system, st, scratch)
    measure_gaps(system, st)
    return count


@inlined
def slowest(system, st):
    """Return the speed below which a relative motion is round-off, m/s."""
    fastest = st.largest_speed[0]
    for r in range(system.friction_rows):
        fastest = max(fastest, abs(st.velocity[r]))
    return SPEED_ROUND_OFF * fastest


@inlined
def rigid(system, r):
    """Whether row r is a constraint while it is closed, not a spring."""
    return system.spring[r] == math.inf


@kernel
def spring_energy(system, st, r):
    """Return the energy in the spring of row r, J."""
    return 0.5 * system.spring[r] * st.displacement[r] * st.displacement[r]
