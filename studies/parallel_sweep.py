"""`vanedamp.sweep`: sweeps as programs and notebooks run them, with processes and a progress bar by arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep as run_sweep
from vanedamp.files.toml_input import InputError
from vanedamp.studies.terminal import Bar
from vanedamp.studies.workers import workers as processes


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
    Every point is checked before the first run: raises InputError for one that is no scene. A run that breaks, or
    takes its worker with it, is a point with the status "error: ...". Raises StoreError when the checkpoint cannot be
    written, SweepError when the workers are lost for good.
    """
    if workers < 0 or (workers != 1 and executor is not None):
        raise InputError("workers: expected a number of processes, 0 for one per core; leave it out beside an executor")
    shown = closing(Bar("sweep", unit="point", leave=True)) if progress is True else nullcontext(progress or None)
    with processes(workers) if executor is None else nullcontext(executor) as pool, shown as report:
        return run_sweep(scene, pool, report, checkpoint, provenance)
