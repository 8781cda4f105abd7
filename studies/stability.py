"""Where methods fail: measured edges of failure beside the analytic limits, where there are any.

Each part takes scenes that differ in one number, runs the method, and finds by bisection where it begins to fail.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh, expm

from coupling.engine import simulate
from coupling.inputs import validate
from coupling.response import Status
from coupling.rows import rows_of
from coupling.scene import Scene
from coupling.structure import linear_structure
from modal.store import write_csv, write_json
from studies.terminal import progress
from studies.timing import machine

#: excitation periods are the unit of time; nothing is excited, so that what grows is the method's doing
_STRUCTURE = {"model": "rigid", "mass": 1.0, "stiffness": (2 * math.pi) ** 2, "damping": 0.0}
_LONG = 40


@dataclass(frozen=True)
class Effort:
    """Points of a map and runs behind a point."""

    points: int
    runs: int
    modes: tuple[int, ...]


FULL = Effort(9, 40, (0, 1, 2, 5, 10, 20, 50))
QUICK = Effort(2, 4, (0, 1, 2))


def run_stability(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure; write stability.json, .csv and a figure into a folder. Returns what the JSON holds."""
    started = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    parts: dict[str, Callable[[Effort], dict[str, Any]]] = {
        "explicit": explicit_limit,
        "contact pair": contact_limit,
        "friction": friction_limit,
        "co-simulation": cosimulation_limit,
        "contact energy": contact_energy,
        "missed impacts": missed_impacts,
        "restitution": restitution_and_modes,
        "chatter": chatter_end,
    }
    result: dict[str, Any] = {"machine": machine(), "effort": asdict(effort), "parts": {}}
    with progress("stability") as report:
        for done, (name, part) in enumerate(parts.items()):
            report(done, len(parts))
            result["parts"][name] = part(effort)
    result["wall_time_s"] = time.perf_counter() - started
    write_json(folder / "stability.json", result)
    points = (
        (name, curve, x, y)
        for name, part in result["parts"].items()
        for curve, values in part["curves"].items()
        for x, y in zip(part["x"], values, strict=True)
    )
    write_csv(folder / "stability.csv", ("part", "curve", "x", "y"), points)
    from studies.method_figures import stability_figure

    stability_figure(result, folder / "stability.png")
    return result


def tell(result: Mapping[str, Any]) -> None:
    """Print how far each measured edge lies from its limit."""
    for name, part in result["parts"].items():
        if "limit" in part["curves"]:
            ratio = np.array(part["curves"]["measured"]) / np.array(part["curves"]["limit"])
            print(f"{name:16} measured / analytic limit {ratio.min():.3f} to {ratio.max():.3f}")
        else:
            print(f"{name:16} {part['summary']}")


def explicit_limit(effort: Effort) -> dict[str, Any]:
    """Central differences: largest stable step against the structure's frequency; limit 2 / omega."""
    ratios = np.geomspace(15, 120, effort.points)
    measured = []
    for ratio in ratios:
        data = _data(structure=_STRUCTURE | {"stiffness": (2 * math.pi * ratio) ** 2}, initial={"displacement": 1.0})
        measured.append(_step(partial(_diverges, data, {"method": "penalty"}), math.pi * ratio))
    return _part(
        "frequency of the structure, 1/period", "step, periods", ratios, measured, 1 / (math.pi * ratios), log=True
    )


def contact_limit(effort: Effort) -> dict[str, Any]:
    """Central differences, a body pressed on a soft wall: limit 2 / omega_max of the pair on its spring."""
    masses, measured, limits = np.geomspace(0.01, 3, effort.points), [], []
    for mass in masses:
        stiffness = (2 * math.pi * 20) ** 2
        data = _pressed(mass, stiffness, restitution=1.0)
        spring = (2 * math.pi) ** 2
        matrix = np.array([[spring + stiffness, -stiffness], [-stiffness, stiffness]])
        limits.append(2 / math.sqrt(eigvalsh(matrix, np.diag([1.0, mass]))[-1]))
        check = partial(_bounces, data, {"method": "penalty"}, mass / stiffness)
        measured.append(_step(check, 1 / limits[-1]))
    return _part("mass of the body / mass of the structure", "step, periods", masses, measured, limits, log=True)


