"""Quantities of motions that do not repeat: each of their periods is evaluated as a run of its own."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, evaluated, table
from vanedamp.coupling.quantities.sums import SUMS, sources_of
from vanedamp.coupling.response.evaluation import Outcome, in_plane_of
from vanedamp.coupling.response.figures import FigureInputs, measure, measured_of
from vanedamp.coupling.response.records import DETACHES, FRICTION, IMPACT
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import parts_of
from vanedamp.coupling.strength.contact_strength import CONTACTS
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.coupling.strength.stress_series import StressSeries
from vanedamp.files.store import frozen


class Periods:
    """The periods of a motion, taken in turn.

    without: inputs that are missing; each: samples of a period, of a scene with hot spots. Sums are evaluated for
    all periods at once, other parts as they come; where contacts yield, once the next period has shown how the impacts
    end that a period does not.
    """

    def __init__(self, scene: Scene, without: Mapping[str, str], each: int = 0) -> None:
        self._without, self._late = without, scene.yields
        spots = spots_of(scene)
        self._stress = None if spots is None else StressSeries(spots, each)
        self._rows, self._planes = list[np.ndarray](), list[Mapping[str, np.ndarray]]()
        self._of_parts = dict[Quantity, list[Any]]()
        self._waiting: tuple[Scene, Outcome] | None = None
        #: what figures need of the system, while it is the same but for the excitation's frequency
        self._measured: FigureInputs | None = None
        self._J = np.zeros(0)

    def add(self, scene: Scene, run: Outcome) -> None:
        """Take a run of one period of a scene."""
        row, system = np.empty(len(SUMS)), run.system
        if self._measured is None or system.J is not self._J:
            self._measured, self._J = measured_of(scene, system), system.J
        clock = np.array([system.omega, system.period])
        measured = self._measured._replace(clock=clock, frequency=system.frequency)
        measure(measured, run.records, 0, 1, np.nan, row)
        self._rows.append(row)
        if run.plane is not None:
            self._planes.append(in_plane_of(run.plane, slice(0, 1)))
        if self._stress is not None:
            self._stress.add(scene, run.records.coordinates)
        self._finish(run)
        self._waiting = scene, run
        if not self._late:
            self._finish(None)

    def _finish(self, later: Outcome | None) -> None:
        """Evaluate the parts of the period that waits."""
        if self._waiting is None:
            return
        (scene, run), self._waiting = self._waiting, None
        if later is not None:
            run = replace(run, log=_ended(run, later.log))
        if parts := _parts(scene, run):
            if not self._of_parts:
                self._of_parts = {one: [] for one in table().values() if one.exists(parts)}
            for one, values in self._of_parts.items():
                values.append(one.of(parts))

    def stress_of_all(self) -> list[Any] | None:
        """Return inputs of quantities of hot spots over all periods, as of a run; None without any."""
        return self._stress.of_spots(whole=True) if self._stress is not None and self._rows else None

    def results(self, further: Mapping[str, Any]) -> dict[str, Any]:
        """Return `quantities` (p, ...) of the periods, `stress` and `strength`; unknown ones are left out.

        further: more inputs of quantities, (p,) each.
        """
        self._finish(None)
        count, rows, of_spots = len(self._rows), np.array(self._rows), dict[str, Any]()
        if not count:
            return {"quantities": {}}
        # sums are columns; bodies have theirs
        sources = {name: _columns(value) for name, value in (sources_of(rows) | dict(further)).items()}
        for name in self._planes[0] if self._planes else ():
            sources[name] = np.array([plane[name] for plane in self._planes])
        if self._stress is not None:
            of_spots = {"stress": frozen(self._stress.amplitudes()), "strength": self._stress.strengths}
            sources["stress"] = self._stress.of_spots()
        series: dict[str, Any] = {
            name: np.moveaxis(value, -1, 0) if "stress" in table()[name].needs else value
            for name, value in evaluated(sources).items()
        } | {one.name: np.array(values, float) for one, values in self._of_parts.items()}
        known = {name: one for name, one in table().items() if name in series and one.lacking(self._without) is None}
        quantities = {
            name: frozen(np.reshape(series[name], (count, *([-1] if one.dims else []))))
            for name, one in known.items()
            if np.isfinite(series[name]).any()
        }
        return {"quantities": quantities, **of_spots}


def _columns(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _columns(one) for name, one in value.items()}
    return value[:, None] if isinstance(value, np.ndarray) else value


def _parts(scene: Scene, run: Outcome) -> dict[str, Any]:
    """Return inputs of quantities of a run of one period besides its sums."""
    ledger, fields = run.records.ledger, dict[str, Any]()
    known = {"transient": 0, "energy": {"friction": float(ledger[1, FRICTION] - ledger[0, FRICTION])}}
    for observer in parts_of(scene):
        # beyond Hertz' law there is no strength
        fields |= {"contacts": None} if observer is CONTACTS else {}
        fields |= observer.fields(scene, run, known)
    return {name: value for name, value in fields.items() if name not in ("warnings", "contact_work")}


def _ended(run: Outcome, later: Sequence[np.ndarray]) -> Sequence[np.ndarray]:
    """Return the log of a period with the ends, in the log of the next one, of impacts unfinished in it."""
    last = {int(entry[2]): entry[1] for log in run.log for entry in log if entry[1] in (IMPACT, DETACHES)}
    ends: dict[int, np.ndarray] = {}
    for entry in itertools.chain(*later):
        row = int(entry[2])
        if entry[1] == DETACHES and last.get(row) == IMPACT and np.isfinite(run.rows.spring[row]):
            ends.setdefault(row, np.r_[entry[0] + run.system.period, entry[1:]])
    return [*run.log, *([np.array(list(ends.values()))] if ends else [])]


def single_periods(run: Outcome) -> Iterator[Outcome]:
    """Yield the periods of a run as runs of their own."""
    records, span, each = run.records, run.system.period, run.records.samples_per_period
    log = np.concatenate(run.log) if run.log else np.zeros((0, 1))
    edges = np.searchsorted(log[:, 0], span * np.arange(run.periods + 1))
    edges[0], edges[-1] = 0, len(log)
    for k in range(run.periods):
        events = log[edges[k] : edges[k + 1]].copy()
        events[:, 0] -= k * span
        arrays = (array[k : k + 2] if len(array) == len(records.peak) else array for array in records)
        own_records = type(records)(*arrays)._replace(coordinates=records.coordinates[k * each : (k + 1) * each])
        plane = run.plane
        if plane is not None:
            cut = {name: getattr(plane, name)[k : k + 1] for name in ("tilt", "lifted", "walls")}
            plane = plane._replace(**cut)
        yield replace(run, records=own_records, periods=1, log=[events] if len(events) else [], plane=plane)
