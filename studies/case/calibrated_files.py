"""Output files of a calibration: the case with the tuned parameters, and a scene with the rigid model."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable, Array, InlineTable

from vanedamp.files.store import replacing
from vanedamp.files.toml_output import write_commented
from vanedamp.modal.rigid_model import motion_along
from vanedamp.studies.case.calibration import Calibration
from vanedamp.studies.case.stages import interface
from vanedamp.studies.case.tables import FILES
from vanedamp.studies.file_kinds import KINDS

#: digits of a tuned number: frequencies agree with the calibration to 1e-11
_DIGITS = 12
#: gaps over the fatigue amplitude, mass of the body over the rigid model's, and range of the frequencies: a
#: start that shows impact mistuning
_GAPS, _BODY, _RANGE = (1.0, 0.5, 0.1), 0.02, (0.95, 1.03)
_SCHEMA = "#:schema "


def save_tuned_case(source: str | Path, calibration: Calibration, path: str | Path) -> None:
    """Write the case file of a calibration with its tuned parameters; everything else is unchanged.

    source: the case file that was calibrated. File names in it are rewritten relative to the new folder.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(tuned_text(Path(source), calibration, Path(path)).encode())


def save_rigid_scene(source: str | Path, calibration: Calibration, path: str | Path) -> None:
    """Write a complete scene of the calibrated rigid model: its cavities, one body in each, and a sweep.

    The JSON Schema of scenes is written into the same folder, for editors.
    """
    head = {"": f"The rigid model of {Path(source).name}, by vanedamp calibrate."}
    write_commented(path, rigid_scene(calibration), KINDS["scene"], head | _scene_notes(calibration))


def tuned_text(source: Path, calibration: Calibration, target: Path) -> str:
    """Return the text of a case file with the tuned parameters of its calibration, for a file at `target`."""
    text = source.read_bytes().decode("utf-8-sig")
    document = tomlkit.parse(text)
    notes = [f"{source.name} calibrated by vanedamp calibrate; what was changed says so."]
    tuning = calibration.tuning
    if tuning is not None:
        reached = ", ".join(f"{value:.6g}" for value in tuning.after_hz)
        measured = ", ".join(f"{value:.6g}" for value in tuning.target_hz)
        notes.append(f"Frequencies: {reached} Hz, measured {measured} Hz.")
        for name, factor in zip(tuning.names, tuning.factors.tolist(), strict=True):
            _tune(document, name, factor)
    if calibration.damping is not None:
        notes.append(f"Damping ratio: {_damping_note(calibration)}.")
        if "modes" not in document:
            document.add("modes", tomlkit.table())
        _change(document["modes"], "damping_ratio", calibration.rigid.damping_ratio, "measured")
    _rebase(document, source.parent.resolve(), target.parent.resolve())
    first, _, rest = tomlkit.dumps(document).partition("\n")
    comments = "".join(f"# {note}\n" for note in notes)
    if first.startswith(_SCHEMA):
        return f"{_rebased_schema(first, source, target)}\n{comments}{rest}"
    return f"{comments}{first}\n{rest}"


def rigid_scene(calibration: Calibration) -> dict[str, Any]:
    """Return the tables of a scene with the rigid model of a calibration, its force and its cavities.

    A case without cavities gets one; the bodies are placeholders (`_BODY`, `_GAPS`).
    """
    rigid, fatigue = calibration.rigid, calibration.analysis.fatigue
    structure: dict[str, Any] = {
        "model": "rigid", "mass": rigid.mass, "stiffness": rigid.stiffness, "damping_ratio": rigid.damping_ratio
    }  # fmt: skip
    if rigid.base_mass is not None:
        structure["base_mass"] = rigid.base_mass
    force = 1.0 if calibration.force is None else calibration.force
    # without a strength the level is free: gaps then suit the force
    free = force / (2.0 * max(rigid.damping_ratio, 1e-3) * rigid.stiffness)
    reference = free if fatigue is None else fatigue.amplitude
    gaps = [_rounded(share * reference) for share in _GAPS]
    motions = {
        label: {"normal_motion": motion.normal_motion, "rotation": motion.rotation}
        for label, motion in calibration.analysis.cavities.items()
    }
    motions = motions | {name: {} for name in _floors(calibration)} or {"c1": {}}
    body = {"mass": _rounded(_BODY * rigid.mass / len(motions)), "friction": 0.4, "restitution": 0.7}
    low, high = (round(share * rigid.frequency_hz, 1) for share in _RANGE)
    sweep: dict[str, Any] = {} if len(motions) > 1 else {f"cavity.{next(iter(motions))}.gap": gaps}
    sweep["excitation.frequency"] = {"start": low, "stop": high, "num": 61}
    return {
        "structure": structure,
        "excitation": {"frequency": rigid.frequency_hz, "force": force},
        "cavity": [{"name": label, "gap": gaps[1], **motion} for label, motion in motions.items()],
        "damper": [{"cavity": label, **body} for label in motions],
        "sweep": sweep,
    }


