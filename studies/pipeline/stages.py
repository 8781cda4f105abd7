"""The stages of a pipeline: what each reads, when it runs again, and how."""

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
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.provenance import versions
from vanedamp.files.store import digest, load
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.studies.case.tables import Case, check_interface, without_strengths
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.jobs.job import Job, SceneJob, StudyJob
from vanedamp.studies.pipeline.record import Inputs, plain
from vanedamp.studies.pipeline.tables import (
    CALIBRATION,
    JOBS,
    MODES,
    REDUCED,
    RIGID_SCENE,
    TUNED_CASE,
    IdentifyStage,
    JobStage,
    PipelineFile,
    ReduceStage,
)
from vanedamp.studies.scene_checks import check_model

#: tables of a scene that only one job reads
_OF_JOBS = {"sweep": "sweep", "orbits": "orbit", "ramp": "ramp", "ringdown": "ring_down"}
#: keys of the rigid model that scenes use
_RIGID = ("mass", "stiffness", "damping_ratio", "base_mass")
#: the model of the structure from the pipeline, and the scene's keys that it replaces
_MODELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "rigid": ("rigid", (*_RIGID, "damping")),
    "reduced": ("rom", ("file",)),
}
#: keys of the level of a scene, which `level` replaces
_LEVELS = ("force", "base_acceleration", "resonance_amplitude", "load_factor")
#: placeholder of the rigid model before it exists, to check a scene
_ANY_RIGID = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01}
_DOLFINX = ("fenics-dolfinx", "dolfinx-solver-real")


@dataclass(frozen=True)
class Tools:
    """The inputs of a stage's work.

    note: prints a line with the stage's name; pool: returns the worker processes, started when first used; workers:
    their number; fresh: files of an earlier start belong to other inputs; made_of: the inputs of existing outputs, if
    these are unchanged.
    """

    note: Callable[[str], None]
    pool: Callable[[], Executor | None]
    workers: int = 1
    fresh: bool = False
    made_of: Inputs | None = None

    def warn(self, warnings: Iterable[str]) -> None:
        """Pass warnings to the user."""
        for warning in warnings:
            self.note(f"warning: {warning}")


@dataclass(frozen=True)
class Stage(ABC):
    """One step.

    name     in printed lines and records
    file     that its errors are about
    outputs  files that it writes
    takes    outputs of earlier stages, its inputs
    """

    #: options that name the outputs of its job
    OPTIONS: ClassVar[Sequence[str]] = ("output",)

    name: str
    file: Path
    outputs: tuple[Path, ...]
    takes: tuple[Path, ...]

    @abstractmethod
    def check(self, workers: int) -> Iterable[str | Path]:
        """Check the input before anything runs, and return the files that it names. Raises VanedampError."""

    @abstractmethod
    def inputs(self) -> dict[str, Any]:
        """Return the inputs that decide whether it runs again (record.Inputs). Missing products are left out."""

    @abstractmethod
    def work(self, tools: Tools) -> str:
        """Run it, and return the result in one line. Raises VanedampError."""

    def _run(self, job: Job, tools: Tools) -> str:
        """Run a job, with its checkpoint in the folder of the results, and write its files; as `work`."""
        checkpoint = Path(f"{self.outputs[0]}.partial")
        if tools.fresh:
            clear(checkpoint)
        tools.warn(job.warnings())

        def resumes(finished: int) -> None:
            if finished:
                tools.note(f"{finished} points are done, the rest follows")

        outcome, _ = job.run(tools.pool, checkpoint, self.name, resumes)
        for option, path in zip(self.OPTIONS, self.outputs, strict=False):
            if (write := outcome.writers.get(option)) is not None:
                write(str(path))
        replace(outcome, unfinished=False).clear(checkpoint)  # the stage is done
        tools.warn(outcome.warnings)
        for note in outcome.notes:
            tools.note(note)
        return outcome.sentence


