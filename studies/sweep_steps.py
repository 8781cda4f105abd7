"""The steps from a scene with a [sweep] to its result file, as the command and a pipeline take them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.checkpoint import Checkpoint
from vanedamp.coupling.sweep.grid import Grid, Points, grid
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep, warm_up
from vanedamp.files.provenance import versions
from vanedamp.files.toml_input import InputError
from vanedamp.studies.headline import format_value
from vanedamp.studies.terminal import progress, stage

if TYPE_CHECKING:  # loads the sweeps, which a single run does not use
    from vanedamp.coupling.ensembles.members import Members

#: samples per period of the run at the peak
PEAK_SAMPLES = 200


class Prepared(NamedTuple):
    """A sweep before its first run: its points, its provenance, and the points that are done.

    checkpoint: the file that keeps finished points, None: nowhere; resumed: points that it had.
    """

    points: Grid
    provenance: dict[str, Any]
    checkpoint: Path | None
    resumed: int


def prepare(scene: Scene, checkpoint: Path | None, peak: bool = False) -> Prepared:
    """Make the grid and take up the checkpoint; peak: the point with the highest mean will run once more.

    Raises InputError for a point that is no scene, a peak that cannot be run, and the checkpoint of another sweep:
    processes are slow to start.
    """
    if peak:
        scene.solver.check_samples(PEAK_SAMPLES)
    points, provenance = grid(scene), {"versions": versions()}
    if peak and points.along is not None:
        raise InputError(
            "--peak: a point of this sweep begins with the state of its neighbour (continuation.direction) and cannot "
            'run once more by itself; take "independent", or leave --peak out'
        )
    resumed = Checkpoint(checkpoint, scene, points.size, provenance).finished.count
    return Prepared(points, provenance, checkpoint, resumed)


def run_points(
    prepared: Prepared,
    output: str | Path | None,
    pool: Executor | None,
    title: str = "sweep",
    moved_starts: bool = True,
) -> Sweep:
    """Run every point that is not done, and write the result. The checkpoint stays until `finish`."""
    if prepared.resumed < prepared.points.size:
        compile_engine(ends_of(prepared.points), pool)
    with progress(title) as report:
        result = sweep(prepared.points, pool, report, prepared.checkpoint, prepared.provenance, moved_starts)
    if output:
        result.save(output)
    return result


def doubts(prepared: Prepared, result: Sweep) -> list[str]:
    """Return the warnings of a result that its points did not have before they ran."""
    return [text for text in result.warnings if text not in prepared.points.warnings]


def ends_of(points: Grid | Members) -> list[Scene]:
    """Return the scenes of the first and the last point, without open choices."""
    scenes = Points(points.base, points.choices)
    return [scenes.scene(points.values(index)) for index in {0, points.size - 1}]


def compile_engine(scenes: Iterable[Scene], pool: Executor | None = None) -> None:
    """Compile the engine that scenes need, which a progress that begins afterwards does not count.

    Left out are scenes with open choices, which decide what is compiled.
    """
    title = "load the engine; the first time it is compiled, which takes a minute or two"
    with stage(title), suppress(BrokenExecutor):  # a scene that ends its worker does so again
        for scene in scenes:
            if leaves_open(scene):
                continue
            if pool is None:
                warm_up(scene)
            else:
                pool.submit(warm_up, scene).result()


def run_peak(prepared: Prepared, result: Sweep, path: str | Path, note: Callable[[str], None]) -> None:
    """Run the point with the highest mean of those that are ok, and write its response; note: takes what to tell.

    Points that began with the state of a neighbour do not count, as they would end in another motion.
    """
    points = prepared.points
    mean = np.where(result.status == "ok", result.amplitude_mean_dynamic, -np.inf)
    directions = points.axes.get("continuation.direction", ())
    if directions:
        linked = [place for place, direction in enumerate(directions) if direction != "independent"]
        np.moveaxis(mean, list(points.axes).index("continuation.direction"), 0)[linked] = -np.inf
    index = int(np.argmax(mean))
    if not np.isfinite(mean.flat[index]):
        note(f"--peak: no point is ok{' that runs by itself' if directions else ''}, {path} was not written")
        return
    values = points.values(index)
    chosen = Points(points.base, points.choices).chosen(values)
    with progress("peak") as report:
        response = simulate(
            chosen.scene, events=True, samples_per_period=PEAK_SAMPLES, start=chosen.start, progress=report
        )  # fmt: skip
    response = replace(response, advice=chosen.advice)
    response.save(path, {"versions": result.provenance.get("versions", {}), "scene": chosen.scene.to_dict()})
    at = ", ".join(f"{axis} = {format_value(value)}" for axis, value in values.items())
    note(f"--peak: {path} is the run at {at}")
