"""From a case and an envelope to one device, in stages of which only those with changed inputs run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

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
    _, result = run(path, folder, workers, False, note)
    return DesignRecord.load(result)


def run(
    path: str | Path, folder: str | Path | None, workers: int | None, dry_run: bool, note: Callable[[str], None] | None
) -> tuple[PipelineResult, Path]:
    """Run the stages of a study file, or name those that would run; return them and the file of the device.

    Raises InputError.
    """
    study, source = DesignFile.load(path), Path(path)
    target = Path(folder) if folder is not None else source.parent / study.folder
    listed = list(design_stages(study, source, target))
    return run_stages(listed, source, [study.case], target, workers, dry_run, note), target / DESIGN
