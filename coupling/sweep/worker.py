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

from vanedamp.coupling.numerics.compiler.jit import CacheError
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.response.evaluation import STATUS_OF, class_name, closed_status
from vanedamp.coupling.response.figures import FIGURES
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.alike import are_scenes, groups, kind_of
from vanedamp.coupling.sweep.further import (
    WEARS,
    bodies_of,
    exponent_width,
    put_exponents,
    put_sections,
    put_sectors,
    put_stresses,
    put_wear,
    section_width,
    sector_width,
    stress_width,
)
from vanedamp.coupling.sweep.grid import Points, PointSet, PointTable
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.errors import VanedampError
from vanedamp.files.store import StoreError
from vanedamp.files.toml_input import InputError

#: measures of a run and their units, each an array over the grid
MEASURES = {
    "amplitude_max": "m", "amplitude_mean": "m", "amplitude_mean_confidence": "m", "amplitude_max_dynamic": "m",
    "amplitude_mean_dynamic": "m", "amplitude_rms": "m", "amplitude_harmonic": "m", "amplitude_undamped": "m",
    "amplitude_fixed": "m",
    "impacts_per_period": "1", "attached_mass_fraction": "1", "energy_residual": "1", "penetration": "1",
}  # fmt: skip
#: measures of each body in the plane and their units, each an array over the grid and the bodies
IN_PLANE = {"tilt_max": "rad", "lift_share": "1", "linearisation": "1", "wall_impacts": "1"}
#: losses of energy, the last axis of `energy_share`
LOSSES = ("viscous", "friction", "impact", "contact")
TEXTS = ("status", "classification")
#: columns of every point: measures, then fractions of the losses; behind them `parts_of`
COLUMNS = (*MEASURES, *LOSSES)
#: faults of a point: of its parameters and of arithmetic; all others, such as of imports, files, memory and the
#: program, would meet the next point as well
OF_A_POINT = (ArithmeticError, LinAlgError, VanedampError)
_LINEAR = [COLUMNS.index(name) for name in ("amplitude_undamped", "amplitude_fixed")]
_OF_RUN = [(name, place) for place, name in enumerate(MEASURES) if place not in _LINEAR]


class SweepError(VanedampError):
    """A sweep that cannot continue: its workers are gone, or the machine lacks a requirement of every run."""


class Task(NamedTuple):
    """Points that one worker runs one after the other; linked ones begin with `start` (None: as the scene says)."""

    points: Sequence[int]
    linked: bool = False
    start: RestartState | None = None
    chain: int = 0


class TaskResult(NamedTuple):
    """The result of a task: values (k, columns), nan where there is none, texts (k, 2), last state, and its time, s."""

    values: np.ndarray
    texts: list[tuple[str, str]]
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
    values, parts = np.full((len(points), width_of(base)), np.nan), parts_of(base)
    texts = [("", "")] * len(points)
    for paths, places in groups(base, points, task.linked):

        def alone(place: int, start: RestartState | None, places: Sequence[int] = places) -> RestartState | None:
            place = places[place]
            final, texts[place] = _run(maker, points[place], start, values[place], parts)
            return final

        def keep(place: int, section: np.ndarray, places: Sequence[int] = places) -> None:
            put_sections(values[places[place], parts["sections"]], section)

        numbers = {path: np.array(points.columns[path], float)[places] for path in paths}
        first, several = points[places[0]], len(places) > 1 and bool(paths)
        kind = kind_of(maker, first, paths) if several and are_scenes(maker, first, numbers) else None
        found = None
        if kind is not None:
            with suppress(InputError):  # a start that does not fit: the runs say so
                found = kind.run_all(numbers, state, task.linked, alone, keep if "sections" in base.kept else None)
        if found is None:
            for place in range(len(places)):
                final = alone(place, state)
                # a run that broke off within a period leaves the state that it began with
                state = final if task.linked and final is not None else state
            continue
        job, linear, state = found
        ran = np.flatnonzero(job.codes)
        at = np.array(places)[ran]
        values[at, : len(COLUMNS)] = _rows(job.figures[ran], linear[ran])
        for place, code, motion, figures in zip(at, job.codes[ran], job.kinds[ran], job.figures[ran], strict=True):
            texts[place] = _status(int(code), figures).value, class_name(int(motion))
    return TaskResult(values, texts, state, time.perf_counter() - started)


