"""`vanedamp info`: what a result is, how it was made, and its main figures."""

from __future__ import annotations

import json
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.ensembles.record import Ensemble
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.response.response import UNITS
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.files.store import Variable, decoding, finite, json_text, load_any
from vanedamp.modal.records.interference import Interference
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.sector_ring import load_ring
from vanedamp.rom.ring.study import MistuningStudy
from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.commands.support.facts import Fact, fact_lines
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.file_kinds import RESULT_KINDS, ResultKind
from vanedamp.studies.hot_spots import plus_minus, spot_lines
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report.designs import designs
from vanedamp.studies.report.forced_response import forced_responses

#: entries of a list that are shown
_MOST = 10
#: ending of the kinds of checkpoints
_CHECKPOINT = "-checkpoint"
_OF_RESPONSE = (
    "status", "classification", "frequency", "amplitude_mean", "amplitude_mean_dynamic", "amplitude_max",
    "amplitude_harmonic", "impacts_per_period", "attached_mass_fraction", "energy_residual", "periods", "transient",
)  # fmt: skip


class _Record(NamedTuple):
    """The content of a file, its texts of nested data as such."""

    path: str
    variables: Mapping[str, Variable]
    attributes: Mapping[str, Any]


def run(arguments: Namespace) -> None:
    """Print the facts. Raises StoreError for a file that is no record of ours, or damaged."""
    path = arguments.input
    kind, variables, attributes = load_any(path)
    checkpoint = kind.endswith(_CHECKPOINT)
    known = _kind(kind.removesuffix(_CHECKPOINT))
    what = f"what {known.about} had finished" if checkpoint else known.about
    figures = _FIGURES.get(kind, _any)
    with decoding(path):
        record = _Record(path, variables, {name: _nested(value) for name, value in attributes.items()})
        found = [
            Fact("command", f"vanedamp {' or '.join(known.commands)}" if known.commands else None),
            Fact("record", known.record, "", "in Python"),
            *_origin(record),
        ]
        found += [Fact("finished", record.attributes.get("finished"))] if checkpoint else figures(record)
        found += [Fact("sizes", {} if checkpoint else _sizes(variables)), Fact("warnings", _warnings(record))]
        result = {"kind": kind} | {fact.key: fact.value for fact in found} | {"scene": _scene(record)}
        lines = list(fact_lines(f"{path}: {kind}, {what}", found))
        json_text(finite(result))  # values of no type that a record of ours has
    write_result(arguments, result, lines)


def _kind(name: str) -> ResultKind:
    """Return a kind of results; of a checkpoint, whose kind has the name of its command, that of the command."""
    of_command = (kind for kind in RESULT_KINDS.values() if name in kind.commands)
    return RESULT_KINDS.get(name) or next(of_command, ResultKind(name, (), None))


def _nested(value: Any) -> Any:
    """Return nested data of its JSON text; any other value as it is."""
    if isinstance(value, str) and value[:1] in "{[":
        try:
            return json.loads(value)
        except ValueError:  # a text that begins like that
            return value
    return value


def _origin(record: _Record) -> Iterator[Fact]:
    """Yield when, by which software and from what input the file was made."""
    path, attributes = Path(record.path), record.attributes
    made = attributes.get("provenance", {})
    matrices = made.get("matrices", attributes.get("matrices"))
    matrices = matrices if isinstance(matrices, dict) else made  # of an imported model: their names
    written = datetime.fromtimestamp(path.stat().st_mtime).astimezone()
    yield Fact(
        "written", written.isoformat(" ", "seconds"), "", f"time of the file, {path.stat().st_size / 1e6:.3g} MB"
    )
    versions = matrices.get("versions", {}) | made.get("versions", {}) | attributes.get("versions", {})
    yield Fact("versions", versions)
    if "mesh" in matrices:
        yield Fact("mesh", {"file": matrices["mesh"], "sha256": matrices["mesh_sha256"]})
    if scene := _scene(record):
        structure = scene["structure"]
        yield Fact("structure", structure["model"], "", structure.get("file", ""))
        yield Fact("bodies", dict(Counter(body["shape"] for body in scene["damper"])))
    yield Fact("files", attributes.get("model"), "", "SHA-256 of the other input files")


