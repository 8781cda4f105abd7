"""`vanedamp design`: from a case and an envelope to one device, with its page; repeats only what changed."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.outputs import of_stages
from vanedamp.studies.design.record import DesignRecord
from vanedamp.studies.pipeline.design import run as run_design


def run(arguments: Namespace) -> None:
    """Run the stages whose inputs have changed, and return the device."""
    folder, note = of_stages(arguments, arguments.input)
    result, file = run_design(arguments.input, folder, arguments.workers, arguments.dry_run, note)
    device = {} if arguments.dry_run else DesignRecord.load(file).to_json()
    write_result(arguments, result.to_json() | device)