def friction_limit(effort: Effort) -> dict[str, Any]:
    """Regularised friction: least slip speed at which a body comes to rest; limit mu N dt / (2 m*)."""
    masses, measured, limits = np.geomspace(0.01, 3, effort.points), [], []
    for mass in masses:
        limits.append(0.5 / 1000 * (1 + 1 / mass))

        def unsteady(slow: float, mass: float = mass) -> bool:
            data = _data(
                gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 1e3}],
                damper=[{"cavity": "c", "mass": mass, "friction": 1.0, "normal_load": 1.0, "velocity": 0.2 * slow}],
                time={"periods": 1, "transient": 0},
            )  # fmt: skip
            solver = {"method": "penalty", "steps_per_period": 1000, "slip_velocity": slow}
            slip = simulate(_scene(data, solver), samples_per_period=1000).body_displacement[-50:, 0]
            return bool(1000 * np.abs(np.diff(slip)).max() > 0.2 * slow)

        low, high = limits[-1] / 3, limits[-1] * 3
        for _ in range(20):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if unsteady(middle) else (low, middle)
        measured.append(high)
    return _part("mass of the body / mass of the structure", "slip speed, m/s", masses, measured, limits, log=True)


def cosimulation_limit(effort: Effort) -> dict[str, Any]:
    """Jacobi co-simulation, forces and speeds held: largest stable macro-step against the ratio of masses.

    The limit is where the spectral radius of the linear macro-step (a body on its spring and dashpot, a structure under
    the mean force of the last macro-step) passes one.
    """
    masses, measured, limits = np.geomspace(0.3, 4, effort.points), [], []
    for mass in masses:
        stiffness = _contact_stiffness(mass)
        data = _pressed(mass, stiffness, restitution=0.7)
        data["structure"] = _STRUCTURE | {"damping": 0.5}
        scene = _scene(data, {})
        rows, _, _ = rows_of(scene, linear_structure(scene))
        limits.append(_macro_step(mass, stiffness, float(rows.dashpot[-2])))
        solver = {"method": "cosim", "exchange": "jacobi", "hold": 0, "substeps": 40}
        measured.append(_step(partial(_bounces, data, solver, mass / stiffness), 1 / limits[-1]))
    return _part("mass of the body / mass of the structure", "macro-step, periods", masses, measured, limits, log=True)


def _macro_step(mass: float, stiffness: float, dashpot: float) -> float:
    """The largest stable macro-step by the spectral radius, s."""

    def radius(h: float) -> float:
        # bodies: x, x', wall w, w' (held), integral of the force; structure: p, p', force (held)
        body = np.zeros((5, 5))
        body[0, 1] = body[2, 3] = 1.0
        body[4, :4] = np.array([stiffness, dashpot, -stiffness, -dashpot])
        body[1] = -body[4] / mass
        structure = np.array([[0.0, 1.0, 0.0], [-((2 * math.pi) ** 2), -0.5, 1.0], [0.0, 0.0, 0.0]])
        one, two = expm(body * h), expm(structure * h)
        step = np.zeros((5, 5))  # p, p', x, x', force on the structure
        step[:2, [0, 1, 4]] = two[:2]
        for row, source in ((2, one[0]), (3, one[1]), (4, one[4] / h)):
            step[row, [2, 3, 0, 1]] = source[:4]
        return float(np.abs(np.linalg.eigvals(step)).max())

    steps = np.geomspace(1e-4, 0.5, 4000)
    first = next((i for i, h in enumerate(steps) if radius(h) > 1 + 1e-9), len(steps) - 1)
    return float(steps[first])


