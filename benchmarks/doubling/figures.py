"""The figure of the period doubling."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods.peers import styles
from vanedamp.studies.figures import BLUE, GREY, draw_grid, save, subplots


def doubling_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw the settled heights over the frequency, errors over cost, and alternation where there is none over cost."""
    figure, (left, middle, right) = subplots(1, 3, size=(18, 5.4))
    looks = styles()
    for number, entry in enumerate(reversed(result["diagram"])):
        colour = next(of for label, (of, _) in looks.items() if entry["method"].startswith(label))
        repeated = np.repeat(entry["frequency"], [len(heights) for heights in entry["height"]])
        heights = 1e9 * np.concatenate(entry["height"])
        left.plot(repeated, heights, ".", ms=2.5 - 0.5 * number, color=colour, label=entry["method"])
    left.axvline(result["exact"], color=GREY, ls="--", lw=0.8, label="multiplier -1")
    left.set_xlabel("excitation frequency, Hz")
    left.set_ylabel("height of the body once a period, nm")
    left.set_title("where a body's bounce doubles its period")
    left.legend(fontsize=8, markerscale=4, loc="upper left")
    for label, (colour, marker) in looks.items():
        mine = [point for point in result["points"] if point["method"] == label]
        for axes, key in ((middle, "error"), (right, "unsteady")):
            drawn = [(1e6 * point["seconds_per_period"], point[key]) for point in mine if point[key]]
            if drawn:
                axes.loglog(*zip(*drawn, strict=True), marker=marker, color=colour, label=label)
    # its doubling takes periods with their derivative, its motion periods of runs
    for axes, cost, value in (
        (middle, result["seconds_per_passage"], max(result["exact_error"], result["exact_tolerance"])),
        (right, result["exact_seconds_per_period"], result["unsteady"]),
    ):
        axes.loglog(1e6 * cost, value, "*", ms=12, color=BLUE, label="exact engine")
    middle.set_ylabel("relative error of the doubling's frequency")
    middle.set_title("error of the doubling")
    right.set_ylabel("change of the height from period to period")
    right.set_title("before it: motion that should repeat")
    for axes in (middle, right):
        axes.set_xlabel("CPU time a period, us")
        axes.legend(fontsize=9)
        draw_grid(axes)
    save(figure, path)