def _scene(record: _Record) -> dict[str, Any] | None:
    """Return the scene in a file, as plain data; None without."""
    of_study, made = record.attributes.get("study", {}), record.attributes.get("provenance", {})
    found: dict[str, Any] | None = record.attributes.get("scene") or of_study.get("scene") or made.get("scene")
    return found


def _modes(record: _Record) -> Iterator[Fact]:
    attributes = record.attributes
    yield Fact("frequency_hz", record.variables["frequency"].values[:_MOST].tolist(), "Hz", "natural frequencies")
    if "first_bending" in attributes:
        yield Fact("first_bending_number", attributes["first_bending"] + 1, "", "of the modes, counted from 1")
    yield Fact("rigid", attributes.get("rigid"), "", "rigid model, SI units")
    yield from _level(attributes.get("fatigue"))


def _level(level: Mapping[str, Any] | None) -> Iterator[Fact]:
    if level:
        error = level["error"] if "error" in level else level.get("hot_spot", {}).get("error")
        note = f"at {level['share']:.0%} of the fatigue strength{plus_minus(error)}"
        yield Fact("fatigue_amplitude", level["amplitude"], "m", note)


def _calibration(record: _Record) -> Iterator[Fact]:
    found = CalibrationRecord.load(record.path)
    yield Fact("rigid", asdict(found.rigid), "", "rigid model, SI units")
    if found.part:
        yield Fact("factor", dict(zip(found.part, found.factor.tolist(), strict=True)), "", "on stiffness")
        yield Fact("target_frequency", found.target_hz.tolist(), "Hz")
        yield Fact("frequency_after", found.after_hz.tolist(), "Hz")
    yield Fact("damping", found.damping)
    yield from _level(found.excitation)
    if found.excitation:
        yield Fact("force", found.excitation["force"], "N", "at resonance, gives this amplitude")


def _campbell(record: _Record) -> Iterator[Fact]:
    of = {name: variable.values for name, variable in record.variables.items()}
    rpm = of["speed"] * 30 / np.pi
    yield Fact("rpm", [float(rpm[0]), float(rpm[-1])], "", "lowest and highest speed")
    ends = [f"mode {mode + 1} {np.nanmin(row):.6g} to {np.nanmax(row):.6g}" for mode, row in zip(
        of["mode"], of["frequency"], strict=True)]  # fmt: skip
    yield Fact("frequencies", ends, "Hz")
    crossings = zip(of["crossing_mode"], of["crossing_order"], of["crossing_speed"] * 30 / np.pi, strict=True)
    found = [f"mode {mode + 1} and order {order:g} at {speed:.6g} rpm" for mode, order, speed in crossings]
    yield Fact("crossings", found)
    yield Fact("veerings", int((of["approach_kind"] == "veering").sum()))
    yield Fact("error", float(of["error"].max()), "", "estimated, relative, of the frequencies")


def _ring(record: _Record) -> Iterator[Fact]:
    found = Interference.load(record.path)
    yield Fact("sectors", found.modes.sectors)
    yield Fact("speed", found.speed, "rad/s")
    rows = [f"diameter {found.label(h)}: " + ", ".join(f"{hz:.6g}" for hz in row if np.isfinite(hz))
            for h, row in found.by_diameter()]  # fmt: skip
    yield Fact("frequencies", rows, "Hz", "by family")
    met = found.in_operation
    yield Fact("meetings", [f"{found.name(each.mode)} and order {each.order:g} at {each.rpm:.6g} rpm" for each in met])


