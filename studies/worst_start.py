"""A damper over its band from several starts: at rest, and from the last state of the neighbour, up and down."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

import numpy as np

from vanedamp.coupling.methods.registry import why_no_restart
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.designs import points_of_designs, relative_amplitudes
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import finite
from vanedamp.studies.band import drive

#: directions of a sweep, and their starts in words
STARTS = {"independent": "at rest", "up": "going up", "down": "going down"}


def worst_start(
    scene: Scene,
    frequencies: np.ndarray,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Return the worst of a scene over frequencies (f,), Hz, and starts, as plain data.

    progress: called with the number of runs done and their total.
    starts: their number, 1 for a method that cannot begin with the state of another run; direction, frequency (Hz) and
    peak_ratio of the highest mean of peaks; maximum_ratio: largest amplitude of all; None without any; not_ok: points.
    """
    axes: dict[str, list[Any]] = {"continuation.direction": list(STARTS)[: 1 if why_no_restart(scene) else None]}
    for frequency in frequencies.tolist():
        for path, value in drive(scene, frequency).items():
            axes.setdefault(path, []).append(value)
    runs = sweep(scene.replace({"sweep": axes}), executor, progress)
    ok, worst = runs.status == "ok", points_of_designs(runs)[0][0]
    start, index = np.unravel_index(worst, runs.shape)
    mean, largest = (
        np.where(ok, relative_amplitudes(runs, heights), np.nan)
        for heights in (runs.amplitude_mean_dynamic, runs.amplitude_max_dynamic)
    )
    facts: dict[str, Any] = finite(
        {
            "starts": len(ok), "direction": axes["continuation.direction"][start],
            "frequency": float(frequencies[index]), "peak_ratio": float(mean.flat[worst]),
            "maximum_ratio": float(np.fmax.reduce(largest, axis=None)), "not_ok": int((~ok).sum()),
        }
    )  # fmt: skip
    return facts


def worst_words(told: dict[str, Any]) -> str:
    """Return the worst over starts in words: its highest mean of peaks, and the largest amplitude."""
    if told["starts"] == 1:
        return "one start only: every run begins as the scene"
    if told["peak_ratio"] is None:
        return f"no amplitude from {told['starts']} starts: {told['not_ok']} points are not ok"
    left_out = f" ({told['not_ok']} points that are not ok are left out)" if told["not_ok"] else ""
    return (
        f"from the worst of {told['starts']} starts, {STARTS[told['direction']]}, {told['peak_ratio']:.1%} of the "
        f"maximum without bodies is left, at {told['frequency']:.6g} Hz, at its largest {told['maximum_ratio']:.1%}"
        f"{left_out}"
    )
