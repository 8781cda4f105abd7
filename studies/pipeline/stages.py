"""The stages of a pipeline: what each reads, what decides about doing it again, and how it is done."""

from __future__ import annotations

import copy
import importlib.metadata
import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.provenance import versions
from vanedamp.files.store import clear_leftovers, digest, load
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.studies.case.tables import Case, check_interface, without_strengths
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.pipeline.record import Inputs, plain
from vanedamp.studies.pipeline.tables import (
    CALIBRATION,
    MODES,
    REDUCED,
    RIGID_SCENE,
    TUNED_CASE,
    IdentifyStage,
    PipelineFile,
    ReduceStage,
    SweepStage,
)
from vanedamp.studies.scene_checks import check_model, check_moved, check_numbers

#: tables of a scene for other commands
_OF_OTHERS = ("orbit", "ramp", "ring_down")
#: keys of the rigid model that a scene takes
_RIGID = ("mass", "stiffness", "damping_ratio", "base_mass")
#: the model of a structure that the pipeline gives, and the keys of the scene's own that it replaces
_MODELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "rigid": ("rigid", (*_RIGID, "damping")),
    "reduced": ("rom", ("file",)),
}
#: the level of a scene, which `level` replaces
_LEVELS = ("force", "base_acceleration", "resonance_amplitude", "load_factor")
#: the rigid model and the reduced one before they are made, to check a scene with
_ANY_RIGID = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01}
_DOLFINX = ("fenics-dolfinx", "dolfinx-solver-real")


@dataclass(frozen=True)
class Tools:
    """The inputs of a stage's work.

    note: takes a line for the user, to which it adds the stage's name; pool: returns the worker processes, started when
    first asked for; fresh: what an earlier start left is of other inputs; made_of: the inputs of the outputs that are
    there, if they are as the stage made them.
    """

    note: Callable[[str], None]
    pool: Callable[[], Executor | None]
    fresh: bool = False
    made_of: Inputs | None = None

    def warn(self, warnings: Iterable[str]) -> None:
        """Pass warnings to the user."""
        for warning in warnings:
            self.note(f"warning: {warning}")


@dataclass(frozen=True)
class Stage(ABC):
    """One step.

    name     as lines and records call it
    file     that its errors are about
    outputs  files that it writes
    takes    outputs of earlier stages that it reads
    """

    name: str
    file: Path
    outputs: tuple[Path, ...]
    takes: tuple[Path, ...]

    @abstractmethod
    def check(self, check_scene: Callable[[Scene, bool], None]) -> Iterable[str | Path]:
        """Check the input before anything runs, and return the files that it names. Raises VanedampError.

        check_scene: takes a scene that will run, and whether its peak runs with samples.
        """

    @abstractmethod
    def inputs(self) -> dict[str, Any]:
        """Return what decides about doing it again (record.Inputs). Products that are not there yet are left out."""

    @abstractmethod
    def work(self, tools: Tools) -> str:
        """Do it, and return the result in one line. Raises VanedampError."""


@dataclass(frozen=True)
class CaseStage(Stage):
    """A stage with finite elements."""

    #: keys of the case's [calibration] that the stage reads; None: all of it, and the measurements
    CALIBRATION_KEYS: ClassVar[Sequence[str] | None] = ()

    def check(self, check_scene: Callable[[Scene, bool], None]) -> Iterable[str | Path]:
        """Check the case, which a tuned one does not differ from but in numbers."""
        return [] if self.takes else [self.file, *self._checked().files]

    def _checked(self) -> Case:
        return Case.load(self.file)

    def inputs(self) -> dict[str, Any]:
        """Return the case's tables without other stages', and the files that it names."""
        if not self.file.exists():
            return {}
        tables, case = read_toml(self.file), Case.load(self.file)
        tables.pop("campbell", None)
        if self.CALIBRATION_KEYS is not None:
            case, measured = replace(case, calibration=None), tables.pop("calibration", {})
            kept = {key: measured[key] for key in self.CALIBRATION_KEYS if key in measured}
            tables |= {"calibration": kept} if self.CALIBRATION_KEYS else {}
        return {f"case {self.file.name}": tables} | _digests(case.files, self.file.parent) | _software(*_DOLFINX)


