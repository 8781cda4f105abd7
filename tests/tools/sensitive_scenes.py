"""Random scenes of every kind, and the numbers in them that a sweep can name."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from tests.tools.planar_laws import crowd, jenkins, tables
from tests.tools.random_scenes import random_compliant, random_jenkins, random_reduced, random_scene
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.in_memory import file_of
from vanedamp.rom.reduced import ReducedModel

KINDS = (
    "slider", "prescribed", "several", "row", "compliant", "jenkins", "stops", "viscoelastic", "reduced",
    "reduced compliant", "reduced jenkins", "rotating", "planar", "planar poisson", "planar viscoelastic",
    "planar compliant", "crowd", "crowd jenkins", "crowd poisson",
)  # fmt: skip
#: events after which a run is given up: some motions end in chatters without an end
MOST_EVENTS = 40000
#: tables whose numbers are none of the motion
_NO_NUMBERS = ("time", "solver", "continuation", "sweep", "orbit", "ramp", "ring_down")
#: keys whose number has no derivative: they choose, or count
_CHOICES = ("order", "tolerance", "modes", "resonance_near")
#: keys that say at 0 that there is no such thing
_ABSENT = ("normal_motion", "rotation", "centrifugal_deg", "centrifugal_stiffness")
#: bounds of keys, at which there is no derivative on both sides
_LEAST = {"friction": 0.0, "force": 0.0, "base_acceleration": 0.0, "lift": 0.0, "acceleration": 0.0, "amplitude": 0.0,
          "restitution": 0.0, "dashpot": 0.0, "damping": 0.0, "damping_ratio": 0.0, "normal_load": 0.0, "speed": 0.0,
          "rpm": 0.0}  # fmt: skip


def scene_of(seed: int, folder: Path) -> tuple[str, Scene]:
    """Return the kind of a random scene and the scene. Raises InputError for numbers that make none."""
    rng = np.random.default_rng([seed, 31])
    kind = KINDS[seed % len(KINDS)]
    data = _DATA[kind.split()[0]](kind, seed, rng, folder)
    if rng.random() < 0.25 and "load" not in data["excitation"]:
        order, phase = int(rng.integers(2, 4)), float(rng.uniform(-180.0, 180.0))
        data["excitation"]["harmonic"] = [{"order": order, "amplitude": float(rng.uniform(0.1, 0.6)), "phase": phase}]
    if data["structure"]["model"] == "rigid":
        data["structure"]["damping_ratio"] = float(rng.uniform(0.05, 0.2))
        if rng.random() < 0.3:
            mass, stiffness = data["structure"]["mass"], data["structure"]["stiffness"]
            data["structure"]["damping"] = 2 * data["structure"].pop("damping_ratio") * math.sqrt(mass * stiffness)
    _wear(data, np.random.default_rng([seed, 52]))
    data["solver"] = data.get("solver", {}) | {"max_events": MOST_EVENTS}
    data["time"] = {"periods": 100, "transient": 0}
    return kind, validate(Scene, data, "scene")


def _wear(data: dict[str, Any], rng: np.random.Generator) -> None:
    """Let contacts wear, or say what touches, in some scenes."""
    if rng.random() < 0.5:
        rates = rng.uniform(0.5, 2.0, 3)
        data["wear"] = {"rate": rates[0] * 1e-13, "impact_rate": rates[1] * 1e-9, "area": rates[2] * 1e-4}
        data["wear"]["impact_exponent"] = float(rng.uniform(0.6, 2.0))
        data["wear"] = {key: float(value) for key, value in data["wear"].items()}
    contact = data.setdefault("contact", {"law": "newton"})
    if rng.random() < 0.5 and contact["law"] in ("newton", "poisson"):
        contact["pair"] = {"young": float(rng.uniform(1e9, 2e11)), "radius": float(rng.uniform(0.01, 0.1))}


def _sliders(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    if kind == "prescribed":
        return random_scene(seed, "prescribed", int(rng.integers(1, 3))).to_dict()
    many = int(rng.integers(2, 4)) if kind in ("several", "row") else 1
    data = random_scene(seed, "rigid", many, shared=kind == "row").to_dict()
    if kind == "viscoelastic":
        for damper in data["damper"]:
            damper.pop("restitution")
        data["contact"] = {"law": "viscoelastic", "coefficient": float(rng.uniform(0.1, 0.6))}
    if kind == "rotating":
        _turn(data, rng)
    return data


def _turn(data: dict[str, Any], rng: np.random.Generator) -> None:
    frequency, structure = data["excitation"]["frequency"], data["structure"]
    acceleration = float(rng.uniform(0.5, 50.0)) * 9.81
    radius = float(rng.uniform(0.1, 0.5))
    speed = math.sqrt(acceleration / radius)
    data["rotation"] = {"speed": speed} if rng.random() < 0.5 else {"rpm": speed * 60 / (2 * math.pi)}
    if rng.random() < 0.5:
        data["excitation"].pop("frequency")
        data["excitation"]["engine_order"] = 2 * math.pi * frequency / speed
    structure["centrifugal_stiffness"] = float(rng.uniform(-0.2, 0.4)) * structure["stiffness"] / speed**2
    for cavity in data["cavity"]:
        cavity |= {"radius": radius, "centrifugal_deg": float(rng.uniform(-60.0, 60.0))}
    for damper in data["damper"]:
        damper.pop("normal_load", None)


def _compliant(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    return random_compliant(seed, "rigid", int(rng.integers(1, 3)), "shared" if rng.random() < 0.3 else "")[0].to_dict()


def _jenkins(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    law = "compliant" if rng.random() < 0.2 else "newton"
    bodies, elements = int(rng.integers(0, 3)), int(rng.integers(1, 3))
    return random_jenkins(seed, "rigid", bodies, law, elements)[0].to_dict()


def _reduced(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    bodies = int(rng.integers(1, 3))
    if kind == "reduced compliant":
        scene, model = random_compliant(seed, "rom", bodies)
    elif kind == "reduced jenkins":
        scene, model = random_jenkins(seed, "rom", int(rng.integers(0, 3)))
    else:
        scene, model = random_scene(seed, "rom", bodies), random_reduced(seed)
    assert model is not None
    data = scene.to_dict()
    data["structure"] = {"model": "rom", "file": file_of(_more_damped(model, rng))}
    return data


def _more_damped(model: ReducedModel, rng: np.random.Generator) -> ReducedModel:
    return ReducedModel.from_matrices(
        mass=model.mass, stiffness=model.stiffness, damping_ratio=float(rng.uniform(0.05, 0.2)),
        interface={label: model.row(label) for label in model.interface},
        directions=dict.fromkeys(model.interface, (0.0, 1.0, 0.0)), base_load=model.base_load,
    )  # fmt: skip


def _stops(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    """A structure with stops and rigid friction dampers, and sliders or none."""
    data = crowd(seed, folder)
    free = rng.random() < 0.4
    sliding = [cavity for cavity in data["cavity"] if cavity["name"].startswith("s")]
    names = [] if free else [cavity["name"] for cavity in sliding]
    data["cavity"] = [cavity for cavity in data["cavity"] if cavity["name"] in names]
    data["damper"] = [damper for damper in data["damper"] if damper["cavity"] in names]
    return data


def _planar(kind: str, seed: int, rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    data = {"planar": lambda: tables(seed), "crowd": lambda: crowd(seed, folder)}[kind.split()[0]]()
    if kind == "crowd jenkins":
        data = jenkins(seed, folder)
    law = {"poisson": {"law": "poisson"}, "viscoelastic": {"law": "viscoelastic", "coefficient": 0.2},
           "compliant": {"law": "compliant", "stiffness": 300.0}}.get(kind.split()[-1], {"law": "newton"})  # fmt: skip
    for damper in data["damper"]:
        if law["law"] == "viscoelastic":
            damper.pop("restitution", None)
        else:
            damper["restitution"] = float(min(max(damper["restitution"], 0.05), 0.8))
    return data | {"contact": law}


_DATA = {
    **dict.fromkeys(("slider", "prescribed", "several", "row", "viscoelastic", "rotating"), _sliders),
    "compliant": _compliant, "jenkins": _jenkins, "stops": _stops, "reduced": _reduced,
    "planar": _planar, "crowd": _planar,
}  # fmt: skip


def numbers_of(scene: Scene, start: bool) -> dict[str, tuple[float, float]]:
    """Return the numbers of a scene that may be changed to both sides, by path: value, and size of it.

    start: with those of its start.
    """
    found = {}
    for path, value in _numbers(scene.to_dict(), ""):
        if (
            path.split(".")[0] in _NO_NUMBERS
            or _at_bound(path, value)
            or (path.split(".")[-1] in _ABSENT and not value)
        ):
            continue
        if not _of_start(path) or (start and not _at_rest(path, value)):
            size = _size(scene, path, value)
            try:
                scene.replace({path: value + 1e-6 * size})
                scene.replace({path: value - 1e-6 * size})
            except InputError:
                continue
            found[path] = value, size
    return found


def _numbers(node: Any, path: str):
    """Yield paths and values of the numbers in plain data that are no choices."""
    entries = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in entries:
        here = f"{path}.{key}" if path else str(key)
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            yield from _numbers(value, here)
        elif isinstance(value, float) and key not in _CHOICES:
            yield here, value


def _of_start(path: str) -> bool:
    keys = ("position", "velocity", "lift", "tilt", "lift_velocity", "tilt_rate")
    return path.split(".")[0] == "initial" or (path.startswith("damper.") and path.split(".")[-1] in keys)


def _at_rest(path: str, value: float) -> bool:
    """Whether a body begins at rest by this number, as it would not by its neighbours on either side."""
    return path.startswith("damper.") and not path.endswith("position") and value == 0.0


def _at_bound(path: str, value: float) -> bool:
    key = path.split(".")[-1]
    return (
        (key in _LEAST and value <= _LEAST[key])
        or (key == "restitution" and value >= 1.0)
        or (key in _ABSENT and value == 0.0)
    )


def _size(scene: Scene, path: str, value: float) -> float:
    """Return what changes of a number are relative to: itself, or what it is added to."""
    key, omega = path.split(".")[-1], 2 * math.pi * scene.frequency
    if key.endswith("_deg") or key == "phase":
        return math.degrees(1.0)
    if path.startswith("damper.") and _of_start(path):
        cavity = scene.cavity[scene.cavity_of(scene.damper[int(path.split(".")[1])])]
        room = (cavity.play or cavity.gap) if "lift" in key or "tilt" in key else cavity.gap
        room = room / (max(scene.damper[int(path.split(".")[1])].half_extent) or 1.0) if "tilt" in key else room
        return room * (omega if key in ("velocity", "lift_velocity", "tilt_rate") else 1.0)
    return abs(value) or 1.0
