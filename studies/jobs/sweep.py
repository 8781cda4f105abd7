"""`vanedamp sweep`: a run at every point of a grid; finished points are stored in a file and survive a kill."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import Grid, Points, grid
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError
from vanedamp.studies.headline import format_value
from vanedamp.studies.jobs.budget import check_run, check_sweep
from vanedamp.studies.jobs.job import Job, JobResult, Means, SceneJob, Write, choice_notes
from vanedamp.studies.jobs.points import ends_of, finished
from vanedamp.studies.report.designs import DesignCurves, designs
from vanedamp.studies.report.forced_response import forced_responses
from vanedamp.studies.report.sector_charts import ring_sentence
from vanedamp.studies.terminal import progress

#: samples per period of the run at the peak
PEAK_SAMPLES = 200
#: designs whose headlines are printed
_MOST_LINES = 12


@dataclass(frozen=True)
class SweepJob(SceneJob):
    """Runs a scene at every point of its sweep.

    peak: file for the point with the highest mean, which is run again with events and samples;
    moved_starts: also run the peak of each curve with displaced bodies.
    """

    peak: str | None = None
    moved_starts: bool = True
    TITLE: ClassVar[str] = "sweep"
    PARALLEL: ClassVar[bool] = True

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Return the job of a scene, or of all samples of its ranges. Raises InputError."""
        (scene,) = inputs
        if not scene.ranges:
            return cls(arguments.input, scene, arguments.peak, not arguments.no_moved_start)
        from vanedamp.studies.jobs.ensemble import EnsembleJob

        if arguments.peak is not None:
            raise InputError("--peak: is for a scene without ranges; leave it out, or give numbers in their place")
        return EnsembleJob(arguments.input, scene)

    @classmethod
    def check_scene(cls, scene: Scene, source: str) -> None:
        """Raise InputError for a scene without a grid."""
        super().check_scene(scene, source)
        if not scene.axes:
            raise InputError(
                'sweep: missing; name a grid, such as "excitation.frequency" = {start = 95, stop = 105, num = 11}'
            )

    @cached_property
    def points(self) -> Grid:
        """The grid. Raises InputError for a point that is no scene, and for a peak that needs a neighbour's state."""
        points = grid(self.of)
        if self.peak is not None:
            self.of.solver.check_samples(PEAK_SAMPLES)
            if points.along is not None:
                raise InputError(
                    "--peak: a point of this sweep begins with the state of its neighbour (continuation.direction) and "
                    'cannot run once more by itself; take "independent", or leave --peak out'
                )
        return points

    def check(self, workers: int) -> None:
        """Reject too many points, or a sweep that takes a month."""
        check_sweep(self.of, workers)
        if self.peak is not None:
            check_run(self.of, PEAK_SAMPLES)

    def notes(self) -> Iterable[str]:
        """Return the choices for all points."""
        return choice_notes(self.points.estimate, self.points.advice)

    def warnings(self) -> Iterable[str]:
        """Return the warnings of the points."""
        return self.points.warnings

    def finished(self, checkpoint: Path | None) -> int:
        """Return the number of points in a checkpoint."""
        return finished(checkpoint, self.of, self.points.size, self.origin)

    def compiled(self) -> Iterable[Scene]:
        """Return the scenes of the first and the last point."""
        return ends_of(self.points)

    def work(self, means: Means) -> JobResult:
        """Run all unfinished points, and the point with the highest mean again."""
        resumed, points = means.finished, self.points
        result = sweep(points, means.pool, means.report, means.checkpoint, means.provenance, self.moved_starts)
        responses = forced_responses(result)
        judged = designs(responses)
        new = [text for text in dict.fromkeys([*result.warnings, *result.provenance.get("warnings", ())])
               if text not in points.warnings]  # fmt: skip
        notes: list[str] = []
        files: dict[str, Write] = {}
        if self.peak is not None:
            note, files = peak(points, result, self.peak)
            notes.append(note)
        bad = int((result.status != "ok").sum())
        best = [design.sentence for design in judged if design.worst.reference > 0]
        sentence = f"{bad} of {result.status.size} points are not ok; " if bad else ""
        return JobResult(
            result, partial(_summary, result, judged, f"{points.size} points, {resumed} of them from the checkpoint"),
            sentence + (best[0] if best else f"{result.status.size} points"), notes, new, files,
            {"points_resumed": resumed, "headlines": [response.to_json() for response in responses],
             "designs": [design.to_json() for design in judged]},
            points.size - resumed,
        )  # fmt: skip


def peak(points: Grid, result: Sweep, path: str) -> tuple[str, dict[str, Write]]:
    """Run the point with the highest mean of those that are ok, with events and samples.

    Points that began with the state of a neighbour do not count, as a single run would end in another motion. Returns a
    note with the name of its file (path), and by the option `peak` the function that writes the file, if
    such a point exists.
    """
    mean = np.where(result.status == "ok", result.amplitude_mean_dynamic, -np.inf)
    directions = points.axes.get("continuation.direction", ())
    if directions:
        linked = [position for position, direction in enumerate(directions) if direction != "independent"]
        np.moveaxis(mean, list(points.axes).index("continuation.direction"), 0)[linked] = -np.inf
    index = int(np.argmax(mean))
    if not np.isfinite(mean.flat[index]):
        return f"--peak: no point is ok{' that runs by itself' if directions else ''}, {path} was not written", {}
    values = points.values(index)
    chosen = Points(points.base, points.choices).chosen(values)
    with progress("peak") as report:
        response = simulate(
            chosen.scene, events=True, samples_per_period=PEAK_SAMPLES, start=chosen.start, progress=report
        )  # fmt: skip
    response = replace(response, advice=chosen.advice)
    made = {key: value for key, value in result.provenance.items() if key.partition("_")[0] in ("versions", "model")}
    at = ", ".join(f"{axis} = {format_value(value)}" for axis, value in values.items())
    made |= {"scene": chosen.scene.to_dict()}
    return f"--peak: {path} is the run at {at}", {"peak": lambda file: response.save(file, made)}


def _summary(result: Sweep, judged: Sequence[DesignCurves], size: str, seconds: float) -> Iterator[str]:
    """Yield the headlines of designs, best first, each of its worst curve, and how many points are not ok."""
    if len(judged) > _MOST_LINES:
        yield f"the {_MOST_LINES} best of {len(judged)} designs; --json and the report have all:"
    for design in judged[:_MOST_LINES]:
        if not design.worst.reference > 0:
            yield (
                f"{design.worst.name}: nothing excites the structure, or a waveform without linear curves: there is no "
                "maximum without bodies to compare with"
            )
            continue
        yield design.sentence
    if result.sectors:
        yield ring_sentence(result)
    bad = [status for status in result.status.ravel() if status != "ok"]
    if bad:
        yield f"{len(bad)} of {result.status.size} points are not ok, such as: {bad[0]}"
    yield f"{size}, in {seconds:.1f} s"
