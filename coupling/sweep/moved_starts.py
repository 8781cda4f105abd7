"""Whether the peaks of a sweep's curves hang on the last bits of their starts: each runs again, from moved bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.response.moved_start import KEPT, Mean, as_one, moved, neighbours
from vanedamp.coupling.sweep.grid import Grid, PointList, Points
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.schedule import run_tasks
from vanedamp.coupling.sweep.worker import SweepTable
from vanedamp.coupling.system.sectors import unrolled

#: sections at which neighbours that never part are looked for
_SECTIONS = 33


def with_moved_starts(grid: Grid, sweep: Sweep, executor: Executor | None) -> Sweep:
    """Return a sweep with the peaks in runs from moved bodies (Sweep.moved_starts).

    Warnings name peaks with another mean, and neighbours that never part. Linked runs are left out, which begin with
    their neighbours' states, and curves of one point, as of maps at one frequency.
    """
    curves = grid.along is None and sweep.axes and len(sweep.axes[sweep.along]) > 1
    peaks = list(_peaks(sweep)) if curves else []
    if not peaks:
        return sweep
    maker, points = Points(grid.base, grid.choices), [grid.values(peak) for peak in peaks]
    scenes = [maker.raw(point) for point in points]
    alike = not any(path.endswith(".sectors") for path in grid.axes)  # in their number of bodies
    rows = [number for number, scene in enumerate(scenes) if alike and next(neighbours(scene), None)]
    aside = [_begun(point, moved(scene, scene.positions)) for point, scene in zip(points, scenes, strict=True)]
    again = [_begun(points[number], scenes[number].positions) for number in rows]
    base = replace(grid.base, sweep={"sections": _SECTIONS} if rows else {})
    table = _run(PointList(base, [*aside, *again], grid.choices), executor)
    compared, notes = _compared(sweep, peaks, points, table)
    sections = {name: values[len(peaks) :] for name, values in table.arrays((len(table.done),)).items()}
    for rank, number in enumerate(rows):
        motion = (sections[name][rank] for name in ("section_slip", "section_slip_velocity"))
        notes += [f"at {_named(points[number])}: {note}" for note in as_one(unrolled(scenes[number]), *motion)]
    warnings = [*sweep.warnings, *_first(notes)]
    more = {"moved_starts": compared} | ({"warnings": warnings} if warnings else {})
    return replace(sweep, provenance={**sweep.provenance, **more})


def _peaks(sweep: Sweep) -> Iterator[int]:
    """Yield the point with the largest mean amplitude of each curve, of those that are ok and have impacts."""
    hit = (sweep.status == "ok") & (sweep.impacts_per_period > 0.0)
    mean = np.where(hit, sweep.amplitude_mean_dynamic, -1.0)
    axis = list(sweep.axes).index(sweep.along)
    mean = np.moveaxis(mean, axis, -1)
    numbers = np.moveaxis(np.arange(sweep.status.size).reshape(sweep.shape), axis, -1)
    for curve in np.ndindex(mean.shape[:-1]):
        peak = int(np.argmax(mean[curve]))
        if mean[curve][peak] >= 0.0:
            yield int(numbers[curve][peak])


def _begun(point: Mapping[str, Any], positions: Sequence[float]) -> dict[str, Any]:
    return {**point} | {f"damper.{number}.position": position for number, position in enumerate(positions)}


def _run(points: PointList, executor: Executor | None) -> SweepTable:
    table = SweepTable(points.size, Row(points.base))
    for task, rest, result in run_tasks(points, table, executor):
        table.add(task, result, bool(rest))
    return table


def _compared(
    sweep: Sweep, peaks: Sequence[int], points: Sequence[Mapping[str, Any]], table: SweepTable
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the results of the second runs, and warnings of those that do not agree with the first."""
    entries, notes, status = [], [], table.text("status")
    for number, (peak, point) in enumerate(zip(peaks, points, strict=True)):
        means = {name: float(table.row.value(table.values[number], name)) for name in KEPT}
        one = Mean.of("ok", {name: float(getattr(sweep, name).flat[peak]) for name in KEPT})
        results, warnings = one.compared(Mean.of(str(status[number]), means), sweep.scene.time.tolerance)
        entries.append({"at": dict(point)} | results | means)
        notes += [f"at {_named(point)}: {warning}" for warning in warnings]
    return entries, notes


def _named(point: Mapping[str, Any]) -> str:
    return ", ".join(f"{path} = {value if isinstance(value, str) else f'{value:.6g}'}" for path, value in point.items())


def _first(notes: Sequence[str], most: int = 3) -> list[str]:
    """Return the first of some warnings, and how many there are of others."""
    rest = len(notes) - most
    return [*notes[:most], *([f"{rest} further warnings of this kind; moved_starts has all"] if rest > 0 else [])]
