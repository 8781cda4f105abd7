"""Where methods fail: measured edges of failure beside the analytic limits, where there are any.

Each part takes scenes that differ in one number, runs the method, and finds by bisection where it begins to fail.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.stability.macro_step import largest_stable
from benchmarks.stability.maps import MAPS, MapEffort
from benchmarks.stability.scenes import (
    STRUCTURE,
    against_rod,
    bounces,
    coupled_pair,
    data,
    first_impulse,
    pressed,
    restless,
    scene,
    steps_over,
    touching,
    unsteady,
)
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.store import finite, write_csv

#: about what a part takes for each of its points, and a map, s
_PART, _MAP = 1.0, 60.0


@dataclass(frozen=True)
class Stability(Benchmark):
    """Points of a curve, runs behind a point, modes of the rod; maps over two numbers, if any."""

    points: int
    runs: int
    modes: tuple[int, ...]
    maps: MapEffort | None = None

    NAME = FILES = "stability"
    COLUMNS = ("part", "curve", "x", "y")

    def rows(self, folder: Path) -> dict[str, Row]:
        found = {name: Row(_PART * self.points, partial(part, self), _edge) for name, part in _parts().items()}
        if self.maps is not None:
            found |= {_map_row(name): Row(_MAP, partial(make, self.maps)) for name, make in MAPS.items()}
        return found

    def result(self, values: Mapping[str, Any]) -> Result:
        result: Result = {"parts": {name: values[name] for name in _parts()}}
        if self.maps is not None:
            result["maps"] = {name: values[_map_row(name)] for name in MAPS}
        return dict(finite(result))

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        """Yield a line a point of a curve."""
        for name, part in result["parts"].items():
            for curve, values in part["curves"].items():
                yield from ((name, curve, x, y) for x, y in zip(part["x"], values, strict=True))

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        """Draw the curves; draw the maps and write their points."""
        from benchmarks.stability.figures import maps_figure, stability_figure

        stability_figure(result, folder / "stability.png")
        if "maps" in result:
            write_csv(folder / "stability_maps.csv", ("map", "x", "y", "value"), _points(result["maps"]))
            maps_figure(result["maps"], folder / "stability_maps.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield how far each measured edge lies from its limit."""
        yield from (f"{name:16} {_edge(part)}" for name, part in result["parts"].items())
        for name, mapped in result.get("maps", {}).items():
            ratio = np.array(mapped["edge"], float) / np.array(mapped["limit"], float)
            known = ratio[np.isfinite(ratio)]
            yield f"map of {name}: edge / analytic limit {known.min():.3f} to {known.max():.3f}, {len(known)} columns"


FULL = Stability(9, 40, (0, 1, 2, 5, 10, 20, 50), MapEffort())
QUICK = Stability(2, 4, (0, 1, 2))


def _parts() -> dict[str, Callable[[Stability], dict[str, Any]]]:
    return {
        "explicit": explicit_limit, "contact pair": contact_limit, "friction": friction_limit,
        "co-simulation": cosimulation_limit, "contact energy": contact_energy, "missed impacts": missed_impacts,
        "restitution": restitution_and_modes, "chatter": chatter_end,
    }  # fmt: skip


def _map_row(name: str) -> str:
    return f"map of {name}"