def contact_energy(effort: Effort) -> dict[str, Any]:
    """Rebound of an elastic collision (restitution 1) by penalty methods, against steps in the contact.

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
    data = _data(
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 4.0}],
        structure={"model": "rigid", "mass": 1e9, "stiffness": 1.0, "damping": 0.0},
        damper=[{"cavity": "c", "mass": 1.0, "restitution": 1.0, "velocity": speed, "position": shift * speed / steps}],
        time={"periods": 1, "transient": 0},
    )  # fmt: skip
    # two metres to the wall at 10 m/s: one collision in the first 0.4 s
    scene = _scene(data, dict(options) | {"steps_per_period": steps, "penetration": 0.5})
    response = simulate(scene, samples_per_period=1000)
    way = response.body_displacement[:, 0]
    return float(abs(way[390] - way[380]) / (10 * speed / steps))


def missed_impacts(effort: Effort) -> dict[str, Any]:
    """Share of short contacts that solve_ivp steps over, against their duration in steps; none beyond one step."""
    ratios = np.linspace(0.1, 1.3, max(2 * effort.points - 1, 3))
    missed, exact = [], []
    for ratio in ratios:
        lost, flawless = 0, 0
        for turn in range(effort.runs):
            steps = 20 + 4 * turn / effort.runs  # not a whole number of them to the first touch
            touch = ratio / steps  # periods that the wall is beyond the resting body
            depth = 1 - math.cos(math.pi * touch)
            data = _data(
                structure={"model": "prescribed", "displacement_amplitude": 1.0}, gravity={"acceleration": 0.0},
                cavity=[{"name": "c", "gap": 2 * (1 - depth)}],
                damper=[{"cavity": "c", "mass": 1.0, "restitution": 0.5, "velocity": -2 * math.pi}],
                excitation={"frequency": 1.0}, time={"periods": 1, "transient": 0},
            )  # fmt: skip
            scene = _scene(data, {})
            flawless += simulate(scene).counters["impacts"] == 0
            tried = _steps_over(scene, 1 / steps)
            lost += tried
        missed.append(lost / effort.runs)
        exact.append(flawless / effort.runs)
    return {
        "x_label": "duration of the touch / step", "y_label": "share of impacts missed", "x": ratios.tolist(),
        "curves": {"sign at step ends (DOP853)": missed, "exact engine": exact, "1 - duration / step":
                   np.maximum(1 - ratios, 0).tolist()},
        "log": False, "summary": f"touches of half a step: {100 * float(np.interp(0.5, ratios, missed)):.0f} % missed",
    }  # fmt: skip


def _steps_over(scene: Scene, step: float) -> bool:
    """Whether scipy's event search with steps of that length misses the first touch of the wall and the body."""
    from scipy.integrate import solve_ivp

    half = scene.cavity[0].gap / 2

    def gap(t: float, y: np.ndarray) -> float:
        return float(half - abs(y[0] - math.sin(2 * math.pi * t)))

    def motion(_t: float, _y: np.ndarray) -> list[float]:
        return [0.0]

    found = solve_ivp(motion, (0.0, 0.5), [0.0], "DOP853", events=gap, max_step=step, first_step=step, rtol=1e-3)
    return not len(found.t_events[0])


def restitution_and_modes(effort: Effort) -> dict[str, Any]:
    """A body against the tip of a clamped rod: contact mass and speed after one impact against the number of modes."""
    from studies.method_scenes import rod

    limit: list[float] = []
    measured: list[float] = []
    newton: list[float] = []
    compliant: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for count in effort.modes:
            file = rod(Path(folder), count)
            data: dict[str, Any] = {
                "structure": {"model": "rom", "file": str(file)}, "excitation": {"frequency": 1.0, "at": "tip"},
                "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 0.2, "floor": "tip"}],
                "damper": [{"cavity": "c", "mass": 0.1, "restitution": 0.7, "velocity": 1.0}],
                "time": {"periods": 1, "transient": 0},
            }  # fmt: skip
            scene = _scene(data, {})
            rows, _, _ = rows_of(scene, linear_structure(scene))
            measured.append(float(1 / (rows.floor[0] ** 2).sum()))
            k = np.arange(1, count + 1)
            limit.append(float(1 / 3 - (2 / (k * math.pi) ** 2).sum()))  # Schur complement of the tip's mass
            for law, values in (("newton", newton), ("compliant", compliant)):
                table = {"law": law} | ({"stiffness": 20.0} if law == "compliant" else {})
                response = simulate(_scene(data | {"contact": table}, {}), events=True)
                values.append(float(_momentum(response)))
    return {
        "x_label": "fixed-interface modes", "y_label": "contact mass; momentum given in the first impact",
        "x": [float(count) for count in effort.modes], "log": False, "summary":
        f"momentum of the first impact, {effort.modes[0]} to {effort.modes[-1]} modes: Newton {newton[0]:.3g} to "
        f"{newton[-1]:.3g}, compliant {compliant[0]:.3g} to {compliant[-1]:.3g}",
        "curves": {"limit": limit, "measured": measured, "Newton's law": newton, "compliant": compliant},
    }  # fmt: skip


