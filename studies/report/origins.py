"""Which results do not belong together, and in what their models and devices differ, by what their files record."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.headline import format_value, leaves
from vanedamp.studies.report.forced_response import setting
from vanedamp.studies.report.results import Result, Results

_MATRICES = ("mesh_sha256", "scale", "degree", "materials", "clamped", "elastic", "temperature", "stiffness", "mass")
#: facts beside matrices; relative difference of numbers typed in three digits
_BESIDES, _TYPED = {"frequency", "damping ratio", "mesh"}, 5e-3


def _model(result: Result) -> dict[str, Any] | None:
    """Return what is known of a result's model, by name; None without one, or with several."""
    made, numbers, study = result.provenance or {}, result.rigid, getattr(result.record, "study", None)
    scene = study.get("scene") if isinstance(study, Mapping) else result.scene
    made_of = made.get("model_made_of", made.get("ring", {} if scene else made))
    if scene:
        if scene["structure"]["model"] == "prescribed" or "structure" in dict(_varied(result)):
            return None
        numbers = scene["structure"] if scene["structure"]["model"] == "rigid" else made_of
    made_of = made_of.get("matrices") or made_of
    stated = leaves({key: made_of[key] for key in _MATRICES if key in made_of})
    # files round numbers
    facts: dict[str, Any] = {
        path: f"{value:.6g}" if isinstance(value, float) else str(value) for path, value in stated.items()
    }
    if "stiffness" in numbers:
        facts["frequency"] = math.sqrt(numbers["stiffness"] / numbers["mass"]) / (2.0 * math.pi)
    known = {"mesh": made_of.get("mesh"), "damping ratio": numbers.get("damping_ratio")}
    facts |= {name: value for name, value in known.items() if value is not None}
    return facts if facts or scene else None


def _agree(one: dict[str, Any], other: dict[str, Any]) -> bool | None:
    """Say whether two models are one; None: not known."""
    shared = one.keys() & other.keys()
    of_matrices = bool(shared - _BESIDES)
    numbers = shared & ({"damping ratio"} if of_matrices else {"damping ratio", "frequency"})
    if not all(math.isclose(one[key], other[key], rel_tol=_TYPED) for key in numbers):
        return False
    if of_matrices:
        return all(one.get(key) == other.get(key) for key in {*one, *other} - _BESIDES)
    return True if "frequency" in numbers else None


def _varied(result: Result) -> set[tuple[str, str]]:
    """Return what varies."""
    scene = result.scene or {}
    paths = [*scene.get("sweep", ()), *scene.get("ranges", ()), getattr(result.record, "parameter", "")]
    return {(path.partition(".")[0], path.rpartition(".")[2]) for path in paths}


def _device(result: Result) -> dict[str, list[Any]]:
    """Return the values of cavities, bodies and load by their paths, none where varied."""
    scene, varied = result.scene or {}, _varied(result)
    device: dict[str, list[Any]] = {"bodies": [len(scene["damper"])]} if scene else {}
    tables = {table: scene[table] for table in ("cavity", "damper", "excitation") if scene.get(table)}
    for path, value in leaves(tables).items():
        table, key = path.partition(".")[0], path.rpartition(".")[2]
        if not is_start(path) and path != "excitation.frequency":
            values = device.setdefault(f"damper.{key}" if table == "damper" else path, [])
            values += [value] if (table, key) not in varied and value not in values else []
    return device


class Origins:
    """groups: files of one model; unknown: files that may be of one. Studies say themselves what they compare."""

    def __init__(self, results: Results) -> None:
        of_studies = {part for file in results.by_file for part in results.parts(file)}
        mine = {file: result for file, result in results.by_file.items() if file not in of_studies}
        self._models = {file: model for file, result in mine.items() if (model := _model(result)) is not None}
        self._devices = {file: _device(result) for file, result in mine.items()}
        self._calibrations, self._names = results.kinds["calibration"], results.names
        self.groups: list[list[str]] = []
        self.unknown: list[str] = []
        for file, model in sorted(self._models.items(), key=lambda item: -len(item[1])):
            found = [(group, [_agree(self._models[other], model) for other in group]) for group in self.groups]
            possible = [(group, True in verdicts) for group, verdicts in found if False not in verdicts]
            if homes := [group for group, sure in possible if sure]:
                homes[0].append(file)
            elif possible or model.keys() <= {"damping ratio"}:
                self.unknown.append(file)
            else:
                self.groups.append([file])

    def group(self, file: str) -> list[str]:
        """Return the files of a file's model; none if not known."""
        return next((group for group in self.groups if file in group), [])

    def label(self, file: str) -> str:
        """Return in what model and device of a file differ from others."""
        words, devices = self.model(self.group(file)), self._devices.values()
        for path, mine in self._devices.get(file, {}).items():
            if mine and any(device.get(path, mine) != mine for device in devices):
                words += [" and ".join(setting(path, value, unit_of(path)) for value in mine)]
        return ", ".join(words)

    def model(self, group: list[str]) -> list[str]:
        """Return in what the model of a group differs from others."""
        if not group or len(self.groups) < 2:
            return []
        tables = [{key: of for file in each for key, of in self._models[file].items()} for each in self.groups]
        mine, words = tables[self.groups.index(group)], list[str]()
        for key, value in mine.items():
            others = (table for table in tables if key in table or {key, *table} - _BESIDES > {key})
            differs = any(table.get(key) != value for table in others)
            if key == "mesh_sha256" and differs:
                words.append(f"mesh {mine['mesh']} ({value[:8]})")
            elif differs and not (words and key in ("frequency", "mesh")):
                words.append(f"{key.rpartition('.')[2]} = {format_value(value)}{' Hz' * (key == 'frequency')}")
        for file, result in self._calibrations.items():
            before = (math.isclose(mine.get("frequency", 0.0), hz, rel_tol=1e-5) for hz in result.record.before_hz)
            words += ["as calibrated"] if file in group else [f"before {self._names[file]}"] if any(before) else []
        return list(dict.fromkeys(words))
