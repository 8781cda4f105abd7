"""`vanedamp.sweep` and `vanedamp.ensemble` for programs and notebooks, with arguments for processes and progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any, TypeVar

from vanedamp.coupling.ensembles.ensemble import ensemble as run_ensemble
from vanedamp.coupling.ensembles.record import Ensemble
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep as run_sweep
from vanedamp.files.toml_input import InputError
from vanedamp.studies.jobs.workers import workers as processes
from vanedamp.studies.terminal import Bar

T = TypeVar("T")


def sweep(
    scene: Scene | str | Path,
    executor: Executor | None = None,
    progress: bool | Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    *,
    workers: int = 1,
) -> Sweep:
    """Run every point of the scene's [sweep] table, or of that in a TOML file.

    workers: processes of this machine, 0: one per core; or an `executor` of concurrent.futures. Processes import the
    main module: in a script, call this under `if __name__ == "__main__":`.
    progress: True shows a bar, a function is called with the number of points done and their total; checkpoint: a file
    that keeps finished points, from which a sweep that was killed resumes; provenance: data that the result keeps
    (JSON-able).
    Every point is checked before the first run: raises InputError for an invalid one. A run that fails, or
    ends its worker, gives a point with the status "error: ...". Raises StoreError if the checkpoint cannot be
    written, SweepError if the workers are lost for good.
    """
    return _run(run_sweep, "sweep", scene, executor, progress, checkpoint, provenance, workers)


def ensemble(
    scene: Scene | str | Path,
    executor: Executor | None = None,
    progress: bool | Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    *,
    workers: int = 1,
) -> Ensemble:
    """Run a scene, or that in a TOML file, for every sample of its ranges, over its [sweep] table if it has one.

    The [ensemble] table says how numbers are sampled; choices for `modes` and `shape` "auto" are those of the scene's
    own numbers. All arguments are those of `sweep`, as are the errors raised.
    """
    return _run(run_ensemble, "ensemble", scene, executor, progress, checkpoint, provenance, workers)


def _run(
    work: Callable[..., T], title: str, scene: Scene | str | Path, executor: Executor | None,
    progress: bool | Callable[[int, int], None] | None, checkpoint: str | Path | None,
    provenance: Mapping[str, Any] | None, workers: int,
) -> T:  # fmt: skip
    if workers < 0 or (workers != 1 and executor is not None):
        raise InputError("workers: expected a number of processes, 0 for one per core; leave it out beside an executor")
    shown = closing(Bar(title, unit="point", leave=True)) if progress is True else nullcontext(progress or None)
    with processes(workers) if executor is None else nullcontext(executor) as pool, shown as report:
        return work(scene, pool, report, checkpoint, provenance)
