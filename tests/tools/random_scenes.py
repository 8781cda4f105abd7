"""Random scenes in the regimes that matter: near resonance, gaps like the amplitude, friction that sticks and slips."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

LABELS = ("a", "b")


def random_scene(seed: int, structure: str = "rigid", bodies: int = 1, *, shared: bool = False) -> Scene:
    """A scene of the model "prescribed", "rigid" or "rom" with one body per cavity, or all in one if shared.

    The motion has a scale X. Half of the scenes are fast (X w^2 far above g, impacts rule), half slow enough that
    friction and gravity decide. A reduced model belongs to the scene: `random_reduced(seed)`.
    """
    rng = np.random.default_rng([seed, len(structure), bodies, shared])
    if rng.random() < 0.5:
        amplitude, frequency = _between(rng, 5e-6, 1e-4), _between(rng, 300.0, 3000.0)
    else:
        frequency = _between(rng, 5.0, 300.0)
        amplitude = _between(rng, 2.0, 100.0) / (2 * math.pi * frequency) ** 2
    if structure == "rom":
        frequency = float(random_reduced(seed).natural_frequencies_hz[0])
        amplitude = _between(rng, 2.0, 5000.0) / (2 * math.pi * frequency) ** 2
    mass = _between(rng, 0.05, 1.0)
    orientation = float(rng.choice([0.0, 90.0, rng.uniform(0.0, 90.0)]))
    data = _structure(rng, structure, amplitude, frequency, mass)
    data |= _bodies(rng, amplitude, frequency, mass, bodies, shared)
    data["gravity"] = {"acceleration": 9.81, "orientation_deg": orientation}
    if structure == "rom":
        for index, cavity in enumerate(data["cavity"]):
            cavity["floor"] = LABELS[index % 2]
        data["structure"]["file"] = f"random-{seed}.h5"
    return validate(Scene, data, f"random scene {seed}")


def random_reduced(seed: int, modes: int | None = None) -> ReducedModel:
    """Two to six modes up to five times the first, interface labels "a" and "b", coupled coordinates."""
    rng = np.random.default_rng([seed, 6])
    drawn = int(rng.integers(2, 7))
    modes = modes or drawn
    first = _between(rng, 20.0, 3000.0)
    omegas = 2 * math.pi * first * np.concatenate([[1.0], np.sort(rng.uniform(1.3, 5.0, modes - 1))])
    # modal coordinates = basis @ q
    basis = np.linalg.inv(np.eye(modes) + 0.2 * rng.standard_normal((modes, modes)))
    shapes = np.column_stack([rng.uniform(0.7, 1.0, 2), rng.uniform(-0.4, 0.4, (2, modes - 1))])
    rows = shapes @ basis / math.sqrt(_between(rng, 0.05, 1.0))
    mass = basis.T @ basis
    rigid = np.linalg.lstsq(rows, np.ones(2), rcond=None)[0]
    return ReducedModel.from_matrices(
        mass=mass,
        stiffness=basis.T @ np.diag(omegas**2) @ basis,
        interface=dict(zip(LABELS, rows, strict=True)),
        damping_ratio=_between(rng, 0.002, 0.02),
        directions=dict.fromkeys(LABELS, (0.0, 1.0, 0.0)),
        base_load=np.outer(mass @ rigid, (0.0, 1.0, 0.0)),
    )


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two positive bounds, uniform in its logarithm."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _structure(rng: np.random.Generator, model: str, amplitude: float, frequency: float, mass: float) -> dict:
    """Tables structure, excitation and initial."""
    excitation = {"frequency": frequency * rng.uniform(0.93, 1.07)}
    if model == "prescribed":
        return {
            "structure": {"model": model, "displacement_amplitude": amplitude},
            "excitation": {"frequency": frequency},
        }
    acceleration = amplitude * (2 * math.pi * frequency) ** 2 * _between(rng, 0.02, 0.2)
    if rng.random() < 0.3:
        excitation["base_acceleration"] = acceleration
    else:
        excitation["force"] = mass * acceleration
    if model == "rom":
        return {"structure": {"model": model}, "excitation": excitation | {"at": "a"}}
    stiffness = mass * (2 * math.pi * frequency) ** 2
    structure = {"model": model, "mass": mass, "stiffness": stiffness, "damping_ratio": _between(rng, 0.002, 0.02)}
    initial = {}
    if rng.random() < 0.7:
        phase, size = rng.uniform(0.0, 2 * math.pi), amplitude * rng.uniform(0.3, 1.0)
        initial = {
            "displacement": size * math.cos(phase),
            "velocity": size * 2 * math.pi * frequency * math.sin(phase),
        }
    return {"structure": structure, "excitation": excitation, "initial": initial}


def _bodies(
    rng: np.random.Generator, amplitude: float, frequency: float, mass: float, count: int, shared: bool
) -> dict:
    """Tables cavity and damper."""
    cavities = [
        {"name": f"c{index + 1}", "gap": amplitude * _between(rng, 0.1, 2.0)} for index in range(1 if shared else count)
    ]
    places = rng.uniform(-0.45, 0.45, count)
    places = np.sort(places) if shared else places
    dampers = []
    for index, place in enumerate(places):
        cavity = cavities[0 if shared else index]
        body = mass * _between(rng, 0.005, 0.1)
        damper = {
            "cavity": cavity["name"],
            "mass": body,
            "friction": 0.0 if rng.random() < 0.2 else rng.uniform(0.05, 0.6),
            "restitution": rng.uniform(0.3, 0.9),
            "position": float(place) * cavity["gap"],
        }
        if rng.random() < 0.3:
            damper["velocity"] = 2 * math.pi * frequency * amplitude * rng.uniform(-0.3, 0.3)
        if rng.random() < 0.5:
            damper["normal_load"] = body * amplitude * (2 * math.pi * frequency) ** 2 * _between(rng, 0.01, 2.0)
        dampers.append(damper)
    return {"cavity": cavities, "damper": dampers}


def random_compliant(
    seed: int, structure: str = "rigid", bodies: int = 1, where: str = ""
) -> tuple[Scene, ReducedModel | None]:
    """A random scene with compliant contacts, and its reduced model (five modes).

    where: words; "shared" for one cavity, "separate" for walls and floor on different functionals.
    The stiffness gives the lightest body 3 to 100 times the frequency of the excitation; one body in five has a
    restitution below exp(-2), where the contact is overdamped, and one in ten is elastic.
    """
    shared, separate = "shared" in where, "separate" in where
    rng = np.random.default_rng([seed, len(structure), bodies, shared, separate])
    scene, reduced = random_scene(seed, structure, bodies, shared=shared), None
    lightest = min(damper.mass for damper in scene.damper)
    stiffness = lightest * (2 * math.pi * scene.excitation.frequency * _between(rng, 3.0, 100.0)) ** 2
    values: dict = {"contact": {"law": "compliant", "stiffness": stiffness}}
    for index in range(bodies):
        chance = rng.random()
        if chance < 0.3:
            values[f"damper.{index}.restitution"] = 1.0 if chance < 0.1 else _between(rng, 0.02, 0.13)
    if structure == "rom":
        reduced = _with_surfaces(random_reduced(seed, modes=5), rng)
        if separate:
            values |= {"cavity.left": "left", "cavity.right": "right", "cavity.floor": "floor"}
    return scene.replace(values), reduced


def random_jenkins(
    seed: int, structure: str = "rigid", bodies: int = 0, law: str = "newton", elements: int = 1
) -> tuple[Scene, ReducedModel | None]:
    """A random scene with Jenkins elements as stiff as a part of the structure, and its reduced model."""
    rng = np.random.default_rng([seed, len(structure), bodies, elements, 7])
    make = random_compliant if law == "compliant" else random_scene
    scene = make(seed, structure, max(bodies, 1))
    scene, reduced = scene if law == "compliant" else (scene, random_reduced(seed) if structure == "rom" else None)
    data = scene.to_dict()
    if not bodies:
        data |= {"cavity": [], "damper": []}
    omega = 2 * math.pi * scene.excitation.frequency
    mass = 0.3 if structure == "rom" else scene.structure.mass
    load = (scene.excitation.force or 0.0) + mass * (scene.excitation.base_acceleration or 0.0)
    data["friction_damper"] = []
    for index in range(elements):
        element = {
            "normal_force": load * _between(rng, 0.3, 10.0),
            "friction": rng.uniform(0.1, 1.0),
            "stiffness": mass * omega**2 * _between(rng, 0.1, 30.0),
        }
        if structure == "rom":
            element["at"] = LABELS[(index + 1) % 2]
        data["friction_damper"].append(element)
    return validate(Scene, data, f"random Jenkins scene {seed}"), reduced


def _with_surfaces(model: ReducedModel, rng: np.random.Generator) -> ReducedModel:
    """The model with labels "left", "right" and "floor" that move a little differently from label "a"."""
    row = model.row("a")
    rows = {label: model.row(label) for label in LABELS}
    rows |= {label: row * (1 + 0.1 * rng.uniform(-1.0, 1.0, len(row))) for label in ("left", "right", "floor")}
    return ReducedModel.from_matrices(
        mass=model.mass,
        stiffness=model.stiffness,
        damping_ratio=model.damping_ratio,
        interface=rows,
        directions=dict.fromkeys(rows, (0.0, 1.0, 0.0)),
        base_load=model.base_load,
    )