def _points(maps: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
    """Yield a line a point of a map."""
    for name, mapped in maps.items():
        for y, row in zip(mapped["y"], mapped["value"], strict=True):
            yield from ((name, x, y, value) for x, value in zip(mapped["x"], row, strict=True))


def _edge(part: Mapping[str, Any]) -> str:
    """Return what a part has found, in words."""
    if "limit" not in part["curves"]:
        return str(part["summary"])
    ratio = np.array(part["curves"]["measured"]) / np.array(part["curves"]["limit"])
    return f"measured / analytic limit {ratio.min():.3f} to {ratio.max():.3f}"


def explicit_limit(effort: Stability) -> dict[str, Any]:
    """Measure central differences: largest stable step against the structure's frequency; limit 2 / omega."""
    ratios = np.geomspace(15, 120, effort.points)
    measured = []
    for ratio in ratios:
        tables = data(structure=STRUCTURE | {"stiffness": (2 * math.pi * ratio) ** 2}, initial={"displacement": 1.0})
        measured.append(_step(partial(_diverges, tables, {"method": "penalty"}), math.pi * ratio))
    return _part(
        "frequency of the structure, 1/period", "step, periods", ratios, measured, 1 / (math.pi * ratios), log=True
    )


def contact_limit(effort: Stability) -> dict[str, Any]:
    """Measure central differences, a body pressed on a soft wall: limit 2 / omega_max of the pair on its spring."""
    masses, measured, limits = np.geomspace(0.01, 3, effort.points), [], []
    for mass in masses:
        stiffness = (2 * math.pi * 20) ** 2
        tables = pressed(mass, stiffness, restitution=1.0)
        spring = (2 * math.pi) ** 2
        matrix = np.array([[spring + stiffness, -stiffness], [-stiffness, stiffness]])
        limits.append(2 / math.sqrt(eigvalsh(matrix, np.diag([1.0, mass]))[-1]))
        check = partial(bounces, tables, {"method": "penalty"}, mass / stiffness)
        measured.append(_step(check, 1 / limits[-1]))
    return _part("mass of the body / mass of the structure", "step, periods", masses, measured, limits, log=True)


def friction_limit(effort: Stability) -> dict[str, Any]:
    """Measure regularised friction: least slip speed at which a body comes to rest; limit mu N dt / (2 m*)."""
    masses, measured, limits = np.geomspace(0.01, 3, effort.points), [], []
    for mass in masses:
        limits.append(0.5 / 1000 * (1 + 1 / mass))

        low, high = limits[-1] / 3, limits[-1] * 3
        for _ in range(20):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if unsteady(float(mass), middle, 1000) else (low, middle)
        measured.append(high)
    return _part("mass of the body / mass of the structure", "slip speed, m/s", masses, measured, limits, log=True)


def cosimulation_limit(effort: Stability) -> dict[str, Any]:
    """Measure Jacobi co-simulation, forces and speeds held: largest stable macro-step against the ratio of masses.

    The limit is where the spectral radius of the linear macro-step (a body on its spring and dashpot, a structure under
    the mean force of the last macro-step) passes one.
    """
    masses, measured, limits = np.geomspace(0.3, 4, effort.points), [], []
    for mass in masses:
        tables, stiffness, dashpot = coupled_pair(mass)
        limits.append(largest_stable(mass, stiffness, dashpot, "jacobi", 0))
        solver = {"method": "cosim", "exchange": "jacobi", "hold": 0, "substeps": 40}
        measured.append(_step(partial(restless, tables, solver, mass / stiffness), 1 / limits[-1]))
    return _part("mass of the body / mass of the structure", "macro-step, periods", masses, measured, limits, log=True)


def contact_energy(effort: Stability) -> dict[str, Any]:
    """Measure the rebound of an elastic collision (restitution 1) by penalty methods, against steps in the contact.

    Largest over where in a step the contact begins; above one, contact makes energy.
    """
    counts = np.unique(np.geomspace(4, 60, effort.points).astype(int)).astype(float)
    methods: dict[str, dict[str, Any]] = {
        "central differences": {"method": "penalty"},
        "Newmark": {"method": "penalty", "scheme": "newmark"},
        "HHT, alpha -0.1": {"method": "penalty", "scheme": "hht"},
    }
    curves = {}
    for name, options in methods.items():
        curves[name] = [
            max(_rebound(options | {"contact_steps": float(count)}, turn / effort.runs) for turn in range(effort.runs))
            for count in counts
        ]
    largest = max(max(values) for values in curves.values())
    return {
        "x_label": "steps in a contact", "y_label": "largest rebound / approach speed", "x": counts.tolist(),
        "curves": curves, "log": False,
        "summary": f"rebound of an elastic collision up to {largest:.4f} of its approach",
    }  # fmt: skip


def _rebound(options: Mapping[str, Any], shift: float) -> float:
    steps, speed = 1000, 10.0
    tables = data(
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 4.0}],
        structure={"model": "rigid", "mass": 1e9, "stiffness": 1.0, "damping": 0.0},
        damper=[{"cavity": "c", "mass": 1.0, "restitution": 1.0, "velocity": speed, "position": shift * speed / steps}],
        time={"periods": 1, "transient": 0},
    )  # fmt: skip
    # two metres to the wall at 10 m/s: one collision in the first 0.4 s
    thrown = scene(tables, dict(options) | {"steps_per_period": steps, "penetration": 0.5})
    response = simulate(thrown, samples_per_period=1000)
    way = response.body_displacement[:, 0]
    return float(abs(way[390] - way[380]) / (10 * speed / steps))


