"""The small complementarity problem of a time step: the rows that take part in it, and its solution in three ways.

The speeds A f + b of the rows and their forces (or impulses) f obey the conditions of numerics.complementarity. The
force of another row may widen the bounds: low - mu f_N <= f <= high + mu f_N, Coulomb's law where f_N is the force of
the contact's normal. Without such rows, pivots solve the problem; with them, Lemke's method does (Glocker and Pfeiffer
1996). Projected Gauss-Seidel iteration (Jourdan, Alart and Jean 1998) solves both, one force after the other, and
has nothing in common with them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.numerics.complementarity import Problem, new_problem, solve_box
from vanedamp.coupling.numerics.linear_complementarity import Lemke, new_lemke, solve_lemke
from vanedamp.coupling.system.system import System

#: sweeps that an iteration may take
_SWEEPS = 100_000


@record
class StepProblem(NamedTuple):
    """A problem of up to k rows of the units (u,), with the space to solve it."""

    exact: bool | None  # None: by iteration; the compiler leaves the others out
    order: np.ndarray  # (u,) int: units in the order they enter
    mobility: np.ndarray  # (2u, 2u) of all rows
    row: np.ndarray  # (k,) int: the rows that take part
    now: np.ndarray  # (k,) their speeds without the unknown forces
    asked: np.ndarray  # (k,) what restitution adds, less than zero
    friction: np.ndarray  # (k,) mu
    normal: np.ndarray  # (k,) int: index of the row of f_N
    box: Problem
    lemke: Lemke | None  # None: no row widens the bounds of another, or by iteration
    place: np.ndarray  # (k,) int, scratch: first unknown of each row
    weight: np.ndarray  # (k,) scratch: size of its force, of size one in Lemke's method


def new_step_problem(system: System, mobility: np.ndarray, exact: bool = True) -> StepProblem:
    """Return room for the problem of all units of a system. mobility: (2u, 2u) of the rows."""
    u, k, coupled = len(system.rest), len(mobility), exact and bool(system.friction[: system.contacts].any())
    elements, contacts = np.arange(system.contacts, u), np.arange(system.contacts)
    return StepProblem(
        exact=exact or None,
        order=np.concatenate([elements, contacts] if exact else [contacts, elements]), mobility=mobility,
        row=np.zeros(k, np.int64), now=np.zeros(k), asked=np.zeros(k), friction=np.zeros(k),
        normal=np.zeros(k, np.int64), box=new_problem(k), lemke=new_lemke(2 * k) if coupled else None,
        place=np.zeros(k, np.int64), weight=np.zeros(k),
    )  # fmt: skip


@kernel
def list_row(problem, count, row, now, low, high, soft):
    """Enter a row as number `count`: its speed without forces, bounds of its force, compliance of its own."""
    box = problem.box
    problem.row[count], problem.now[count], problem.asked[count], problem.friction[count] = row, now, 0.0, 0.0
    box.low[count], box.high[count] = low, high
    for a in range(count + 1):
        box.matrix[count, a] = problem.mobility[row, problem.row[a]]
        box.matrix[a, count] = box.matrix[count, a]
    box.matrix[count, count] += soft


@kernel
def list_slip(system, problem, count, r, now, bound, had, soft):
    """Enter the slip of the contact whose normal is row number `count`. Return the number of the next row.

    bound, had: of its force by a normal force that has been applied already, and that friction; soft: compliance of the
    row.
    """
    if system.friction[r] == 0.0:
        return count + 1
    list_row(problem, count + 1, len(system.rest) + r, now, -bound - had, bound - had, soft)
    problem.friction[count + 1], problem.normal[count + 1] = system.friction[r], count
    return count + 2


@kernel
def solve_rows(problem, count, factor, tolerance):
    """Solve the problem of the first rows with a factor of restitution's speeds: box.force, box.acceleration.

    tolerance: by how much a sweep of the iteration may still change a speed, m/s. Returns False without a solution.
    """
    box = problem.box
    for a in range(count):
        box.b[a], box.forced[a] = problem.now[a] + factor * problem.asked[a], 0
    if count == 1:
        box.force[0] = min(max(-box.b[0] / box.matrix[0, 0], box.low[0]), box.high[0])
        box.acceleration[0] = box.b[0] + box.matrix[0, 0] * box.force[0]
        return True
    return _solve(problem, problem.exact, problem.lemke, count, tolerance)


@kernel
def _solve(problem, exact, lemke, count, tolerance):
    """Solve the problem of several rows in the way there is room for."""
    if exact is None:
        return _iterate(problem, count, tolerance)
    if lemke is None:
        return solve_box(problem.box, count, 0.0)
    return _solve_lemke(problem, lemke, count)


@kernel
def _iterate(problem, count, tolerance):
    """Solve the problem by projected Gauss-Seidel iteration. Returns False if it does not converge."""
    box = problem.box
    for a in range(count):
        box.force[a], box.acceleration[a] = 0.0, box.b[a]
    for _ in range(_SWEEPS):
        largest = 0.0
        for a in range(count):
            wide = 0.0
            if problem.friction[a] > 0.0:
                wide = problem.friction[a] * box.force[problem.normal[a]]
            diagonal = box.matrix[a, a]
            wanted = min(max(box.force[a] - box.acceleration[a] / diagonal, box.low[a] - wide), box.high[a] + wide)
            change = wanted - box.force[a]
            if change != 0.0:
                box.force[a] = wanted
                for c in range(count):
                    box.acceleration[c] += box.matrix[c, a] * change
            largest = max(largest, abs(change) * diagonal)
        if largest <= tolerance:
            return True
    return False


@kernel
def _solve_lemke(problem, lemke, count):
    """Solve the problem by Lemke's method, with one unknown for a normal and two for a row of two bounds.

    A normal has its force above the least. A row of two bounds has its force above the lower one, complementary to its
    speed to the right, and its speed to the left, complementary to the distance from the upper bound.
    """
    box, size, scale = problem.box, 0, 0.0
    for a in range(count):
        root = math.sqrt(box.matrix[a, a])
        problem.place[a], problem.weight[a] = size, 1.0 / root
        size += 1 if box.high[a] == math.inf else 2
        scale = max(scale, abs(box.b[a]) / root, abs(box.low[a]) * root)
    scale = scale if scale > 0.0 else 1.0
    for i in range(size):
        for j in range(size):
            lemke.matrix[i, j] = 0.0
    for a in range(count):
        i, weight, speed = problem.place[a], problem.weight[a], box.b[a]
        for c in range(count):
            element = box.matrix[a, c]
            speed += element * _least(problem, c)
            lemke.matrix[i, problem.place[c]] += weight * problem.weight[c] * element
            if problem.friction[c] > 0.0:
                normal = problem.normal[c]
                entry = weight * problem.weight[normal] * problem.friction[c] * element
                lemke.matrix[i, problem.place[normal]] -= entry
        lemke.q[i] = weight * speed / scale
        if box.high[a] < math.inf:
            room, wide, normal = box.high[a] - box.low[a], 2.0 * problem.friction[a], problem.normal[a]
            lemke.matrix[i, i + 1], lemke.matrix[i + 1, i] = 1.0, -1.0
            if wide > 0.0:
                lemke.matrix[i + 1, problem.place[normal]] = wide * problem.weight[normal] / weight
                room += wide * box.low[normal]
            lemke.q[i + 1] = room / (weight * scale)
    if not solve_lemke(lemke, size, 0):
        return False
    for a in range(count):
        box.force[a] = lemke.z[problem.place[a]] * problem.weight[a] * scale + box.low[a]
    for a in range(count):
        if problem.friction[a] > 0.0:
            box.force[a] -= problem.friction[a] * box.force[problem.normal[a]]
    for a in range(count):
        box.acceleration[a] = box.b[a]
        for c in range(count):
            box.acceleration[a] += box.matrix[a, c] * box.force[c]
    return True


@inlined
def _least(problem, a):
    """Return the force of a row where its and its normal's unknowns are zero."""
    least = problem.box.low[a]
    if problem.friction[a] > 0.0:
        least -= problem.friction[a] * problem.box.low[problem.normal[a]]
    return least
