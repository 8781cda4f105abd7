"""Runs of a sweep's points by a worker, and the finished points in arrays."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.linalg import LinAlgError

from vanedamp.coupling.exponents.lyapunov import NO_EXPONENT, lyapunov
from vanedamp.coupling.numerics.compiler.jit import CacheError
from vanedamp.coupling.response.evaluation import linear_parts
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.alike import are_scenes, groups, kind_of
from vanedamp.coupling.sweep.grid import Points, PointSet, PointTable
from vanedamp.coupling.sweep.row import TEXTS, Row
from vanedamp.files.errors import VanedampError
from vanedamp.files.store import StoreError, frozen
from vanedamp.files.toml_input import InputError

#: faults of a point: of its parameters and of arithmetic; all others, such as of imports, files, memory and the
#: program, would meet the next point as well
OF_A_POINT = (ArithmeticError, LinAlgError, VanedampError)


class SweepError(VanedampError):
    """A sweep that cannot continue: its workers are gone, or the machine lacks a requirement of every run."""


class Task(NamedTuple):
    """Points that one worker runs in turn; linked ones begin with `start` (None: as the scene says)."""

    points: Sequence[int]
    linked: bool = False
    start: RestartState | None = None
    chain: int = 0


class TaskResult(NamedTuple):
    """The result of a task: values (k, width), nan where there is none, texts (k, t), last state, and its time, s."""

    values: np.ndarray
    texts: list[tuple[str, ...]]
    final: RestartState | None
    seconds: float = 0.0


def run_points(base: Scene, choices: Any, points: Sequence[Mapping[str, Any]], task: Task) -> TaskResult:
    """Run some points, given by the values of the axes: the task of a worker.

    Those that differ in numbers only run as one (sweep.alike). Raises SweepError for errors that are no fault of a
    point.
    """
    try:
        return _run_points(base, choices, points, task)
    except OF_A_POINT:
        raise
    except Exception as error:
        raise _stopped(error, f"points {task.points[0]} to {task.points[-1]}") from error


def _run_points(base: Scene, choices: Any, points: Sequence[Mapping[str, Any]], task: Task) -> TaskResult:
    started = time.perf_counter()
    points, maker, state = PointTable.of(points), Points(base, choices), task.start if task.linked else None
    row = Row(base)
    values, texts = np.full((len(points), row.width), np.nan), [("",) * len(row.texts)] * len(points)
    for paths, places in groups(base, points, task.linked):

        def alone(index: int, start: RestartState | None, places: Sequence[int] = places) -> RestartState | None:
            index = places[index]
            final, texts[index] = _run(maker, points[index], start, values[index], row)
            return final

        def keep(index: int, parts: Mapping[str, Any], places: Sequence[int] = places) -> None:
            row.put_parts(values[places[index]], parts)

        numbers = {path: np.array(points.columns[path], float)[places] for path in paths}
        first = points[places[0]]
        kind = kind_of(maker, first, paths) if paths and are_scenes(maker, first, numbers) else None
        outcome = None
        if kind is not None:
            with suppress(InputError):  # a start that does not fit: the runs say so
                outcome = kind.run_all(numbers, state, task.linked, alone, keep if row.keeps else None)
        if kind is None or outcome is None:
            for index in range(len(places)):
                final = alone(index, state)
                # a run that broke off within a period leaves the state that it began with
                state = final if task.linked and final is not None else state
            continue
        job, linear, state = outcome
        ran = np.flatnonzero(job.codes)
        if not len(ran):
            continue
        at = np.array(places)[ran]
        rows = values[at]
        row.put_many(rows, kind.sources(job, linear, ran))
        values[at] = rows
        for index, k in zip(at, ran, strict=True):
            status, motion = kind.ended(job, k)
            texts[index] = status.value, motion
    return TaskResult(values, texts, state, time.perf_counter() - started)


def broken(error: BaseException, row: Row, points: int = 1) -> TaskResult:
    """Return the result of points whose run has broken, or has broken its worker."""
    text = " ".join(f"error: {type(error).__name__}: {error}".split())
    if isinstance(error, BrokenExecutor):
        text = "error: the worker process ended abruptly (killed, or out of memory)"
    texts = (text, *("" for _ in row.texts[1:]))
    return TaskResult(np.full((points, row.width), np.nan), [texts] * points, None)


class SweepTable:
    """The finished points of a grid: some 180 bytes each.

    row: of each; values: (points, width); codes: (points, t) indices in `texts`; done: (points,);
    states: the state that the next run of an unfinished chain begins with.
    """

    def __init__(self, size: int, row: Row) -> None:
        self.row = row
        self.values = np.full((size, row.width), np.nan, order="F")  # a result takes its columns as they are
        self.codes = np.zeros((size, len(row.texts)), np.int32)
        self.done = np.zeros(size, bool)
        self.states: dict[int, RestartState] = {}
        self._places: dict[str, int] = {}
        self.count = 0

    @property
    def texts(self) -> list[str]:
        """Unique status and classification strings."""
        return list(self._places)

    def add(self, task: Task, result: TaskResult, more: bool) -> None:
        """Take over the result of a task; more: whether its chain continues."""
        where = list(task.points)
        codes = [[self._places.setdefault(text, len(self._places)) for text in pair] for pair in result.texts]
        self.put(where, result.values, np.array(codes))
        self.states.pop(task.chain, None)
        if more and task.linked and result.final is not None:
            self.states[task.chain] = result.final

    def put(self, where: Any, values: np.ndarray, codes: np.ndarray, texts: Sequence[str] | None = None) -> None:
        """Set points, with codes that refer to `texts` (default: those of this record)."""
        if texts is not None:
            numbers = np.array([self._places.setdefault(text, len(self._places)) for text in texts], np.int32)
            codes = numbers[codes]
        self.values[where], self.codes[where] = values, codes
        self.done[where] = True
        self.count = int(np.count_nonzero(self.done))

    def text(self, name: str) -> np.ndarray:
        """Return a text of every point, objects (points,)."""
        return np.array(self.texts, object)[self.codes[:, self.row.texts.index(name)]]

    def arrays(self, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
        """Return all quantities as arrays over a grid, and behind it their own dimensions."""
        texts = {name: frozen(self.text(name).reshape(shape), object) for name in self.row.texts[len(TEXTS) :]}
        return self.row.arrays(self.values, shape) | texts


def _run(
    maker: Points, point: Mapping[str, Any], start: RestartState | None, values: np.ndarray, row: Row
) -> tuple[RestartState | None, tuple[str, ...]]:
    """Run one point into its row. Returns its last state and its texts."""
    try:
        chosen, more = maker.chosen(point), dict[str, Any]()
        response = simulate(chosen.scene, start=start or chosen.start)
        if periods := maker.base.kept.get("exponents"):
            final = response.final
            more["lyapunov"] = NO_EXPONENT if final is None else lyapunov(chosen.scene, periods, final).to_json()
    except Exception as error:  # one broken point must not cost the others
        if isinstance(error, StoreError | CacheError) or not isinstance(error, OF_A_POINT):
            raise _stopped(error, ", ".join(f"{path} = {value}" for path, value in point.items())) from error
        with suppress(*OF_A_POINT):
            row.put_parts(values, linear_parts(maker.scene(point)))
        return None, broken(error, row).texts[0]
    return response.final, row.put(values, response, more)


def _stopped(error: Exception, where: str) -> SweepError:
    again = "run the same again to go on from the checkpoint"
    return SweepError(f"stopped at {where}: {type(error).__name__}: {error}; {again}")


def tasks_of(grid: PointSet, finished: SweepTable, size: Callable[[], int]) -> Iterator[tuple[Task, Sequence[int]]]:
    """Yield tasks that can run side by side, each with the rest of its chain; size: of the next task, in points.

    All tasks of chains that are not linked, and the first of those that are; of points that are not done.
    """
    for number, chain in enumerate(grid.chains()):
        if chain.linked:
            rest = [point for point in chain.points if not finished.done[point]]
            if rest:
                most = size()
                yield Task(rest[:most], True, finished.states.get(number), number), rest[most:]
            continue
        points = (point for point in chain.points if not finished.done[point])
        while some := list(itertools.islice(points, size())):
            yield Task(some, chain=number), []