@dataclass(frozen=True)
class Calibrate(CaseStage):
    """From a case to its calibration, the tuned case and a scene of the rigid model."""

    CALIBRATION_KEYS = None

    def work(self, tools: Tools) -> str:
        """Calibrate."""
        from vanedamp.files.checkpoint_file import clear
        from vanedamp.studies.case.calibrated_files import save_rigid_scene, save_tuned_case
        from vanedamp.studies.case.calibration import calibrate

        record, tuned, scene = self.outputs
        checkpoint = f"{record}.partial"
        if tools.fresh:
            clear(checkpoint)
        found = calibrate(Case.load(self.file), checkpoint)
        found.record.save(record)
        save_tuned_case(self.file, found, tuned)
        save_rigid_scene(self.file, found, scene)
        clear(checkpoint)
        tools.warn(found.warnings)
        rigid, factors = found.rigid, ""
        if found.tuning is not None:
            pairs = zip(found.tuning.names, found.tuning.factors.tolist(), strict=True)
            factors = "; " + ", ".join(f"{name} times {factor:.4g}" for name, factor in pairs)
        return f"{rigid.frequency_hz:.6g} Hz, damping ratio {rigid.damping_ratio:.4g}{factors}"


@dataclass(frozen=True)
class Modal(CaseStage):
    """From a case to its modes."""

    CALIBRATION_KEYS = ("share", "hot_spot")

    def work(self, tools: Tools) -> str:
        """Compute the modes."""
        from vanedamp.studies.case.stages import assemble, modal_analysis, set_level

        case, now = Case.load(self.file), plain(self.inputs())
        same = tools.made_of is not None and _without_level(tools.made_of) == _without_level(now)
        if same and (level := set_level(self.outputs[0], case)) is not None:
            tools.warn(level_warnings(level.to_json()))
            return "modes kept, only the amplitude at the fatigue strength is new"
        analysis = modal_analysis(assemble(case))
        analysis.save(self.outputs[0])
        tools.warn(analysis.warnings)
        first = "" if analysis.rigid is None else f", first bending {analysis.rigid.frequency_hz:.6g} Hz"
        return f"{len(analysis.modes)} modes{first}"


@dataclass(frozen=True)
class Reduce(CaseStage):
    """From a case to its reduced model."""

    table: ReduceStage

    def _checked(self) -> Case:
        case = super()._checked()
        check_interface(case)
        return case

    def inputs(self) -> dict[str, Any]:
        """Return the case's inputs and the options, without those of the fatigue level, which sweeps take elsewhere.

        Strengths are in a model with its hot spots only.
        """
        return _without_level(super().inputs(), self.table.hot_spots > 0) | {"option": asdict(self.table)}

    def work(self, tools: Tools) -> str:
        """Reduce."""
        from vanedamp.studies.case.stages import assemble, reduction, reduction_warnings

        table, structure = self.table, assemble(Case.load(self.file))
        modes = None if table.modes == "auto" else table.modes
        model = reduction(
            structure, modes, table.basis, table.tolerance, table.max_frequency, table.hot_spots, level=False
        )
        model.save(self.outputs[0])
        tools.warn(reduction_warnings(structure, model))
        return str(model.provenance["estimate"]["sentence"])


