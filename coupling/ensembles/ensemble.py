"""Ensembles: the runs of a scene with ranges, by the machinery of sweeps, and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.ensembles.design import indices, quantiles
from vanedamp.coupling.ensembles.members import Members, members
from vanedamp.coupling.ensembles.record import PEAK, REDUCTION, Ensemble, complete, of_samples
from vanedamp.coupling.quantities.amplitude import amplitude_mean_dynamic, amplitude_undamped
from vanedamp.coupling.quantities.linear_peaks import undamped_peak
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.coupling.sweep.over_axes import of_axes
from vanedamp.coupling.sweep.sweep import notes_on, run_all
from vanedamp.coupling.sweep.worker import SweepTable
from vanedamp.files.store import frozen


def ensemble(
    scene: Scene | Members | str | Path,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    checkpoint: str | Path | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Ensemble:
    """Run a scene, or the one in a TOML file, for every sample of its ranges, over its [sweep] table if it has one.

    executor, progress, checkpoint, provenance: as of a sweep. Raises as `sweep` does.
    """
    points = scene if isinstance(scene, Members) else members(loaded(scene))
    provenance = dict(provenance or {})
    return _record(points, run_all(points.scene, points, executor, progress, checkpoint, provenance), provenance)


def _record(points: Members, finished: SweepTable, provenance: dict[str, Any]) -> Ensemble:
    shape, grid = (points.count, *points.grid.shape), points.grid
    arrays = {name: values for name, values in finished.arrays(shape).items() if name in of_samples()}
    by_member = {name: _worst(values, len(table()[name].dims)) for name, values in arrays.items()}
    by_member = {
        name: values for name, values in by_member.items() if not table()[name].dims or np.isfinite(values).any()
    }
    status = finished.text("status").reshape(shape)
    ok = status == "ok"
    results = {name: np.where(ok, by_member[name], np.nan) for name in by_member if table()[name].spread}
    of_curves = _of_curves(points, results)
    # indices of all results at every point of a grid would take far longer than the runs
    mean = amplitude_mean_dynamic.name
    analysed = {mean: results[mean]} if grid.axes else results
    count, seed = len(points.samples), points.scene.sampled.seed
    return Ensemble(
        scene=points.scene,
        axes=of_axes(grid.axes),
        samples=points.samples,
        members=by_member,
        status=frozen(status, object),
        quantile={name: frozen(quantiles(values, count)) for name, values in (results | of_curves).items()},
        indices={name: frozen(indices(values, count, seed)) for name, values in (analysed | of_curves).items()},
        provenance=provenance | notes_on(grid, by_member),
    )


def _worst(values: np.ndarray, dims: int) -> np.ndarray:
    """Return the largest of a quantity over its own dimensions, if it has any; nan where none is known."""
    return frozen(np.fmax.reduce(values, axis=tuple(range(-dims, 0)))) if dims else values


def _of_curves(points: Members, results: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the highest mean, m, the reduction, and the highest of limited quantities of all curves."""
    swept, _ = resonance_axis(points.base, points.grid.axes)
    along = () if swept is None else (1 + list(points.grid.axes).index(swept),)

    whole = complete(np.isfinite(results[amplitude_mean_dynamic.name]), points.base, points.grid.axes)

    def highest(name: str) -> np.ndarray:
        return np.where(whole, np.fmax.reduce(results[name], axis=along), np.nan)

    peak = highest(amplitude_mean_dynamic.name)
    undamped = points.peaks().get(undamped_peak.name, highest(amplitude_undamped.name))
    usable = (undamped > 0.0) & np.isfinite(undamped)
    reduction = 1.0 - np.divide(peak, undamped, out=np.full(peak.shape, np.nan), where=usable)
    further = {f"peak_{name}": highest(name) for name in results if table()[name].limited}
    return {PEAK: peak, REDUCTION: reduction, **further}
