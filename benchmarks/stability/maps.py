"""Maps of failure over two numbers, with the edge that bisection finds and the analytic limit.

Each map is a grid of runs: 1 where the method fails (or the share of what it misses), 0 where it does not.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh

from benchmarks.stability import scenes
from benchmarks.stability.macro_step import largest_stable
from vanedamp.coupling.simulation import simulate

#: exchanges and orders of extrapolation of a co-simulation, by the name of their map
CO_SIMULATIONS = {
    f"co-simulation, {name}, hold {hold}": (exchange, hold)
    for name, exchange in (("Jacobi", "jacobi"), ("Gauss-Seidel", "gauss_seidel"))
    for hold in (0, 1)
}


@dataclass(frozen=True)
class MapEffort:
    """Points of a grid across and up, phases behind a share, modes of the rod."""

    across: int = 9
    up: int = 15
    phases: int = 40
    modes: tuple[int, ...] = (0, 1, 2, 3, 5, 7, 10, 15, 20)


#: x, y to whether a run fails, and to the share of runs that do
Fails = Callable[[float, float], bool]
Share = Callable[[float, float], float]


def contact_map(effort: MapEffort) -> dict[str, Any]:
    """Map central differences, step against stiffness of a contact: 2 / omega_max of the pair on its spring."""
    mass, stiffnesses = 0.1, (2 * math.pi) ** 2 * np.geomspace(20, 5000, effort.across)

    def limit(stiffness: float) -> float:
        matrix = np.array([[(2 * math.pi) ** 2 + stiffness, -stiffness], [-stiffness, stiffness]])
        return 2 / math.sqrt(eigvalsh(matrix, np.diag([1.0, mass]))[-1])

    def fails(stiffness: float, step: float) -> bool:
        tables = scenes.pressed(mass, stiffness, restitution=1.0)
        return scenes.bounces(tables, {"method": "penalty"}, mass / stiffness, math.floor(1 / step))

    limits = np.array([limit(stiffness) for stiffness in stiffnesses])
    grid = _map(stiffnesses, limits, fails, effort)
    return grid | {"x_label": "contact stiffness, N/m", "y_label": "step, periods"}


def friction_map(effort: MapEffort) -> dict[str, Any]:
    """Map regularised friction, step against slip speed: 2 v_reg m* / (mu N)."""
    mass, speeds = 0.1, np.geomspace(1e-3, 1e-1, effort.across)
    limits = 2 * speeds * mass / (1 + mass)

    def fails(slow: float, step: float) -> bool:
        return scenes.unsteady(mass, slow, math.floor(1 / step))

    grid = _map(speeds, limits, fails, effort)
    return grid | {"x_label": "slip speed of the regularisation, m/s", "y_label": "step, periods"}


def cosimulation_map(effort: MapEffort, exchange: str, hold: int) -> dict[str, Any]:
    """Map co-simulation, macro-step against ratio of masses: spectral radius of the linear macro-step."""
    masses = np.geomspace(0.4, 4, effort.across)
    pairs = {float(mass): scenes.coupled_pair(float(mass)) for mass in masses}
    limits = np.array([largest_stable(mass, *pair[1:], exchange, hold) for mass, pair in pairs.items()])
    solver = {"method": "cosim", "exchange": exchange, "hold": hold, "substeps": 40}

    def fails(mass: float, step: float) -> bool:
        tables, stiffness, _ = pairs[float(mass)]
        return scenes.restless(tables, solver, mass / stiffness, math.floor(1 / step))

    grid = _map(masses, limits, fails, effort)
    return grid | {"x_label": "mass of the body / mass of the structure", "y_label": "macro-step, periods"}


def missed_map(effort: MapEffort) -> dict[str, Any]:
    """Map the share of touches that a search by signs at step ends misses, step against closing speed.

    The wall is beyond the resting body for asin(speed) / pi periods; steps shorter than that miss nothing.
    missed_by_exact: touches that the exact engine misses.
    """
    speeds = np.geomspace(0.05, 0.6, effort.across)
    limits = np.arcsin(speeds) / math.pi
    exact = [0]

    def share(speed: float, step: float) -> float:
        touch = math.asin(speed) / math.pi
        lost = 0
        for turn in range(effort.phases):
            shift = turn / effort.phases * step
            lost += scenes.steps_over(scenes.touching(touch), step, shift)
        return lost / effort.phases

    for speed in speeds:
        response = simulate(scenes.touching(math.asin(speed) / math.pi))
        exact[0] += response.counters["impacts"] == 0
    grid = _map(speeds, limits, lambda speed, step: share(speed, step) > 0, effort, share)
    return grid | {
        "x_label": "closing speed / largest speed of the wall", "y_label": "step, periods", "missed_by_exact": exact[0]
    }  # fmt: skip


def newton_map(effort: MapEffort) -> dict[str, Any]:
    """Map the momentum of the first impact on a rod by Newton's law, relative to that of the rod without modes.

    Edge: the mass of the body from which on less than half is left; limit: the same from the contact's mass,
    1/3 - sum 2/(k pi)^2.
    """
    from benchmarks.methods.scenes import rod

    masses = np.geomspace(0.003, 3, effort.up)
    contact = [1 / 3 - sum(2 / (k * math.pi) ** 2 for k in range(1, n + 1)) for n in effort.modes]
    with tempfile.TemporaryDirectory() as folder:
        files = {n: str(rod(Path(folder), n)) for n in {0, *effort.modes}}

        def left(modes: int, mass: float) -> float:
            ours, rigid = (scenes.first_impulse(scenes.against_rod(files[n], mass, "newton")) for n in (modes, 0))
            return ours / rigid

        value = np.array([[left(n, float(mass)) for n in effort.modes] for mass in masses])
        # m* falls to half of that without modes at a body of m_0 m_n / (m_0 - 2 m_n)
        limit = [contact[0] * m / (contact[0] - 2 * m) if contact[0] > 2 * m else math.nan for m in contact]

        def halved(modes: int, mass: float) -> bool:
            return left(modes, mass) < 0.5

        edge = [
            _bisect(partial(halved, n), bound / 3, bound * 3) if math.isfinite(bound) else math.nan
            for n, bound in zip(effort.modes, limit, strict=True)
        ]
    return {
        "x": list(effort.modes), "y": masses.tolist(), "value": value.tolist(), "edge": edge, "limit": limit,
        "x_label": "fixed-interface modes", "y_label": "mass of the body / mass of the rod",
    }  # fmt: skip


def _map(
    x: np.ndarray,
    limit: np.ndarray,
    fails: Fails,
    effort: MapEffort,
    value: Callable[[float, float], float] | None = None,
) -> dict[str, Any]:
    """Return a grid from a third of the lowest limit to three times the highest, and the edge in every column."""
    finite = limit[np.isfinite(limit)]
    y = np.geomspace(finite.min() / 3, min(3 * finite.max(), 0.24), effort.up)
    shade = value or fails
    edge = [
        _bisect(partial(fails, float(a)), bound / 3, min(3 * bound, 0.24)) if math.isfinite(bound) else math.nan
        for a, bound in zip(x, limit, strict=True)
    ]
    return {
        "x": x.tolist(), "y": y.tolist(), "value": [[float(shade(float(a), float(b))) for a in x] for b in y],
        "edge": edge, "limit": limit.tolist(),
    }  # fmt: skip


def _bisect(fails: Callable[[float], bool], low: float, high: float) -> float:
    """Return where a method begins to fail between two numbers, to 0.5 %."""
    while high > 1.005 * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return math.sqrt(low * high)


#: maps by name: x (nx,), y (ny,), value (ny, nx), edge and limit (nx,), not finite where there is none
MAPS: dict[str, Callable[[MapEffort], dict[str, Any]]] = {
    "central differences, soft contact": contact_map,
    "regularised friction": friction_map,
    **{name: partial(cosimulation_map, exchange=e, hold=h) for name, (e, h) in CO_SIMULATIONS.items()},
    "missed impacts": missed_map,
    "Newton's law on a rod": newton_map,
}
