"""What constraints leave of a derivative: closed gaps stay closed, units that stick stay, sliders follow.

Maps of derivatives M (2N, k + P) of u, by k numbers of the start and by P of the scene: a matrix for places, one for
rates, and a part of their own for the latter, since gaps and directions depend on these.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.matrices import (
    add_product,
    copy,
    dot,
    integers,
    inverse_of_rows,
    matrix,
    product,
    unit,
    vector,
)
from vanedamp.coupling.derivatives.walking import SPEEDS
from vanedamp.coupling.numerics.codes import CLOSED, OPEN, STICK
from vanedamp.coupling.numerics.compiler.jit import counting, inlined
from vanedamp.coupling.system.unit_kinematics import is_slip


class AffineMap(NamedTuple):
    """The map M -> (places, rates) M + (0, offset): matrices (N, N), offset (2N, P)."""

    places: np.ndarray
    rates: np.ndarray
    offset: np.ndarray


@inlined
def presses(state):
    """Return whether a contact in a state is closed with its own force."""
    return state < OPEN or state == CLOSED


@counting
def identity(room, eq, turns):
    """Return the map that changes nothing."""
    size = len(eq.root)
    return AffineMap(unit(room, size), unit(room, size), matrix(room, 2 * size, turns.numbers))


@counting
def applied(room, map_, M):
    """Return the derivative (2N, k + P) after a map."""
    size, P = len(map_.places), map_.offset.shape[1]
    image = matrix(room, 2 * size, M.shape[1])
    add_product(image[:size], map_.places, M[:size])
    add_product(image[size:], map_.rates, M[size:])
    first = M.shape[1] - P
    for i in range(2 * size):
        for p in range(P):
            image[i, first + p] += map_.offset[i, p]
    return image


@counting
def then(room, one, other):
    """Return a map and then another."""
    size = len(one.places)
    offset = matrix(room, 2 * size, one.offset.shape[1])
    add_product(offset[:size], other.places, one.offset[:size])
    add_product(offset[size:], other.rates, one.offset[size:])
    for i in range(2 * size):
        for p in range(offset.shape[1]):
            offset[i, p] += other.offset[i, p]
    return AffineMap(product(room, other.places, one.places), product(room, other.rates, one.rates), offset)


@counting
def held(room, eq, turns, closed, stuck, z):
    """Return the map, in the metric of mass, that keeps contacts (u,) closed and slips zero, at z (K,).

    Both sides move by forces between them only, which keep their momentum and their centre of mass.
    """
    size, units = len(eq.root), len(closed)
    map_, count, more = identity(room, eq, turns), 0, 0
    for r in range(units):
        count += closed[r]
        more += stuck[r]
    normal, both, rows = matrix(room, count, size), matrix(room, count + more, size), integers(room, count + more)
    n, m = 0, count
    for r in range(units):
        if closed[r]:
            rows[n] = r
            copy(normal[n], eq.rows[r])
            copy(both[n], eq.rows[r])
            n += 1
        if stuck[r]:
            rows[m] = units + r
            copy(both[m], eq.rows[units + r])
            m += 1
    inverse, of_both = inverse_of_rows(room, normal), inverse_of_rows(room, both)
    on_places, on_rates = product(room, inverse, normal), product(room, of_both, both)
    for i in range(size):
        for k in range(size):
            map_.places[i, k] -= eq.rate[i] * on_places[i, k] / eq.rate[k]
            map_.rates[i, k] -= on_rates[i, k]
    for p in range(turns.numbers):
        for a in range(count):
            opened = dot(turns.gap[p, rows[a]], z)
            for i in range(size):
                map_.offset[i, p] -= eq.rate[i] * inverse[i, a] * opened
        for a in range(count + more):
            moved = dot(turns.rows[p, rows[a]], z[size:])
            for i in range(size):
                map_.offset[size + i, p] -= of_both[i, a] * moved
    return map_


@counting
def followed(room, eq, turns, state, z):
    """Return the map to sliders as they are in states (u,): slipping ones follow their drivers, others rest."""
    size, sliders, map_ = len(eq.root), len(eq.bound), identity(room, eq, turns)
    for j in range(sliders):
        r = eq.sprung[j]
        at, way = size - sliders + j, state[r]
        for k in range(size):
            map_.rates[at, k] = 0.0
        if way == STICK:
            continue
        for k in range(size):
            map_.places[at, k], map_.rates[at, k] = eq.follows[j, k], eq.follows[j, size + k]
        for p in range(turns.numbers):
            map_.offset[at, p] = dot(turns.follows[p, j, :size], z)
            if is_slip(way):
                map_.offset[at, p] -= way * turns.bound[p, j]
            map_.offset[size + at, p] = dot(turns.follows[p, j, size:], z[size:])
        if is_slip(way) and r < eq.contacts:
            _ease(eq, turns, map_, way, r, j, at, z)
    return map_


@inlined
def _ease(eq, turns, map_, way, r, j, at, z):
    """Add what a slider that slips moves by, as the bound falls with the contact's normal force."""
    size = len(eq.root)
    ease, opened, opens = way * eq.ease[j], dot(eq.gap[r], z), dot(eq.speed[r], z) / eq.rate[at]
    for k in range(size):
        map_.places[at, k] += ease * eq.gap[r, k]
        map_.rates[at, k] += ease * eq.speed[r, size + k] / eq.rate[at]
    for p in range(turns.numbers):
        map_.offset[at, p] += way * turns.ease[p, j] * opened + ease * dot(turns.gap[p, r], z)
        moved = ease * dot(turns.speed[p, r], z) / eq.rate[at]
        map_.offset[size + at, p] += way * turns.ease[p, j] * opens + moved


