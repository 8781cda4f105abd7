"""The figure of bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.methods.peers import styles
from vanedamp.studies.figures import BLUE, GREY, RED, draw_grid, save, subplots


def bodies_figure(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw amplitudes, tilt and lift, and impacts of slider and block over the frequency."""
    figure, (left, middle, right) = subplots(1, 3, size=(14, 4.6), width_ratios=[1.4, 1, 1])
    for shape, colour, marker in (("slider", BLUE, "."), ("block", RED, ".")):
        mine = [row for row in rows if row["shape"] == shape]
        ratio = [row["ratio"] for row in mine]
        left.plot(ratio, [row["amplitude"] for row in mine], marker, ls="-", lw=0.8, color=colour, label=shape)
        right.plot(
            ratio, [row["impacts_per_period"] for row in mine], marker, ls="-", lw=0.8, color=colour, label=shape
        )
        if shape == "slider":
            left.plot(ratio, [row["undamped"] for row in mine], "--", color=GREY, label="without body")
            left.plot(ratio, [row["fixed"] for row in mine], ":", color=GREY, label="body fixed")
        else:
            middle.plot(
                ratio, [1e3 * row["tilt_max"] for row in mine], marker, color=colour, label="largest tilt, mrad"
            )
            lifted = middle.twinx()
            lifted.plot(ratio, [row["lift_share"] for row in mine], "+", color=GREY)
            lifted.set_ylabel("share of the time off the floor (+)", color=GREY)
            lifted.set_ylim(0, 1.15)
    left.set_ylim(0, 1.05)
    left.set_ylabel("mean amplitude over the undamped resonance's")
    left.set_title("a block that tilts is no slider")
    middle.set_ylim(0, 1.15 * max(1e3 * row["tilt_max"] for row in rows if row["shape"] == "block"))
    middle.set_ylabel("largest tilt of the block, mrad", color=RED)
    middle.set_title("tilt and lift of the block")
    right.set_ylim(bottom=0)
    right.set_ylabel("impacts of contacts in a period")
    right.set_title("impacts")
    for axes in (left, middle, right):
        axes.set_xlabel("excitation frequency over the first natural frequency")
        draw_grid(axes)
    left.legend()
    right.legend()
    save(figure, path)


def methods_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw the error of every method over its cost, a panel a coefficient of friction."""
    cases = sorted({row["friction"] for row in result["points"]}, reverse=True)
    figure, panels = subplots(1, len(cases), size=(6.5 * len(cases), 5.2), sharey=True, squeeze=False)
    for axes, friction in zip(panels[0], cases, strict=True):
        for label, (colour, marker) in styles().items():
            mine = [
                row for row in result["points"]
                if row["method"] == label and row["friction"] == friction and row["error"] is not None
            ]  # fmt: skip
            if not mine:
                continue
            cost, error = [1e6 * row["seconds_per_period"] for row in mine], [row["error"] for row in mine]
            spread = [[row["error"] - row["low"] for row in mine], [row["high"] - row["error"] for row in mine]]
            axes.errorbar(
                cost, error, spread, fmt=marker + "-", color=colour, lw=1.2, elinewidth=0.8,
                ms=13 if marker == "*" else 5, label=label, zorder=3 if marker == "*" else 2,
            )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("CPU time per period, µs")
        axes.set_title(f"friction {friction:g}")
        draw_grid(axes)
    panels[0][0].set_ylabel("error of response and slip in two periods\n(median and quartiles over starts)")
    panels[0][-1].legend()
    save(figure, path)
