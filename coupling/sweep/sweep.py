"""Sweeps: a run at every point of a scene's [sweep] grid, on any executor of concurrent.futures."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.engine.columns import foreseen
from vanedamp.coupling.methods.registry import wall_warnings
from vanedamp.coupling.quantities.energy import penetration
from vanedamp.coupling.quantities.quantity import evaluated
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.coupling.scene.scene import Scene, Time, loaded
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.checkpoint import SweepCheckpoint
from vanedamp.coupling.sweep.grid import Grid, PointList, Points, PointSet, resonance_axis
from vanedamp.coupling.sweep.grid import grid as grid_of
from vanedamp.coupling.sweep.moved_starts import with_moved_starts
from vanedamp.coupling.sweep.over_axes import of_axes
from vanedamp.coupling.sweep.record import PEAKS, Sweep
from vanedamp.coupling.sweep.row import TEXTS, Row
from vanedamp.coupling.sweep.schedule import run_tasks
from vanedamp.coupling.sweep.worker import OF_A_POINT, SweepTable
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import LinearPeak, linear_peaks
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError, validate

#: takes the number of points of a list that are done
ListProgress = Callable[[int], None]


def sweep(
    scene: Scene | Grid | str | Path,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    moved_starts: bool = False,
) -> Sweep:
    """Run every point of the scene's [sweep] table, in this process or on an executor.

    scene: or its TOML file, or its grid; progress: called with the number of points done and their total, at
    the beginning, too; checkpoint: a file to which finished points are written and from which a sweep that was killed
    resumes; the caller removes it once the result is safe (files.checkpoint_file.clear); moved_starts: run the peak of
    each curve again, from bodies a little aside (Sweep.moved_starts).
    Every point is checked before the first run: raises InputError for one that is no scene. A run that breaks, or
    takes its worker with it, is a point with the status "error: ...". Raises StoreError when the checkpoint cannot be
    written, SweepError when the executor has lost its workers for good.
    """
    grid = scene if isinstance(scene, Grid) else grid_of(loaded(scene))
    provenance = dict(provenance or {})
    result = result_of(grid, run_all(grid.scene, grid, executor, progress, checkpoint, provenance), provenance)
    return with_moved_starts(grid, result, executor) if moved_starts else result


def run_all(
    scene: Scene,
    points: PointSet,
    executor: Executor | None,
    progress: Callable[[int, int], None] | None,
    checkpoint: str | Path | None,
    provenance: Mapping[str, Any],
) -> SweepTable:
    """Run all points of a scene with a [sweep] table, or with ranges; other arguments as of `sweep`."""
    with SweepCheckpoint(checkpoint, scene, points.size, provenance) as saved:
        finished = saved.finished
        if progress is not None:
            progress(finished.count, points.size)
        for task, rest, result in run_tasks(points, finished, executor):
            saved.add(task, result, bool(rest))
            if progress is not None:
                progress(finished.count, points.size)
    return finished


def run_list(
    base: Scene,
    points: Sequence[Mapping[str, Any]],
    executor: Executor | None = None,
    progress: ListProgress | None = None,
    finished: SweepTable | None = None,
) -> SweepTable:
    """Run scenes that differ from `base` in some values, by their paths; all points name the same paths.

    progress: called with the number of points done; finished: takes the results as they come.
    """
    listed = PointList(base, points)
    finished = SweepTable(listed.size, Row(base)) if finished is None else finished
    for task, rest, result in run_tasks(listed, finished, executor):
        finished.add(task, result, bool(rest))
        if progress is not None:
            progress(finished.count)
    return finished


def result_of(grid: Grid, finished: SweepTable, provenance: dict[str, Any]) -> Sweep:
    """Return the record of a grid whose points are all finished."""
    quantities = finished.arrays(grid.shape)
    return Sweep(
        scene=grid.scene,
        axes=of_axes(grid.axes),
        quantities=quantities,
        **{name: frozen(finished.text(name).reshape(grid.shape), object) for name in TEXTS},
        peaks=linear_tops(grid),
        provenance=provenance
        | ({"hot_spots": spots} if (spots := hot_spots_in_file(grid.base.structure)) else {})
        | notes_on(grid, quantities),
    )


def notes_on(grid: Grid, quantities: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return a grid's part of a record's provenance: warnings, estimate and advice. quantities: of all points."""
    warnings = [*grid.warnings, *wall_warnings(grid.base, grid.axes, quantities[penetration.name])]
    notes = {"warnings": warnings, "estimate": grid.estimate, "advice": grid.advice}
    return {name: note for name, note in notes.items() if note}


