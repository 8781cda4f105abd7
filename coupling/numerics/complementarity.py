"""The complementarity problem of contact and friction, solved exactly.

Accelerations (or velocities) of rows are a = A f + b with A symmetric and positive semidefinite, and each force obeys

    a_i = 0 with low_i <= f_i <= high_i,    a_i > 0 with f_i = low_i,    a_i < 0 with f_i = high_i.

A contact has low = 0, high = inf; Coulomb friction at zero slip has low = -mu N, high = mu N (Pfeiffer and Glocker,
1996). The principal pivoting of Dantzig and of Baraff (1994) brings in one row after the other and never loses a
condition. Rows may depend on each other (a body that a wall and the floor's friction both hold): then accelerations
are unique, and one of the possible sets of forces is found.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import AT_HIGH, AT_LOW, DEPENDENT, FREE, OUT
from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.tolerances import DEPENDENCE, FORCE_ROUND_OFF

NONE = np.int64(-1)


@entry
def solve_box(problem, k, scale):
    """Solve the first k rows in place: forces, accelerations, and states FREE, AT_LOW, AT_HIGH or DEPENDENT.

    scale: size of the terms that b is the sum of, which sets the round-off.
    problem.forced: 0, or AT_LOW / AT_HIGH for a row whose force has just reached that bound on its way out: it stays
    there unless its acceleration then contradicts (forced becomes 0). Rows found at a bound without acceleration are
    marked likewise.
    DEPENDENT rows are at rest because FREE rows hold them; their force keeps a value within its bounds.
    Returns False if the budget of pivots is spent (a safeguard: positive semidefinite problems end).
    """
    a, state, forced = problem.acceleration, problem.state, problem.forced
    tolerance = FORCE_ROUND_OFF * _begin(problem, k, scale)
    for i in range(k):
        if state[i] == OUT and not _drive(problem, k, i, tolerance):
            return False
    for i in range(k):
        # a row forced to its bound stays there only while its acceleration agrees
        if forced[i] != 0 and _leaves(state[i], a[i], tolerance):
            forced[i], state[i] = 0, OUT
            if not _drive(problem, k, i, tolerance):
                return False
    for i in range(k):
        # the rows that held it may have gone to their bounds
        if state[i] == DEPENDENT and not _dependent(problem, k, i):
            state[i] = FREE
    for i in range(k):
        if state[i] != FREE and abs(a[i]) <= tolerance:
            if _dependent(problem, k, i):
                state[i] = DEPENDENT
            elif state[i] != DEPENDENT:
                forced[i] = state[i]
    return True


@kernel
def _begin(problem, k, scale):
    """Set forces, states and accelerations with forced rows at their bounds. Return the size of the accelerations."""
    f, a, state, forced = problem.force, problem.acceleration, problem.state, problem.forced
    for i in range(k):
        f[i], state[i] = 0.0, OUT
        if forced[i] == AT_LOW:
            f[i], state[i] = problem.low[i], AT_LOW
        elif forced[i] == AT_HIGH:
            f[i], state[i] = problem.high[i], AT_HIGH
    for i in range(k):
        a[i] = problem.b[i]
        for j in range(k):
            a[i] += problem.matrix[i, j] * f[j]
        scale = max(scale, abs(a[i]), abs(problem.b[i]))
    return scale


@kernel
def _drive(problem, k, i, tolerance):
    """Move f_i until row i obeys its condition, keeping the conditions of all rows that are in."""
    f, a, state = problem.force, problem.acceleration, problem.state
    df, da = problem.d_force, problem.d_acceleration
    if k == 1:
        return _drive_only(problem, tolerance)
    for _ in range(50 + 20 * k):
        if abs(a[i]) <= tolerance:
            state[i] = DEPENDENT if _dependent(problem, k, i) else FREE
            a[i] = 0.0
            return True
        way = 1.0 if a[i] < 0.0 else -1.0
        bound = problem.high[i] if way > 0.0 else problem.low[i]
        if f[i] == bound:
            state[i] = AT_HIGH if way > 0.0 else AT_LOW
            return True
        _respond(problem, k, i, way)
        step, stops, at_bound = _longest_step(problem, k, i, way, bound)
        if step == np.inf:
            return False
        for j in range(k):
            f[j] += step * df[j]
            a[j] += step * da[j]
        if not at_bound:
            state[stops], a[stops] = FREE, 0.0
        else:
            high = df[stops] > 0.0
            state[stops] = AT_HIGH if high else AT_LOW
            f[stops] = problem.high[stops] if high else problem.low[stops]
        if stops == i:
            return True
    return False


@kernel
def _drive_only(problem, tolerance):
    """Move the force of the only row until it obeys its condition, as `_drive` does, without its equations."""
    f, a, inverse_mass = problem.force[0], problem.acceleration[0], problem.matrix[0, 0]
    way = 1.0 if a < 0.0 else -1.0
    bound = problem.high[0] if way > 0.0 else problem.low[0]
    room = (bound - f) * way
    if abs(a) <= tolerance:
        problem.state[0] = FREE if inverse_mass > 0.0 else DEPENDENT
        a = 0.0
    elif inverse_mass > 0.0 and 0.0 < abs(a) / inverse_mass <= room:
        problem.state[0] = FREE
        f += way * (abs(a) / inverse_mass)
        a = 0.0
    else:
        problem.state[0] = AT_HIGH if way > 0.0 else AT_LOW
        if room == np.inf:
            return False
        if room > 0.0:
            f = bound
            a += room * way * inverse_mass
    problem.force[0], problem.acceleration[0] = f, a
    return True


@kernel
def _longest_step(problem, k, i, way, bound):
    """Return the step of f_i before a condition breaks, the row that stops it, and whether its force is at a bound."""
    f, a, state = problem.force, problem.acceleration, problem.state
    df, da = problem.d_force, problem.d_acceleration
    step, stops, at_bound = (bound - f[i]) * way, i, True
    if da[i] * way > 0.0 and -a[i] / da[i] <= step:
        step, at_bound = -a[i] / da[i], False
    for j in range(k):
        if j == i or state[j] == OUT:
            continue
        if state[j] == FREE:
            if df[j] != 0.0:
                room = ((problem.high[j] if df[j] > 0.0 else problem.low[j]) - f[j]) / df[j]
                if room < step:
                    step, stops, at_bound = max(room, 0.0), j, True
        elif state[j] == DEPENDENT:
            # a row that FREE rows held takes over at once when they no longer do
            if abs(da[j]) > DEPENDENCE * np.sqrt(problem.matrix[i, i] * problem.matrix[j, j]):
                step, stops, at_bound = 0.0, j, False
        elif problem.forced[j] == 0 and _leaves(state[j], da[j], 0.0):
            room = max(-a[j] / da[j], 0.0)
            if room < step and not _dependent_beside(problem, k, j, i):
                step, stops, at_bound = room, j, False
    return step, stops, at_bound


@inlined
def _leaves(state, acceleration, tolerance):
    """Whether the acceleration of a row at a bound, or its change, is one with which it does not stay there."""
    return (state == AT_LOW and acceleration < -tolerance) or (state == AT_HIGH and acceleration > tolerance)


@kernel
def _respond(problem, k, i, way):
    """Set the change of all forces and accelerations as f_i changes by `way` and FREE rows keep their acceleration."""
    df, da = problem.d_force, problem.d_acceleration
    for j in range(k):
        df[j] = 0.0
    df[i] = way
    count = _free_rows(problem, k, i, NONE)
    _solve(problem, count, i)
    for p in range(count):
        df[problem.free[p]] = -way * problem.solution[p]
    for j in range(k):
        da[j], size = 0.0, 0.0
        for l in range(k):
            da[j] += problem.matrix[j, l] * df[l]
            size += abs(problem.matrix[j, l] * df[l])
        if abs(da[j]) <= FORCE_ROUND_OFF * size:
            da[j] = 0.0  # a row that FREE rows hold would come in and go out for ever
    for p in range(count):
        da[problem.free[p]] = 0.0
    if da[i] * way <= DEPENDENCE * problem.matrix[i, i]:
        da[i] = 0.0


@kernel
def _free_rows(problem, k, but, also):
    """List the FREE rows except `but`, and the row `also` (NONE: none). Return their number."""
    count = 0
    for j in range(k):
        if j != but and (problem.state[j] == FREE or j == also):
            problem.free[count] = j
            count += 1
    return count


@kernel
def _dependent(problem, k, i):
    """Whether the FREE rows determine the acceleration of row i."""
    return _rest(problem, _free_rows(problem, k, i, NONE), i) <= DEPENDENCE * problem.matrix[i, i]


@kernel
def _dependent_beside(problem, k, j, i):
    """Whether the FREE rows together with row i determine the acceleration of row j."""
    also = NONE if _dependent(problem, k, i) else i
    return _rest(problem, _free_rows(problem, k, j, also), j) <= DEPENDENCE * problem.matrix[j, j]


@kernel
def _rest(problem, count, i):
    """Return the Schur complement of row i after the `count` listed free rows."""
    _solve(problem, count, i)
    rest = problem.matrix[i, i]
    for p in range(count):
        rest -= problem.matrix[i, problem.free[p]] * problem.solution[p]
    return rest


@kernel
def _solve(problem, count, i):
    """Solve A_ff x = A_fi for the listed free rows by Cholesky; they are independent by construction."""
    a_matrix, free, factor, x = problem.matrix, problem.free, problem.factor, problem.solution
    for p in range(count):
        for q in range(p + 1):
            total = a_matrix[free[p], free[q]]
            for l in range(q):
                total -= factor[p, l] * factor[q, l]
            factor[p, q] = np.sqrt(max(total, 1e-300)) if p == q else total / factor[q, q]
        total = a_matrix[free[p], i]
        for l in range(p):
            total -= factor[p, l] * x[l]
        x[p] = total / factor[p, p]
    for p in range(count - 1, -1, -1):
        total = x[p]
        for l in range(p + 1, count):
            total -= factor[l, p] * x[l]
        x[p] = total / factor[p, p]


@record
class Problem(NamedTuple):
    """A complementarity problem of up to r rows with the space to solve it."""

    # the problem
    matrix: Annotated[np.ndarray, "r r"]  # A
    b: Annotated[np.ndarray, "r"]  # accelerations without forces
    low: Annotated[np.ndarray, "r"]  # bounds of the forces
    high: Annotated[np.ndarray, "r"]
    forced: Annotated[np.ndarray, "r", int]  # bound that a force has just reached, or 0 (changed by the solution)
    restitution: Annotated[np.ndarray, "r"]  # of the contacts in an impact; the solution does not use it

    # its solution
    force: Annotated[np.ndarray, "r"]  # f
    acceleration: Annotated[np.ndarray, "r"]  # a
    state: Annotated[np.ndarray, "r", int]  # FREE, AT_LOW, AT_HIGH or DEPENDENT

    # scratch
    d_force: Annotated[np.ndarray, "r"]  # change of the forces in a pivot step
    d_acceleration: Annotated[np.ndarray, "r"]  # change of the accelerations
    free: Annotated[np.ndarray, "r", int]  # list of FREE rows
    factor: Annotated[np.ndarray, "r r"]  # Cholesky factor of their part of A
    solution: Annotated[np.ndarray, "r"]  # of a system of equations with it


def new_problem(r: int) -> Problem:
    """Return room for a complementarity problem of r rows."""
    return room(Problem, {"r": r})
