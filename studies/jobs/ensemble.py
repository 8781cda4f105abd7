"""A scene whose numbers are ranges, run for all their samples, as `vanedamp run` and `vanedamp sweep` do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import ClassVar

from vanedamp.coupling.ensembles.ensemble import ensemble
from vanedamp.coupling.ensembles.members import Members, members
from vanedamp.coupling.ensembles.record import Ensemble, spreads
from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.jobs.budget import check_sweep
from vanedamp.studies.jobs.job import JobResult, Means, SceneJob, choice_notes
from vanedamp.studies.jobs.points import ends_of, finished

#: curves whose sentences are printed
_MOST_LINES = 12


@dataclass(frozen=True)
class EnsembleJob(SceneJob):
    """Runs the samples of a scene at every point of its sweep, or at its frequency."""

    TITLE: ClassVar[str] = "ensemble"
    PARALLEL: ClassVar[bool] = True

    @cached_property
    def points(self) -> Members:
        """All samples at all points."""
        return members(self.of)

    def check(self, workers: int) -> None:
        """Reject too many points, or an ensemble that takes a month."""
        check_sweep(self.of, workers)

    def notes(self) -> Iterable[str]:
        """Return the choices for the scene's own numbers."""
        return choice_notes(self.points.grid.estimate, self.points.grid.advice)

    def warnings(self) -> Iterable[str]:
        """Return the warnings of the points."""
        return self.points.grid.warnings

    def finished(self, checkpoint: Path | None) -> int:
        """Return the number of points in a checkpoint."""
        return finished(checkpoint, self.of, self.points.size, self.origin)

    def compiled(self) -> Iterable[Scene]:
        """Return the scenes of the first and the last point."""
        return ends_of(self.points)

    def work(self, means: Means) -> JobResult:
        """Run all that is not done."""
        resumed = means.finished
        result = ensemble(self.points, means.pool, means.report, means.checkpoint, means.provenance)
        new = [text for text in result.provenance.get("warnings", ()) if text not in self.points.grid.warnings]
        size = f"{self.points.size} points of {len(result.status)} samples"
        lines = partial(_summary, result, f"{size}, {resumed} of them from the checkpoint")
        return JobResult(result, lines, size, warnings=new, data={"points_resumed": resumed})


def _summary(result: Ensemble, size: str, seconds: float) -> Iterator[str]:
    """Yield spreads of curves, or of the quantities at one frequency, and how many points are not ok."""
    yield from islice(result.sentences(), _MOST_LINES)
    if not result.axes:
        yield from _at_one_frequency(result)
    yield f"{size}, in {seconds:.1f} s"
    if result.not_ok:
        yield f"{result.not_ok} of {result.status.size} points are not ok, and left out"


def _at_one_frequency(result: Ensemble) -> Iterator[str]:
    yield f"{'':26} {'5 %':>12} {'25 %':>12} {'50 %':>12} {'75 %':>12} {'95 %':>12}"
    for name, values in result.quantile.items():
        unit = spreads()[name].unit
        unit = "" if unit == "1" else unit
        yield f"{name:26} {' '.join(f'{value:12.6g}' for value in values.tolist())} {unit}".rstrip()
