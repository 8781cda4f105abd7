"""A sweep on many workers, simulated from measured costs: what its main process can hand out, collect and keep.

The main process (with dask: and its scheduler) does one thing after the other: it hands out a task, takes a result,
writes the checkpoint. Each worker does one task after the other. What is not in the model: the network, start-up, the
loss of workers.
"""

from __future__ import annotations

import heapq
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.sweep.schedule import TaskSize
from vanedamp.files.checkpoint_file import SHARE


class Costs(NamedTuple):
    """Time of the main process, s: of a task, of each of its points, of a checkpoint, of each point in it."""

    task: float
    point: float
    write: float
    write_point: float


class Simulated(NamedTuple):
    """A simulated sweep.

    efficiency: time of the points over workers times the whole time; main: share of the time in which the main process
    works, checkpoints included, and `checkpoints`: those only; tail: share of the workers' time after the first of them
    has run out of tasks; tasks: their number; unsaved_s: longest time between two checkpoints, s.
    """

    workers: int
    points: int
    efficiency: float
    main: float
    checkpoints: float
    tail: float
    tasks: int
    unsaved_s: float

    @property
    def limit(self) -> str:
        """What costs most."""
        if self.efficiency > 0.95:
            return "nothing"
        return "main process" if self.main > 0.9 else "end" if self.tail > 0.5 * (1 - self.efficiency) else "tasks"


def simulated(workers: int, seconds: np.ndarray, costs: Costs, flying: int | None = None) -> Simulated:
    """Run a sweep of points that take the given seconds (n,), in their order. flying: tasks out at a time."""
    begun = np.concatenate([[0.0], np.cumsum(seconds)])
    count, table = len(seconds), SimpleNamespace(done=seconds, count=0)
    size = TaskSize(table, workers)  # type: ignore[arg-type]
    free = [0.0] * workers  # when each worker ends what it has
    running: list[tuple[float, int, float]] = []
    now = busy = kept = following = unsaved = 0.0
    given = tasks = 0
    idle = list[float]()
    while given < count or running:
        while given < count and len(running) < (flying or 2 * workers + 2):
            points = min(size(), count - given)
            now += costs.task / 2 + points * costs.point / 2
            started = max(now, heapq.heappop(free))
            took = float(begun[given + points] - begun[given])
            heapq.heappush(free, started + took)
            heapq.heappush(running, (started + took, points, took))
            given, tasks = given + points, tasks + 1
        if given == count and not idle:
            idle = sorted(free)
        ended, points, took = heapq.heappop(running)
        now = max(now, ended) + costs.task / 2 + points * costs.point / 2
        size.learn(points, took)
        table.count += points
        if now >= following:
            write = costs.write + costs.write_point * table.count
            now, kept = now + write, kept + write
            unsaved, following = max(unsaved, SHARE * write), now + SHARE * write
    busy = tasks * costs.task + count * costs.point + kept
    tail = sum(now - one for one in idle) / (workers * now)
    return Simulated(
        workers, count, float(begun[-1]) / (workers * now), busy / now, kept / now, tail, tasks, unsaved
    )  # fmt: skip
