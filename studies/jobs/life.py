"""`vanedamp life`: service life of a damper, from the wear of its contacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.jobs.budget import check_life
from vanedamp.studies.jobs.job import JobResult, Means, StudyJob
from vanedamp.studies.life.life import life
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.life.study import LifeFile, LifeStudy


@dataclass(frozen=True)
class LifeJob(StudyJob):
    """Integrates the wear."""

    TITLE: ClassVar[str] = "life"
    STUDY: ClassVar[Any] = LifeStudy
    FILE: ClassVar[type[Scene]] = LifeFile

    def check(self, workers: int) -> None:
        """Reject a life that takes a month."""
        check_life(self.study, workers)

    def work(self, means: Means) -> JobResult:
        """Integrate it."""
        record = life(self.study, means.pool, means.report, means.provenance, means.checkpoint)
        return JobResult(record, partial(_summary, record), record.sentence)


def _summary(record: LifeRecord, seconds: float) -> Iterator[str]:
    yield f"{'hours':>8}  {'gaps, um':24}  reduction, %"
    for hours, gaps, reduction in record.rows():
        yield f"{hours:>8}  {gaps:24}  {reduction}"
    yield f"{record.sentence}. {record.runs} runs in {seconds:.0f} s."
    if record.trouble:
        yield f"{record.trouble} of {record.runs} runs are not ok; give [time] more periods and a longer transient"
