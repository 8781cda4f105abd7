"""The figure of bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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