@dataclass(frozen=True)
class CaseStage(Stage):
    """A stage with finite elements."""

    #: keys of the case's [calibration] that the stage reads; None: all of it, and the measurements
    CALIBRATION_KEYS: ClassVar[Sequence[str] | None] = ()

    def check(self, workers: int) -> Iterable[str | Path]:
        """Check the case; a tuned case differs only in numbers."""
        return [] if self.takes else [self.file, *self._checked().files]

    def _checked(self) -> Case:
        return Case.load(self.file)

    def inputs(self) -> dict[str, Any]:
        """Return the case's tables without those of other stages, and the files that it names."""
        if not self.file.exists():
            return {}
        tables, case = read_toml(self.file), Case.load(self.file)
        tables.pop("campbell", None)
        if self.CALIBRATION_KEYS is not None:
            case, measured = replace(case, calibration=None), tables.pop("calibration", {})
            calibration = {key: measured[key] for key in self.CALIBRATION_KEYS if key in measured}
            tables |= {"calibration": calibration} if self.CALIBRATION_KEYS else {}
        return {f"case {self.file.name}": tables} | digests(case.files, self.file.parent) | software(*_DOLFINX)


@dataclass(frozen=True)
class Calibrate(CaseStage):
    """From a case to its calibration, the tuned case and a scene of the rigid model."""

    CALIBRATION_KEYS = None
    OPTIONS = ("output", "case", "scene")

    def work(self, tools: Tools) -> str:
        """Calibrate."""
        from vanedamp.studies.jobs.calibrate import CalibrateJob

        return self._run(CalibrateJob(str(self.file), Case.load(self.file)), tools)


@dataclass(frozen=True)
class Modal(CaseStage):
    """From a case to its modes."""

    CALIBRATION_KEYS = ("share", "hot_spot")

    def work(self, tools: Tools) -> str:
        """Compute the modes."""
        from vanedamp.studies.case.stages import assemble, modal_analysis, set_level

        case, now = Case.load(self.file), plain(self.inputs())
        same_modes = tools.made_of is not None and _without_level(tools.made_of) == _without_level(now)
        if same_modes and (level := set_level(self.outputs[0], case)) is not None:
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

    #: whether the model keeps the amplitude at the case's fatigue strength
    LEVEL: ClassVar[bool] = False

    table: ReduceStage

    def _checked(self) -> Case:
        case = super()._checked()
        check_interface(case)
        return case

    def inputs(self) -> dict[str, Any]:
        """Return the case's inputs and the options, without the fatigue level, which sweeps read elsewhere.

        Only a model with hot spots depends on strengths.
        """
        case = super().inputs() if self.LEVEL else _without_level(super().inputs(), self.table.hot_spots > 0)
        return case | {"option": asdict(self.table)}

    def work(self, tools: Tools) -> str:
        """Reduce."""
        from vanedamp.studies.case.stages import assemble, reduction, reduction_warnings

        table, structure = self.table, assemble(Case.load(self.file))
        modes = None if table.modes == "auto" else table.modes
        model = reduction(
            structure, modes, table.basis, table.tolerance, table.max_frequency, table.hot_spots, level=self.LEVEL
        )
        model.save(self.outputs[0])
        tools.warn(reduction_warnings(structure, model))
        return str(model.provenance["estimate"]["sentence"])


@dataclass(frozen=True)
class Identify(Stage):
    """From measurements to the numbers of a scene, and the scene with them."""

    table: IdentifyStage
    OPTIONS = ("output", "scene")

    def check(self, workers: int) -> Iterable[str | Path]:
        """Check the study, and return it, its scene and the measurements."""
        job = self._job()
        job.check(workers)
        return [self.file, *self._named(), *job.files]

    def _job(self) -> Job:
        from vanedamp.studies.identification.study import IdentificationStudy
        from vanedamp.studies.jobs.identify import IdentifyJob

        return IdentifyJob(str(self.file), IdentificationStudy.load(self.file))

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
        return of | digests(files, self.file.parent) | software()

    def work(self, tools: Tools) -> str:
        """Identify."""
        return self._run(self._job(), tools)


