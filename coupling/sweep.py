"""Sweeps: a run at every point of a scene's [sweep] grid, on any executor of concurrent.futures."""

from __future__ import annotations

import itertools
import json
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from coupling.checkpoint import Checkpoint
from coupling.engine import simulate
from coupling.grid import FREQUENCY, Grid, PointList, Points
from coupling.grid import grid as grid_of
from coupling.inputs import InputError, validate
from coupling.linear import LinearPeak, linear_responses
from coupling.points import COLUMNS, LOSSES, MEASURES, TEXTS, Block, Finished, Task, broken, run_points, tasks_of
from coupling.scene import Scene
from modal.store import Variable, frozen, load, save

_KIND = "sweep"
_UNITS = {
    "frequency": "Hz", "gap": "m", "mass": "kg", "stiffness": "N/m", "damping": "N s/m", "force": "N",
    "base_acceleration": "m/s^2", "acceleration": "m/s^2", "resonance_amplitude": "m", "displacement_amplitude": "m",
    "position": "m", "displacement": "m", "velocity": "m/s", "normal_load": "N", "normal_force": "N",
    "orientation_deg": "degree",
}  # fmt: skip
#: tops of the linear curves over the swept frequencies and their units, each an array over the other axes
PEAKS = {
    "undamped_peak": "m", "undamped_peak_frequency": "Hz", "half_power_width": "Hz",
    "fixed_peak": "m", "fixed_peak_frequency": "Hz",
}  # fmt: skip
# few enough points that workers end together, and that a killed sweep loses little
_MOST_PER_TASK = 16
#: tasks that are with an executor of unknown size at a time: enough for some hundred workers
_IN_FLIGHT = 512


class SweepError(ValueError):
    """A sweep that cannot go on: its workers are gone."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Responses over the product of the axes; every array has the shape of the grid, in the axes' order.

    scene                 the scene of the sweep, with its [sweep] table
    axes                  dotted path -> values
    amplitude_*           m, of the displacement at excitation.at; `undamped` and `fixed` are those of the linear
                          structure without bodies and with every body glued to its cavity; `mean_confidence` is the
                          half width of the mean's 95 % confidence interval, nan where there are too few periods
    attached_mass_fraction  share of the bodies' mass that the structure feels; nan without bodies or motion
    energy_share          (*grid, 4) share of viscous, friction, impact and contact loss; nan where nothing is lost
    status                "ok", another coupling.response.Status, or "error: ..." for a run that broke, without measures
    peaks                 by the names of PEAKS: tops of `undamped` and `fixed` from the lowest to the highest
                          frequency, between the points as well, their frequencies, and the half-power width of the
                          undamped one, over the axes other than the frequency; empty for a sweep at one frequency
    A point of the grid is the same whoever ran it, and whenever: no time is taken.
    provenance            versions and whatever else the caller knows (JSON-able)
    """

    scene: Scene
    axes: Mapping[str, np.ndarray]
    amplitude_max: np.ndarray
    amplitude_mean: np.ndarray
    amplitude_mean_confidence: np.ndarray
    amplitude_rms: np.ndarray
    amplitude_harmonic: np.ndarray
    amplitude_undamped: np.ndarray
    amplitude_fixed: np.ndarray
    impacts_per_period: np.ndarray
    attached_mass_fraction: np.ndarray
    energy_share: np.ndarray
    energy_residual: np.ndarray
    status: np.ndarray
    classification: np.ndarray
    peaks: Mapping[str, np.ndarray] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.status.shape

    def units(self) -> dict[str, str]:
        """Unit of every axis by its path."""
        return {path: _UNITS.get(path.rsplit(".", 1)[-1], "1") for path in self.axes}

    def to_json(self) -> dict[str, Any]:
        """Plain data: axes and units by path, measures as nested lists (nan where there is none)."""
        names = (*MEASURES, "energy_share", "status", "classification")
        estimate = self.provenance.get("estimate")
        told = {"warnings": list(self.provenance.get("warnings", ()))}
        told |= {} if estimate is None else {"estimate": estimate}
        axes = {path: values.tolist() for path, values in self.axes.items()}
        return (
            {"axes": axes, "units": self.units() | MEASURES | {name: PEAKS[name] for name in self.peaks}}
            | {"loss": list(LOSSES)}
            | told
            | {name: getattr(self, name).tolist() for name in names}
            | {name: values.tolist() for name, values in self.peaks.items()}
        )

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens. Dimensions are the axes' paths with _ for dots."""
        dims = tuple(_dimension(axis) for axis in self.axes)
        units = self.units()
        variables = {_dimension(axis): Variable(v, (_dimension(axis),), units[axis]) for axis, v in self.axes.items()}
        variables["loss"] = Variable(np.array(LOSSES, dtype=object), ("loss",))
        variables["energy_share"] = Variable(self.energy_share, (*dims, "loss"))
        for name, unit in (MEASURES | {"status": "1", "classification": "1"}).items():
            variables[name] = Variable(getattr(self, name), dims, unit)
        others = tuple(_dimension(axis) for axis in self.axes if axis != FREQUENCY)
        variables |= {name: Variable(values, others, PEAKS[name]) for name, values in self.peaks.items()}
        attributes = {
            "axes": list(self.axes),
            "scene": self.scene.to_dict(),
            "provenance": dict(self.provenance),
        }
        save(path, _KIND, variables, attributes)

    @classmethod
    def load(cls, path: str | Path) -> Sweep:
        """Read the record that `save` wrote. Raises modal.store.StoreError."""
        values, attributes = load(path, _KIND)
        axes = {axis: values[_dimension(axis)] for axis in attributes["axes"]}
        return cls(
            scene=validate(Scene, json.loads(attributes["scene"]), str(path)),
            axes={axis: frozen(array, array.dtype) for axis, array in axes.items()},
            **{name: frozen(values[name]) for name in (*MEASURES, "energy_share")},
            **{name: frozen(values[name], object) for name in ("status", "classification")},
            peaks={name: frozen(values[name]) for name in PEAKS if name in values},
            provenance=json.loads(attributes["provenance"]),
        )