def _floors(calibration: Calibration) -> dict[str, float]:
    """Return the cavities that only a floor's motion along gives, NAME_floor, with that motion in the rigid model."""
    analysis, case = calibration.analysis, calibration.case
    assert analysis.first_bending is not None and analysis.functional is not None
    shape = analysis.modes.shapes[analysis.first_bending]
    motions: dict[str, float] = {}
    for label, table in case.interface.items():
        name = label.removesuffix("_floor")
        if label != name and name not in analysis.cavities and not table.planar and table.motion == "translation":
            vector = interface(case, analysis.structure.matrices, [label]).vectors[:, 0]
            along = motion_along(shape, vector, analysis.functional)
            motions |= {} if along is None else {name: along}
    return motions


def _scene_notes(calibration: Calibration) -> dict[str, str]:
    """Return comments on the tables of the scene, by their names."""
    rigid, analysis = calibration.rigid, calibration.analysis
    force = "No fatigue strength in the case: 1 N, put the force of your excitation in its place."
    if analysis.fatigue is not None:
        force = (
            f"The force brings the resonance without bodies to {analysis.fatigue.amplitude:.6g} m at {rigid.at}, "
            f"{analysis.fatigue.share:.0%} of the fatigue strength."
        )
    along = {label: motion.along for label, motion in analysis.cavities.items()} | _floors(calibration)
    motions = [f"{name} moves by {value:.4g} of {rigid.at}" for name, value in along.items()]
    plane = f"Along itself {', '.join(motions)}, in this scene by 1; normal_motion and rotation are for planar bodies."
    return {
        "structure": f"{rigid.frequency_hz:.6g} Hz; damping ratio: {_damping_note(calibration)}.",
        "excitation": force,
        "cavity": "A start: put your gaps in their place. " + (plane if motions else ""),
        "damper": f"A start: {_BODY:.0%} of the mass; put your bodies in their place.",
    }


def _damping_note(calibration: Calibration) -> str:
    measured = calibration.damping
    if measured is None:
        return f"{calibration.rigid.damping_ratio:.6g}, the case's"
    return f"{measured.ratio:.6g} +- {measured.deviation:.1g}, from {Path(measured.file).name}"


def _tune(document: tomlkit.TOMLDocument, name: str, factor: float) -> None:
    """Multiply the numbers of a part of the stiffness (`material.<group>`, `support.<group>`) in a case file."""
    kind, group = name.split(".", 1)
    if kind == "support":
        springs = document["support"]["elastic"][group]
        for key in ("stiffness", "normal", "tangential"):
            if key in springs:
                _scale(springs, key, factor)
        return
    materials: Any = document["material"]
    if group not in materials:  # so far it had the default's
        table = tomlkit.inline_table() if isinstance(materials, InlineTable) else tomlkit.table()
        table.update(materials["default"].unwrap())
        materials[group] = table
    for key in ("young", "young_at"):
        if key in materials[group]:
            _scale(materials[group], key, factor)


def _scale(table: AbstractTable, key: str, factor: float) -> None:
    """Multiply a number, all numbers of a list, or the second number of each pair by a factor."""
    old: Any = table[key]
    note = f"tuned: times {factor:.6g}"
    if not isinstance(old, Array):
        _change(table, key, factor * old, note)
        return
    for index, entry in enumerate(old):
        if isinstance(entry, Array):
            entry[1] = _number(factor * entry[1])
        else:
            old[index] = _number(factor * entry)
    _remark(table, key, note)


def _change(table: AbstractTable, key: str, value: float, note: str) -> None:
    """Give a key another number, and a comment with the reason and the old value."""
    was = f"; was {float(table[key]):.6g}" if key in table else ""
    table[key] = _number(value)
    _remark(table, key, note + was)


def _remark(table: AbstractTable, key: str, note: str) -> None:
    if isinstance(table, InlineTable):  # holds no comments
        return
    item: Any = table[key]
    old = item.trivia.comment.removeprefix("#").strip()
    item.comment(f"{old}; {note}" if old else note)


def _number(value: float) -> Any:
    """Return a number as TOML writes moduli: 1.9e11."""
    mantissa, _, exponent = f"{value:.{_DIGITS - 1}e}".partition("e")
    if abs(int(exponent)) < 5:
        text = f"{value:.{_DIGITS}g}"
        return tomlkit.value(text if "." in text else f"{text}.0")
    return tomlkit.value(f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}")


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _rebase(document: tomlkit.TOMLDocument, old: Path, new: Path) -> None:
    """Name the files of a case from another folder."""
    if old == new:
        return
    for key_path in FILES:
        table: Any = document
        for step in key_path[:-1]:
            table = table.get(step, {})
        if key_path[-1] in table and not Path(table[key_path[-1]]).is_absolute():
            table[key_path[-1]] = os.path.relpath(old / table[key_path[-1]], new)


def _rebased_schema(line: str, source: Path, target: Path) -> str:
    """Return the line that names the schema of a file for editors, from another folder."""
    name = line.removeprefix(_SCHEMA).strip()
    if "://" in name or Path(name).is_absolute() or source.parent.resolve() == target.parent.resolve():
        return line
    return _SCHEMA + os.path.relpath(source.parent.resolve() / name, target.parent.resolve())