@dataclass(frozen=True)
class OnScene(Stage):
    """A job on a scene or a study. products: the files of the rigid model and of the reduced one, by their kind."""

    kind: str
    table: JobStage
    products: dict[str, Path]
    OPTIONS = ("output", "peak")

    def check(self, workers: int) -> Iterable[str | Path]:
        """Check the scene, with a placeholder for a structure that does not exist yet."""
        if self.file in self.takes:
            return []
        kind = self._class()
        scene = kind.FILE.of(self._tables(_ANY_RIGID, 1e-6), self.file)
        products = {path.resolve() for path in self.takes}
        if self.table.structure is None and not products:
            check_model(scene)
        # a study evaluates its model, which may not exist yet
        if issubclass(kind, SceneJob) or (self.table.structure is None and not products):
            self._job(_ANY_RIGID, 1e-6).check(workers)
        return [self.file, *(file for file in scene.files if Path(file).resolve() not in products)]

    def inputs(self) -> dict[str, Any]:
        """Return the scene, its changes by the pipeline, and the files that it names."""
        if not self.file.exists():
            return {}
        rigid, amplitude = self._model()
        tables = self._kept(read_toml(self.file))
        for table in {*_OF_JOBS.values()} - {_OF_JOBS.get(self.kind)}:
            tables.pop(table, None)
        options = [key for key in ("structure", "level", "peak") if hasattr(self.table, key)]
        changes: dict[str, Any] = {"option": {key: getattr(self.table, key) for key in options}}
        if self.table.structure == "rigid":
            changes["rigid model"] = rigid
        if self.table.level is not None:
            changes["fatigue level"] = {"amplitude": amplitude}
        there = (rigid or self.table.structure != "rigid") and (amplitude is not None or self.table.level is None)
        files = self._class().FILE.of(self._tables(rigid, amplitude), self.file).files if there else []
        return {f"scene {self.file.name}": tables} | changes | digests(files, self.file.parent) | software()

    def work(self, tools: Tools) -> str:
        """Run it."""
        job = self._job(*self._model())
        assert job.scene is not None
        check_model(job.scene)
        return self._run(job, tools)

    def _class(self) -> type[SceneJob | StudyJob]:
        module, _, name = JOBS[self.kind].partition(":")
        job_class: type[SceneJob | StudyJob] = getattr(import_module(f"vanedamp.studies.jobs.{module}"), name)
        return job_class

    def _job(self, rigid: dict[str, Any], amplitude: float | None) -> SceneJob | StudyJob:
        """Return the job with the structure and the level of the pipeline."""
        options = dict(zip(self.OPTIONS[1:], (path.name for path in self.outputs[1:]), strict=False))
        return self._class().of_tables(self._tables(rigid, amplitude), self.file, **options)

    def _tables(self, rigid: dict[str, Any], amplitude: float | None) -> dict[str, Any]:
        """Return the file's tables with the structure and the level of the pipeline."""
        tables = self._kept(read_toml(self.file))
        if self.table.structure is not None:
            reduced = {"file": str(self.products.get("reduced", REDUCED))}
            tables["structure"] |= rigid if self.table.structure == "rigid" else reduced
        if self.table.level is not None:
            tables["excitation"]["resonance_amplitude"] = amplitude
        return tables

    def _kept(self, tables: dict[str, Any]) -> dict[str, Any]:
        """Return the scene's tables without the keys that the pipeline replaces."""
        structure, excitation = tables.get("structure", {}), tables.get("excitation", {})
        if not (isinstance(structure, dict) and isinstance(excitation, dict)):
            raise InputError("structure, excitation: expected tables, headed [structure] and [excitation]")
        if self.table.structure is not None:
            model, replaced = _MODELS[self.table.structure]
            base = structure if structure.get("model") == model else {}
            tables["structure"] = {"model": model} | {key: base[key] for key in base if key not in replaced}
        if self.table.level is not None:
            tables["excitation"] = {key: excitation[key] for key in excitation if key not in _LEVELS}
        return tables

    def _model(self) -> tuple[dict[str, Any], float | None]:
        """Return the rigid model (empty before it exists) and the amplitude at the fatigue level."""
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

    def check(self, workers: int) -> Iterable[str | Path]:
        """Return the results that are not the pipeline's."""
        return self.results

    def inputs(self) -> dict[str, Any]:
        """Return all results."""
        return digests([*self.takes, *self.results], self.file.parent) | {"title": self.title} | software()

    def work(self, tools: Tools) -> str:
        """Write the page."""
        from vanedamp.studies.report.page import write_report
        from vanedamp.studies.report.results import collect

        files = [path for path in (*self.takes, *self.results) if path.exists()]
        write_report(collect(files), self.outputs[0], self.title)
        return f"{len(files)} result{'s' * (len(files) != 1)} on {self.outputs[0].name}"


