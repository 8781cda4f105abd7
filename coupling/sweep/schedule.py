"""Schedule of a sweep's tasks on workers: their order, lost workers, the end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.grid import PointSet
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.worker import SweepError, SweepTable, Task, TaskResult, broken, run_points, tasks_of

#: s that a task takes at least, unless few points are left: long enough that handing it out costs nothing
_SECONDS = 1.0
#: tasks that end in a second at most: schedulers manage some hundreds
_RATE = 100
#: tasks of each worker that the points still to be run make at least, so that workers end together; more are dearer to
#: hand out than they save at the end (`vanedamp bench sweep` simulates it)
_PER_WORKER = 4
#: points of a task at most: their values and results wait in the main process
_MOST = 10_000
#: workers of an executor of an unknown number
_UNKNOWN = 256

#: a task and the rest of its chain
_Entry = tuple[Task, Sequence[int]]


def run_tasks(
    grid: PointSet, finished: SweepTable, executor: Executor | None
) -> Iterator[tuple[Task, Sequence[int], TaskResult]]:
    """Yield tasks as they are done, each with the rest of its chain, and its result."""
    workers = _workers(executor)
    size = TaskSize(finished, workers)
    source, ready = tasks_of(grid, finished, size), deque[_Entry]()
    running: dict[Future[TaskResult], _Entry] = {}
    try:
        while True:
            while len(running) < (1 if executor is None else 2 * workers + 2):
                entry = ready.popleft() if ready else next(source, None)
                if entry is None:
                    break
                running[_submit(grid, entry[0], executor)] = entry
            if not running:
                return
            for (task, rest), result in _ended(grid, running, executor):
                size.learn(len(task.points), result.seconds)
                if rest and task.linked:
                    most = size()
                    ready.append((Task(rest[:most], True, result.final, task.chain), rest[most:]))
                yield task, rest, result
    finally:
        for future in running:
            future.cancel()


def width_of(base: Scene) -> int:
    """Return the number of columns of a scene's points: something that a worker can do."""
    return Row(base).width


class TaskSize:
    """How many points the next task takes: by the time of those before, and few at the end."""

    def __init__(self, finished: SweepTable, workers: int) -> None:
        self._finished, self._tasks = finished, _PER_WORKER * workers
        self._seconds = max(_SECONDS, workers / _RATE)
        self._most = 1

    def __call__(self) -> int:
        """Return the number of points, at least 1."""
        left = len(self._finished.done) - self._finished.count
        return max(1, min(self._most, left // self._tasks))

    def learn(self, points: int, seconds: float) -> None:
        """Take the time that some points took. A task grows at most fourfold: the first points may be quick ones."""
        self._most = max(1, min(4 * points, int(points * self._seconds / max(seconds, 1e-9)), _MOST))


def _workers(executor: Executor | None) -> int:
    """Return the number of an executor's workers; those that a dask cluster has now."""
    if executor is None:
        return 1
    if (client := getattr(executor, "_client", None)) is not None:
        return len(client.ncores()) or _UNKNOWN
    known = getattr(executor, "_max_workers", None) or getattr(executor, "num_workers", None)
    return known if isinstance(known, int) else _UNKNOWN


def _submit(grid: PointSet, task: Task, executor: Executor | None) -> Future[TaskResult]:
    points = grid.table(task.points)
    if executor is None:
        future: Future[TaskResult] = Future()
        future.set_result(run_points(grid.base, grid.choices, points, task))
        return future
    return _handed_out(executor, run_points, grid.base, grid.choices, points, task)


def _handed_out(executor: Executor, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
    try:
        return executor.submit(function, *arguments)
    except (BrokenExecutor, RuntimeError) as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error


def _ended(
    grid: PointSet, running: dict[Future[TaskResult], _Entry], executor: Executor | None
) -> Iterator[tuple[_Entry, TaskResult]]:
    """Yield tasks that have ended, taken from those that run.

    A process pool that loses a worker gives up all of its tasks: their points run again, one by one, to find the point
    that breaks it. Raises SweepError for errors that are no fault of a point.
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
    for _, future in lost:
        _raise_sweep_error(future)
    for (task, rest), future in lost:
        yield (task, rest), _one_by_one(grid, task, future, executor)


def _one_by_one(grid: PointSet, task: Task, lost: Future[TaskResult], executor: Executor | None) -> TaskResult:
    """Run the points of a lost task, each as a task of its own."""
    results, state = [], task.start
    for point in task.points:
        single = Task([point], task.linked, state, task.chain)
        # a lone point need not be tried again, unless others may have broken the pool
        known = len(task.points) == 1 and not lost.cancelled() and not isinstance(lost.exception(), BrokenExecutor)
        future = lost if known else _submit(grid, single, executor)
        error = future.exception()
        if error is not None:
            _raise_sweep_error(future)
            if executor is not None and _handed_out(executor, width_of, grid.base).exception() is not None:
                raise SweepError(f"the workers end as they begin ({error}); run the same again to go on") from error
        results.append(future.result() if error is None else broken(error, Row(grid.base)))
        state = state if results[-1].final is None else results[-1].final
    texts = [text for result in results for text in result.texts]
    return TaskResult(np.concatenate([result.values for result in results]), texts, state if task.linked else None)


def _raise_sweep_error(future: Future[TaskResult]) -> None:
    """Raise an error of a worker that is no fault of a point."""
    if not future.cancelled() and isinstance(future.exception(), SweepError):
        future.result()
