"""Template files: a scene, a case and a study that work unchanged, with comments on their keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.resonance import chosen_resonance
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import NORMAL, ROTATION, ReducedModel
from vanedamp.studies.case.tables import Case
from vanedamp.studies.demo.figure_file import FigureStructure
from vanedamp.studies.hot_spots import plus_minus
from vanedamp.studies.model_scene import contact_stiffness, on_model, rounded

#: mass of the body over the structure's, and its gap over the amplitude without bodies
_MASS_RATIO, _GAP_RATIO = 0.02, 0.5
#: relative to the natural frequency: a run in which the body is active, and the ends of a sweep and of a study's band
_RUN, _SWEEP, _BAND = 0.988, (0.96, 1.02), (0.975, 1.01)

_SCENE_NOTE = """\
A structure with one loose body in a cavity. `vanedamp run {file}` runs it at one frequency, `vanedamp sweep {file}`
over the values in [sweep], `vanedamp check {file}` says what it means. SI units; every key: `vanedamp schema scene`."""
_STUDY_NOTE = """\
Which body reduces a resonance most? `vanedamp optimise {file}` varies mass, gap and number of bodies of this scene;
`vanedamp check {file}` says how long that takes. SI units; every key: `vanedamp schema study`."""
_CASE_NOTE = """\
The parametric vane cluster. `vanedamp modal {file}` computes its modes, `vanedamp reduce {file}` a model for scenes,
`vanedamp check {file}` says what it means. SI units; every key: `vanedamp schema case`."""
_DESIGN_NOTE = """\
Which damper for a case, and does it hold? `vanedamp design {file}` finds mass and gap for each number of bodies, and
confirms the best over everything that is uncertain; design.html in the folder is the answer. Measured frequencies and
damping belong into the case ([calibration]). SI units; every key: `vanedamp schema design`."""
_LEVEL_NOTE = """\
resonance_amplitude: {level}."""
_AT_STRENGTH = (
    "at this amplitude the stress reaches {share:.0%} of the case's fatigue strength, {strength:.4g} Pa when the model "
    "was reduced"
)
_NO_STRENGTH = "that of the shipped cluster; the model's case has no fatigue strength, set your own"
_CONTACT_NOTE = """\
The stiffness is that of the model's wall under a static force, without the resonance's share, and keeps a body on it
at 10 to 30 times the frequency of the resonance. Replace it by one that is measured or computed for the pair."""
_STRUCTURE_NOTE = """\
In place of these keys a reduced model: model = "rom" and file = "rom.h5", with interface labels at excitation.at and
cavity.floor (`vanedamp new scene --rom rom.h5` writes such a scene)."""
_MESH_NOTE = """\
A mesh of your own, in place of all keys of this table: file = "cluster.msh" (gmsh; or .inp, .bdf of other programs),
and scale = 1e-3 where it is in millimetres. The names below are those of its groups: volumes in [material], facets in
[support] and [interface]."""
_INTERFACE_NOTE = "The response, and the force."
_CAVITY_NOTE = """\
The floor of the cavity, as the bodies feel it: `floor` of [[cavity]] in a scene. Its direction is that from the left
wall to the right one. For planar bodies: facets = ["c1_left", "c1_right", "c1_floor", "c1_roof"], kind = "cavity",
direction = "c1_left", normal = "c1_floor"."""


#: tables of a file, and further comments by tables, as files.toml_output takes them
Template = tuple[dict[str, Any], dict[str, str]]


def template(kind: str, file: Path, rom: Path | None = None, case: Path | None = None) -> Template:
    """Return the first version of a file of a kind (scene, study, case or design), with its comments.

    A scene is of the shipped rigid model, or of a reduced model (rom), a study is on the same scene, a design is for a
    case. Raises InputError for the reduced model's file or the case, and for one that the kind does not take.
    """
    if case is not None and kind != "design":
        raise InputError("--case: is for a design")
    if kind in ("case", "design"):
        if rom is not None:
            raise InputError("--rom: is for a scene or a study; a case is what a reduced model is made from")
        return _case(file) if kind == "case" else _design(file, case)
    data = _scene(file, rom, blocks=kind == "scene")
    if kind == "scene":
        return data, {"": _SCENE_NOTE.format(file=file.name)} | _notes(rom)
    del data["sweep"]
    low, high = (rounded(share / _RUN * data["excitation"]["frequency"]) for share in _BAND)
    data["time"] = {"periods": 500, "transient": 400}
    data["optimise"] = {
        "band": {"start": low, "stop": high, "num": 12}, "samples": 4, "evaluations": 10,
        "variables": {"mass_ratio": [0.005, 0.05], "gap_ratio": [0.1, 2.0], "bodies": [1, 2]},
        "tolerances": {"gap": 0.1, "excitation": 0.2}, "map": {"mass_ratio": 4, "gap_ratio": 5},
    }  # fmt: skip
    return data, {"": _STUDY_NOTE.format(file=file.name)}


def _notes(rom: Path | None) -> dict[str, str]:
    """Return the comments on tables of a scene, of the shipped rigid model or of a reduced model."""
    if rom is None:
        return {"structure": _STRUCTURE_NOTE}
    level = ReducedModel.load(rom).provenance.get("fatigue")
    level_text = _NO_STRENGTH if level is None else _AT_STRENGTH.format(**level) + plus_minus(level.get("error"))
    return {"excitation": _LEVEL_NOTE.format(level=level_text), "contact": _CONTACT_NOTE}


def _case(file: Path) -> Template:
    """Return a case: the parametric cluster with one cavity."""
    tangential = [0, 1, 0]
    data = {
        "mesh": {"generator": "vane_cluster", "airfoils": 4, "cavities": 1, "element_size": 2.6e-3, "degree": 2},
        "material": {
            "default": {
                "young": 2.0e11, "poisson": 0.3, "density": 8190.0, "damping_ratio": 0.002, "fatigue_strength": 4.0e8
            }
        },
        "support": {"clamped": ["clamp"]},
        "modes": {"count": 10, "direction": tangential, "at": "shroud"},
        "interface": {
            "shroud": {"facets": "shroud", "direction": tangential},
            "c1_floor": {"facets": "c1_floor", "direction": tangential},
        },
    }  # fmt: skip
    notes = {"": _CASE_NOTE.format(file=file.name), "mesh": _MESH_NOTE, "interface.shroud": _INTERFACE_NOTE}
    return data, notes | {"interface.c1_floor": _CAVITY_NOTE}


def _design(file: Path, case: Path | None) -> Template:
    """Return a design for a case: an envelope about good dampers of the shipped cluster, and common requirements."""
    shipped = FigureStructure.shipped()
    ends = [rounded(share * shipped.amplitude, 2) for share in (0.1, 2.0)]
    data: dict[str, Any] = {
        "case": "case.toml" if case is None else _beside(case, file.parent),
        "folder": file.stem,
        "operation": {"hours": 10_000.0},
        "envelope": {
            "bodies": [1, 2, 4], "mass": [rounded(share * shipped.mass, 2) for share in (0.01, 0.04)], "gap": ends,
            "gap_tolerance": 2e-6, "mass_tolerance": 0.03, "orientation_deg": [0.0, 90.0], "friction": [0.2, 0.6],
            "restitution": [0.4, 0.8],
        },
        "requirements": {"amplitude_ratio": 0.5},
    }  # fmt: skip
    if case is not None:
        found = Case.load(case)
        floors = [label.removesuffix("_floor") for label in found.interface if label.endswith("_floor")]
        data["envelope"] |= {"cavities": floors} if floors else {}
        if found.fatigue_strength:
            data["requirements"] |= {"utilisation": 1.0}
    return data, {"": _DESIGN_NOTE.format(file=file.name)}


def _scene(file: Path, rom: Path | None, blocks: bool) -> dict[str, Any]:
    """Return a scene with gap and mass of a good damper, by the resonance of its structure.

    blocks: use blocks where a reduced model has the motion and the size of their cavity; these runs take longer.
    """
    shipped = FigureStructure.shipped()
    amplitude = rounded(shipped.amplitude, 2)
    if rom is None:
        structure = {
            "model": "rigid", "mass": rounded(shipped.mass), "stiffness": rounded(shipped.stiffness),
            "damping_ratio": shipped.damping_ratio,
        }  # fmt: skip
        location: dict[str, Any] = {}
        cavities: list[dict[str, Any]] = [{"name": "c1"}]
        near = [shipped.frequency] * 2
    else:
        model = ReducedModel.load(rom)
        structure, location, cavities, near = on_model(model, rom)
        if (level := model.provenance.get("fatigue")) is not None:
            location["at"], near = level["at"], [level["frequency_hz"]] * 2
            amplitude = rounded(level["amplitude"], 2)
    excitation = location | {"frequency": near[0], "resonance_amplitude": amplitude}
    moving: dict[str, Any] = {"structure": structure, "excitation": excitation | {"resonance_near": near}}
    moving["cavity"] = [cavity | {"gap": amplitude} for cavity in cavities]
    resonance = chosen_resonance(validate(Scene, moving, str(rom or file)))
    if rom is not None:
        structure["file"] = _beside(rom, file.parent)
    mass, gap = rounded(_MASS_RATIO * resonance.mass / len(cavities)), rounded(_GAP_RATIO * amplitude)
    frequencies = [rounded(share * resonance.frequency) for share in (_RUN, *_SWEEP)]
    bodies: list[dict[str, Any]] = [
        {"cavity": cavity["name"], "mass": mass, "friction": 0.4, "restitution": 0.7} for cavity in cavities
    ]
    contact: dict[str, Any] = {}
    if rom is not None:
        contact = {"contact": {"law": "compliant", "stiffness": contact_stiffness(model, cavities, resonance, mass)}}
        for cavity, body in zip(cavities, bodies, strict=True):
            if blocks and (size := _pocket(model, cavity["floor"])) is not None:
                cavity["play"] = gap
                length, height = (rounded(extent - gap) for extent in size)
                body |= {"shape": "block", "length": length, "height": height}
    points = 21 if any("shape" in body for body in bodies) else 61  # blocks take longer
    return {
        "structure": structure,
        "excitation": excitation | {"frequency": frequencies[0]},
        "cavity": [cavity | {"gap": gap} for cavity in cavities],
        "damper": bodies,
        **contact,
        "gravity": {"acceleration": 9.81, "orientation_deg": 0.0},
        "time": {"periods": 1500, "transient": 1000},
        "sweep": {
            "cavity.gap": [gap, rounded(gap / 5)],
            "excitation.frequency": {"start": frequencies[1], "stop": frequencies[2], "num": points},
        },
    }


def _pocket(model: ReducedModel, label: str) -> tuple[float, float] | None:
    """Return length and height (m) of a rectangular cavity whose surfaces one rigid motion describes, or None.

    The rotation is that about the surfaces' centroid, half of the height above the floor; its arm is their radius of
    gyration.
    """
    turn, across = label + ROTATION, label + NORMAL
    if not {turn, across} <= set(model.interface) or model.positions is None or model.arms is None:
        return None
    floor, centre = (model.interface.index(name) for name in (label, turn))
    height = 2.0 * float(np.linalg.norm(model.positions[centre] - model.positions[floor]))
    square = model.arms[centre] ** 2
    # of a rectangle a x h: 12 (a + h) r^2 = a^3 + 3 a h^2 + h^3 + 3 h a^2 = (a + h)^3
    length = float(np.sqrt(12.0 * square)) - height
    return (length, height) if min(length, height) > 0.1 * max(length, height) else None


def _beside(file: Path, folder: Path) -> str:
    """Return the path of a file relative to a folder."""
    file, folder = file.resolve(), folder.resolve()
    return str(file.relative_to(folder) if file.is_relative_to(folder) else file)
