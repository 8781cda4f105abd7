"""`vanedamp life`: how long a damper damps, by the wear of its contacts."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator

from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.budget import check_life
from vanedamp.studies.commands.support.messages import write_timed
from vanedamp.studies.commands.support.scenes import print_resonance
from vanedamp.studies.life.life import life
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.life.study import LifeStudy
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import available_cores, workers


def run(arguments: Namespace) -> None:
    """Integrate the wear."""
    study = LifeStudy.load(arguments.input)
    arguments.outputs.keep(study.scene.files)
    check_life(study, arguments.workers or available_cores())
    print_resonance(arguments.input, study.scene)
    started = time.perf_counter()
    with workers(arguments.workers) as pool:
        compile_engine([study.scene], pool)
        with progress("life") as report:
            record = life(study, pool, report, {"versions": versions()}, arguments.checkpoint)
    write_timed(arguments, record, started, _summary)


def _summary(record: LifeRecord, seconds: float) -> Iterator[str]:
    yield f"{'hours':>8}  {'gaps, um':24}  reduction, %"
    for hours, gaps, reduction in record.rows():
        yield f"{hours:>8}  {gaps:24}  {reduction}"
    yield f"{record.sentence}. {record.runs} runs in {seconds:.0f} s."
    if record.trouble:
        yield f"{record.trouble} of {record.runs} runs are not ok; give [time] more periods and a longer transient"
