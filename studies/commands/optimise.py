"""`vanedamp optimise`: mass, gap and number of bodies that reduce most, as designed and within tolerances."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output, add_workers
from vanedamp.studies.terminal import progress

ORDER = 90
SUMMARY = "mass, gap and number of bodies that reduce most"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a study, the result files and a number of processes."""
    add_input(parser, "STUDY.toml")
    add_output(parser, "OPTIMUM.h5")
    add_json(parser)
    add_workers(parser)


def run(arguments: Namespace) -> None:
    """Search for the best damper."""
    from vanedamp.studies.commands.support.messages import write_result
    from vanedamp.studies.commands.support.outputs import RECORD, check_outputs
    from vanedamp.studies.workers import workers

    outputs = check_outputs(arguments, output=RECORD)
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.support.budget import check_optimise
    from vanedamp.studies.commands.support.scenes import print_resonance
    from vanedamp.studies.optimisation.search import optimise
    from vanedamp.studies.optimisation.study import Study

    study = Study.load(arguments.input)
    outputs.keep(study.scene.files)
    check_optimise(study, arguments.workers)
    print_resonance(arguments.input, study.scene)
    with workers(arguments.workers) as pool, progress("optimise") as report:
        optimisation = optimise(study, pool, report, {"versions": versions()})
    files = partial(optimisation.save, arguments.output) if arguments.output else None
    write_result(arguments.json, optimisation.to_json(), files)
    if arguments.json != "-":
        print(optimisation.sentence)
        if optimisation.trouble:
            print(
                f"{optimisation.trouble} of {optimisation.scenes} scenes are not ok and count as undamped, so that the "
                "optimum may lie elsewhere; give [time] more periods and a longer transient"
            )