def _reduced(record: _Record) -> Iterator[Fact]:
    made = record.attributes.get("provenance", {})
    frequencies = record.variables["natural_frequency"].values
    yield Fact("frequency_hz", frequencies[:_MOST].tolist(), "Hz", "natural frequencies")
    yield Fact("interface", record.variables["interface"].values.tolist())
    yield Fact("basis", made.get("basis"))
    yield Fact("estimate", made.get("estimate", {}).get("sentence"))
    yield from _level(made.get("fatigue"))
    for line in spot_lines(hot_spots(ReducedModel.load(record.path))):
        name, _, facts = line.partition(" ")
        yield Fact(name, facts)


def _ring_model(record: _Record) -> Iterator[Fact]:
    ring = load_ring(record.path)
    yield Fact("sectors", ring.sectors)
    yield Fact("frequency_hz", np.unique(ring.frequencies_hz)[:_MOST].tolist(), "Hz", "of the tuned ring")
    yield Fact("interface", list(ring.interface), "", "of every sector")
    yield Fact("modes", ring.modes, "", f"natural modes of {ring.size} coordinates")
    yield Fact("estimate", ring.provenance.get("estimate", {}).get("sentence"))


def _mistuning(record: _Record) -> Iterator[Fact]:
    study = MistuningStudy.load(record.path).to_json()
    yield Fact("draws", study["seeds"])
    for row in study["orders"]:
        top, median = row["amplification"]["largest"], row["quantiles"][0]["value"]
        yield Fact(f"order {row['order']}", f"amplification up to {top:.4g}, median {median:.4g}")


def _response(record: _Record) -> Iterator[Fact]:
    for name in _OF_RESPONSE:
        yield Fact(name, record.attributes.get(name), UNITS.get(name, ""))
    for name, spot in record.attributes.get("stress", {}).items():
        share = spot["strength_fraction"]
        level = "" if share is None else f"{share:.3g} of the fatigue strength"
        yield Fact(f"{name}_von_mises", spot["von_mises"], "Pa", level + plus_minus(spot.get("mesh_error")))


def _sweep(record: _Record) -> Iterator[Fact]:
    sweep = Sweep.load(record.path)
    units = sweep.units()
    ends = {path: f"{values[0]} to {values[-1]} {units[path]}".strip() for path, values in sweep.axes.items()}
    yield Fact("axes", {path: f"{ends[path]}, {len(values)} values" for path, values in sweep.axes.items()})
    for name, texts in (("status", sweep.status), ("classification", sweep.classification)):
        yield Fact(name, dict(Counter(map(str, texts.ravel()))), "", "points")
    found = [design for design in designs(forced_responses(sweep)) if design.worst.reference > 0]
    yield Fact("response", [design.sentence for design in found[:1]], "", "best design, by its worst curve")
    yield Fact("designs", len(found))
    yield Fact("curves", sum(len(design.curves) for design in found))


def _ensemble(record: _Record) -> Iterator[Fact]:
    found = Ensemble.load(record.path)
    yield Fact("ranges", {path: list(ends) for path, ends in found.scene.ranges.items()})
    yield Fact("samples", len(found.status))
    yield Fact("status", dict(Counter(map(str, found.status.ravel()))), "", "points")
    low = found.quantile["reduction"][0].ravel()
    worst = int(np.nanargmin(low)) if np.isfinite(low).any() else 0
    yield Fact("response", list(found.sentences())[worst : worst + 1], "", "the curve with the lowest reduction")


def _orbits(record: _Record) -> Iterator[Fact]:
    branches = Branches.load(record.path)
    yield Fact("parameter", branches.parameter)
    found = branches.to_json()
    yield Fact("branches", [
        f"{branch['points']} orbits from {branch['parameter_min']:.6g} to {branch['parameter_max']:.6g} "
        f"{found['unit']}, {branch['stable_points']} stable" for branch in found["branches"]
    ])  # fmt: skip
    yield Fact("special_points", dict(Counter(point["kind"] for point in found["special_points"])))
    yield Fact("borders", [
        f"{border['kind']}, {border['points']} points over {branches.second}" for border in found["borders"]
    ])  # fmt: skip


