"""The figure of the sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.studies.figures import BLUE, GREEN, GREY, RED, draw_grid, save, subplots


def sweep_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw time, memory and efficiency of sweeps against the number of scenes."""
    figure, (left, middle, right) = subplots(1, 3, size=(14, 4.6), width_ratios=[1.2, 1.2, 0.8])
    sizes = result["sizes"]
    points = np.array([entry["points"] for entry in sizes])
    left.loglog(points, [entry["wall_s"] for entry in sizes], "o-", color=BLUE, label=f"{result['workers']} workers")
    alone = np.median([pair["one"]["wall_s"] / pair["one"]["points"] for pair in result["pairs"]])
    left.loglog(points, alone * points, "--", color=GREY, label="one process, extrapolated")
    left.set_ylabel("time by the clock, s")
    left.set_title(f"scenes of {result['periods']} periods, rigid model")
    middle.semilogx(points, [e["main_peak_bytes"] / 1e6 for e in sizes], "o-", color=BLUE, label="main process")
    middle.semilogx(points, [e["worker_peak_bytes"] / 1e6 for e in sizes], "s-", color=GREEN, label="largest worker")
    middle.set_ylim(bottom=0)
    middle.set_ylabel("peak memory, MB")
    middle.set_title("memory")
    for axes in (left, middle):
        axes.set_xlabel("scenes in the sweep")
        draw_grid(axes)
        axes.legend()
    names = list(result["efficiency"])
    values = [result["efficiency"][name]["median"] for name in names]
    bars = right.bar([f"by the {name}" for name in names], values, color=[GREY, BLUE])
    right.bar_label(bars, [f"{value:.2f}" for value in values])
    right.axhline(result["target"], color=RED, linestyle="--", label=f"target {result['target']}")
    right.set_ylim(0, 1.1)
    right.set_ylabel("parallel efficiency")
    right.set_title(f"{result['workers']} workers, load {result['machine']['load']:.1f} at the start")
    right.legend(loc="lower right")
    save(figure, path, dpi=150)
