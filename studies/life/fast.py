"""The fast motion of a life: wear rates and amplitudes in the band, from runs stored in a checkpoint."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.quantities.amplitude import amplitude_mean
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.worker import OF_A_POINT, SweepError
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import InputError, tables
from vanedamp.studies.life.study import HALVINGS, LifeStudy, WearContact
from vanedamp.studies.measure import Measure

#: statuses of complete runs, whose results count; all but the first are reported
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN, Status.TILTED)
#: columns of a run before the damage per hour of its hot spots, the rates of its contacts and their confidence
_AMPLITUDE, _CONFIDENCE, _OK, _DAMAGE = range(4)


class BandMeans(NamedTuple):
    """Means over the band at a state of wear.

    rate, confidence: (c,) volumes of wear per hour, m^3/h, and half widths of their 95 % confidence intervals.
    amplitude, spread: (f,) measure relative to the reference, and half widths; nan where a run failed.
    reduction, reduction_confidence: of the band, and half width. damage: (s,) of the hot spots per hour, 1/h.
    """

    rate: np.ndarray
    confidence: np.ndarray
    amplitude: np.ndarray
    spread: np.ndarray
    reduction: float
    reduction_confidence: float
    damage: np.ndarray


def run_point(scene: Scene, measure: Measure, spots: int) -> tuple[np.ndarray, list[WearContact]]:
    """Return the row of a run and its contacts, in a worker; nan and no contacts where it failed.

    spots: number of hot spots whose damage counts. The relative confidence of the measure is taken to be that of the
    mean amplitude.
    """
    try:
        response = simulate(scene)
    except OF_A_POINT as error:
        if isinstance(error, InputError):
            raise
        return np.r_[np.nan, np.nan, 0.0, np.full(spots, np.nan)], []
    wear = response.wear or ()
    contacts = [
        WearContact(item.damper, item.side, item.corner, np.nan if item.area is None else item.area, item.share)
        for item in wear
    ]
    usable = response.status in _USABLE
    value, confidence = measure.value(response), _or(response.amplitude_mean_confidence, 0.0)
    if measure.quantity.unit != amplitude_mean.unit:
        confidence *= value / max(response.amplitude_mean, np.finfo(float).tiny)
    measured = [value, confidence]
    rates = [item.volume_rate for item in wear], [_or(item.volume_rate_confidence, 0.0) for item in wear]
    damage = response.damage_per_hour if spots else ()
    row = np.array([*measured, float(response.status == Status.OK), *damage, *rates[0], *rates[1]])
    return np.where(usable, row, np.r_[np.nan, np.nan, 0.0, np.full(len(row) - _DAMAGE, np.nan)]), contacts


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


class LifeRuns(SceneCheckpoint):
    """Runs of a life so far, in memory and in a file (path None: in memory only).

    The same life requests the same runs in the same order, so that stored runs come first.
    """

    def __init__(
        self, path: str | Path | None, study: LifeStudy, executor: Executor | None, provenance: Mapping[str, Any],
        progress: Callable[[int], None],
    ) -> None:  # fmt: skip
        """Load the file's runs. progress: called with the number of runs done.

        Raises InputError for a file of another study, or one that cannot be read.
        """
        belongs = {"life": ("study", json.loads(json.dumps(tables(study.table))))}
        super().__init__(path, "life-checkpoint", study.scene, provenance, belongs)
        self.study, self._executor, self._progress = study, executor, progress
        self.contacts: list[WearContact] = []
        self._rows: list[np.ndarray] = []
        self.asked = self.trouble = 0
        if (content := self.read()) is not None:
            self._rows = list(content[0]["runs"])
            self.contacts = [WearContact(*values) for values in json.loads(content[1]["contacts"])]

    def at(self, scene: Scene) -> BandMeans:
        """Run a scene over the band, unless its runs are stored, and return the means. Raises SweepError."""
        rows, beyond = self._at(scene, self.study.frequencies.tolist()), 0.0
        band = len(rows)
        if self.study.refines:
            more, beyond = self._refined(scene, rows)
            rows = rows + more
        width = _DAMAGE + len(self.study.spots) + 2 * len(self.contacts)
        padded = np.array([np.r_[row[:width], np.full(width - min(len(row), width), np.nan)] for row in rows])
        self.trouble += int(np.count_nonzero(padded[:, _OK] != 1.0))
        return self._means(padded, band, beyond)

    def _at(self, scene: Scene, frequencies: Sequence[float]) -> list[np.ndarray]:
        """Return the rows of a scene at some frequencies."""
        points = self.study.points(scene, frequencies)
        stored = self._rows[self.asked : self.asked + len(points)]
        self.asked += len(points)
        for row, contacts in self._run(points[len(stored) :]):
            self.contacts = self.contacts or contacts
            self._rows.append(row)
            self.changed()
            self._progress(len(self._rows))
        return self._rows[self.asked - len(points) : self.asked]

    def _refined(self, scene: Scene, band: Sequence[np.ndarray]) -> tuple[list[np.ndarray], float]:
        """Return rows around the worst point of the band, at ever smaller spacing, and the estimated remaining rise, m.

        The estimate is the rise in the last halving, or half of that in the one before: halving reduces the distance
        to the maximum to a quarter in a smooth curve, and to half in one that ends in a jump.
        """
        frequencies, heights = self.study.frequencies.tolist(), [_height(row) for row in band]
        more, rise = list[np.ndarray](), 0.0
        for _ in range(HALVINGS if max(heights) > 0.0 else 0):
            order = np.argsort(frequencies)
            top = int(np.argmax(heights))
            at = int(np.flatnonzero(order == top)[0])
            neighbours = [order[near] for near in (at - 1, at + 1) if 0 <= near < len(order)]
            middles = [(frequencies[top] + frequencies[near]) / 2 for near in neighbours]
            rows = self._at(scene, middles)
            frequencies, more = frequencies + middles, more + rows
            heights += [_height(row) for row in rows]
            rise = max(max(heights) - heights[top], rise / 2)
        return more, rise

    def content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        """Return the variables of the file, its contacts, and the progress in words."""
        width = max(map(len, self._rows), default=0)
        rows = np.array([np.r_[row, np.full(width - len(row), np.nan)] for row in self._rows])
        contacts = json.dumps([list(contact) for contact in self.contacts])
        return {"runs": Variable(rows, ("run", "column"))}, {"contacts": contacts}, f"{len(rows)} runs are finished"

    def _run(self, points: Sequence[Scene]) -> Any:
        common = [self.study.measure] * len(points), [len(self.study.spots)] * len(points)
        if self._executor is None:
            return map(run_point, points, *common)
        return _handed_out(self._executor, points, *common)

    def _means(self, rows: np.ndarray, band: int, beyond: float) -> BandMeans:
        """Return the means of rows (k, columns), those of the band first.

        beyond: estimate by which the maximum may be higher, m.
        """
        table, c, first = self.study.table, len(self.contacts), _DAMAGE + len(self.study.spots)
        ok = np.isfinite(rows[:, _AMPLITUDE])
        amplitude, spread = rows[:, _AMPLITUDE] / self.study.reference, rows[:, _CONFIDENCE] / self.study.reference
        # failed runs are left out; if all have failed, there is no damping
        counted = np.where(ok, amplitude, -np.inf) if ok.any() else np.ones(len(rows))
        highest = int(np.argmax(counted))
        weights = np.arange(len(rows)) < band
        if table.dwell == "peak":
            weights = np.arange(len(rows)) == highest
        elif not isinstance(table.dwell, str):
            weights = np.r_[table.dwell, np.zeros(len(rows) - band)]
        weights = weights * ok
        weights = weights / max(weights.sum(), np.finfo(float).tiny)
        rates, damage = (np.where(ok[:, None], part, 0.0) for part in (rows[:, first:], rows[:, _DAMAGE:first]))
        in_band, half = counted[:band], np.where(ok, spread, 0.0)
        reduction, confidence = 1.0 - float(counted[highest]), float(half[highest]) + beyond / self.study.reference
        if table.over_band == "mean":
            reduction = 1.0 - float(in_band[np.isfinite(in_band)].mean())
            confidence = float(np.sqrt((half[:band] ** 2).sum()) / max(ok[:band].sum(), 1))
        return BandMeans(
            weights @ rates[:, :c], np.sqrt(weights**2 @ rates[:, c:] ** 2), amplitude[:band], spread[:band],
            reduction, confidence, weights @ damage,
        )  # fmt: skip


def _height(row: np.ndarray) -> float:
    """Return the amplitude in a row of a run, m; -inf where it failed."""
    return float(row[_AMPLITUDE]) if np.isfinite(row[_AMPLITUDE]) else -np.inf


def _handed_out(executor: Executor, *arguments: Sequence[Any]) -> Any:
    try:
        yield from executor.map(run_point, *arguments)
    except BrokenExecutor as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error
