"""The pipeline file: which stages run, on which case and scenes (SI units), as frozen records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, InputError, Positive, Real, Whole, read_toml, validate
from vanedamp.rom.basis import basis_named

#: outputs of the stages in the folder of the results, with a file for every sweep
CALIBRATION, TUNED_CASE, RIGID_SCENE = "calibration.h5", "tuned.toml", "rigid.toml"
MODES, REDUCED = "modes.h5", "rom.h5"
#: by its table, the class of a job below studies.jobs, in the order in which they run
JOBS = {
    "sweep": "sweep:SweepJob", "run": "run:RunJob", "orbits": "orbits:OrbitsJob", "ramp": "ramp:RampJob",
    "ringdown": "ring_down:RingDownJob", "optimise": "optimise:OptimiseJob", "life": "life:LifeJob",
}  # fmt: skip


@dataclass(frozen=True, config=STRICT)
class CalibrateStage:
    """Stage `calibrate`: tunes the case to its measurements. The stages after it take the tuned case."""


@dataclass(frozen=True, config=STRICT)
class ModalStage:
    """Stage `modal`: modes of the case, or of the tuned one."""


@dataclass(frozen=True, config=STRICT)
class ReduceStage:
    """Stage `reduce`: the reduced model of the case, or of the tuned one, with the options of `vanedamp reduce`."""

    modes: Annotated[Whole, Field(ge=0)] | Literal["auto"] = 12
    """modes to keep, or "auto": as few as the tolerance needs [-]"""
    basis: str = "craig-bampton"
    """craig-bampton, rubin, macneal, massless or truncated"""
    tolerance: Annotated[Real, Field(gt=0, lt=1)] = 0.01
    """relative error that modes = "auto" keeps within [-]"""
    max_frequency: Positive | None = None
    """frequency up to which the error is estimated; left out: 1.5 times the first bending [Hz]"""
    hot_spots: Annotated[Whole, Field(ge=0, le=1000)] = 0
    """most stressed places of the first mode whose stresses are outputs of the model [-]"""

    def __post_init__(self) -> None:
        basis_named(self.basis)


@dataclass(frozen=True, config=STRICT)
class IdentifyStage:
    """Stage `identify`: numbers of a scene from measurements, and the scene with them, for a sweep."""

    study: str
    """study file of `vanedamp identify`, relative to the pipeline's"""
    name: str | None = None
    """name of the stage and of its results NAME.h5 and NAME_found.toml, the scene; left out: that of the study file"""

    @property
    def stem(self) -> str:
        """The name of the result files, without suffix."""
        return self.name or Path(self.study).stem

    @property
    def scene(self) -> str:
        """The name of the scene file that it writes."""
        return f"{self.stem}_found.toml"


@dataclass(frozen=True, config=STRICT, kw_only=True)
class JobStage:
    """Stage of a job on a scene, or on a study with one."""

    structure: Literal["rigid", "reduced"] | None = None
    """structure in place of the scene's own: "rigid", that of calibrate (or modal), or "reduced", that of reduce"""
    level: Literal["fatigue"] | None = None
    """"fatigue" in place of the scene's own level: the resonance without bodies reaches the case's fraction of the
    fatigue strength"""
    name: str | None = None
    """name of the stage and of its result NAME.h5; left out: that of the scene or study file"""

    @property
    def file(self) -> str:
        """The name of the scene or study file."""
        raise NotImplementedError

    @property
    def stem(self) -> str:
        """The name of the result file, without suffix."""
        return self.name or Path(self.file).stem


@dataclass(frozen=True, config=STRICT, kw_only=True)
class SceneStage(JobStage):
    """Stage of a job on a scene: `run`, `orbits`, `ramp`, `ringdown`."""

    scene: str
    """scene file, relative to the pipeline's"""

    @property
    def file(self) -> str:
        """The name of the scene file."""
        return self.scene


@dataclass(frozen=True, config=STRICT, kw_only=True)
class SweepStage(SceneStage):
    """Stage `sweep`: a run at every point of a scene's [sweep] grid."""

    peak: bool = False
    """whether the point with the highest mean runs once more, with events and samples for the report (NAME_peak.h5)"""


@dataclass(frozen=True, config=STRICT, kw_only=True)
class StudyStage(JobStage):
    """Stage of a job on a study: `optimise`, `life`."""

    study: str
    """study file, relative to the pipeline's"""

    @property
    def file(self) -> str:
        """The name of the study file."""
        return self.study


@dataclass(frozen=True, config=STRICT)
class ReportStage:
    """Stage `report`: one page of all results."""

    file: Annotated[str, Field(pattern=r"\.html?$")] = "report.html"
    """page, in the folder of the results"""
    title: str | None = None
    """title of the page"""
    results: tuple[str, ...] = ()
    """further result files to show, relative to the pipeline's"""


