"""Facts of a pipeline: its stages and files, and which of them would run now."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.facts import Fact
from vanedamp.studies.pipeline.pipeline import pipeline
from vanedamp.studies.pipeline.tables import PipelineFile


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the pipeline in a file. Raises InputError, as `vanedamp pipeline` does."""
    table = PipelineFile.load(path)
    plan = pipeline(path, dry_run=True).stages
    return [
        Fact("commands", ["pipeline"]),
        Fact("files", [str(Path(path).parent / name) for name in table.named_files.values()]),
        Fact("stages", [stage.stage for stage in plan]),
        Fact("runs", [stage.stage for stage in plan if stage.status == "runs"], "", "because of what has changed"),
        Fact("perhaps", [stage.stage for stage in plan if stage.status == "perhaps"], "", "if what they take changes"),
    ]
