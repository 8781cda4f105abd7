"""Random scenes of everything the engine knows, in natural units: motion about 1, angular frequency about 1."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.rom.recovery import with_stresses
from vanedamp.rom.reduced import ReducedModel

LAWS = ("newton", "compliant")
STRUCTURES = ("prescribed", "rigid", "rom")
APART = {"left": "left", "right": "right", "floor": "floor"}
#: how many reduced models there are for each number of modes
MODELS = 3


def between(low, high):
    """Numbers between two positive bounds, even in their logarithm."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def speeds(largest):
    """Speeds to either side; tests/coupling/engine/line/test_traps.py has those far below round-off."""
    return st.floats(-largest, largest).map(lambda speed: round(speed, 9))


@st.composite
def scene_tables(draw, structures=STRUCTURES, laws=LAWS, cavities=None, elements=True, longest=6):
    """Tables of a scene (`scene_of` makes it one).

    cavities: "own" for one body a cavity, otherwise up to four bodies share them at random; elements: whether friction
    dampers are drawn; longest: largest number of periods.
    """
    law = draw(st.sampled_from(laws))
    gaps, dampers = _bodies(draw, law, cavities)
    data = {
        "excitation": {"frequency": draw(st.floats(0.9, 1.1)) / (2 * math.pi)},
        "gravity": _gravity(draw, dampers),
        "cavity": [{"name": f"c{i}", "gap": gap} for i, gap in enumerate(gaps)],
        "damper": dampers,
        "contact": _contact(draw, law, dampers),
        "time": {"periods": draw(st.integers(2, longest)), "transient": 0},
        "solver": {"max_events": 100_000},
    }
    return data | _structure(draw, draw(st.sampled_from(structures)), data, elements)


def scene_of(data: dict) -> Scene:
    """The scene of such tables. Raises InputError."""
    structure = dict(data["structure"])
    if structure["model"] == "rom":
        structure["file"] = model_file(*structure.pop("drawn"))
    return validate(Scene, data | {"structure": structure}, "scene")


@cache
def model_file(seed: int, modes: int) -> str:
    """File of a random reduced model: first frequency 1, labels "left", "right", "floor" and "one", of any part."""
    rng = np.random.default_rng([seed, modes])
    omegas = np.r_[1.0, np.sort(rng.uniform(1.3, 12.0, modes - 1))]
    one = np.r_[1.0, rng.uniform(-0.5, 0.5, modes - 1)]
    rows = {"one": one} | {label: one + np.r_[0.0, rng.uniform(-0.1, 0.1, modes - 1)] for label in APART}
    basis = np.linalg.inv(np.eye(modes) + 0.2 * rng.standard_normal((modes, modes)))
    model = ReducedModel.from_matrices(
        mass=basis.T @ basis,
        stiffness=basis.T @ np.diag(omegas**2) @ basis,
        interface={label: row @ basis for label, row in rows.items()},
        damping_ratio=float(np.exp(rng.uniform(math.log(2e-3), math.log(5e-2)))),
        directions=dict.fromkeys(rows, (0.0, 1.0, 0.0)),
        base_load=np.outer(basis.T @ one / (one @ one), (0.0, 1.0, 0.0)),
    )
    path = Path(_folder().name) / f"{modes}-{seed}.h5"
    model.save(path)
    return str(path)


