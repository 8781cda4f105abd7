"""Figures of the benchmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, draw_grid, save, subplots


def one_mode_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw the error of the state against time per period: engine, hand-written loops, solve_ivp."""
    one = result["one_mode"]
    figure, axes = subplots(size=(7.5, 5))
    looks = {
        "engine": ("o", BLUE),
        "plain loop": ("v", GREEN),
        "lean loop": ("^", GREEN),
        "complete loop": ("s", GREEN),
    }
    for name, (marker, colour) in looks.items():
        _point(axes, one["time"][name], one["error"][name], name, marker=marker, color=colour)
    solvers = [name for name in one["time"] if name not in looks]
    times = [1e6 * one["time"][name]["median"] for name in solvers]
    errors = [one["error"][name] for name in solvers]
    axes.loglog(times, errors, "D-", color=RED, label="solve_ivp, DOP853 with events")
    for name, time, error in zip(solvers, times, errors, strict=True):
        axes.annotate(
            f"rtol {name.split()[1]}",
            (time, error),
            (-8, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=9,
        )
    axes.set_xlabel("CPU time per excitation period, µs")
    axes.set_ylabel(f"largest error of the state over {one['checked_periods']} periods, relative")
    axes.set_title("one mode, one body, two impacts per period")
    draw_grid(axes)
    axes.legend(loc="center")
    save(figure, path, dpi=150)


def scaling_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw time against modes and bodies, and the parts of a period."""
    figure, (left, middle, right) = subplots(1, 3, size=(14, 4.6), width_ratios=[1.2, 1, 0.8])
    modes = result["modes"]
    for (use, entry), colour in zip(modes["uses"].items(), (GREEN, BLUE, GOLD, RED), strict=True):
        label = f"{use} ({entry['awake'][-1]:.1f} of {modes['counts'][-1]} awake)"
        _draw_times(left, modes["counts"], entry["time"], label, color=colour, marker="o")
    left.set_xlabel("modes of the structure")
    left.set_title("one body, n modes")
    left.set_ylim(top=left.get_ylim()[1] * 4)
    left.legend(fontsize=9, loc="upper left")
    bodies = result["bodies"]
    counts = np.array(bodies["counts"])
    _draw_times(middle, counts, bodies["time"], "exact engine", color=BLUE, marker="o")
    start = 1e6 * bodies["time"][0]["median"]
    middle.plot(counts, start * counts, "--", color=GREY, label="in proportion to n")
    middle.set_xticks(counts, [str(count) for count in counts])
    middle.minorticks_off()
    middle.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    middle.yaxis.set_major_formatter("{x:g}")
    middle.set_xlabel("bodies, each in a cavity of its own")
    middle.set_title("one mode, n bodies, 2n impacts per period")
    middle.legend(fontsize=9)
    for axes in (left, middle):
        axes.set_ylabel("CPU time per excitation period, µs")
        draw_grid(axes)
    _parts(right, result["costs"])
    save(figure, path, dpi=150)


def _parts(axes: Axes, costs: Mapping[str, Any]) -> None:
    """Draw bars: the parts of a period of the one-mode scene, by count and by part of the engine."""
    counted = {"period": "fitted: end of period", "event": "events", "evaluation": "evaluations"}
    timed = {"search": "timed: search", "account": "account", "rest": "the rest"}
    names = [*counted.values(), *timed.values()]
    values = [1e6 * part["number"] * part["cost"] for part in costs["counted"].values()]
    values += [1e6 * costs["timed"][name] for name in timed]
    labels = [f"{part['number']:.3g} x {1e9 * part['cost']:.0f} ns" for part in costs["counted"].values()]
    labels += [f"{value:.2f} µs" for value in values[len(counted) :]]
    places = [0, 1, 2, 3.5, 4.5, 5.5]
    bars = axes.barh(places, values, color=[BLUE] * len(counted) + [GOLD] * len(timed))
    axes.bar_label(bars, labels, padding=3)
    axes.set_yticks(places, names)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.5 * max(values))
    axes.set_xlabel("CPU time per excitation period, µs")
    axes.set_title("one mode, one body, two impacts")


def _point(axes: Axes, time: Mapping[str, float], error: float, label: str, **look: Any) -> None:
    median = 1e6 * time["median"]
    spread = [[median - 1e6 * time["low"]], [1e6 * time["high"] - median]]
    axes.errorbar([median], [error], xerr=spread, label=label, linestyle="none", capsize=2, markersize=8, **look)


def _draw_times(
    axes: Axes, counts: Sequence[int] | np.ndarray, times: Sequence[Mapping[str, float]], label: str, **look: Any
) -> None:
    """Draw medians, with the quartiles as bars, over counts."""
    low, median, high = (np.array([1e6 * time[key] for time in times]) for key in ("low", "median", "high"))
    axes.errorbar(counts, median, yerr=[median - low, high - median], label=label, capsize=2, **look)
    axes.set_xscale("log")
    axes.set_yscale("log")
