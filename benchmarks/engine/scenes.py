"""The scenes of the engine's benchmark: one mode and one body, then more modes and more bodies."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

MASS, STIFFNESS, DAMPING_RATIO = 0.148, 3.4e7, 0.002
#: displacement of the undamped resonance, m
AMPLITUDE = 35e-6
_BODY, _RESTITUTION = 0.02 * MASS, 0.7
#: in the middle of a range of frequencies and gaps with one steady state: two impacts per period, 1:1
_FREQUENCY = 0.996 * math.sqrt(STIFFNESS / MASS) / (2 * math.pi)
_GAP = 0.4 * AMPLITUDE
_FASTEST = 30.0
#: what the body does on a reduced model: changes of the cavity and of the body
USES: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "free": ({"gap": 1000 * AMPLITUDE}, {}),
    "stuck": ({}, {"friction": 0.5, "normal_load": 200.0}),
    "rare impacts": ({"gap": 1000 * AMPLITUDE}, {"velocity": 0.3, "restitution": 0.95}),
    "two impacts per period": ({}, {}),
}


def one_mode(frequency: float = 1.0, gap: float = 1.0) -> Scene:
    """Return a scene of one mode and one body without friction; factors: of the values for two impacts per period."""
    return _rigid([{"name": "c", "gap": gap * _GAP}], [_body()], frequency * _FREQUENCY)


def settled(scene: Scene, periods: int) -> Scene:
    """Return the scene of one body with the state that it has after a number of periods as its initial state."""
    response = simulate(scene.replace({"time.periods": periods}))
    state = {
        "initial.displacement": response.section[-1, 0],
        "initial.velocity": response.section[-1, 1],
        "damper.0.position": response.slip[-1, 0],
        "damper.0.velocity": response.slip_velocity[-1, 0],
    }
    return scene.replace({path: float(value) for path, value in state.items()})


def bodies(count: int) -> Scene:
    """Return bodies of one total mass, each in a cavity of its own; gaps differ, so that they hit one by one."""
    cavities = [{"name": f"c{i}", "gap": _GAP * (1 + 0.02 * i)} for i in range(count)]
    return _rigid(cavities, [_body() | {"cavity": f"c{i}", "mass": _BODY / count} for i in range(count)], _FREQUENCY)


def reduced(folder: Path, modes: int, use: str) -> Scene:
    """Return the one-mode structure with further modes up to 30 times its frequency, as a reduced model in that folder.

    Damping is proportional to stiffness; the interface is a patch, whose share of a mode falls with its frequency.
    """
    factors = np.linspace(1.0, _FASTEST, modes) if modes > 1 else np.ones(1)
    stiffness = STIFFNESS * np.diag(factors**2)
    file = folder / f"modes_{modes}.h5"
    if not file.exists():
        model = ReducedModel.from_matrices(
            MASS * np.eye(modes), stiffness, {"shroud": 1 / factors},
            damping=2 * DAMPING_RATIO * math.sqrt(MASS / STIFFNESS) * stiffness,
        )  # fmt: skip
        model.save(file)
    cavity, body = USES[use]
    return _scene(
        {"model": "rom", "file": str(file)}, [{"name": "c", "gap": _GAP, "floor": "shroud"} | cavity],
        [_body() | body], {"frequency": _FREQUENCY, "at": "shroud"},
    )  # fmt: skip


def _body() -> dict[str, Any]:
    return {"cavity": "c", "mass": _BODY, "restitution": _RESTITUTION}


def _rigid(cavities: list[dict[str, Any]], dampers: list[dict[str, Any]], frequency: float) -> Scene:
    structure = {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": DAMPING_RATIO}
    return _scene(structure, cavities, dampers, {"frequency": frequency})


def _scene(
    structure: dict[str, Any], cavities: list[dict[str, Any]], dampers: list[dict[str, Any]], excitation: dict[str, Any]
) -> Scene:
    data = {
        "structure": structure,
        "excitation": excitation | {"resonance_amplitude": AMPLITUDE},
        "gravity": {"acceleration": 0.0},
        "cavity": cavities,
        "damper": dampers,
    }
    return validate(Scene, data, "bench")