def _momentum(response: Any) -> float:
    return abs(next(event.impulse for event in response.event_list if event.kind == "impact"))


def chatter_end(effort: Effort) -> dict[str, Any]:
    """A ball dropped on a plate at rest: end of its chatter against restitution; limit t0 (1 + k) / (1 - k)."""
    restitutions = np.linspace(0.2, 0.9, effort.points)
    measured, limits, events = [], [], []
    height, gravity = 0.01, 9.81
    for k in restitutions:
        data = _data(
            structure={"model": "prescribed", "displacement_amplitude": 1e-12}, excitation={"frequency": 0.5},
            gravity={"acceleration": gravity, "orientation_deg": 90.0}, cavity=[{"name": "c", "gap": 1.0}],
            damper=[{"cavity": "c", "mass": 1.0, "restitution": float(k), "position": -0.5 + height}],
            time={"periods": 1, "transient": 0},
        )  # fmt: skip
        response = simulate(_scene(data, {}), events=True)
        measured.append(max(event.time for event in response.event_list if event.kind == "impact"))
        limits.append(math.sqrt(2 * height / gravity) * (1 + k) / (1 - k))
        solver = {"method": "solve_ivp", "complete_chatter": False, "max_events": 200}
        events.append(simulate(_scene(data, solver)).status.value)
    part = _part("restitution", "end of the chatter, s", restitutions, measured, limits, log=False)
    return part | {"without_completion": events}


# -- helpers


def _data(**changes: Any) -> dict[str, Any]:
    common = {"structure": _STRUCTURE, "excitation": {"frequency": 1.0}, "time": {"periods": _LONG, "transient": 0}}
    return common | changes


def _scene(data: Mapping[str, Any], solver: Mapping[str, Any]) -> Scene:
    return validate(Scene, dict(data) | ({"solver": dict(solver)} if solver else {}), "scene")


def _contact_stiffness(mass: float) -> float:
    """A contact with a frequency of 30 a period."""
    return (2 * math.pi * 30) ** 2 / (1 + 1 / mass)


def _pressed(mass: float, stiffness: float, restitution: float) -> dict[str, Any]:
    """A body that gravity of 1 m/s^2 presses on the wall."""
    return _data(
        gravity={"acceleration": 1.0, "orientation_deg": 90.0}, cavity=[{"name": "c", "gap": 1e3}],
        contact={"law": "compliant", "stiffness": stiffness},
        damper=[{"cavity": "c", "mass": mass, "restitution": restitution, "position": -500.0}],
    )  # fmt: skip


def _diverges(data: Mapping[str, Any], solver: Mapping[str, Any], steps: int) -> bool:
    response = simulate(_scene(data, dict(solver) | {"steps_per_period": steps}))
    return response.status is Status.DIVERGED or response.amplitude_max > 1e3


def _bounces(data: Mapping[str, Any], solver: Mapping[str, Any], static: float, steps: int) -> bool:
    """Whether the body leaves its wall by more than three times its static compression, or the run fails."""
    response = simulate(_scene(data, dict(solver) | {"steps_per_period": steps}))
    if response.status not in (Status.OK, Status.ENERGY):
        return True
    return bool((response.slip[1:, 0] + 500.0).max() > 3 * static)


def _step(fails: Callable[[int], bool], guess: float) -> float:
    """The largest step, in periods, of a whole number of which a period consists and which does not fail."""
    low, high = max(int(guess / 3), 4), int(3 * guess) + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fails(middle) else (low, middle)
    return 1 / high


def _part(x_label: str, y_label: str, x: Any, measured: list[float], limit: Any, log: bool) -> dict[str, Any]:
    curves = {"measured": [float(value) for value in measured], "limit": [float(value) for value in limit]}
    return {"x_label": x_label, "y_label": y_label, "x": [float(v) for v in x], "curves": curves, "log": log}
