"""`vanedamp optimise`: mass, gap and number of bodies that reduce most, as designed and within tolerances."""

from __future__ import annotations

from argparse import Namespace
from functools import partial

from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.budget import check_optimise
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.scenes import print_resonance
from vanedamp.studies.optimisation.search import optimise
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import workers


def run(arguments: Namespace) -> None:
    """Search for the best damper."""
    study = Study.load(arguments.input)
    arguments.outputs.keep(study.scene.files)
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
