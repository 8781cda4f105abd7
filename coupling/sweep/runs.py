"""Runs of one scene with other numbers, one after the other: in compiled code where the numbers have columns.

A search runs a scene some thousand times. A run of a few hundred periods that Python makes, assembles and evaluates
takes several times as long as its motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from vanedamp.coupling.engine.line.columns import columned
from vanedamp.coupling.numerics.codes import DONE, NOT_STEADY, UNCERTAIN
from vanedamp.coupling.quantities.quantity import Measured, evaluated
from vanedamp.coupling.quantities.sums import sources_of
from vanedamp.coupling.response.evaluation import known_value
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.alike import Common, Kind, ended_as, kind_of, without_starts
from vanedamp.coupling.sweep.grid import Points
from vanedamp.coupling.sweep.row import Row
from vanedamp.files.toml_input import InputError

#: ends of runs that were not broken off within a period
_WHOLE = (DONE, NOT_STEADY, UNCERTAIN)


@dataclass(frozen=True, eq=False)
class Ran(Measured):
    """What a run has: as a Response, from which it has only these."""

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
        self._common, self._whole = Common.of(self._maker), not Row(base).keeps

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
        if self._paths and self._whole:
            kind = kind_of(self._maker, numbers, self._paths, self._common)
            with suppress(InputError):  # a start that does not fit: its own run says so
                if kind is not None and (found := _ran(kind, numbers, self._paths, start)) is not None:
                    return found
        scene = self.scene(numbers)
        return None if scene is None else simulate(scene, start=start)


def _ran(kind: Kind, numbers: Mapping[str, float], paths: Iterable[str], start: RestartState | None) -> Ran | None:
    """Return the run of one scene of a kind; None for one that compiled code refuses."""
    values = {path: np.array([numbers[path]]) for path in paths}
    job, linear, final = kind.run_all(values, start, start is not None, lambda *_: None)
    if not job.codes[0]:
        return None
    if job.codes[0] not in _WHOLE:
        final = None
    elif start is None:
        final = kind.end(job)
    undamped, fixed = linear[0].tolist()
    status, classification = ended_as(job, 0)
    sources = sources_of(job.sums[0]) | {"undamped": undamped, "fixed": fixed, "overlap": 0.0}
    return Ran(status, classification, evaluated(sources, partial(known_value, status)), final)
