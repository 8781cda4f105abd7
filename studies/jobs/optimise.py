"""`vanedamp optimise`: mass, gap and number of bodies with the largest reduction, nominal and within tolerances."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.jobs.budget import check_optimise
from vanedamp.studies.jobs.job import JobResult, Means, StudyJob
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import optimise
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.optimisation.tables import StudyFile


@dataclass(frozen=True)
class OptimiseJob(StudyJob):
    """Searches for the best damper."""

    TITLE: ClassVar[str] = "optimise"
    STUDY: ClassVar[Any] = Study
    FILE: ClassVar[type[Scene]] = StudyFile

    def check(self, workers: int) -> None:
        """Reject a search that takes a month."""
        check_optimise(self.study, workers)

    def compiled(self) -> Iterable[Scene]:
        """Return the scene with every number of bodies."""
        return map(self.study.with_bodies, self.study.counts)

    def work(self, means: Means) -> JobResult:
        """Search."""
        result = optimise(self.study, means.pool, means.report, means.provenance, means.checkpoint)
        return JobResult(result, partial(_summary, result), result.sentence, warnings=self.study.doubts)


def _summary(optimisation: Optimisation, seconds: float) -> Iterator[str]:
    yield optimisation.sentence
    yield from optimisation.remarks
    yield f"{optimisation.scenes} scenes in {seconds:.0f} s"
    if optimisation.trouble:
        yield (
            f"{optimisation.trouble} of {optimisation.scenes} scenes are not ok and count as undamped, so that the "
            "optimum may lie elsewhere; give [time] more periods and a longer transient"
        )
