"""One arc of a motion by scipy's DOP853: from now to the first event, or to the end of a grid of times."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from vanedamp.coupling.methods.scipy_ivp.root_search import NODES, first_root


class Arc(NamedTuple):
    """Motion between two events: states (size, k) at the points t (k,) of the grid, and its end.

    event: index of the event function, None at the end of the grid; duration, last: time since the start, state there.
    """

    t: np.ndarray
    y: np.ndarray
    event: int | None
    duration: float
    last: np.ndarray
    evaluations: int
    failed: bool = False


def integrate(
    rate: Callable[[float, np.ndarray], np.ndarray], y: np.ndarray, time: float, grid: np.ndarray,
    watched: Callable[[np.ndarray, np.ndarray], np.ndarray], order: np.ndarray, tolerance: float,
    absolute: np.ndarray, first: float, step: float,
) -> Arc:  # fmt: skip
    """Return the motion from the state y (size,) at `time` to the first event, or to the end of the grid.

    watched: event functions (k, points) at times (points,) and states (size, points), which turn negative at events;
    order: (k,) of their zeros at the start; first, step: the first and the longest step, s.
    """
    far = grid - time
    solver = DOP853(
        lambda tau, y: rate(time + tau, y), 0.0, y, far[-1], max_step=step, rtol=tolerance, atol=absolute,
        first_step=min(first, far[-1]),
    )  # fmt: skip
    states, reached, root = [], 0, None
    while solver.status == "running" and root is None:
        solver.step()
        if solver.status == "failed":
            return Arc(grid[:0], y[:, None][:, :0], None, 0.0, y, solver.nfev, True)
        piece, now, last = solver.dense_output(), solver.t, solver.y
        if len(order):
            at = solver.t_old + NODES * (solver.t - solver.t_old)
            root = first_root(watched(time + at, piece(at)), order)
        if root is not None:
            now = solver.t_old + root[0] * (solver.t - solver.t_old)
            last = piece(now)
        # an event may fall on a point of the grid, which round-off must not leave out
        passed = np.count_nonzero((far <= now) | (grid <= time + now))
        states += [piece(tau) for tau in far[reached:passed]]
        order, reached = np.zeros_like(order), passed
    points = np.array(states).reshape(reached, len(y)).T
    return Arc(grid[:reached], points, None if root is None else root[1], now, last, solver.nfev)


def first_step(
    value: np.ndarray, slope: np.ndarray, curvature: np.ndarray, shortest: float, longest: float
) -> float:  # fmt: skip
    """Return twice the time to the first event by the functions' parabolas: round-off is that of the flight, s."""
    with np.errstate(all="ignore"):
        root = np.sqrt(slope**2 - 2 * curvature * value)
        times = np.where(slope > 0, -(slope + root) / curvature, 2 * value / (root - slope))
    times = times[np.isfinite(times) & (times > 0)]
    return float(np.clip(2 * times.min(initial=np.inf), shortest, longest))