def sweep(
    scene: Scene | Grid,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Sweep:
    """Run every point of the scene's [sweep] table, in this process or on an executor.

    scene: with its grid, if the caller has made it; progress: called with the number of points done and their total, at
    the beginning, too; checkpoint: a file to which finished points are written and from which a sweep that was killed
    goes on; the caller removes it once the result is safe (coupling.checkpoint.clear).
    Every point is checked before the first run: raises InputError for one that is no scene. A run that breaks, or
    takes its worker with it, is a point with the status "error: ...". Raises StoreError when the checkpoint cannot be
    written, SweepError when the executor has lost its workers for good.
    """
    grid = scene if isinstance(scene, Grid) else grid_of(scene)
    provenance = dict(provenance or {})
    with Checkpoint(checkpoint, grid.scene, grid.size, provenance) as kept:
        finished = kept.finished
        if progress is not None:
            progress(finished.count, grid.size)
        for task, rest, block in _run(grid, finished, executor):
            kept.add(task, block, bool(rest))
            if progress is not None:
                progress(finished.count, grid.size)
    return _result(grid, finished, provenance)


def run_list(
    base: Scene,
    points: Sequence[Mapping[str, Any]],
    executor: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> Finished:
    """Runs of scenes that differ from `base` in some values, by their paths; all points name the same paths.

    progress: called with the number of points done.
    """
    listed = PointList(base, points)
    finished = Finished(listed.size)
    for task, rest, block in _run(listed, finished, executor):
        finished.add(task, block, bool(rest))
        if progress is not None:
            progress(finished.count)
    return finished


def _result(grid: Grid, finished: Finished, provenance: dict[str, Any]) -> Sweep:
    columns = {name: finished.values[:, place].reshape(grid.shape) for place, name in enumerate(COLUMNS)}
    return Sweep(
        scene=grid.scene,
        axes={path: frozen(values, np.asarray(values).dtype) for path, values in grid.axes.items()},
        energy_share=frozen(np.stack([columns[name] for name in LOSSES], axis=-1)),
        **{name: frozen(columns[name]) for name in MEASURES},
        **{name: frozen(finished.text(name).reshape(grid.shape), object) for name in TEXTS},
        peaks=_peaks(grid),
        provenance=provenance
        | ({"warnings": list(grid.warnings)} if grid.warnings else {})
        | ({} if grid.estimate is None else {"estimate": grid.estimate}),
    )


def _peaks(grid: Grid) -> dict[str, np.ndarray]:
    """Tops of the linear curves over the swept frequencies; nan at a combination of the other axes that is no scene."""
    others = {path: values for path, values in grid.axes.items() if path != FREQUENCY}
    if len(set(grid.axes.get(FREQUENCY, ()))) < 2:
        return {}
    low, high = min(grid.axes[FREQUENCY]), max(grid.axes[FREQUENCY])
    points, found = Points(grid.base, grid.choices), []
    for values in itertools.product(*others.values()):
        try:
            scene = points.scene({**dict(zip(others, values, strict=True)), FREQUENCY: low})
            found.append(tops(*(response.peak(low, high) for response in linear_responses(scene))))
        except InputError:  # told as the status of its points
            found.append(dict.fromkeys(PEAKS, np.nan))
    shape = tuple(len(values) for values in others.values())
    return {name: frozen(np.reshape([item[name] for item in found], shape)) for name in PEAKS}


def tops(undamped: LinearPeak, fixed: LinearPeak) -> dict[str, float]:
    """Tops of both linear curves by the names of PEAKS."""
    values = (undamped.amplitude, undamped.frequency, undamped.width, fixed.amplitude, fixed.frequency)
    return dict(zip(PEAKS, values, strict=True))


def warm_up() -> None:
    """Compile the engine, or load it from the disk cache: once, before many processes would do it side by side."""
    simulate(validate(Scene, _SMALLEST, "warm-up"))


_SMALLEST = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 0.16, "force": 1.0},
    "cavity": [{"name": "c", "gap": 1.0}],
    "damper": [{"cavity": "c", "mass": 0.1, "friction": 0.1, "restitution": 0.5}],
    "gravity": {"acceleration": 1.0},
    "time": {"periods": 4, "transient": 1},
}


