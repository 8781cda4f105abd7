"""`vanedamp design`: from a case and an envelope to one device, with its page; repeats only what changed."""

from __future__ import annotations

import sys
from argparse import Namespace
from functools import partial

from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import check_outputs, output_folder
from vanedamp.studies.design.record import DesignRecord
from vanedamp.studies.pipeline.design import run as run_design


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed, and return the device."""
    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [arguments.input]
    check_outputs(arguments)
    note = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)
    result, file = run_design(arguments.input, folder, arguments.workers, arguments.dry_run, note)
    device = {} if arguments.dry_run else DesignRecord.load(file).to_json()
    write_result(arguments, result.to_json() | device)
