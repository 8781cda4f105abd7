"""Points of a sweep that differ in numbers only, run as one in compiled code (engine.scenes).

A scene of a sweep costs a run a few microseconds there, where Python would take a thousand times as long to make it.
Points whose other values differ, and scenes that the compiled code refuses, are run one by one.
"""

from __future__ import annotations

import itertools
import pickle
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.engine.columns import LEVELS, STARTS, Columns, columned, tells
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.engine.scenes import (
    BEGINS,
    COUNT,
    DROPPED,
    GIVEN,
    LEFT,
    LINKS,
    NEGLECTED,
    OWN,
    PLACE,
    STAGE,
    BatchArrays,
    new_job,
)
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import OUTSIDE
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.quantities.sums import ENERGIES, SUMS, sources_of
from vanedamp.coupling.response.evaluation import STATUS_OF, class_name, closed_status, in_plane, levelled_status
from vanedamp.coupling.response.figures import measured_of
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import marked_with_speed, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.paths import with_numbers
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import FILE_PATHS, Scene
from vanedamp.coupling.simulation import parts_of_run
from vanedamp.coupling.sweep.grid import Points, PointTable
from vanedamp.coupling.sweep.row import PARTS, Row
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.transient import Transient, most_periods
from vanedamp.files.store import file_stamp
from vanedamp.files.toml_input import InputError

#: numbers with which a run begins: of linked runs only the first
_OF_STARTS = ("initial.", ".position", ".velocity")
#: kinds that a thread keeps
_MOST = 4

#: runs point k of a group by itself, from a state; returns the state that it leaves, None if it broke off
Alone = Callable[[int, RestartState | None], RestartState | None]
#: takes data of point k besides its sums: its sections, and observers' data, by name
Keep = Callable[[int, Mapping[str, Any]], None]