@counting
def begun(room, eq, turns, state, closed, z):
    """Return the map that contacts `closed` (u,) and units that stick in states (u,) leave at z (K,)."""
    units = len(state)
    rigid, stuck = integers(room, units), integers(room, units)
    for r in range(units):
        rigid[r] = 1 if closed[r] and eq.spring[r] == math.inf else 0
        stuck[r] = 1 if state[r] == STICK and eq.rubs[r] else 0
    return then(room, held(room, eq, turns, rigid, stuck, z), followed(room, eq, turns, state, z))


@counting
def pressing(room, state):
    """Return whether units (u,) press, as contacts, in states."""
    pressed = integers(room, len(state))
    for r in range(len(state)):
        pressed[r] = 1 if presses(state[r]) else 0
    return pressed


@counting
def left(room, eq, turns, M, z, rows, kind):
    """Return derivatives of functionals at z (GAPS of contacts, or SPEEDS of rows): (m, k + P)."""
    derivative = matrix(room, len(rows), M.shape[1])
    for a in range(len(rows)):
        _add_left(eq, turns, M, z, rows[a], kind, derivative[a])
    return derivative


@counting
def left_of(room, eq, turns, M, z, row, kind):
    """Return the same of one functional: (k + P,)."""
    derivative = vector(room, M.shape[1])
    _add_left(eq, turns, M, z, row, kind, derivative)
    return derivative


@counting
def _add_left(eq, turns, M, z, row, kind, derivative):
    functional, first = eq.speed[row] if kind == SPEEDS else eq.gap[row], M.shape[1] - turns.numbers
    for i in range(M.shape[0]):
        if functional[i] != 0.0:
            for c in range(M.shape[1]):
                derivative[c] += functional[i] * M[i, c]
    for p in range(turns.numbers):
        derivative[first + p] += explicit_of(turns, p, row, z, kind)


@inlined
def explicit_of(turns, p, row, z, kind):
    """Return the explicit change by number p of a functional at z."""
    return dot(turns.speed[p, row], z) if kind == SPEEDS else dot(turns.gap[p, row], z)


@counting
def largest(room, eq, M):
    """Return the largest entry of a derivative (2N, k + P) in units of the sizes of states."""
    most, of_state = 0.0, vector(room, M.shape[1])
    for s in range(len(eq.scale)):
        for c in range(M.shape[1]):
            of_state[c] = 0.0
        for i in range(M.shape[0]):
            if eq.to_state[s, i] != 0.0:
                for c in range(M.shape[1]):
                    of_state[c] += eq.to_state[s, i] * M[i, c]
        for c in range(M.shape[1]):
            most = max(most, abs(of_state[c]) / eq.scale[s])
    return most
