"""Schedule of a sweep's tasks on workers: their order, lost workers, the end."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait

import numpy as np

from vanedamp.coupling.sweep.grid import Grid, PointList
from vanedamp.coupling.sweep.worker import SweepTable, Task, TaskResult, broken, run_points, tasks_of, width_of
from vanedamp.files.errors import VanedampError

# few enough points that workers end together, and that a killed sweep loses little
_MOST_PER_TASK = 16
#: tasks that are with an executor of unknown size at a time: enough for some hundred workers
_IN_FLIGHT = 512


class SweepError(VanedampError):
    """A sweep that cannot go on: its workers are gone."""


#: a task and the rest of its chain
_Entry = tuple[Task, Sequence[int]]


def _run(
    grid: Grid | PointList, finished: SweepTable, executor: Executor | None
) -> Iterator[tuple[Task, Sequence[int], TaskResult]]:
    """Yield tasks as they are done, each with the rest of its chain, and its result."""
    most = max(1, min(_MOST_PER_TASK, (grid.size - finished.count) // 32))
    source, ready = tasks_of(grid, finished, most), deque[_Entry]()
    running: dict[Future[TaskResult], _Entry] = {}
    try:
        while True:
            while len(running) < (1 if executor is None else _in_flight(executor)):
                entry = ready.popleft() if ready else next(source, None)
                if entry is None:
                    break
                running[_submit(grid, entry[0], executor)] = entry
            if not running:
                return
            for (task, rest), result in _ended(grid, running, executor):
                if rest and task.linked:
                    ready.append((Task(rest[:most], True, result.final, task.chain), rest[most:]))
                yield task, rest, result
    finally:
        for future in running:
            future.cancel()


def _in_flight(executor: Executor) -> int:
    """Return how many tasks keep an executor busy; few, since all of them are in doubt when a worker dies."""
    known = getattr(executor, "_max_workers", None) or getattr(executor, "num_workers", None)
    return 2 * known + 2 if isinstance(known, int) else _IN_FLIGHT


def _submit(grid: Grid | PointList, task: Task, executor: Executor | None) -> Future[TaskResult]:
    points = [grid.values(point) for point in task.points]
    if executor is None:
        future: Future[TaskResult] = Future()
        future.set_result(run_points(grid.base, grid.choices, points, task))
        return future
    try:
        return executor.submit(run_points, grid.base, grid.choices, points, task)
    except (BrokenExecutor, RuntimeError) as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error


def _ended(
    grid: Grid | PointList, running: dict[Future[TaskResult], _Entry], executor: Executor | None
) -> Iterator[tuple[_Entry, TaskResult]]:
    """Yield tasks that have ended, taken from those that run.

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


def _one_by_one(grid: Grid | PointList, task: Task, lost: Future[TaskResult], executor: Executor | None) -> TaskResult:
    """Run the points of a lost task, each as a task of its own."""
    results, state = [], task.start
    for point in task.points:
        single = Task([point], task.linked, state, task.chain)
        # a lone point need not be tried again, unless others may have broken the pool
        known = len(task.points) == 1 and not lost.cancelled() and not isinstance(lost.exception(), BrokenExecutor)
        future = lost if known else _submit(grid, single, executor)
        error = future.exception()
        results.append(future.result() if error is None else broken(error, width_of(grid.base)))
        state = state if results[-1].final is None else results[-1].final
    texts = [text for result in results for text in result.texts]
    return TaskResult(np.concatenate([result.values for result in results]), texts, state if task.linked else None)
