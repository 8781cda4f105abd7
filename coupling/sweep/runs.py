"""Runs of one scene with other numbers, in turn: in compiled code where the numbers have columns.

A search runs a scene some thousand times. A run of a few hundred periods that Python makes, assembles and evaluates
takes several times while its motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vanedamp.coupling.engine.columns import columned
from vanedamp.coupling.numerics.codes import DONE, NOT_STEADY, UNCERTAIN
from vanedamp.coupling.quantities.quantity import QuantityRecord, evaluated
from vanedamp.coupling.response.evaluation import known_value
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.alike import Common, SceneBatch, keys, kind_of, without_starts
from vanedamp.coupling.sweep.grid import Points, PointTable
from vanedamp.coupling.sweep.row import Row
from vanedamp.files.toml_input import InputError

#: ends of runs that were not broken off within a period
_WHOLE = (DONE, NOT_STEADY, UNCERTAIN)


@dataclass(frozen=True, eq=False)
class Ran(QuantityRecord):
    """Data of a run, as a Response, from which it has only these."""

    status: Status
    classification: str
    quantities: Mapping[str, Any]
    final: RestartState | None


class Runs:
    """Runs of a scene without open choices whose numbers change.

    paths: of the numbers, which every run gives; between the values that are asked for they make scenes, but for places
    and gaps that bound each other.
    """

    def __init__(self, base: Scene, paths: Iterable[str]) -> None:
        self._maker, self._paths = Points(base), without_starts(columned(base, paths))
        self._common, self._whole = Common.of(self._maker), Row(base).searches

    def scene(self, numbers: Mapping[str, float]) -> Scene | None:
        """Return the scene with numbers; None where they make none."""
        try:
            return self._maker.scene(numbers)
        except InputError:
            return None

    def run(self, numbers: Mapping[str, float], start: RestartState | None = None) -> Ran | Response | None:
        """Return the run with numbers, from the state that another one has left, or the scene's own start.

        None where the numbers make no scene. Raises InputError for a start that the scene does not take.
        """
        return self.run_all([numbers], [start])[0]

    def run_all(
        self, points: Sequence[Mapping[str, float]], starts: Sequence[RestartState | None]
    ) -> list[Ran | Response | None]:
        """Return the runs with numbers, each as `run`: those that differ only in columns in one compiled call."""
        records: list[Ran | Response | None] = [None] * len(points)
        waiting, groups = dict.fromkeys(range(len(points))), dict[Any, list[int]]()
        if self._paths and self._whole:
            for index, key in enumerate(keys(PointTable.of(points), self._paths)):
                groups.setdefault((starts[index] is None, *key), []).append(index)
        for places in groups.values():
            kind = kind_of(self._maker, points[places[0]], self._paths, self._common, True)
            with suppress(InputError):  # a start that does not fit: its own run says so
                if kind is not None:
                    batch = self._ran(kind, [points[index] for index in places], [starts[index] for index in places])
                    for index, ran in zip(places, batch, strict=True):
                        if ran is not None:
                            records[index] = ran
                            del waiting[index]
        for index in waiting:
            scene = self.scene(points[index])
            records[index] = None if scene is None else simulate(scene, start=starts[index])
        return records

    def _ran(
        self, kind: SceneBatch, points: Sequence[Mapping[str, float]], starts: Sequence[RestartState | None]
    ) -> list[Ran | None]:
        """Return the runs of scenes of a kind, all with starts or all without; None for those that it refuses."""
        values = {path: np.array([numbers[path] for numbers in points]) for path in self._paths}
        given = [start for start in starts if start is not None]
        job, linear, _ = kind.run_all(values, given or None, False, lambda *_: None)
        records = list[Ran | None]()
        for k in range(len(points)):
            if not job.codes[k]:
                records.append(None)
                continue
            final = kind.left(k) if job.codes[k] in _WHOLE else None
            status, classification = kind.ended(job, k)
            quantities = evaluated(kind.sources(job, linear, k), partial(known_value, status))
            records.append(Ran(status, classification, quantities, final))
        return records
