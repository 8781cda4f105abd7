"""`vanedamp pipeline`: from a case to a report in one command, which repeats only stages with changed inputs."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import of_stages
from vanedamp.studies.pipeline.pipeline import pipeline


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed."""
    folder, note = of_stages(arguments, arguments.pipeline)
    result = pipeline(arguments.pipeline, folder, arguments.workers, arguments.dry_run, note)
    write_result(arguments, result.to_json())