@dataclass(frozen=True)
class Identify(Stage):
    """From measurements to the numbers of a scene, and the scene with them."""

    table: IdentifyStage

    def check(self, check_scene: Callable[[Scene, bool], None]) -> Iterable[str | Path]:
        """Check the study, and return it, its scene and the measurements."""
        from vanedamp.studies.identification.study import IdentificationStudy

        study = IdentificationStudy.load(self.file)
        check_scene(study.base, False)
        return [self.file, *self._named(), *study.scene.files]

    def _named(self) -> list[Path]:
        """Return the files that the study names."""
        tables = read_toml(self.file)
        measured = [entry for table in tables.values() if isinstance(table, list) for entry in table]
        return [self.file.parent / name for name in (tables["scene"], *(entry["file"] for entry in measured))]

    def inputs(self) -> dict[str, Any]:
        """Return the study, its scene, and the files that both name."""
        scene, *measured = self._named()
        files: list[str | Path] = [*measured, *Scene.load(scene).files]
        of = {f"study {self.file.name}": read_toml(self.file), f"scene {scene.name}": read_toml(scene)}
        return of | _digests(files, self.file.parent) | _software()

    def work(self, tools: Tools) -> str:
        """Identify."""
        from vanedamp.files.checkpoint_file import clear
        from vanedamp.studies.identification.search import identify
        from vanedamp.studies.terminal import progress

        record, scene = self.outputs
        checkpoint = f"{record}.partial"
        if tools.fresh:
            clear(checkpoint)
        with progress(self.name) as report:
            found = identify(self.file, tools.pool(), report, {"versions": versions()}, checkpoint)
        found.save(record)
        found.save_scene(scene)
        clear(checkpoint)
        tools.warn(found.notes)
        return f"{found.status.value}, {found.sentence.removesuffix('.')}"


