"""`vanedamp optimise`: mass, gap and number of bodies that reduce most, as designed and within tolerances."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator

from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.budget import check_optimise
from vanedamp.studies.commands.support.messages import write_timed
from vanedamp.studies.commands.support.scenes import print_resonance
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import optimise
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import available_cores, workers


def run(arguments: Namespace) -> None:
    """Search for the best damper."""
    study = Study.load(arguments.input)
    arguments.outputs.keep(study.scene.files)
    check_optimise(study, arguments.workers or available_cores())
    print_resonance(arguments.input, study.scene)
    started = time.perf_counter()
    with workers(arguments.workers) as pool:
        compile_engine(map(study.with_bodies, study.counts), pool)
        with progress("optimise") as report:
            optimisation = optimise(study, pool, report, {"versions": versions()}, arguments.checkpoint)
    write_timed(arguments, optimisation, started, _summary, study.doubts)


def _summary(optimisation: Optimisation, seconds: float) -> Iterator[str]:
    yield optimisation.sentence
    yield from optimisation.remarks
    yield f"{optimisation.scenes} scenes in {seconds:.0f} s"
    if optimisation.trouble:
        yield (
            f"{optimisation.trouble} of {optimisation.scenes} scenes are not ok and count as undamped, so that the "
            "optimum may lie elsewhere; give [time] more periods and a longer transient"
        )