def _dimension(path: str) -> str:
    return path.replace(".", "_")


#: a task and what is left of its chain
_Entry = tuple[Task, Sequence[int]]


def _run(
    grid: Grid | PointList, finished: Finished, executor: Executor | None
) -> Iterator[tuple[Task, Sequence[int], Block]]:
    """Tasks as they are done, each with what is left of its chain, and what it leaves."""
    most = max(1, min(_MOST_PER_TASK, (grid.size - finished.count) // 32))
    source, ready = tasks_of(grid, finished, most), deque[_Entry]()
    running: dict[Future[Block], _Entry] = {}
    try:
        while True:
            while len(running) < (1 if executor is None else _in_flight(executor)):
                entry = ready.popleft() if ready else next(source, None)
                if entry is None:
                    break
                running[_submit(grid, entry[0], executor)] = entry
            if not running:
                return
            for (task, rest), block in _ended(grid, running, executor):
                if rest and task.linked:
                    ready.append((Task(rest[:most], True, block.final, task.chain), rest[most:]))
                yield task, rest, block
    finally:
        for future in running:
            future.cancel()


def _in_flight(executor: Executor) -> int:
    """Tasks to keep an executor busy; few, since all of them are in doubt when a worker dies."""
    known = getattr(executor, "_max_workers", None) or getattr(executor, "num_workers", None)
    return 2 * known + 2 if isinstance(known, int) else _IN_FLIGHT


def _submit(grid: Grid | PointList, task: Task, executor: Executor | None) -> Future[Block]:
    points = [grid.values(point) for point in task.points]
    if executor is None:
        future: Future[Block] = Future()
        future.set_result(run_points(grid.base, grid.choices, points, task))
        return future
    try:
        return executor.submit(run_points, grid.base, grid.choices, points, task)
    except (BrokenExecutor, RuntimeError) as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error


def _ended(
    grid: Grid | PointList, running: dict[Future[Block], _Entry], executor: Executor | None
) -> Iterator[tuple[_Entry, Block]]:
    """Tasks that have ended, taken from those that run.

    A process pool that loses a worker gives up all of its tasks: their points run again, one by one, to find the point
    that breaks it.
    """
    done = wait(running, return_when=FIRST_COMPLETED).done
    if any(isinstance(future.exception(), BrokenExecutor) for future in done if not future.cancelled()):
        done = wait(running).done
    lost = []
    for future in done:
        entry = running.pop(future)
        if future.cancelled() or future.exception() is not None:
            lost.append((entry, future))
        else:
            yield entry, future.result()
    for (task, rest), future in lost:
        yield (task, rest), _one_by_one(grid, task, future, executor)


def _one_by_one(grid: Grid | PointList, task: Task, lost: Future[Block], executor: Executor | None) -> Block:
    """The points of a task that was lost, each as a task of its own."""
    blocks, state = [], task.start
    for point in task.points:
        alone = Task([point], task.linked, state, task.chain)
        # a lone point need not be tried again, unless others may have broken the pool
        known = len(task.points) == 1 and not lost.cancelled() and not isinstance(lost.exception(), BrokenExecutor)
        future = lost if known else _submit(grid, alone, executor)
        error = future.exception()
        blocks.append(future.result() if error is None else broken(error))
        state = state if blocks[-1].final is None else blocks[-1].final
    texts = [text for block in blocks for text in block.texts]
    return Block(np.concatenate([block.values for block in blocks]), texts, state if task.linked else None)
