"""The fast motion of a life: wear rates and amplitudes over the band, by runs that a checkpoint keeps."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.worker import OF_A_POINT, SweepError
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import InputError, tables
from vanedamp.studies.life.study import Contact, LifeStudy

#: statuses of runs that came to their end, whose figures count; those but the first are reported
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN, Status.TILTED)
#: columns of a run before the rates of its contacts and their confidence
_AMPLITUDE, _CONFIDENCE, _OK, _RATES = range(4)


class Found(NamedTuple):
    """Means over the band at a state.

    rate, confidence: (c,) volumes of wear per hour, m^3/h, and half widths of their 95 % confidence intervals.
    amplitude, spread: (f,) amplitudes over the reference and half widths; nan where a run failed.
    reduction, reduction_confidence: of what counts of the band.
    """

    rate: np.ndarray
    confidence: np.ndarray
    amplitude: np.ndarray
    spread: np.ndarray
    reduction: float
    reduction_confidence: float


def run_point(scene: Scene, measure: str) -> tuple[np.ndarray, list[Contact]]:
    """Return the row of a run and its contacts; nan, and none, where it failed: the task of a worker."""
    try:
        response = simulate(scene)
    except OF_A_POINT as error:
        if isinstance(error, InputError):
            raise
        return np.array([np.nan, np.nan, 0.0]), []
    wear = response.wear or ()
    contacts = [
        Contact(one.damper, one.side, one.corner, np.nan if one.area is None else one.area, one.share) for one in wear
    ]
    usable = response.status in _USABLE
    known = [getattr(response, f"{measure}_dynamic"), _or(response.amplitude_mean_confidence, 0.0)]
    rates = [one.volume_rate for one in wear], [_or(one.volume_rate_confidence, 0.0) for one in wear]
    row = np.array([*known, float(response.status == Status.OK), *rates[0], *rates[1]])
    return np.where(usable, row, np.r_[np.nan, np.nan, 0.0, np.full(2 * len(wear), np.nan)]), contacts


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


class Runs(SceneCheckpoint):
    """Runs of a life so far, in memory and in a file (path None: in memory only).

    The same life asks for the same runs in the same order, and begins with those kept.
    """

    def __init__(
        self, path: str | Path | None, study: LifeStudy, executor: Executor | None, provenance: Mapping[str, Any],
        progress: Callable[[int], None],
    ) -> None:  # fmt: skip
        """Take up the file's runs. progress: called with the number of runs done.

        Raises InputError for a file of another study, or one that cannot be read.
        """
        belongs = {"life": ("study", json.loads(json.dumps(tables(study.table))))}
        super().__init__(path, "life-checkpoint", study.scene, provenance, belongs)
        self.study, self._executor, self._progress = study, executor, progress
        self.contacts: list[Contact] = []
        self._rows: list[np.ndarray] = []
        self.asked = self.trouble = 0
        if (found := self.read()) is not None:
            self._rows = list(found[0]["runs"])
            self.contacts = [Contact(*one) for one in json.loads(found[1]["contacts"])]

    def at(self, scene: Scene) -> Found:
        """Run a scene over the band, unless the runs are kept, and return its means. Raises SweepError."""
        points = self.study.points(scene)
        kept = self._rows[self.asked : self.asked + len(points)]
        self.asked += len(points)
        for row, contacts in self._run(points[len(kept) :]):
            self.contacts = self.contacts or contacts
            self._rows.append(row)
            self.changed()
            self._progress(len(self._rows))
        rows = self._rows[self.asked - len(points) : self.asked]
        width = _RATES + 2 * len(self.contacts)
        found = np.array([np.r_[row[:width], np.full(width - min(len(row), width), np.nan)] for row in rows])
        self.trouble += int(np.count_nonzero(found[:, _OK] != 1.0))
        return self._means(found)

    def content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        """Return variables of the file, its contacts, and how much is finished, in words."""
        width = max(map(len, self._rows), default=0)
        rows = np.array([np.r_[row, np.full(width - len(row), np.nan)] for row in self._rows])
        contacts = json.dumps([list(one) for one in self.contacts])
        return {"runs": Variable(rows, ("run", "column"))}, {"contacts": contacts}, f"{len(rows)} runs are finished"

    def _run(self, points: Sequence[Scene]) -> Any:
        measures = [self.study.table.measure] * len(points)
        if self._executor is None:
            return map(run_point, points, measures)
        return _handed_out(self._executor, points, measures)

    def _means(self, found: np.ndarray) -> Found:
        """Return the means over the band (f, columns)."""
        table, c = self.study.table, len(self.contacts)
        ok = np.isfinite(found[:, _AMPLITUDE])
        amplitude = found[:, _AMPLITUDE] / self.study.reference
        spread = found[:, _CONFIDENCE] / self.study.reference
        # runs that failed say nothing of their frequencies; where all have, nothing is damped
        counted = np.where(ok, amplitude, -np.inf) if ok.any() else np.ones(len(found))
        highest = int(np.argmax(counted))
        weights = np.ones(len(found))
        if table.dwell == "peak":
            weights = np.arange(len(found)) == highest
        elif not isinstance(table.dwell, str):
            weights = np.array(table.dwell)
        weights = weights * ok
        weights = weights / max(weights.sum(), np.finfo(float).tiny)
        rates = np.where(ok[:, None], found[:, _RATES:], 0.0)
        worst = table.over_band == "worst"
        known = np.where(ok, spread, 0.0)
        return Found(
            weights @ rates[:, :c], np.sqrt(weights**2 @ rates[:, c:] ** 2), amplitude, spread,
            1.0 - float(counted[highest] if worst else counted[np.isfinite(counted)].mean()),
            float(known[highest] if worst else np.sqrt((known**2).sum()) / max(ok.sum(), 1)),
        )  # fmt: skip


def _handed_out(executor: Executor, points: Sequence[Scene], measures: Sequence[str]) -> Any:
    try:
        yield from executor.map(run_point, points, measures)
    except BrokenExecutor as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error