def _ramp(record: _Record) -> Iterator[Fact]:
    found = Ramp.load(record.path).to_json()
    yield Fact("runs", [
        f"{abs(run['rate']):g} {found['unit']}/s {run['direction']}: {run['status']}, peak {run['peak']:.6g} m at "
        f"{run['peak_frequency']:.6g} Hz, {run['peak_share']:.1%} of the steady peak without bodies"
        for run in found["runs"]
    ])  # fmt: skip


def _ring_down(record: _Record) -> Iterator[Fact]:
    found = RingDown.load(record.path)
    half = found.half_cycles
    yield Fact("status", found.status.value)
    yield Fact("mode_hz", found.linear.frequency, "Hz", f"mode {found.linear.mode}, without bodies")
    yield Fact("damping_ratio", found.linear.damping_ratio, "", "of it")
    yield Fact("half_cycles", len(half.time))
    yield Fact("amplitude", half.amplitude[[0, -1]].tolist() if len(half.time) else None, "m", "first and last")
    yield Fact("impacts", int(found.impacts.sum()))
    yield Fact("rest_time", found.rest_time, "s")


def _optimisation(record: _Record) -> Iterator[Fact]:
    attributes = record.attributes
    yield Fact("answer", attributes["sentence"])
    yield Fact("nominal", attributes["nominal"], "", "best as designed")
    yield Fact("robust", attributes["robust"], "", "best within the tolerances")
    yield Fact("remarks", Optimisation.load(record.path).remarks)
    yield Fact("scenes", attributes["scenes"], "", f"of them {attributes['trouble']} not ok")


def _life(record: _Record) -> Iterator[Fact]:
    attributes, of = record.attributes, {name: variable.values for name, variable in record.variables.items()}
    yield Fact("answer", attributes["sentence"])
    yield Fact("hours", of["time"][[0, -1]].tolist(), "h", "first and last moment")
    yield Fact("gap", of["gap"][[0, -1]].tolist(), "m", "of the cavities, then")
    yield Fact("runs", attributes["runs"], "", f"of them {attributes['trouble']} not ok")


def _identification(record: _Record) -> Iterator[Fact]:
    attributes = record.attributes
    yield Fact("status", attributes["status"])
    yield Fact("answer", attributes["sentence"])
    yield Fact("notes", list(attributes["notes"]))
    yield Fact("measured", len(record.variables["data_value"].values), "", "values")
    yield Fact("counts", attributes["counts"], "", "engine runs and evaluations of period maps")


def _any(record: _Record) -> Iterator[Fact]:
    """Yield the numbers and words of a record of another kind."""
    for name, value in record.attributes.items():
        if isinstance(value, str | int | float) and name not in ("kind", "schema_version"):
            yield Fact(name, value)


def _sizes(variables: Mapping[str, Variable]) -> dict[str, int]:
    """Return the lengths of the dimensions."""
    return {
        name: length
        for variable in variables.values()
        for name, length in zip(variable.dims, np.shape(variable.values), strict=True)
    }


def _warnings(record: _Record) -> list[str]:
    found = record.attributes.get("warnings") or record.attributes.get("provenance", {}).get("warnings", [])
    return list(found)


#: figures of the kinds of records that have some of their own
_FIGURES: dict[str, Callable[[_Record], Iterator[Fact]]] = {
    "modes": _modes, "calibration": _calibration, "campbell": _campbell, "ring-modes": _ring,
    "reduced-model": _reduced, "ring-model": _ring_model, "ring-sectors": _ring_model, "mistuning": _mistuning,
    "response": _response, "sweep": _sweep, "ensemble": _ensemble, "orbits": _orbits, "ramp": _ramp,
    "ring_down": _ring_down, "optimisation": _optimisation, "life": _life, "identification": _identification,
}  # fmt: skip
