"""The figure of the sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from vanedamp.studies.bench.style import _BLUE, _GREEN, _GREY, _RED, _save


def sweep_figure(result: Mapping[str, Any], path: Path) -> None:
    """Time, memory and efficiency of sweeps against the number of scenes."""
    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(14, 4.6), width_ratios=[1.2, 1.2, 0.8], layout="constrained"
    )
    sizes = result["sizes"]
    points = np.array([entry["points"] for entry in sizes])
    left.loglog(points, [entry["wall_s"] for entry in sizes], "o-", color=_BLUE, label=f"{result['workers']} workers")
    alone = np.median([pair["one"]["wall_s"] / pair["one"]["points"] for pair in result["pairs"]])
    left.loglog(points, alone * points, "--", color=_GREY, label="one process, extrapolated")
    left.set_ylabel("time by the clock, s")
    left.set_title(f"scenes of {result['periods']} periods, rigid model")
    middle.semilogx(points, [e["main_peak_bytes"] / 1e6 for e in sizes], "o-", color=_BLUE, label="main process")
    middle.semilogx(points, [e["worker_peak_bytes"] / 1e6 for e in sizes], "s-", color=_GREEN, label="largest worker")
    middle.set_ylim(bottom=0)
    middle.set_ylabel("peak memory, MB")
    middle.set_title("memory")
    for axes in (left, middle):
        axes.set_xlabel("scenes in the sweep")
        axes.grid(True, which="major", color="#e2e8f0")
        axes.legend()
    names = list(result["efficiency"])
    values = [result["efficiency"][name]["median"] for name in names]
    bars = right.bar([f"by the {name}" for name in names], values, color=[_GREY, _BLUE])
    right.bar_label(bars, [f"{value:.2f}" for value in values])
    right.axhline(result["target"], color=_RED, linestyle="--", label=f"target {result['target']}")
    right.set_ylim(0, 1.1)
    right.set_ylabel("parallel efficiency")
    right.set_title(f"{result['workers']} workers, load {result['machine']['load']:.1f} at the start")
    right.legend(loc="lower right")
    _save(figure, path)
