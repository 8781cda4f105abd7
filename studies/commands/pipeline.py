"""`vanedamp pipeline`: from a case to a report in one command, which redoes only what changed."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from functools import partial

from vanedamp.studies.commands.support.arguments import add_json, add_output, add_workers

ORDER = 105
SUMMARY = "case, calibration, reduction, sweeps and report; redoes only what changed"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a pipeline file, the folder of the results and how to run it."""
    parser.add_argument("pipeline", metavar="PIPELINE.toml", help="stages, case and scenes")
    add_output(parser, "DIR")
    add_json(parser)
    add_workers(parser)
    parser.add_argument("--dry-run", action="store_true", help="say what would run and why, and run nothing")


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed."""
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.studies.commands.support.budget import check_run, check_sweep
    from vanedamp.studies.commands.support.messages import write_result
    from vanedamp.studies.commands.support.outputs import check_outputs, output_folder
    from vanedamp.studies.pipeline.pipeline import pipeline

    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [arguments.pipeline]
    check_outputs(arguments)
    from vanedamp.studies.sweep_steps import PEAK_SAMPLES

    def check(scene: Scene, peak: bool) -> None:
        check_sweep(scene, arguments.workers)
        if peak:
            check_run(scene, PEAK_SAMPLES)

    note = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)
    result = pipeline(arguments.pipeline, folder, arguments.workers, arguments.dry_run, note, check)
    write_result(arguments.json, result.to_json())
