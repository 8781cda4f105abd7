"""Ensembles: the runs of a scene with ranges, by the machinery of sweeps, and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.ensembles.design import indices, quantiles
from vanedamp.coupling.ensembles.members import Members, members
from vanedamp.coupling.ensembles.record import AT_POINTS, Ensemble
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.coupling.sweep.sweep import run_all
from vanedamp.coupling.sweep.worker import COLUMNS, MEASURES, SweepTable
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
    found = {name: frozen(finished.values[:, COLUMNS.index(name)].reshape(shape)) for name in MEASURES}
    status = finished.text("status").reshape(shape)
    ok = status == "ok"
    results = {name: np.where(ok, found[name], np.nan) for name in AT_POINTS} | _of_curves(points, found, ok)
    count, seed = len(points.samples), points.scene.sampled.seed
    # those of every point of a grid of all results would take far longer than the runs
    told = ("amplitude_mean_dynamic", "peak_amplitude", "reduction") if grid.axes else tuple(results)
    return Ensemble(
        scene=points.scene,
        axes={path: frozen(values, np.asarray(values).dtype) for path, values in grid.axes.items()},
        samples=points.samples,
        members=found,
        status=frozen(status, object),
        quantile={name: frozen(quantiles(values, count)) for name, values in results.items()},
        indices={name: frozen(indices(results[name], count, seed)) for name in told},
        provenance=provenance
        | ({"warnings": list(grid.warnings)} if grid.warnings else {})
        | ({} if grid.estimate is None else {"estimate": grid.estimate})
        | ({} if grid.advice is None else {"advice": grid.advice}),
    )


def _of_curves(points: Members, found: Mapping[str, np.ndarray], ok: np.ndarray) -> dict[str, np.ndarray]:
    """Return the highest mean along the frequency, m, and the reduction, of every curve of every sample."""
    swept, _ = resonance_axis(points.base, points.grid.axes)
    along = () if swept is None else (1 + list(points.grid.axes).index(swept),)
    peak = np.where(ok, found["amplitude_mean_dynamic"], -np.inf).max(axis=along)
    peak = np.where(np.isfinite(peak), peak, np.nan)
    undamped = points.peaks().get("undamped_peak", found["amplitude_undamped"].max(axis=along))
    usable = (undamped > 0.0) & np.isfinite(undamped)
    reduction = 1.0 - np.divide(peak, undamped, out=np.full(peak.shape, np.nan), where=usable)
    return {"peak_amplitude": peak, "reduction": reduction}
