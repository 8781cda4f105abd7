"""Scenes in which nothing is excited, so that what grows is the method's doing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import validate

#: one oscillation in a unit of time
STRUCTURE = {"model": "rigid", "mass": 1.0, "stiffness": (2 * math.pi) ** 2, "damping": 0.0}
#: of the structure that a co-simulation couples to a body, N s/m
DAMPING = 0.5
#: periods of a run
LONG = 40


def data(**changes: Any) -> dict[str, Any]:
    """Return the tables of a scene without excitation, with changes."""
    common = {"structure": STRUCTURE, "excitation": {"frequency": 1.0}, "time": {"periods": LONG, "transient": 0}}
    return common | changes


def scene(tables: Mapping[str, Any], solver: Mapping[str, Any]) -> Scene:
    """Return the scene of such tables with a [solver]."""
    return validate(Scene, dict(tables) | ({"solver": dict(solver)} if solver else {}), "scene")


def contact_stiffness(mass: float) -> float:
    """Return a contact with a frequency of 30 a period."""
    return (2 * math.pi * 30) ** 2 / (1 + 1 / mass)


def pressed(mass: float, stiffness: float, restitution: float) -> dict[str, Any]:
    """Return a body that gravity of 1 m/s^2 presses on a soft wall."""
    return data(
        gravity={"acceleration": 1.0, "orientation_deg": 90.0}, cavity=[{"name": "c", "gap": 1e3}],
        contact={"law": "compliant", "stiffness": stiffness},
        damper=[{"cavity": "c", "mass": mass, "restitution": restitution, "position": -500.0}],
    )  # fmt: skip


def bounces(tables: Mapping[str, Any], solver: Mapping[str, Any], static: float, steps: int) -> bool:
    """Say whether the body leaves its wall by more than three times its static compression, or the run fails."""
    response = simulate(scene(tables, dict(solver) | {"steps_per_period": steps}))
    if response.status not in (Status.OK, Status.ENERGY):
        return True
    return bool((response.slip[1:, 0] + 500.0).max() > 3 * static)


def coupled_pair(mass: float) -> tuple[dict[str, Any], float, float]:
    """Return tables of a structure and a body pressed on it; stiffness (N/m) and dashpot (N s/m) of their contact."""
    stiffness = contact_stiffness(mass)
    tables = pressed(mass, stiffness, restitution=0.7)
    tables["structure"] = STRUCTURE | {"damping": DAMPING}
    pair = scene(tables, {})
    return tables, stiffness, float(assemble(pair).dashpot[0])


def restless(tables: Mapping[str, Any], solver: Mapping[str, Any], static: float, steps: int) -> bool:
    """Say whether a body on a wall with a dashpot does not come to rest at its static compression, or the run fails."""
    response = simulate(scene(tables, dict(solver) | {"steps_per_period": steps}))
    if response.status not in (Status.OK, Status.ENERGY):
        return True
    return bool(np.abs(response.slip[-10:, 0] + 500.0 + static).max() > 0.5 * static)


def unsteady(mass: float, slow: float, steps: int) -> bool:
    """Say whether a body on a floor with regularised friction does not come to rest; slow: its slip speed, m/s."""
    tables = data(
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 1e3}],
        damper=[{"cavity": "c", "mass": mass, "friction": 1.0, "normal_load": 1.0, "velocity": 0.2 * slow}],
        time={"periods": 1, "transient": 0},
    )  # fmt: skip
    solver = {"method": "penalty", "steps_per_period": steps, "slip_velocity": slow}
    slip = simulate(scene(tables, solver), samples_per_period=steps).body_displacement[-50:, 0]
    return bool(steps * np.abs(np.diff(slip)).max() > 0.2 * slow)


def touching(touch: float) -> Scene:
    """Return a wall that is beyond a resting body for the share `touch` of a period."""
    depth = 1 - math.cos(math.pi * touch)
    tables = data(
        structure={"model": "prescribed", "displacement_amplitude": 1.0}, gravity={"acceleration": 0.0},
        cavity=[{"name": "c", "gap": 2 * (1 - depth)}],
        damper=[{"cavity": "c", "mass": 1.0, "restitution": 0.5, "velocity": -2 * math.pi}],
        excitation={"frequency": 1.0}, time={"periods": 1, "transient": 0},
    )  # fmt: skip
    return scene(tables, {})


def steps_over(touch: Scene, step: float, start: float = 0.0) -> bool:
    """Say whether scipy's event search with steps of that length misses the first touch of the wall and the body."""
    from scipy.integrate import solve_ivp

    half = touch.cavity[0].gap / 2

    def gap(t: float, y: np.ndarray) -> float:
        return float(half - abs(y[0] - math.sin(2 * math.pi * t)))

    def motion(_t: float, _y: np.ndarray) -> list[float]:
        return [0.0]

    solution = solve_ivp(motion, (start, 0.5), [0.0], "DOP853", events=gap, max_step=step, first_step=step, rtol=1e-3)
    return not len(solution.t_events[0])


def against_rod(file: str, mass: float, law: str) -> Scene:
    """Return a body of 1 m/s against the tip of a rod, a reduced model's file."""
    return scene(data(
        structure={"model": "rom", "file": file}, excitation={"frequency": 1.0, "at": "tip"},
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 0.2, "floor": "tip"}],
        damper=[{"cavity": "c", "mass": mass, "restitution": 0.7, "velocity": 1.0}],
        contact={"law": law} | ({"stiffness": 20.0} if law == "compliant" else {}),
        time={"periods": 1, "transient": 0},
    ), {})  # fmt: skip


def first_impulse(struck: Scene) -> float:
    """Return the momentum given in the first impact, N s."""
    response = simulate(struck, events=True)
    return abs(next(event.impulse for event in response.event_list if event.kind == "impact"))
