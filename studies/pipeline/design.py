"""From a case and an envelope to one device, in stages of which only those with changed inputs run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from vanedamp.files.toml_input import InputError
from vanedamp.studies.design.record import DesignRecord
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.pipeline.design_stages import DESIGN, design_stages
from vanedamp.studies.pipeline.pipeline import PipelineResult, run_stages


def design(
    path: str | Path,
    folder: str | Path | None = None,
    workers: int | None = None,
    note: Callable[[str], None] | None = None,
) -> DesignRecord:
    """Return the device of a study file: the one with the smallest largest amplitude over all that is uncertain.

    Arguments as of `pipeline`: a killed study resumes. The folder of the results has the page, design.html, the reduced
    model, searches, confirmations, and the scenes of the results. Raises InputError.
    """
    run(path, folder, workers, False, note)
    return DesignRecord.load(folder_of(path, folder) / DESIGN)


def run(
    path: str | Path, folder: str | Path | None, workers: int | None, dry_run: bool, note: Callable[[str], None] | None
) -> PipelineResult:
    """Run the stages of a study file, or name those that would run. Raises InputError."""
    study, target = DesignFile.load(path), folder_of(path, folder)
    return run_stages(
        list(design_stages(study, Path(path), target)), Path(path), [study.case], target, workers, dry_run, note
    )


def folder_of(path: str | Path, folder: str | Path | None) -> Path:
    """Return the folder of the results of a study file. Raises InputError for a file of that name."""
    target = Path(folder) if folder is not None else Path(path).parent / DesignFile.load(path).folder
    if target.exists() and not target.is_dir():
        raise InputError(f"{path}: folder: {target} is a file; name a folder for the results")
    return target
