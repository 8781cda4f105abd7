"""Run a job from its command: notes before and after it, worker processes, files, and checkpoint."""

from __future__ import annotations

from argparse import Namespace
from contextlib import ExitStack
from typing import Any

from vanedamp.studies.commands.support.messages import print_note, print_warnings, write_result
from vanedamp.studies.commands.support.scenes import print_resonance
from vanedamp.studies.jobs.job import Job


def run(arguments: Namespace, kind: type[Job], *inputs: Any) -> None:
    """Run the job of a command line on the input that the command has read. Raises VanedampError."""
    job = kind.of_arguments(arguments, *inputs)
    arguments.outputs.keep(job.files)
    count = 1
    if job.PARALLEL:  # loads pools of processes
        from vanedamp.studies.jobs.workers import available_cores, workers

        count = getattr(arguments, "workers", None) or available_cores()
    job.check(count)
    for note in job.notes():
        print_note(job.source, note)
    print_warnings(job.source, job.warnings())
    resonance = {} if job.scene is None else print_resonance(job.source, job.scene)
    checkpoint = getattr(arguments, "checkpoint", None)
    with ExitStack() as stack:
        outcome, seconds = job.run(lambda: stack.enter_context(workers(count)), checkpoint)
    for note in outcome.notes:
        print_note(job.source, note)
    data, lines = outcome.to_json(seconds) | resonance, outcome.lines(seconds)
    write_result(arguments, data, lines, outcome.warnings, **outcome.writers)
    outcome.clear(checkpoint)
