"""`vanedamp design`: from a case and an envelope to one device, with its page; repeats only what changed."""

from __future__ import annotations

import sys
from argparse import Namespace
from functools import partial

from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import check_outputs, output_folder
from vanedamp.studies.design.record import DesignRecord
from vanedamp.studies.pipeline.design import folder_of
from vanedamp.studies.pipeline.design import run as run_design
from vanedamp.studies.pipeline.design_stages import DESIGN


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed, and return the device."""
    folder = None if arguments.output is None else output_folder(arguments)
    arguments.output, arguments.inputs = None, [arguments.input]
    check_outputs(arguments)
    note = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout, flush=True)
    result = run_design(arguments.input, folder, arguments.workers, arguments.dry_run, note)
    data = result.to_json()
    if not arguments.dry_run:
        data |= DesignRecord.load(folder_of(arguments.input, folder) / DESIGN).to_json()
    write_result(arguments, data)
