"""A unit's kind, and its gap, elongation, speeds and spring force at given coordinates."""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.codes import OPEN, SLIP_LEFT, SLIP_RIGHT
from vanedamp.coupling.numerics.compiler.jit import inlined
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS


@inlined
def row_speed(system, row, v):
    """Speed of a row, m/s."""
    total = 0.0
    for i in range(len(v)):
        total += system.J[row, i] * v[i]
    return total


@inlined
def gap(system, unit, q):
    """Gap of a contact, m."""
    return system.rest[unit] + row_speed(system, unit, q)


@inlined
def is_compliant(system, unit):
    """Whether a unit is a contact with a spring."""
    return system.spring[unit] < math.inf


@inlined
def is_rigid(system, unit):
    """Whether a unit is a contact without a spring."""
    return unit < system.contacts and system.spring[unit] == math.inf


@inlined
def spring_force(system, unit, q, v):
    """Return the force of spring and dashpot of a closed contact, N; they never pull."""
    force = system.spring[unit] * gap(system, unit, q) + system.dashpot[unit] * row_speed(system, unit, v)
    return max(-force, 0.0)


@inlined
def least_force(system, unit):
    """Return the force of a compliant contact by the resolution of its gap, N: below, it carries nothing."""
    return SIMULTANEOUS * system.spring[unit] * system.play[unit]


@inlined
def has_friction(system, unit):
    """Whether a unit has friction."""
    return unit >= system.contacts or system.friction[unit] > 0.0


@inlined
def is_slip(state):
    """Whether a unit in this state slips; its state is the direction then, as a factor."""
    return state == SLIP_RIGHT or state == SLIP_LEFT


@inlined
def speed_scale(system, v):
    """Largest sum of the parts of a row's speed, m/s."""
    largest = 0.0
    for row in range(len(system.J)):
        total = 0.0
        for i in range(len(v)):
            total += abs(system.J[row, i] * v[i])
        largest = max(largest, total)
    return largest


@inlined
def is_closed(system, st, unit):
    """Whether a contact's gap is zero."""
    return st.state[unit] != OPEN or gap(system, unit, st.q) <= SIMULTANEOUS * system.play[unit]


@inlined
def is_second(system, unit):
    """Whether a contact shares the normal force of the one before: of a joint with two directions."""
    second = unit > 0 and system.corner[unit] == 1
    for i in range(len(system.mass)):
        second = second and system.J[unit, i] == system.J[unit - 1, i]
    return second


@inlined
def elongation(system, j, q):
    """Return the elongation of the spring before a slider, m; of velocities, its rate."""
    total = 0.0
    for i in range(len(q)):
        total += system.elongation[j, i] * q[i]
    return total


@inlined
def slider_bound(system, unit, q):
    """Return the largest force of the spring before a unit's slider at coordinates q, N."""
    most = system.limit[unit]
    if unit < system.contacts:
        most += system.friction[unit] * max(-system.spring[unit] * gap(system, unit, q), 0.0)
    return most


@inlined
def slider_speed(system, unit, state, v):
    """Return the speed of a unit's slider that follows its driver, m/s; of accelerations, its acceleration.

    One that slips does so at its bound: as the normal force falls, its spring shortens.
    """
    j = system.slider[unit]
    speed = elongation(system, j, v) + row_speed(system, len(system.rest) + unit, v)
    if unit < system.contacts and is_slip(state):
        speed += state * system.friction[unit] * system.spring[unit] * row_speed(system, unit, v) / system.tangential[j]
    return speed