@dataclass(frozen=True)
class Sweep(Stage):
    """From a scene to its sweep. products: the files of the rigid model and of the reduced one, by their kind."""

    table: SweepStage
    products: dict[str, Path]

    def check(self, check_scene: Callable[[Scene, bool], None]) -> Iterable[str | Path]:
        """Check the scene, on any structure of the kind where its own is not made yet."""
        if self.file in self.takes:
            return []
        scene = Scene.of(self._tables(_ANY_RIGID, 1e-6), self.file)
        self._check(scene)
        check_scene(scene, self.table.peak)
        made = {path.resolve() for path in self.takes}
        if self.table.structure is None and not made:
            check_model(scene)
        return [self.file, *(file for file in scene.files if Path(file).resolve() not in made)]

    def inputs(self) -> dict[str, Any]:
        """Return the scene, its changes by the pipeline, and the files that it names."""
        if not self.file.exists():
            return {}
        scene, (rigid, amplitude) = self._scene(), self._model()
        tables = {key: table for key, table in self._kept(read_toml(self.file)).items() if key not in _OF_OTHERS}
        given: dict[str, Any] = {"option": {key: getattr(self.table, key) for key in ("structure", "level", "peak")}}
        if self.table.structure == "rigid":
            given["rigid model"] = rigid
        if self.table.level is not None:
            given["fatigue level"] = {"amplitude": amplitude}
        files = [] if scene is None else scene.files
        return {f"scene {self.file.name}": tables} | given | _digests(files, self.file.parent) | _software()

    def work(self, tools: Tools) -> str:
        """Run the points that are not done."""
        from vanedamp.files.checkpoint_file import clear
        from vanedamp.studies.report.designs import designs
        from vanedamp.studies.report.forced_response import forced_responses
        from vanedamp.studies.sweep_steps import doubts, prepare, run_peak, run_points

        scene = self._scene()
        assert scene is not None
        self._check(scene)
        check_model(scene)
        checkpoint = Path(f"{self.outputs[0]}.partial")
        if tools.fresh:
            clear(checkpoint)
        prepared = prepare(scene, checkpoint, self.table.peak)
        tools.warn(prepared.points.warnings)
        if prepared.resumed:
            tools.note(f"{prepared.resumed} of {prepared.points.size} points are done, the rest follows")
        result = run_points(prepared, self.outputs[0], tools.pool(), self.name)
        tools.warn(doubts(prepared, result))
        if self.table.peak:
            peak = self.outputs[1]
            run_peak(prepared, result, peak, lambda text: tools.note(text.replace(str(peak), peak.name)))
        clear(checkpoint)
        clear_leftovers(self.outputs[0])
        bad = int((result.status != "ok").sum())
        told = f"{bad} of {result.status.size} points are not ok; " if bad else ""
        best = [design for design in designs(forced_responses(result)) if design.worst.reference > 0]
        return told + (best[0].sentence if best else f"{result.status.size} points")

    def _check(self, scene: Scene) -> None:
        check_moved(scene)
        check_numbers(scene, f"{self.file}: ")
        if not scene.axes:
            raise InputError(
                'sweep: missing; name a grid, such as "excitation.frequency" = {start = 95, stop = 105, num = 11}'
            )

    def _scene(self) -> Scene | None:
        """Return the scene on its structure; None as long as that is not made."""
        rigid, amplitude = self._model()
        if (self.table.structure == "rigid" and not rigid) or (self.table.level is not None and amplitude is None):
            return None
        return Scene.of(self._tables(rigid, amplitude), self.file)

    def _tables(self, rigid: dict[str, Any], amplitude: float | None) -> dict[str, Any]:
        """Return the scene's tables with the structure and the level that the pipeline gives."""
        tables = self._kept(read_toml(self.file))
        if self.table.structure is not None:
            reduced = {"file": str(self.products.get("reduced", REDUCED))}
            tables["structure"] |= rigid if self.table.structure == "rigid" else reduced
        if self.table.level is not None:
            tables["excitation"]["resonance_amplitude"] = amplitude
        return tables

    def _kept(self, tables: dict[str, Any]) -> dict[str, Any]:
        """Return the scene's tables without the keys in whose place the pipeline gives others."""
        structure, excitation = tables.get("structure", {}), tables.get("excitation", {})
        if not (isinstance(structure, dict) and isinstance(excitation, dict)):
            raise InputError("structure, excitation: expected tables, headed [structure] and [excitation]")
        if self.table.structure is not None:
            model, replaced = _MODELS[self.table.structure]
            own = structure if structure.get("model") == model else {}
            tables["structure"] = {"model": model} | {key: own[key] for key in own if key not in replaced}
        if self.table.level is not None:
            tables["excitation"] = {key: excitation[key] for key in excitation if key not in _LEVELS}
        return tables

    def _model(self) -> tuple[dict[str, Any], float | None]:
        """Return the rigid model (nothing before it is made) and the amplitude at the fatigue level."""
        source = self.products.get("rigid")
        if source is None or not source.exists() or (self.table.structure != "rigid" and self.table.level is None):
            return {}, None
        if source.name == CALIBRATION:
            from vanedamp.studies.case.calibration_record import CalibrationRecord

            record = CalibrationRecord.load(source)
            rigid, fatigue = asdict(record.rigid), record.excitation or {}
        else:
            _, attributes = load(source, "modes")
            rigid, fatigue = (json.loads(attributes.get(name, "{}")) for name in ("rigid", "fatigue"))
        if self.table.structure == "rigid" and not rigid:
            raise InputError(f"structure: {source} has no rigid model; give the case an [interface.<label>] table")
        if self.table.level is not None and not fatigue:
            raise InputError(f"level: {source} has no fatigue amplitude; give the case a material.fatigue_strength")
        return {key: rigid[key] for key in _RIGID if rigid.get(key) is not None}, fatigue.get("amplitude")


@dataclass(frozen=True)
class Report(Stage):
    """From all results to the page."""

    results: tuple[Path, ...]
    title: str | None = None

    def check(self, check_scene: Callable[[Scene, bool], None]) -> Iterable[str | Path]:
        """Return the results that are not the pipeline's."""
        return self.results

    def inputs(self) -> dict[str, Any]:
        """Return all results."""
        return _digests([*self.takes, *self.results], self.file.parent) | {"title": self.title} | _software()

    def work(self, tools: Tools) -> str:
        """Write the page."""
        from vanedamp.studies.report.page import write_report
        from vanedamp.studies.report.results import collect

        files = [path for path in (*self.takes, *self.results) if path.exists()]
        write_report(collect(files), self.outputs[0], self.title)
        return f"{len(files)} results on {self.outputs[0].name}"


