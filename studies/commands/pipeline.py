"""`vanedamp pipeline`: from a case to a report in one command, which repeats only stages with changed inputs."""

from __future__ import annotations

import sys
from argparse import Namespace
from functools import partial

from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import check_outputs, output_folder
from vanedamp.studies.pipeline.pipeline import pipeline


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed."""
    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [arguments.pipeline]
    check_outputs(arguments)

    note = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)
    result = pipeline(arguments.pipeline, folder, arguments.workers, arguments.dry_run, note)
    write_result(arguments, result.to_json())