@dataclass(frozen=True, config=STRICT)
class PipelineFile:
    """A pipeline: a stage runs if its table is there, an empty one too, in the order of the keys below."""

    case: str | None = None
    """case file of calibrate, modal and reduce, relative to this file"""
    folder: str = "."
    """folder of the results, relative to this file"""
    calibrate: CalibrateStage | None = None
    """tune the case to its measurements (its table [calibration]) and go on with the tuned one"""
    modal: ModalStage | None = None
    """modes, effective masses, rigid model"""
    reduce: ReduceStage | None = None
    """reduced model at the case's interface"""
    identify: tuple[IdentifyStage, ...] = ()
    """numbers of scenes from measurements, one table each"""
    sweep: tuple[SweepStage, ...] = ()
    """scenes to run at every point of their [sweep], one table each"""
    run: tuple[SceneStage, ...] = ()
    """scenes to run at one frequency, one table each"""
    orbits: tuple[SceneStage, ...] = ()
    """scenes whose periodic orbits are followed, as their [orbit] says"""
    ramp: tuple[SceneStage, ...] = ()
    """scenes that run up and down, as their [ramp] says"""
    ringdown: tuple[SceneStage, ...] = ()
    """scenes that ring down, as their [ring_down] says"""
    optimise: tuple[StudyStage, ...] = ()
    """studies of `vanedamp optimise`"""
    life: tuple[StudyStage, ...] = ()
    """studies of `vanedamp life`"""
    report: ReportStage | None = None
    """one HTML page of all results"""

    def __post_init__(self) -> None:
        structural = [name for name in ("calibrate", "modal", "reduce") if getattr(self, name) is not None]
        if self.case is None and structural:
            raise ValueError(f"case: missing; [{structural[0]}] needs a case file")
        if self.case is not None and not structural:
            raise ValueError("case: no stage takes it; give [calibrate], [modal] or [reduce], or leave it out")
        if not (structural or self.identify or self.jobs):
            raise ValueError("sweep: missing; give a stage: [calibrate], [modal], [reduce], [[identify]] or [[sweep]]")
        for key, stage in self.identified.items():
            self._check_name(key, stage)
        for key, table in self.jobs.items():
            self._check_job(key, table)
            self._check_name(key, table)

    @property
    def jobs(self) -> dict[str, JobStage]:
        """The tables of jobs by their keys, in the order in which they run."""
        return {f"{kind}[{index}]": table for kind in JOBS for index, table in enumerate(getattr(self, kind))}

    @property
    def identified(self) -> dict[str, IdentifyStage]:
        """The tables [[identify]] by their keys."""
        return {f"identify[{index}]": table for index, table in enumerate(self.identify)}

    def _check_job(self, key: str, table: JobStage) -> None:
        rigid = self.calibrate is not None or self.modal is not None
        if table.structure == "rigid" and not rigid:
            raise ValueError(f'{key}.structure: "rigid" is that of [calibrate] or [modal]; add one of these tables')
        if table.structure == "reduced" and self.reduce is None:
            raise ValueError(f'{key}.structure: "reduced" is that of [reduce]; add this table')
        if table.level is not None and not rigid:
            raise ValueError(f'{key}.level: "fatigue" is that of [calibrate] or [modal]; add one of these tables')

    def _check_name(self, key: str, table: JobStage | IdentifyStage) -> None:
        if not table.stem or Path(table.stem).name != table.stem:
            raise ValueError(f"{key}.name: expected a file name without folder and suffix, not '{table.stem}'")
        stems = [stage.stem for stage in self.jobs.values()] + [stage.stem for stage in self.identify]
        if stems.count(table.stem) > 1:
            raise ValueError(f"{key}.name: two stages have the name '{table.stem}'; give one of them another")

    @classmethod
    def load(cls, path: str | Path) -> PipelineFile:
        """Read the file. Raises InputError."""
        pipeline = validate(cls, read_toml(path), str(path))
        for key, name in pipeline.named_files.items():
            if not (Path(path).parent / name).is_file() and not pipeline.makes(name):
                raise InputError(f"{path}: {key}: no such file {Path(path).parent / name}")
        return pipeline

    @property
    def named_files(self) -> dict[str, str]:
        """The files that it names, by their keys."""
        studies = {f"{key}.study": table.study for key, table in self.identified.items()}
        scenes = {f"{key}.{'study' if isinstance(table, StudyStage) else 'scene'}": table.file
                  for key, table in self.jobs.items()}  # fmt: skip
        further = {} if self.report is None else {f"report.results[{i}]": n for i, n in enumerate(self.report.results)}
        return ({} if self.case is None else {"case": self.case}) | studies | scenes | further

    def makes(self, name: str) -> bool:
        """Say whether a scene is one that `calibrate` or `identify` writes."""
        return Path(name).name in self.scenes_made

    @property
    def scenes_made(self) -> list[str]:
        """Names of the scenes that stages write."""
        return [RIGID_SCENE] * (self.calibrate is not None) + [table.scene for table in self.identify]