def missed_impacts(effort: Stability) -> dict[str, Any]:
    """Measure the share of short contacts that solve_ivp steps over, by their duration in steps; none beyond one."""
    ratios = np.linspace(0.1, 1.3, max(2 * effort.points - 1, 3))
    missed, exact = [], []
    for ratio in ratios:
        lost, flawless = 0, 0
        for turn in range(effort.runs):
            steps = 20 + 4 * turn / effort.runs  # not a whole number of them to the first touch
            touch = ratio / steps  # periods that the wall is beyond the resting body
            touched = touching(touch)
            flawless += simulate(touched).counters["impacts"] == 0
            tried = steps_over(touched, 1 / steps)
            lost += tried
        missed.append(lost / effort.runs)
        exact.append(flawless / effort.runs)
    return {
        "x_label": "duration of the touch / step", "y_label": "share of impacts missed", "x": ratios.tolist(),
        "curves": {"sign at step ends (DOP853)": missed, "exact engine": exact, "1 - duration / step":
                   np.maximum(1 - ratios, 0).tolist()},
        "log": False, "summary": f"touches of half a step: {100 * float(np.interp(0.5, ratios, missed)):.0f} % missed",
    }  # fmt: skip


def restitution_and_modes(effort: Stability) -> dict[str, Any]:
    """Measure contact mass and speed after one impact of a body on the tip of a clamped rod, by the number of modes."""
    from benchmarks.methods.scenes import rod

    limit: list[float] = []
    measured: list[float] = []
    newton: list[float] = []
    compliant: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for count in effort.modes:
            by_law = {law: against_rod(str(rod(Path(folder), count)), 0.1, law) for law in ("newton", "compliant")}
            system = assemble(by_law["newton"])
            measured.append(float(1 / (system.floor[0, : system.modes] ** 2).sum()))
            k = np.arange(1, count + 1)
            limit.append(float(1 / 3 - (2 / (k * math.pi) ** 2).sum()))  # Schur complement of the tip's mass
            newton.append(first_impulse(by_law["newton"]))
            compliant.append(first_impulse(by_law["compliant"]))
    return {
        "x_label": "fixed-interface modes", "y_label": "contact mass; momentum given in the first impact",
        "x": [float(count) for count in effort.modes], "log": False, "summary":
        f"momentum of the first impact, {effort.modes[0]} to {effort.modes[-1]} modes: Newton {newton[0]:.3g} to "
        f"{newton[-1]:.3g}, compliant {compliant[0]:.3g} to {compliant[-1]:.3g}",
        "curves": {"limit": limit, "measured": measured, "Newton's law": newton, "compliant": compliant},
    }  # fmt: skip


def chatter_end(effort: Stability) -> dict[str, Any]:
    """Measure the end of the chatter of a ball dropped on a plate, by restitution; limit t0 (1 + k) / (1 - k)."""
    restitutions = np.linspace(0.2, 0.9, effort.points)
    measured, limits, events = [], [], []
    height, gravity = 0.01, 9.81
    for k in restitutions:
        tables = data(
            structure={"model": "prescribed", "displacement_amplitude": 1e-12}, excitation={"frequency": 0.5},
            gravity={"acceleration": gravity, "orientation_deg": 90.0}, cavity=[{"name": "c", "gap": 1.0}],
            damper=[{"cavity": "c", "mass": 1.0, "restitution": float(k), "position": -0.5 + height}],
            time={"periods": 1, "transient": 0},
        )  # fmt: skip
        response = simulate(scene(tables, {}), events=True)
        measured.append(max(event.time for event in response.event_list if event.kind == "impact"))
        limits.append(math.sqrt(2 * height / gravity) * (1 + k) / (1 - k))
        solver = {"method": "solve_ivp", "complete_chatter": False, "max_events": 200}
        events.append(simulate(scene(tables, solver)).status.value)
    part = _part("restitution", "end of the chatter, s", restitutions, measured, limits, log=False)
    return part | {"without_completion": events}


def _diverges(tables: Mapping[str, Any], solver: Mapping[str, Any], steps: int) -> bool:
    response = simulate(scene(tables, dict(solver) | {"steps_per_period": steps}))
    return response.status is Status.DIVERGED or response.amplitude_max > 1e3


def _step(fails: Callable[[int], bool], guess: float) -> float:
    """Return the largest step, in periods, that divides a period and does not fail."""
    low, high = max(int(guess / 3), 4), int(3 * guess) + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fails(middle) else (low, middle)
    return 1 / high


def _part(x_label: str, y_label: str, x: Any, measured: list[float], limit: Any, log: bool) -> dict[str, Any]:
    curves = {"measured": [float(value) for value in measured], "limit": [float(value) for value in limit]}
    return {"x_label": x_label, "y_label": y_label, "x": [float(v) for v in x], "curves": curves, "log": log}
