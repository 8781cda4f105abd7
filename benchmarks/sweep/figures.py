"""The figure of the sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, draw_grid, save, subplots

_LABELS = {"clock": "by the\nclock", "processor": "by the\nprocessor", "busy": "workers\nwith a task"}


def sweep_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw efficiency, memory, and what is simulated for many workers."""
    figure, (left, middle, right) = subplots(1, 3, size=(14, 4.6), width_ratios=[0.8, 1.2, 1.2])
    names = list(result["efficiency"])
    values = [result["efficiency"][name]["median"] for name in names]
    bars = left.bar([_LABELS[name] for name in names], values, color=[GREY, BLUE, GREEN])
    left.bar_label(bars, [f"{value:.3f}" for value in values])
    left.axhline(result["target"], color=RED, linestyle="--", label=f"target {result['target']}")
    left.set_ylim(0, 1.2)
    left.set_ylabel("parallel efficiency")
    left.set_title(f"{result['workers']} workers, load {result['machine']['load']:.1f} at the start")
    entries = sorted([pair["all"] for pair in result["pairs"][:1]] + result["sizes"], key=lambda entry: entry["points"])
    points = [entry["points"] for entry in entries]
    middle.semilogx(points, [e["main_peak_bytes"] / 1e6 for e in entries], "o-", color=BLUE, label="main process")
    middle.semilogx(points, [e["worker_peak_bytes"] / 1e6 for e in entries], "s-", color=GREEN, label="a worker")
    middle.set_ylim(bottom=0)
    middle.set_xlabel("scenes in the sweep")
    middle.set_ylabel("peak memory, MB")
    middle.set_title("memory, shared pages by their part")
    for (name, runs), colour in zip(result["simulated"].items(), (BLUE, GREEN, GOLD), strict=False):
        workers = [run["workers"] for run in runs]
        right.semilogx(workers, [run["efficiency"] for run in runs], "o-", color=colour, label=name)
    right.axhline(result["target"], color=RED, linestyle="--")
    right.set_ylim(0, 1.1)
    right.set_xlabel("workers")
    right.set_ylabel("parallel efficiency")
    right.set_title("simulated from measured costs")
    for axes in (left, middle, right):
        draw_grid(axes)
        axes.legend(loc="lower left")
    save(figure, path, dpi=150)