class SceneBatch:
    """Scenes that differ from one in numbers with columns, and the run that takes them in turn."""

    def __init__(self, scene: Scene, sums_only: bool = False) -> None:
        """Take the first scene, without open choices. Raises InputError or ValueError for one that is no such scene.

        sums_only: nothing else is taken of the runs.
        """
        self.observers = [] if sums_only else parts_of_run(scene)
        run = run_of(scene, self.observers)
        for observer in self.observers:
            observer.look(run, None)
        if not isinstance(run, EventDrivenRun) or scene.contact.parallel:
            raise ValueError("not a scene of the exact engine, or one whose contacts begin at several gaps")
        run.check()
        self.scene, self.run, self.start, self._data = scene, run, start_of(scene, run.whole), scene.to_dict()
        transient, self.linear = Transient(scene, run.whole), linear_responses(scene, run.whole)
        (setup, free, stuck), (loose, held) = transient.numbers, transient.parts
        # compiled code writes the numbers of each scene into these: none is an array of the first one's records
        self.statistics = tuple(map(_own, (setup, loose, held, free, stuck, measured_of(scene, run.whole))))
        run.system = _own(run.system)

    def run_all(
        self,
        values: Mapping[str, np.ndarray],
        start: RestartState | Sequence[RestartState] | None,
        linked: bool,
        alone: Alone,
        keep: Keep | None = None,
    ) -> tuple[BatchArrays, np.ndarray, RestartState | None]:
        """Run scenes (k,). Return the job with their results, linear amplitudes (k, 2), and the state they leave.

        values: of all paths; start: of the first of linked scenes, or of every scene (`left` then says how each ends);
        alone: runs scenes that compiled code rejects, whose codes stay 0; keep: takes the data of every other one,
        before the next begins.
        """
        run, size = self.run, len(next(iter(values.values())))
        given = [] if start is None else [start] if isinstance(start, RestartState) else start
        kind, bodies = LINKS if linked else GIVEN if given else OWN, run.whole.bodies * run.whole.in_plane
        job = new_job(size, most_periods(self.scene), kind, run.keep, bodies)
        table = self._columns(values, given, linked, job)
        first, motions = given[0] if linked and given else None, self._motions(table, values)
        linear = [one for observer in self.observers for one in observer.linear(self.linear[0].order, motions)]
        for count in [size] if keep is None else range(1, size + 1):
            job.at[COUNT] = count
            while run.run_many(job, table, self.statistics) == OUTSIDE:
                index = int(job.at[PLACE])
                left = alone(index, self._left(job, index, first) if linked else None)
                job.codes[index] = 0
                if linked:
                    for name in STARTS:
                        column = getattr(table, name)
                        column[index + 1] = column[index] if left is None else getattr(left, name)
                job.at[PLACE], job.at[STAGE] = index + 1, BEGINS
                job.at[LEFT] = job.at[LEFT] if left is None else index + 1
            if keep is not None and job.codes[count - 1]:
                keep(count - 1, self._parts(job, table, values, linear, count - 1))
        amplitudes = np.transpose([curve.heights(motion) for curve, motion in zip(self.linear, motions, strict=True)])
        return job, amplitudes, self._left(job, size, first) if linked else None

    def ended(self, job: BatchArrays, k: int) -> tuple[Status, str]:
        """Return how scene k of a job has ended, and the class of its motion."""
        unbalanced, made = (float(job.sums[k, SUMS.index(name)]) for name in ("unbalanced", "made"))
        status = closed_status(STATUS_OF[int(job.codes[k])], unbalanced, made, OPEN_LEDGER)
        if job.plane.size:
            status = levelled_status(status, in_plane(*job.plane[:, k]), self.run.linearisation)
        return status, class_name(int(job.kinds[k]))

    def sources(self, job: BatchArrays, linear: np.ndarray, k: Any) -> dict[str, Any]:
        """Return inputs of quantities of scene k of a job, or of several, (n, ...) each."""
        undamped, fixed = linear[k].T
        plane = in_plane(*job.plane[:, k]) if job.plane.size else {}
        return sources_of(job.sums[k]) | {"undamped": undamped, "fixed": fixed, "overlap": 0.0 * undamped} | plane

    def left(self, k: int) -> RestartState:
        """Return the state that scene k of the last job has left, which are not linked."""
        return marked_with_speed(self.scene, self.run.start_in(k, k))

    def _parts(
        self, job: BatchArrays, table: Columns, values: Mapping[str, np.ndarray], linear: Sequence[Any], k: int
    ) -> dict[str, Any]:
        """Return the data kept of the run of scene k, just ended, by name."""
        run = self.run.outcome()
        first, b = min(int(job.at[DROPPED]), max(run.periods - 1, 0)), self.run.system.bodies
        section, fields = run.records.section[first : run.periods + 1], dict[str, Any](transient=0)
        fields |= {"section": section[:, :2], "slip": section[:, 3 : 3 + b], "slip_velocity": section[:, 3 + b :]}
        if self.observers:
            scene = with_numbers(self.scene, self._data, {path: float(numbers[k]) for path, numbers in values.items()})
            run, known = replace(run, system=self.run.whole_in(table, k)), dict[str, Any](transient=first)
            known["energy"] = {name: float(job.sums[k, SUMS.index(name)]) for name in ENERGIES}
            known |= {"classification": class_name(int(job.kinds[k]))} | ({"linear": linear[k]} if linear else {})
            fields |= dict.fromkeys(PARTS)
            for observer in self.observers:
                fields |= observer.fields(scene, run, known)
        return fields

    def _columns(
        self, values: Mapping[str, np.ndarray], given: Sequence[RestartState], linked: bool, job: BatchArrays
    ) -> Columns:
        """Return the columns of scenes; of linked ones with a row more, for the state that the last one leaves.

        Scenes that a given start does not fit as it is are noted in the job: Python moves it.
        """
        if linked:
            values = {path: np.append(numbers, numbers[-1]) for path, numbers in values.items()}
        table, outside = self.run.columns_of(self.scene, self.start, values)
        job.codes[[k for k in outside if k < len(job.codes)]] = OUTSIDE
        if job.plane.size:
            job.plane[NEGLECTED] = table.neglected[: len(job.codes)]
        for k, start in enumerate(given):
            moved = start_of(self.scene, self.run.whole_in(table, k), start)
            for name in STARTS:
                getattr(table, name)[k] = getattr(start, name)
            if not all(np.array_equal(getattr(start, name), getattr(moved, name)) for name in STARTS):
                job.codes[k] = OUTSIDE
        return table

    def _left(self, job: BatchArrays, index: int, start: RestartState | None) -> RestartState | None:
        """Return the state with which linked scene k begins: that of the last one before that has left one."""
        left = int(job.at[LEFT])
        return start if left == 0 else marked_with_speed(self.scene, self.run.start_in(index, left - 1))

    def _motions(self, table: Columns, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the linear motions (2, k, e, n) without bodies and with fixed ones."""
        size, n = len(next(iter(values.values()))), self.run.system.modes
        frequency, motions = values.get(FREQUENCY, np.full(size, self.scene.frequency)), []
        for response in self.linear:
            load = None
            if any(path in values for path in LEVELS):
                load = table.load[:size, np.isin(self.run.whole.order, response.order), :n]
            motions.append(response.motions(frequency, load))
        return np.array(motions)


def _own(record: Any) -> Any:
    """Return a record of compiled functions with arrays of its own."""
    return record._make(value.copy() if isinstance(value, np.ndarray) else value for value in record)


class _Kept(threading.local):
    """The kinds that ran last in a thread, by key, the last one behind."""

    def __init__(self) -> None:
        self.kinds: dict[bytes, SceneBatch | None] = {}


_KEPT = _Kept()


class Common(NamedTuple):
    """Common to the kinds of a maker's points: scene and choices as bytes, and the files that it names."""

    made_of: bytes
    files: list[str]

    @classmethod
    def of(cls, maker: Points) -> Common:
        """Return that of a maker."""
        return cls(pickle.dumps((maker.base, maker.choices)), maker.base.files)


def kind_of(
    maker: Points, point: Mapping[str, Any], paths: list[str], common: Common | None = None, sums_only: bool = False
) -> SceneBatch | None:
    """Return the kind of a point's scene; None where it has to be run by itself. The last ones are kept.

    common: of the maker, where it is known; sums_only: as of a SceneBatch.
    """
    common = common or Common.of(maker)
    slow = {path: value for path, value in point.items() if path not in paths}
    above = [point[path] > 0.0 for path in paths if tells(path)]
    files = [*common.files, *(value for path, value in slow.items() if path in FILE_PATHS)]
    key = common.made_of + pickle.dumps((slow, paths, above, sums_only, [file_stamp(file) for file in files]))
    kinds = _KEPT.kinds
    if key in kinds:
        kinds[key] = kinds.pop(key)
        return kinds[key]
    kinds[key] = None
    with suppress(InputError, ValueError):  # its own run reports the error
        chosen = maker.chosen(point)
        # other values may be in the way of a column
        if chosen.start is None and columned(chosen.scene, paths) == paths:
            kinds[key] = SceneBatch(chosen.scene, sums_only)
    if len(kinds) > _MOST:
        del kinds[next(iter(kinds))]
    return kinds[key]


def are_scenes(maker: Points, first: Mapping[str, Any], numbers: Mapping[str, np.ndarray]) -> bool:
    """Return whether the ends of all numbers (k,) are those of scenes. Between them others are, too: bounds are linear.

    Bounds by other numbers (positions by gaps) are checked at the start.
    """
    try:
        for path, values in numbers.items():
            for end in {float(values.min()), float(values.max())}:
                maker.raw({**first, path: end})
    except InputError:
        return False
    return True


def without_starts(paths: Iterable[str]) -> list[str]:
    """Return the paths that say more than how a run begins."""
    return [path for path in paths if not any(key in path for key in _OF_STARTS)]


def keys(points: PointTable, paths: Iterable[str]) -> list[tuple[Any, ...]]:
    """Return each point's key: scenes of one key differ in numbers with columns only."""
    columns = points.columns
    telling = [values for path, values in columns.items() if path not in paths]
    telling += [np.asarray(columns[path]) > 0.0 for path in paths if path in columns and tells(path)]
    return list(zip(*telling, strict=True)) if telling else [()] * len(points)


def groups(base: Scene, points: PointTable, linked: bool) -> Iterator[tuple[list[str], list[int]]]:
    """Yield the paths with columns, and the indices of points that differ only in these; linked ones in turn."""
    columns = points.columns
    paths = [path for path in columned(base, columns) if all(isinstance(value, int | float) for value in columns[path])]
    paths = without_starts(paths) if linked else paths
    key = keys(points, paths)
    if not paths or Row(base).alone:
        yield from (([], [index]) for index in range(len(points)))
    elif linked:
        yield from ((paths, list(some)) for _, some in itertools.groupby(range(len(points)), key.__getitem__))
    else:
        by_key: dict[tuple[Any, ...], list[int]] = {}
        for index in range(len(points)):
            by_key.setdefault(key[index], []).append(index)
        yield from ((paths, some) for some in by_key.values())