@cache
def stressed_file(file: str) -> str:
    """File of the same model with two random hot spots, one of which has a curve of stress and life."""
    model = ReducedModel.load(file)
    rng = np.random.default_rng(len(model.mass))
    curve = {"strength": 1.0, "exponent": 5.0, "knee": 1e6, "tensile_strength": 3.0, "criterion": "principal"}
    facts = {"hot1": {"fatigue": curve}, "hot2": {"static": {"temperature": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}}
    made = replace(model, provenance=model.provenance | {"hot_spots": facts})
    path = file.replace(".h5", "-stressed.h5")
    with_stresses(made, {name: rng.standard_normal((6, len(model.mass))) for name in facts}).save(path)
    return path


@cache
def _folder() -> tempfile.TemporaryDirectory:
    return tempfile.TemporaryDirectory(prefix="scene-strategies-")


def _bodies(draw, law, cavities):
    """(gaps, tables of the dampers): one to four bodies in a row in each of their cavities."""
    count = draw(st.integers(1, 4))
    rooms = count if cavities == "own" else draw(st.integers(1, count))
    gaps = [draw(between(0.05, 3.0)) for _ in range(rooms)]
    owners = sorted([*range(rooms), *(draw(st.integers(0, rooms - 1)) for _ in range(count - rooms))])
    places = [draw(st.floats(-0.49, 0.49)) for _ in owners]
    if law == "newton":
        restitution = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.05, 0.95))
    else:
        restitution = st.one_of(st.just(1.0), st.floats(0.14, 0.95))
    dampers = []
    for owner, place in sorted(zip(owners, places, strict=True)):
        damper = {
            "cavity": f"c{owner}",
            "mass": draw(between(0.005, 0.2)),
            "friction": draw(st.one_of(st.just(0.0), st.floats(0.05, 0.6))),
            "restitution": draw(restitution),
            "position": place * gaps[owner],
            "velocity": draw(st.one_of(st.just(0.0), speeds(0.5))),
        }
        if draw(st.booleans()):
            damper["normal_load"] = damper["mass"] * draw(between(0.01, 2.0))
        dampers.append(damper)
    return gaps, dampers


def _gravity(draw, dampers):
    """Any orientation; where gravity lifts the bodies off their floors, what rubs is pressed on it."""
    orientation = draw(st.one_of(st.sampled_from([0.0, 90.0, -90.0, 37.0, 180.0]), st.floats(-180.0, 180.0)))
    if math.cos(math.radians(orientation)) < 0.0:
        for damper in dampers:
            damper.setdefault("normal_load", 0.3 * damper["mass"])
    return {"acceleration": draw(between(1e-3, 1.0)), "orientation_deg": orientation}


def _contact(draw, law, dampers):
    """Compliant contacts give the lightest body 3 to 100 times the frequency of the motion."""
    if law == "newton":
        return {"law": law}
    lightest = min(damper["mass"] for damper in dampers)
    return {"law": law, "stiffness": lightest * draw(between(3.0, 100.0)) ** 2}


def _structure(draw, model, data, elements):
    """Tables of the structure, its excitation, its initial state and its friction dampers; completes the cavities."""
    excitation = data["excitation"]
    if model == "prescribed":
        return {"structure": {"model": model, "displacement_amplitude": draw(st.floats(0.3, 1.5))}}
    excitation = excitation | {draw(st.sampled_from(["force", "base_acceleration"])): draw(between(0.01, 0.5))}
    tables = {"excitation": excitation}
    if elements:
        tables["friction_damper"] = [_element(draw) for _ in range(draw(st.sampled_from([0, 0, 1, 2])))]
    if model == "rigid":
        ratio = draw(between(1e-3, 0.1))
        return tables | {
            "structure": {"model": model, "mass": 1.0, "stiffness": 1.0, "damping_ratio": ratio},
            "initial": {"displacement": draw(st.floats(-1.0, 1.0)), "velocity": draw(speeds(1.0))},
        }
    excitation["at"] = "one"
    labels = APART if draw(st.booleans()) else {"floor": "one"}
    tables["cavity"] = [cavity | labels for cavity in data["cavity"]]
    for element in tables.get("friction_damper", []):
        element["at"] = draw(st.sampled_from(["one", "left"]))
    drawn = (draw(st.integers(0, MODELS - 1)), draw(st.integers(1, 12)))
    return tables | {"structure": {"model": model, "file": "", "drawn": drawn}}


def _element(draw):
    """A Coulomb element or, with a spring, a Jenkins element; its limit is like the excitation."""
    element = {"normal_force": draw(between(0.01, 1.0)), "friction": draw(st.floats(0.0, 1.0))}
    if draw(st.booleans()):
        element["stiffness"] = draw(between(0.1, 30.0))
    return element