def _rows(figures: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Return the rows of runs from their figures (k, figures) and linear amplitudes (k, 2)."""
    rows = np.empty((len(figures), len(COLUMNS)))
    for name, place in _OF_RUN:
        rows[:, place] = figures[:, FIGURES.index(name)] if name in FIGURES else 0.0  # exact: no penetration
    rows[:, _LINEAR] = linear
    rows[:, len(MEASURES) :] = _shares(figures[:, [FIGURES.index(name) for name in LOSSES]])
    return rows


def _status(code: int, figures: np.ndarray) -> Status:
    residual, gain = (figures[FIGURES.index(name)] for name in ("energy_residual", "contact_gain"))
    return closed_status(STATUS_OF[code], residual, gain, OPEN_LEDGER)


def parts_of(base: Scene) -> dict[str, slice]:
    """Return the columns of a point behind COLUMNS, by the names of what further.py keeps, and "in_plane"."""
    in_plane = len(IN_PLANE) * bodies_of(base) if base.planar else 0
    wear = len(WEARS) if base.wear is not None else 0
    widths = in_plane, exponent_width(base), section_width(base), wear, stress_width(base), sector_width(base)
    ends = np.cumsum([len(COLUMNS), *widths]).tolist()
    names = ("in_plane", "exponents", "sections", "wear", "stress", "sectors")
    return {name: slice(*between) for name, between in zip(names, itertools.pairwise(ends), strict=True)}


def width_of(base: Scene) -> int:
    """Return the number of columns of a scene's points."""
    return int(parts_of(base)["sectors"].stop)


def broken(error: BaseException, width: int = len(COLUMNS), points: int = 1) -> TaskResult:
    """Return the result of points whose run has broken, or has broken its worker."""
    text = " ".join(f"error: {type(error).__name__}: {error}".split())
    if isinstance(error, BrokenExecutor):
        text = "error: the worker process ended abruptly (killed, or out of memory)"
    return TaskResult(np.full((points, width), np.nan), [(text, "")] * points, None)


class SweepTable:
    """The finished points of a grid: some 120 bytes each.

    values: (points, columns); codes: (points, 2) places of the texts in `texts`; done: (points,);
    states: the state that the next run of an unfinished chain begins with.
    """

    def __init__(self, size: int, width: int = len(COLUMNS)) -> None:
        self.values = np.full((size, width), np.nan, order="F")  # a result takes its columns as they are
        self.codes = np.zeros((size, len(TEXTS)), np.int32)
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
            own = np.array([self._places.setdefault(text, len(self._places)) for text in texts], np.int32)
            codes = own[codes]
        self.values[where], self.codes[where] = values, codes
        self.done[where] = True
        self.count = int(np.count_nonzero(self.done))

    def text(self, name: str) -> np.ndarray:
        """Return status or classification of every point, objects (points,)."""
        return np.array(self.texts, object)[self.codes[:, TEXTS.index(name)]]


def _run(
    maker: Points, point: Mapping[str, Any], start: RestartState | None, row: np.ndarray, parts: Mapping[str, slice]
) -> tuple[RestartState | None, tuple[str, str]]:
    """Run one point into its row. Returns its last state and its texts."""
    try:
        chosen = maker.chosen(point)
        row[_LINEAR] = _linear(chosen.scene)
        response = simulate(chosen.scene, start=start or chosen.start)
        if periods := maker.base.kept.get("exponents"):
            put_exponents(row[parts["exponents"]], chosen.scene, periods, response.final)
    except Exception as error:  # one broken point must not cost the others
        if isinstance(error, StoreError | CacheError) or not isinstance(error, OF_A_POINT):
            raise _stopped(error, ", ".join(f"{path} = {value}" for path, value in point.items())) from error
        return None, broken(error).texts[0]
    for name, place in _OF_RUN:
        value = getattr(response, name)
        row[place] = np.nan if value is None else value
    row[len(MEASURES) : len(COLUMNS)] = _shares(np.array([[response.energy[name] for name in LOSSES]]))[0]
    of_bodies = np.reshape(row[parts["in_plane"]], (len(IN_PLANE), -1))
    for place, name in enumerate(IN_PLANE if of_bodies.size else ()):
        of_bodies[place] = getattr(response, name)  # None, of sliders, is nan
    section = np.hstack([response.section, response.slip, response.slip_velocity])
    put_sections(row[parts["sections"]], section[response.transient :])
    put_stresses(row[parts["stress"]], maker.base, response.stress)
    put_wear(row[parts["wear"]], response.wear)
    put_sectors(row[parts["sectors"]], response.sectors)
    return response.final, (response.status.value, response.classification)


def _stopped(error: Exception, where: str) -> SweepError:
    again = "run the same again to go on from the checkpoint"
    return SweepError(f"stopped at {where}: {type(error).__name__}: {error}; {again}")


def _shares(losses: np.ndarray) -> np.ndarray:
    """Return the fractions (k, 4) of energies lost (k, 4); nan where nothing is."""
    total = losses.sum(axis=1, keepdims=True)
    return np.divide(losses, total, out=np.full(losses.shape, np.nan), where=total > 0)


def _linear(scene: Scene) -> list[float]:
    """Return the amplitude without bodies, and with every body fixed in its cavity's floor, m; nan if unknown."""
    if scene.excitation.signal is not None:
        return [np.nan, np.nan]
    frequency = np.array([scene.frequency])
    return [float(response.amplitude(frequency)[0]) for response in linear_responses(scene)]


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