def _without_level(inputs: Inputs, strengths: bool = False) -> dict[str, Any]:
    """Return the inputs of a case's stage without those of the fatigue level, which does not affect modes.

    strengths: keep the strengths and fatigue data of materials.
    """
    remaining = copy.deepcopy(dict(inputs))
    for tables in (data for subject, data in remaining.items() if subject.startswith("case ")):
        tables.pop("calibration", None)
        if not strengths and "material" in tables:
            tables["material"] = without_strengths(tables["material"])
    return remaining


def stages(pipeline: PipelineFile, source: Path, folder: Path) -> Iterator[Stage]:
    """Yield the stages of a pipeline file with results in a folder, each after the stages that it depends on."""
    base, folder = source.resolve().parent, folder.resolve()
    results: list[Path] = []
    case, tuned = (base / (pipeline.case or "")).resolve(), tuple[Path, ...]()
    products: dict[str, Path] = {}
    if pipeline.calibrate is not None:
        files = tuple(folder / name for name in (CALIBRATION, TUNED_CASE, RIGID_SCENE))
        yield Calibrate("calibrate", case, files, ())
        products["rigid"] = files[0]
        case, tuned = files[1], files[1:2]
        results.append(files[0])
    if pipeline.modal is not None:
        yield Modal("modal", case, (folder / MODES,), tuned)
        products.setdefault("rigid", folder / MODES)
        results.append(folder / MODES)
    if pipeline.reduce is not None:
        yield Reduce("reduce", case, (folder / REDUCED,), tuned, pipeline.reduce)
        products["reduced"] = folder / REDUCED
        results.append(folder / REDUCED)
    for identified in pipeline.identify:
        files = (folder / f"{identified.stem}.h5", folder / identified.scene)
        yield Identify(f"identify {identified.stem}", (base / identified.study).resolve(), files, (), identified)
        results.append(files[0])
    for kind in JOBS:
        for table in getattr(pipeline, kind):
            stage = _on_scene(kind, table, base, folder, products, pipeline)
            yield stage
            results += stage.outputs
    if pipeline.report is not None:
        further = tuple(base / name for name in pipeline.report.results)
        page = folder / pipeline.report.file
        yield Report("report", page, (page,), tuple(results), further, pipeline.report.title)


def _on_scene(
    kind: str, table: JobStage, base: Path, folder: Path, products: dict[str, Path], pipeline: PipelineFile
) -> OnScene:
    scene = (base / table.file).resolve()
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
    names = [f"{table.stem}.h5"] + ([f"{table.stem}_peak.h5"] if getattr(table, "peak", False) else [])
    files = tuple(folder / name for name in names)
    return OnScene(f"{kind} {table.stem}", scene, files, tuple(takes), kind, table, products)


def digests(files: Iterable[str | Path], folder: Path) -> dict[str, str]:
    """Return the digests of existing files, by their paths relative to a folder."""
    return {f"file {os.path.relpath(file, folder)}": digest(file) for file in files if Path(file).is_file()}


def software(*packages: str) -> dict[str, Any]:
    """Return the versions of the software that the numbers of a stage depend on."""
    installed = versions()
    for package in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            installed[package] = importlib.metadata.version(package)
    return {"version": installed}
