"""Linear motions with their derivatives by numbers, by Taylor's series over short panels.

z' = X z, and by P numbers of X: Z' = X Z + D z. The series end at round-off, so that both are as exact as exp(X t).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from copy import copy
from typing import NamedTuple

import numpy as np
from scipy.linalg import matrix_balance

from vanedamp.coupling.derivatives.matrices import matrix, product, unit, vector
from vanedamp.coupling.numerics.compiler.jit import ZERO, counting, entry, kernel

#: norm of X, balanced, over a panel, and terms of a series then: 3^32/32! < 1e-19
_NORM, TERMS = 3.0, 32
#: most panels of a motion whose nodes are kept at once
_MOST = 200
#: nodes and weights of Gauss and Legendre on a panel (0 to 1): they integrate the motion and its squares to round-off
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(12)[0] + 1) / 2, np.polynomial.legendre.leggauss(12)[1] / 2


class Trajectory(NamedTuple):
    """A motion over a time: n nodes in it with weights (n,) of integrals, s.

    time (n,) s; z (n, K), Z (n, K, ...): the motion and its derivatives there; last (K,), end (K, ...): at its end.
    """

    time: np.ndarray
    weight: np.ndarray
    z: np.ndarray
    Z: np.ndarray
    last: np.ndarray
    end: np.ndarray


class Series:
    """The series of one flow X (K, K), with derivatives or without."""

    def __init__(self, X: np.ndarray) -> None:
        self.X, self.alone = X, self
        # units of the constants, in which stiff springs have huge loads, are no rates
        balanced = np.abs(matrix_balance(X, permute=False)[0])
        self.norm = float(min(balanced.sum(axis=0).max(), balanced.sum(axis=1).max()))
        rows, columns = np.nonzero(X)
        self._X = rows, columns, X[rows, columns]
        self._set_derivatives(np.zeros((0, *X.shape)))

    def by(self, D: np.ndarray) -> Series:
        """Return the same series with derivatives D (P, K, K) of the flow."""
        series = copy(self)
        series._set_derivatives(D)
        return series

    def _set_derivatives(self, D: np.ndarray) -> None:
        number, at, of = np.nonzero(D)
        self._D, self._numbers = (number, at, of, D[number, at, of]), len(D)

    def pieces(self, z: np.ndarray, Z: np.ndarray, duration: float) -> Iterator[tuple[float, float, Trajectory]]:
        """Yield start, end and course, with nodes, of the pieces of a motion from z (K,), Z (K, P) over a duration, s.

        A stiff contact has tens of thousands of panels, whose nodes exceed the memory.
        """
        count = max(int(np.ceil(self._panels(duration) / _MOST)), 1)
        times = [*(duration * piece / count for piece in range(count)), duration]
        for start, end in itertools.pairwise(times):
            course = self.course(z, Z, end - start, True)
            yield start, end, course
            z, Z = course.last, course.end

    def _panels(self, duration: float) -> int:
        return max(int(np.ceil(self.norm * abs(duration) / _NORM)), 1)

    def course(self, z: np.ndarray, Z: np.ndarray, duration: float, nodes: bool) -> Trajectory:
        """Return the motion from z (K,), Z (K, k + P) over a duration, s; at nodes, or without any.

        The first k columns are derivatives that change no flow.
        """
        panels = self._panels(duration)
        step, (k, p) = duration / panels, Z.shape
        places = _NODES if nodes else np.zeros(0)
        g = len(places)
        of_z, of_Z = np.empty((panels * g, k)), np.empty((panels * g, k, p))
        z, Z = np.array(z), np.array(Z)
        room = np.empty((TERMS, k)), np.empty((TERMS, k, p))
        _advance(*self._X, *self._D, p - self._numbers, z, Z, step, panels, places, *room, of_z, of_Z)
        time = ((np.arange(panels)[:, None] + places) * step).ravel()
        weight = np.resize(_WEIGHTS * step, len(time)) if nodes else time
        return Trajectory(time, weight, of_z, of_Z, z, Z)


@entry
def _advance(row, column, x, number, at, of, d, first, z, Z, step, panels, places, a, b, of_z, of_Z):
    """Advance z and Z in place over panels; set them at places of each. a, b: room for the terms of the series."""
    for panel in range(panels):
        set_terms(row, column, x, number, at, of, d, first, z, Z, step, a, b)
        for i in range(len(places)):
            node = panel * len(places) + i
            set_sums(a, b, places[i], of_z[node], of_Z[node])
        set_sums(a, b, 1.0, z, Z)


@kernel
def set_terms(row, column, x, number, at, of, d, first, z, Z, step, a, b):
    """Set the terms a (t, K) and b (t, K, p) of the series of z and Z over a step.

    x: entries of X at rows and columns; d: of its derivatives by numbers, of which the first has column `first`.
    """
    terms, k, p = b.shape[0], len(z), Z.shape[1]
    for i in range(k):
        a[0, i] = z[i]
        for n in range(p):
            b[0, i, n] = Z[i, n]
    for j in range(1, terms):
        share = step / j
        for i in range(k):
            a[j, i] = 0.0
            for n in range(p):
                b[j, i, n] = 0.0
        for entry_ in range(len(x)):
            i, l, value = row[entry_], column[entry_], share * x[entry_]
            a[j, i] += value * a[j - 1, l]
            for n in range(p):
                b[j, i, n] += value * b[j - 1, l, n]
        for entry_ in range(len(d)):
            b[j, at[entry_], first + number[entry_]] += share * d[entry_] * a[j - 1, of[entry_]]


@kernel
def set_sums(a, b, x, z, Z):
    """Set z and Z to the sums of the series at x of the step, 0 to 1."""
    terms = b.shape[0]
    for i in range(len(z)):
        sum_ = a[terms - 1, i]
        for j in range(terms - 2, -1, -1):
            sum_ = sum_ * x + a[j, i]
        z[i] = sum_
        for n in range(Z.shape[1]):
            sum_ = b[terms - 1, i, n]
            for j in range(terms - 2, -1, -1):
                sum_ = sum_ * x + b[j, i, n]
            Z[i, n] = sum_


@kernel
def panels_of(norm, duration):
    """Return how many panels a motion over a duration has, whose flow has a norm, 1/s."""
    return max(math.ceil(norm * abs(duration) / _NORM), 1)


@counting
def follow(room, flows, f, first, z, Z, duration, a, b):
    """Advance z (K,) and Z (K, p) of flow f over a duration, s. first: column of the first number, or beyond.

    Columns that no number changes go by a power of the step's exponential where that takes fewer operations than their
    series at every panel.
    """
    panels, (size, columns) = panels_of(flows.norm[f], duration), Z.shape
    plain, each = min(first, columns), TERMS * (flows.counts[f, 0] + size)
    if each * size + 2.0 * math.log2(panels) * size**3 >= 1.0 * panels * each * plain:
        _step(flows, f, first, z, Z, duration / panels, panels, a, b)
        return
    power = _power(room, flows, f, duration / panels, panels, a, b)
    alone, rest = matrix(room, size, plain), matrix(room, size, columns - plain)
    for i in range(size):
        for c in range(columns):
            if c < plain:
                alone[i, c] = Z[i, c]
            else:
                rest[i, c - plain] = Z[i, c]
    alone = product(room, power, alone)
    _step(flows, f, ZERO, z, rest, duration / panels, panels, a, b)
    for i in range(size):
        for c in range(columns):
            Z[i, c] = alone[i, c] if c < plain else rest[i, c - plain]


@counting
def _step(flows, f, first, z, Z, step, panels, a, b):
    """Advance z and Z of flow f over panels by their series."""
    n, d = flows.counts[f, 0], flows.counts[f, 1] if first < Z.shape[1] else 0
    for _ in range(panels):
        set_terms(
            flows.row[f, :n], flows.column[f, :n], flows.x[f, :n], flows.number[f, :d], flows.to[f, :d],
            flows.of[f, :d], flows.d[f, :d], first, z, Z, step, a, b,
        )  # fmt: skip
        set_sums(a, b, 1.0, z, Z)


@counting
def _power(room, flows, f, step, panels, a, b):
    """Return the exponential (K, K) of flow f over panels: a power of that over one."""
    size = flows.forces.shape[2]
    base, power, left = unit(room, size), unit(room, size), panels
    _step(flows, f, size, vector(room, size), base, step, ZERO + 1, a, b)
    while left > 0:
        if left % 2 == 1:
            power = product(room, power, base)
        left //= 2
        if left > 0:
            base = product(room, base, base)
    return power
