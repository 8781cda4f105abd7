"""One sweep of the benchmark, in a process of its own, so that its peak memory is its own.

    python -m benchmarks.sweep.worker JOB.json RESULT.json

JOB: fields of Job. RESULT: what `measure` returns. With MPI each rank runs this, and the first one measures.
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.checkpoint import SweepCheckpoint
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.schedule import run_tasks
from vanedamp.coupling.sweep.sweep import sweep, warm_up
from vanedamp.coupling.sweep.worker import SweepTable, Task, TaskResult, run_points
from vanedamp.files.store import write_json
from vanedamp.files.toml_input import validate
from vanedamp.studies.jobs.workers import workers

#: the calibrated cluster of the demonstration
_MASS, _STIFFNESS, _AMPLITUDE = 0.148, 3.4e7, 3.0e-5
#: turns of the programs on many short scenes
_ROUNDS = 5


@dataclass(frozen=True)
class Job:
    """What is measured: "sweep" runs scenes; "tasks" hands them out without running any; "points" times single ones.

    "short": many short scenes, compared with heyoka.

    executor: "pool", "dask" or "mpi"; folder: of the sweep's files.
    """

    what: str
    points: int
    periods: int
    workers: int
    folder: str
    executor: str = "pool"
    per_task: int = 0


class _Use(NamedTuple):
    """What a process has used: s of the processor, peak bytes, those of them that it shares with nobody, its parent.

    Bytes that several processes share count by their part for each, where the system tells.
    """

    process: int
    cpu_s: float
    peak_bytes: int
    own_bytes: int
    parent: int


def scene(points: int, periods: int) -> Scene:
    """Return a rigid model with one body: gaps times frequencies around the resonance, `points` in all."""
    frequencies = max(count for count in range(1, math.isqrt(points) + 1) if points % count == 0)
    first = math.sqrt(_STIFFNESS / _MASS) / (2 * math.pi)
    data: dict[str, Any] = {
        "structure": {"model": "rigid", "mass": _MASS, "stiffness": _STIFFNESS, "damping_ratio": 0.002},
        "excitation": {"frequency": first, "resonance_amplitude": _AMPLITUDE},
        "cavity": [{"name": "c1", "gap": 0.5 * _AMPLITUDE}],
        "damper": [{"cavity": "c1", "mass": 0.02 * _MASS, "friction": 0.4, "restitution": 0.7}],
        "time": {"periods": periods, "transient": 0},
        "sweep": {
            "cavity.c1.gap": {"start": 0.2 * _AMPLITUDE, "stop": 2.0 * _AMPLITUDE, "num": points // frequencies},
            "excitation.frequency": {"start": 0.95 * first, "stop": 1.03 * first, "num": frequencies},
        },
    }
    return validate(Scene, data, "benchmark")


def measure(job: Job) -> dict[str, Any] | None:
    """Run a job; workers have started before the clock. None: on MPI ranks other than the first."""
    if job.what == "points":
        return {"seconds": _single_points(job)}
    if job.what == "short":
        from benchmarks.sweep import short_scenes  # whose engine and loops would count in the memory of the others

        return short_scenes.measure(job.points, job.periods, _ROUNDS)
    with _executor(job) as pool:
        if pool is None and job.executor == "mpi":
            return None
        return _tasks(job, pool) if job.what == "tasks" else _sweep(job, pool)


def _sweep(job: Job, pool: Executor | None) -> dict[str, Any]:
    """Run a sweep with its checkpoint and its result, as the command does."""
    made, folder = scene(job.points, job.periods), Path(job.folder)
    warm_up()
    watched = None if pool is None else _Watched(pool)
    before = _uses(pool, job.workers)
    resumed = SweepCheckpoint(folder / "sweep.h5.partial", made, job.points, {}).finished.count
    started = time.perf_counter()
    result = sweep(made, watched, checkpoint=folder / "sweep.h5.partial")
    result.save(folder / "sweep.h5")
    wall = time.perf_counter() - started
    after = _uses(pool, job.workers)
    spent = {use.process: use.cpu_s - before[use.process].cpu_s for use in after.values()}
    own = spent.pop(os.getpid())
    of_workers = [use for use in after.values() if use.process != os.getpid()]
    return {
        "points": job.points, "resumed": resumed, "periods": job.periods, "workers": job.workers,
        "executor": job.executor, "wall_s": wall, "main_cpu_s": own, "worker_cpu_s": sorted(spent.values()),
        "tasks": watched.tasks if watched else 0, "task_s": watched.seconds if watched else own,
        "main_peak_bytes": after[os.getpid()].peak_bytes,
        "worker_own_bytes": max((use.own_bytes for use in of_workers), default=0),
        "worker_peak_bytes": _share(job, of_workers),
        "file_bytes": (folder / "sweep.h5").stat().st_size,
        "ok": int((result.status == "ok").sum()), "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }  # fmt: skip


def _tasks(job: Job, pool: Executor | None) -> dict[str, Any]:
    """Hand out tasks that run nothing and say that they took a second: what is left is what handing out costs."""
    assert pool is not None
    points = grid(scene(job.points, job.periods))
    idle, finished = _Watched(pool, partial(_nothing, job.per_task)), SweepTable(points.size, Row(points.base))
    started, used = time.perf_counter(), time.process_time()
    for task, rest, result in run_tasks(points, finished, idle):
        finished.add(task, result, bool(rest))
    return {
        "points": job.points, "tasks": idle.tasks, "main_cpu_s": time.process_time() - used,
        "wall_s": time.perf_counter() - started,
    }  # fmt: skip


def _single_points(job: Job) -> list[float]:
    """Return the processor time of points at random, s."""
    points = grid(scene(10_000, job.periods))
    warm_up()
    found = []
    for index in np.random.default_rng(1).permutation(points.size)[: job.points].tolist():
        started = time.process_time()
        run_points(points.base, points.choices, [points.values(index)], Task([index]))
        found.append(time.process_time() - started)
    return found


def _nothing(per_task: int, base: Scene, choices: Any, points: Sequence[Mapping[str, Any]], task: Task) -> TaskResult:
    """Stand for a task of which `per_task` points take a second."""
    count = len(points)
    return TaskResult(np.zeros((count, Row(base).width)), [("ok", "")] * count, None, count / per_task)


class _Watched(Executor):
    """An executor whose tasks are counted, with the time they took by the clock; function: in place of theirs."""

    def __init__(self, inner: Executor, function: Callable[..., TaskResult] | None = None) -> None:
        self._inner, self._function, self.tasks, self.seconds = inner, function, 0, 0.0
        for name in ("_max_workers", "num_workers", "_client"):  # by which a sweep knows how many workers there are
            if hasattr(inner, name):
                setattr(self, name, getattr(inner, name))

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        future = self._inner.submit(self._function or function, *arguments, **options)
        future.add_done_callback(self._count)
        return future

    def _count(self, future: Future[TaskResult]) -> None:
        self.tasks += 1
        self.seconds += future.result().seconds


@contextmanager
def _executor(job: Job) -> Iterator[Executor | None]:
    """Yield the executor; its workers have the engine."""
    if job.executor == "pool":
        with workers(job.workers) as pool:
            yield pool
    elif job.executor == "dask":
        from distributed import Client, LocalCluster

        options = {"n_workers": job.workers, "threads_per_worker": 1, "dashboard_address": None}
        with LocalCluster(local_directory=job.folder, **options) as cluster, Client(cluster) as client:
            yield client.get_executor(pure=False)
    else:
        from mpi4py.futures import MPICommExecutor

        with MPICommExecutor() as executor:
            yield executor


def _uses(pool: Executor | None, count: int) -> dict[int, _Use]:
    """Return what this process and each worker have used, by process; each has run the engine."""
    uses = {use.process: use for use in [_use(0.0)]}
    while pool is not None and len(uses) < count + 1:
        tried = [pool.submit(_use, 0.2) for _ in range(count)]
        uses |= {use.process: use for use in (future.result() for future in tried)}
    return uses


def _use(pause: float) -> _Use:
    warm_up()
    time.sleep(pause)  # so that every worker is asked
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    memory = _memory("self")
    more = peak - memory.get("Rss", 0)  # at the peak, than now
    own = memory.get("Private_Clean", 0) + memory.get("Private_Dirty", 0)
    return _Use(os.getpid(), time.process_time(), memory.get("Pss", 0) + more, own + more, os.getppid())


def _share(job: Job, uses: Sequence[_Use]) -> int:
    """Return the bytes of a worker, with its part of the server from which the workers of a pool are forked."""
    if not uses:
        return 0
    parents = {use.parent for use in uses} - {os.getpid()} if job.executor == "pool" else ()
    return (sum(use.peak_bytes for use in uses) + sum(_memory(str(one)).get("Pss", 0) for one in parents)) // len(uses)


def _memory(process: str) -> dict[str, int]:
    """Return the sizes of a process's memory by Linux's names, bytes; empty on other systems."""
    try:
        text = Path("/proc", process, "smaps_rollup").read_text(encoding="ascii")
    except OSError:
        return {}
    return {name: 1024 * int(size) for name, size in re.findall(r"^(\w+):\s+(\d+) kB", text, re.MULTILINE)}


def _main(arguments: Sequence[str]) -> None:
    found = measure(Job(**json.loads(Path(arguments[0]).read_text(encoding="utf-8"))))
    if found is not None:
        write_json(arguments[1], found)


if __name__ == "__main__":
    _main(sys.argv[1:])
