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


@dataclass(frozen=True, config=STRICT)
class SweepStage:
    """Stage `sweep`: a run at every point of a scene's [sweep] grid."""

    scene: str
    """scene file, relative to the pipeline's"""
    structure: Literal["rigid", "reduced"] | None = None
    """structure in place of the scene's own: "rigid", that of calibrate (or modal), or "reduced", that of reduce"""
    level: Literal["fatigue"] | None = None
    """"fatigue" in place of the scene's own level: the resonance without bodies reaches the case's fraction of the
    fatigue strength"""
    name: str | None = None
    """name of the stage and of its result NAME.h5; left out: that of the scene file"""
    peak: bool = False
    """whether the point with the highest mean runs once more, with events and samples for the report (NAME_peak.h5)"""

    @property
    def stem(self) -> str:
        """The name of the result file, without suffix."""
        return self.name or Path(self.scene).stem


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
    """A pipeline: a stage runs if its table is there, an empty one too, in the order calibrate, modal, reduce,
    identify, sweep, report."""

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
    """scenes to run, one table each"""
    report: ReportStage | None = None
    """one HTML page of all results"""

    def __post_init__(self) -> None:
        structural = [name for name in ("calibrate", "modal", "reduce") if getattr(self, name) is not None]
        if self.case is None and structural:
            raise ValueError(f"case: missing; [{structural[0]}] needs a case file")
        if self.case is not None and not structural:
            raise ValueError("case: no stage takes it; give [calibrate], [modal] or [reduce], or leave it out")
        if not (structural or self.sweep or self.identify):
            raise ValueError("sweep: missing; give a stage: [calibrate], [modal], [reduce], [[identify]] or [[sweep]]")
        for index, one in enumerate(self.identify):
            self._check_name(f"identify[{index}]", one)
        for index, table in enumerate(self.sweep):
            self._check_sweep(f"sweep[{index}]", table)
            self._check_name(f"sweep[{index}]", table)

    def _check_sweep(self, key: str, table: SweepStage) -> None:
        rigid = self.calibrate is not None or self.modal is not None
        if table.structure == "rigid" and not rigid:
            raise ValueError(f'{key}.structure: "rigid" is that of [calibrate] or [modal]; add one of these tables')
        if table.structure == "reduced" and self.reduce is None:
            raise ValueError(f'{key}.structure: "reduced" is that of [reduce]; add this table')
        if table.level is not None and not rigid:
            raise ValueError(f'{key}.level: "fatigue" is that of [calibrate] or [modal]; add one of these tables')

    def _check_name(self, key: str, table: SweepStage | IdentifyStage) -> None:
        if not table.stem or Path(table.stem).name != table.stem:
            raise ValueError(f"{key}.name: expected a file name without folder and suffix, not '{table.stem}'")
        sweeps, others = [one.stem for one in self.sweep], [one.stem for one in self.identify]
        if (sweeps + others).count(table.stem) > 1:
            kind = "stages" if table.stem in others else "sweeps"
            raise ValueError(f"{key}.name: two {kind} have the name '{table.stem}'; give one of them another")

    @classmethod
    def load(cls, path: str | Path) -> PipelineFile:
        """Read the file. Raises InputError."""
        found = validate(cls, read_toml(path), str(path))
        for key, name in found.named_files.items():
            if not (Path(path).parent / name).is_file() and not found.makes(name):
                raise InputError(f"{path}: {key}: no such file {Path(path).parent / name}")
        return found

    @property
    def named_files(self) -> dict[str, str]:
        """The files that it names, by their keys."""
        studies = {f"identify[{index}].study": table.study for index, table in enumerate(self.identify)}
        scenes = {f"sweep[{index}].scene": table.scene for index, table in enumerate(self.sweep)}
        further = {} if self.report is None else {f"report.results[{i}]": n for i, n in enumerate(self.report.results)}
        return ({} if self.case is None else {"case": self.case}) | studies | scenes | further

    def makes(self, name: str) -> bool:
        """Say whether a scene is one that `calibrate` or `identify` writes."""
        return Path(name).name in self.scenes_made

    @property
    def scenes_made(self) -> list[str]:
        """Names of the scenes that stages write."""
        return [RIGID_SCENE] * (self.calibrate is not None) + [table.scene for table in self.identify]
