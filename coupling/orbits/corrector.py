"""Newton's method near a predicted orbit of a branch, with few iterations: a shorter step is better than many."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus, Point, Problem, solve

#: corrections of a point before its step is shortened
ITERATIONS, HALVINGS = 8, 3


def corrected(problem: Problem, head: Point, step: float) -> Orbit | None:
    """Return the orbit in the plane normal to the tangent, at a distance along it; None if there is none near."""
    return near(problem, head.y + step * head.tangent, head.tangent, head.slope, abs(step))


def near(problem: Problem, predicted: np.ndarray, row: np.ndarray, slope: np.ndarray, distance: float) -> Orbit | None:
    """Return the orbit in the plane through a point; with the slope there, if the one given does not serve."""
    for renewed in (False, True):
        if renewed:
            if (passage := problem.passage(predicted)) is None:
                return None
            slope = problem.slope(predicted, passage)
        orbit = solve(problem, predicted, row, slope, ITERATIONS, HALVINGS)
        problem.count["iterations"] += orbit.iterations
        if orbit.status is OrbitStatus.OK:
            off = np.linalg.norm(problem.pack(orbit.state, orbit.parameter) - predicted)
            return orbit if off <= distance else None
    return None
