"""`vanedamp pipeline`: from a case to a report in one command, which redoes only what changed."""

from __future__ import annotations

import sys
from argparse import Namespace
from functools import partial

from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.commands.support.budget import check_run, check_sweep
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import check_outputs, output_folder
from vanedamp.studies.pipeline.pipeline import pipeline
from vanedamp.studies.sweep_steps import PEAK_SAMPLES
from vanedamp.studies.workers import available_cores


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed."""
    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [arguments.pipeline]
    check_outputs(arguments)

    def check(scene: Scene, peak: bool) -> None:
        check_sweep(scene, arguments.workers or available_cores())
        if peak:
            check_run(scene, PEAK_SAMPLES)

    note = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)
    result = pipeline(arguments.pipeline, folder, arguments.workers, arguments.dry_run, note, check)
    write_result(arguments, result.to_json())
