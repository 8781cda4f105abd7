"""The linear complementarity problem w = M z + q, w >= 0, z >= 0, w z = 0, for any square matrix M.

Lemke's method by complementary pivots (Cottle, Pang and Stone, The Linear Complementarity Problem, 1992, section 4.4).
Ties are broken lexicographically, so that it ends: contacts that depend on each other, as both corners of a block that
lies flat, are ties. For contact with Coulomb friction it finds a solution if there is one in all but paradoxical cases
(Glocker and Pfeiffer 1996; Stewart and Trinkle 1996).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.tolerances import PIVOT, PIVOT_GROWTH, RESIDUAL, RESIDUAL_LARGEST

#: covering vectors that are tried, and the ratio that spreads their entries
_ATTEMPTS, _GOLDEN = 4, 0.6180339887498949


@record
class Lemke(NamedTuple):
    """Room for a problem of up to k unknowns."""

    matrix: Annotated[np.ndarray, "k k"]  # M
    q: Annotated[np.ndarray, "k"]
    z: Annotated[np.ndarray, "k"]  # the solution
    w: Annotated[np.ndarray, "k"]
    tableau: Annotated[np.ndarray, "k columns"]  # scratch: columns of w, z, the covering variable, and q
    basis: Annotated[np.ndarray, "k", int]  # scratch: basic variable of each row


def new_lemke(k: int) -> Lemke:
    """Room for a problem of up to k unknowns."""
    return room(Lemke, {"k": k, "columns": 2 * k + 2})


@entry
def solve_lemke(problem, k, first):
    """Solve the problem of the first k unknowns in place (z, w). Returns False if the method finds no solution.

    M and q should have numbers of size one: round-off is judged by that. Where it makes a wrong choice among ties,
    another covering vector leads past them, or to another one of several solutions. Where none does, round-off is
    judged by how far the tableau grows.
    first: number of the covering vector to begin with, 0 or more.
    """
    for grown in (0.0, PIVOT_GROWTH):
        for attempt in range(first, first + _ATTEMPTS):
            if _solve(problem, k, attempt, grown) and _fits(problem, k):
                return True
    return False


@kernel
def _solve(problem, k, attempt, grown):
    """Solve the problem by one covering vector: of ones, or another for later attempts.

    grown: round-off relative to the largest entry so far, in addition to PIVOT.
    """
    t, basis, cover, noise = problem.tableau, problem.basis, 2 * k, 0.0
    entering, leaving = cover, _fill_tableau(problem, k, attempt)
    if leaving < 0:
        return True
    for _ in range(50 + 20 * k):
        _pivot(t, leaving, entering, k)
        left, basis[leaving] = basis[leaving], entering
        if left == cover:
            _take_solution(problem, k)
            return True
        entering = left + k if left < k else left - k
        if grown > 0.0:
            for i in range(k):
                for j in range(2 * k + 2):
                    noise = max(noise, grown * abs(t[i, j]))
        leaving, least = -1, max(PIVOT, noise)
        for i in range(k):
            if t[i, entering] > least and (leaving < 0 or _before(t, basis, i, leaving, entering, k, noise)):
                leaving = i
        if leaving < 0:
            return False
    return False


@kernel
def _fill_tableau(problem, k, attempt):
    """Begin with the slack variables w = q. Return the row that the covering variable replaces, -1 if q >= 0."""
    t, cover, lowest, leaving = problem.tableau, 2 * k, -PIVOT, -1
    for i in range(k):
        for j in range(2 * k + 1):
            t[i, j] = 0.0
        t[i, i] = 1.0
        for j in range(k):
            t[i, k + j] = -problem.matrix[i, j]
        covering = 1.0 + attempt * ((i + 1) * _GOLDEN % 1.0)
        t[i, cover], t[i, cover + 1] = -covering, problem.q[i]
        problem.basis[i] = i
        if problem.q[i] < lowest * covering:
            lowest, leaving = problem.q[i] / covering, i
        problem.z[i], problem.w[i] = 0.0, max(problem.q[i], 0.0)
    return leaving


@kernel
def _pivot(t, leaving, entering, k):
    """Bring a column into the basis instead of that of a row."""
    pivot = t[leaving, entering]
    for j in range(2 * k + 2):
        t[leaving, j] /= pivot
    for i in range(k):
        factor = t[i, entering]
        if i != leaving and factor != 0.0:
            for j in range(2 * k + 2):
                t[i, j] -= factor * t[leaving, j]
            t[i, entering] = 0.0


@kernel
def _take_solution(problem, k):
    """Set w and z to the values of the basic variables; others are zero."""
    for i in range(k):
        problem.w[i] = 0.0
    for i in range(k):
        variable, value = problem.basis[i], max(problem.tableau[i, 2 * k + 1], 0.0)
        if variable < k:
            problem.w[variable] = value
        else:
            problem.z[variable - k] = value


@kernel
def _fits(problem, k):
    """Whether w = M z + q: pivots of round-off may have spoilt a solution."""
    largest = 0.0
    for i in range(k):
        largest = max(largest, problem.z[i])
    for i in range(k):
        error, size = problem.q[i] - problem.w[i], abs(problem.q[i]) + abs(problem.w[i])
        for j in range(k):
            term = problem.matrix[i, j] * problem.z[j]
            error += term
            size += abs(term)
        if abs(error) > max(RESIDUAL * max(size, 1.0), RESIDUAL_LARGEST * largest):
            return False
    return True


@kernel
def _before(t, basis, i, other, entering, k, noise):
    """Whether row i leaves the basis before another one: smaller ratio, covering variable, lexicographic order."""
    last, a, b = 2 * k + 1, t[i, entering], t[other, entering]
    tie = max(PIVOT * a * b, noise * (a + b))
    difference = t[i, last] * b - t[other, last] * a
    if abs(difference) > tie:
        return difference < 0.0
    if basis[i] == 2 * k or basis[other] == 2 * k:
        return basis[i] == 2 * k
    for j in range(k):
        difference = t[i, j] * b - t[other, j] * a
        if abs(difference) > tie:
            return difference < 0.0
    return False
