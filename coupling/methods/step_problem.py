"""The small complementarity problem of a time step: the rows that take part in it, and its solution."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.complementarity import solve_box


@inlined
def list_row(problem, listed, mobility, count, r, free, low, high, soft):
    """Enter row r as number `count`: its motion without forces, bounds of its force, compliance of its own."""
    listed[count] = r
    problem.b[count] = free
    problem.low[count], problem.high[count], problem.forced[count] = low, high, 0
    for a in range(count + 1):
        problem.matrix[count, a] = mobility[r, listed[a]]
        problem.matrix[a, count] = problem.matrix[count, a]
    problem.matrix[count, count] += soft


@kernel
def solve_rows(problem, count):
    """Solve the problem, of a single row in closed form. Return whether there is a solution."""
    if count > 1:
        return solve_box(problem, count, 0.0)
    problem.force[0] = min(max(-problem.b[0] / problem.matrix[0, 0], problem.low[0]), problem.high[0])
    return True
