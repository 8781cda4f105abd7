"""Small matrices of compiled functions: room for them, products, and the pseudo-inverse.

Room is taken from one array as from a stack, which is emptied at every event: what compiled functions allocate
otherwise costs more than their arithmetic here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import counting as kernel
from vanedamp.coupling.numerics.compiler.jit import inlined
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.system.unit_laws import SINGULAR

#: columns whose cosine is below this are orthogonal; sweeps over all pairs of them, of which some six suffice
_ORTHOGONAL, _SWEEPS = 1e-16, 60


@record
class Room(NamedTuple):
    """Room for numbers and integers; used: (3,) int: of each, and whether more was wanted than there is."""

    numbers: np.ndarray
    integers: np.ndarray
    used: np.ndarray


def new_room(size: int) -> Room:
    """Return room for so many numbers."""
    return Room(np.empty(size), np.empty(max(size // 8, 64), np.int64), np.zeros(3, np.int64))


@kernel
def matrix(room, rows, columns):
    """Return a matrix of zeros (rows, columns)."""
    return vector(room, rows * columns).reshape(rows, columns)


@kernel
def vector(room, size):
    """Return zeros (size,)."""
    first = room.used[0]
    if first + size > len(room.numbers):
        first, room.used[2] = 0, 1
        size = min(size, len(room.numbers))
    room.used[0] = first + size
    entries = room.numbers[first : first + size]
    for i in range(size):
        entries[i] = 0.0
    return entries


@kernel
def integers(room, size):
    """Return integers (size,), zeros."""
    first = room.used[1]
    if first + size > len(room.integers):
        first, room.used[2] = 0, 1
    room.used[1] = first + size
    entries = room.integers[first : first + size]
    for i in range(size):
        entries[i] = 0
    return entries


@inlined
def empty(room):
    """Give all room back."""
    room.used[0], room.used[1] = 0, 0


@kernel
def unit(room, size):
    """Return the unit matrix (size, size)."""
    identity = matrix(room, size, size)
    for i in range(size):
        identity[i, i] = 1.0
    return identity


@kernel
def copied(room, a):
    """Return a copy of a matrix."""
    b = matrix(room, a.shape[0], a.shape[1])
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            b[i, j] = a[i, j]
    return b


@kernel
def product(room, a, b):
    """Return a b of matrices."""
    c = matrix(room, a.shape[0], b.shape[1])
    add_product(c, a, b)
    return c


@kernel
def add_product(c, a, b):
    """Add a b to a matrix."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            factor = a[i, k]
            if factor != 0.0:
                for j in range(b.shape[1]):
                    c[i, j] += factor * b[k, j]


@kernel
def copy(to, a):
    """Set numbers to others: an assignment by numba brings its message on shapes, half a second to compile."""
    for i in range(len(to)):
        to[i] = a[i]


@kernel
def times(room, a, x):
    """Return a x of a matrix and a vector of its columns, which may be longer."""
    y = vector(room, a.shape[0])
    for i in range(a.shape[0]):
        y[i] = dot(a[i], x)
    return y


@inlined
def dot(a, x):
    """Return the product of a vector and the first numbers of another."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * x[i]
    return total


@inlined
def dot_abs(a, x):
    """Return the same of their sizes."""
    total = 0.0
    for i in range(len(a)):
        total += abs(a[i] * x[i])
    return total


@kernel
def pseudo_inverse(room, a):
    """Return the pseudo-inverse (n, m) of a matrix (m, n): singular values below SINGULAR of the largest count as none.

    By orthogonal turns of its rows among each other (Hestenes 1958; Golub and Van Loan, Matrix Computations, 8.6.3).
    """
    m, n = a.shape
    inverse, turned, turns = matrix(room, n, m), copied(room, a), unit(room, m)
    for _ in range(_SWEEPS):
        largest = 0.0
        for i in range(m):
            for j in range(i + 1, m):
                largest = max(largest, _turn(turned, turns, i, j))
        if largest <= _ORTHOGONAL:
            break
    sizes, most = vector(room, m), 0.0
    for i in range(m):
        sizes[i] = math.sqrt(dot(turned[i], turned[i]))
        most = max(most, sizes[i])
    for i in range(m):  # of a = turns^T turned, the rows of turned orthogonal
        if sizes[i] > SINGULAR * most:
            for k in range(n):
                weight = turned[i, k] / sizes[i] / sizes[i]
                for j in range(m):
                    inverse[k, j] += weight * turns[i, j]
    return inverse


@kernel
def _turn(turned, turns, i, j):
    """Make rows i and j orthogonal. Returns the size of their cosine before, 0 of rows that vanish."""
    one, other = dot(turned[i], turned[i]), dot(turned[j], turned[j])
    both = dot(turned[i], turned[j])
    size = math.sqrt(one) * math.sqrt(other)
    if size == 0.0 or abs(both) <= _ORTHOGONAL * size:
        return 0.0
    slope = 0.5 * (other - one) / both
    t = (1.0 if slope >= 0.0 else -1.0) / (abs(slope) + math.sqrt(1.0 + slope * slope))
    c = 1.0 / math.sqrt(1.0 + t * t)
    for rows in (turned, turns):
        for k in range(rows.shape[1]):
            x, y = rows[i, k], rows[j, k]
            rows[i, k], rows[j, k] = c * (x - t * y), c * (y + t * x)
    return abs(both) / size


@kernel
def inverse_of_rows(room, rows):
    """Return the pseudo-inverse (n, m) of rows (m, n) that may depend on each other, whatever their lengths."""
    scaled, lengths = copied(room, rows), vector(room, rows.shape[0])
    for i in range(len(lengths)):
        length = math.sqrt(dot(rows[i], rows[i]))
        lengths[i] = length if length > 0.0 else 1.0
        for j in range(rows.shape[1]):
            scaled[i, j] /= lengths[i]
    inverse = pseudo_inverse(room, scaled)
    for j in range(inverse.shape[0]):
        for i in range(inverse.shape[1]):
            inverse[j, i] /= lengths[i]
    return inverse
