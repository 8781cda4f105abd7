"""The macro-step of a co-simulation as a matrix: a structure of one mode, and a body on a spring and a dashpot at it.

Its spectral radius is the analytic limit of stability, for both exchanges and both orders of extrapolation, derived
apart from coupling.methods.cosimulation: the bodies' unit is taken to be exact.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm

from benchmarks.stability.scenes import DAMPING

#: structure's place and speed, its speed a macro-step ago, the body's place and speed, last and older mean force
_P, _V, _BEFORE, _X, _U, _LAST, _OLDER = range(7)


def macro_step(h: float, mass: float, stiffness: float, dashpot: float, exchange: str, hold: int) -> np.ndarray:
    """Return the matrix (7, 7) of a macro-step h (s): unit mass on a spring of (2 pi)^2 N/m, body of `mass` (kg)."""
    slope = np.zeros(7)
    if hold == 1:
        slope[_LAST], slope[_OLDER] = 1 / h, -1 / h
    constant = np.eye(7)[_LAST] + 0.5 * h * slope  # the mean belongs to the middle of the last macro-step
    rate = np.zeros((4, 4))
    rate[0, 1], rate[1], rate[2, 3] = 1.0, [-((2 * math.pi) ** 2), -DAMPING, 1.0, 0.0], 1.0
    place, speed = expm(rate * h)[:2] @ np.array([np.eye(7)[_P], np.eye(7)[_V], constant, slope])
    # the wall as the body knows it: its place, its speed and the change of that
    start, now, bend = np.eye(7)[_P], np.eye(7)[_V], np.zeros(7)
    if hold == 1:
        bend = (speed - now if exchange == "gauss_seidel" else now - np.eye(7)[_BEFORE]) / h
    elif exchange == "gauss_seidel":
        now = (place - start) / h
    body = np.zeros((6, 6))  # x, x', wall's place, speed, bend, integral of the force on the structure
    body[0, 1] = body[2, 3] = body[3, 4] = 1.0
    body[5, :4] = [stiffness, dashpot, -stiffness, -dashpot]
    body[1] = -body[5] / mass
    moved = expm(body * h) @ np.array([np.eye(7)[_X], np.eye(7)[_U], start, now, bend, np.zeros(7)])
    return np.array([place, speed, np.eye(7)[_V], moved[0], moved[1], moved[5] / h, np.eye(7)[_LAST]])


def largest_stable(mass: float, stiffness: float, dashpot: float, exchange: str, hold: int) -> float:
    """Return the macro-step (s) at which the spectral radius first passes one; inf if not below half a period."""
    steps = np.geomspace(1e-4, 0.5, 4000)
    for h in steps:
        matrix = macro_step(float(h), mass, stiffness, dashpot, exchange, hold)
        if np.abs(np.linalg.eigvals(matrix)).max() > 1 + 1e-9:
            return float(h)
    return math.inf