def _without_level(inputs: Inputs, strengths: bool = False) -> dict[str, Any]:
    """Return the inputs of a case's stage without those of the fatigue level, which concerns no mode.

    strengths: keep the strengths and fatigue data of materials.
    """
    found = copy.deepcopy(dict(inputs))
    for tables in (data for subject, data in found.items() if subject.startswith("case ")):
        tables.pop("calibration", None)
        if not strengths and "material" in tables:
            tables["material"] = without_strengths(tables["material"])
    return found


def stages(pipeline: PipelineFile, source: Path, folder: Path) -> Iterator[Stage]:
    """Yield the stages of a pipeline file with results in a folder, each after those that it takes from."""
    base, folder = source.resolve().parent, folder.resolve()
    made: list[Path] = []
    case, tuned = (base / (pipeline.case or "")).resolve(), tuple[Path, ...]()
    products: dict[str, Path] = {}
    if pipeline.calibrate is not None:
        files = tuple(folder / name for name in (CALIBRATION, TUNED_CASE, RIGID_SCENE))
        yield Calibrate("calibrate", case, files, ())
        products["rigid"] = files[0]
        case, tuned = files[1], files[1:2]
        made.append(files[0])
    if pipeline.modal is not None:
        yield Modal("modal", case, (folder / MODES,), tuned)
        products.setdefault("rigid", folder / MODES)
        made.append(folder / MODES)
    if pipeline.reduce is not None:
        yield Reduce("reduce", case, (folder / REDUCED,), tuned, pipeline.reduce)
        products["reduced"] = folder / REDUCED
        made.append(folder / REDUCED)
    for one in pipeline.identify:
        files = (folder / f"{one.stem}.h5", folder / one.scene)
        yield Identify(f"identify {one.stem}", (base / one.study).resolve(), files, (), one)
        made.append(files[0])
    for table in pipeline.sweep:
        stage = _sweep(table, base, folder, products, pipeline)
        yield stage
        made += stage.outputs
    if pipeline.report is not None:
        further = tuple(base / name for name in pipeline.report.results)
        page = folder / pipeline.report.file
        yield Report("report", page, (page,), tuple(made), further, pipeline.report.title)


def _sweep(table: SweepStage, base: Path, folder: Path, products: dict[str, Path], pipeline: PipelineFile) -> Sweep:
    scene = (base / table.scene).resolve()
    takes = []
    if scene in [folder / name for name in pipeline.scenes_made]:
        takes.append(scene)
    if table.structure == "rigid" or table.level is not None:
        takes.append(products["rigid"])
    if table.structure == "reduced":
        takes.append(products["reduced"])
    elif table.structure is None and "reduced" in products and scene.is_file():
        # a scene may name the pipeline's own model
        with suppress(InputError, AttributeError):  # the stage's check reports the error
            named = read_toml(scene).get("structure", {}).get("file")
            if isinstance(named, str) and (scene.parent / named).resolve() == products["reduced"]:
                takes.append(products["reduced"])
    names = [f"{table.stem}.h5"] + ([f"{table.stem}_peak.h5"] if table.peak else [])
    return Sweep(f"sweep {table.stem}", scene, tuple(folder / name for name in names), tuple(takes), table, products)


def _digests(files: Iterable[str | Path], folder: Path) -> dict[str, str]:
    """Return the digests of the files that are there, by their paths from a folder."""
    return {f"file {os.path.relpath(file, folder)}": digest(file) for file in files if Path(file).is_file()}


def _software(*packages: str) -> dict[str, Any]:
    """Return the versions of the software that the numbers of a stage depend on."""
    found = versions()
    for package in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return {"version": found}