#: keys that linear curves do not depend on
UNFELT = re.compile(
    r"(friction_)?damper(\.[^.]+)?\.(friction|restitution|position|velocity|normal_force)|cavity(\.[^.]+)?\.gap|initial\..+"
)


def linear_tops(grid: Grid) -> dict[str, np.ndarray]:
    """Return the peaks of the linear curves over the swept frequencies; nan where there is none."""
    swept = resonance_axis(grid.base, grid.axes)[0]
    if swept is None or len(set(grid.axes[swept])) < 2:
        return {}
    others = {path: values for path, values in grid.axes.items() if path != swept}
    low, high = min(grid.axes[swept]), max(grid.axes[swept])
    points, peaks, known = Points(grid.base, grid.choices), [], dict[tuple[Any, ...], dict[str, float]]()
    feels = [path for path in others if not UNFELT.fullmatch(path)]
    fits = set(foreseen(grid.base, others)) | set(feels) == set(others)  # others may keep bodies from fitting together
    for values in itertools.product(*others.values()):
        felt = tuple(value for path, value in zip(others, values, strict=True) if path in feels)
        if felt in known and fits:
            peaks.append(known[felt])
            continue
        try:
            scene = points.scene({**dict(zip(others, values, strict=True)), swept: low})
            if felt in known:
                assemble(scene)  # raises where bodies do not fit together
            else:
                known[felt] = tops(*linear_peaks(scene, *(end * SPEEDS.get(swept, 1.0) for end in (low, high))))
            peaks.append(known[felt])
        except InputError:  # the points' status, or a waveform
            peaks.append(dict.fromkeys(PEAKS, np.nan))
    shape = tuple(len(values) for values in others.values())
    return {name: frozen(np.reshape([item[name] for item in peaks], shape)) for name in PEAKS}


def tops(undamped: LinearPeak, fixed: LinearPeak) -> dict[str, float]:
    """Return the peaks of both linear curves by the names of PEAKS."""
    return dict(evaluated({"undamped_top": undamped, "fixed_top": fixed}))


def warm_up(scene: Scene | None = None) -> None:
    """Compile the engine, or load it from the disk cache: once, before many processes would do it side by side.

    scene: without open choices, whose engine it is; None: a slider's. A scene that cannot run says so in its own run.
    """
    if scene is None:
        simulate(validate(Scene, _SMALLEST, "warm-up"))
        return
    with suppress(*OF_A_POINT):
        simulate(replace(scene, sweep={}, time=Time(periods=1, transient=0)))


def warm_up_engine(engine: str) -> None:
    """Compile all kernels of an engine, "line" (one body, and several) or "plane", or load them from the disk cache."""
    [body], [cavity] = _SMALLEST["damper"], _SMALLEST["cavity"]
    if engine == "line":
        warm_up()
        tables = {"cavity": [cavity, cavity | {"name": "d"}], "damper": [body, body | {"cavity": "d"}]}
    else:
        block = body | {"shape": "block", "length": 1.0, "height": 1.0}
        tables = {"cavity": [cavity | {"play": 1.0}], "damper": [block]}
    warm_up(validate(Scene, _SMALLEST | tables, "warm-up"))


_SMALLEST: dict[str, Any] = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 0.16, "force": 1.0},
    "cavity": [{"name": "c", "gap": 1.0}],
    "damper": [{"cavity": "c", "mass": 0.1, "friction": 0.1, "restitution": 0.5}],
    "gravity": {"acceleration": 1.0},
    "time": {"periods": 4, "transient": 1},
}
