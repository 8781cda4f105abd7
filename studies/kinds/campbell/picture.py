"""Campbell diagram as a picture (matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vanedamp.modal.records.campbell import RPM, Campbell
from vanedamp.studies.figures import draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS

_ORDER, _MARK = "#64748b", "#111827"


def campbell_picture(diagram: Campbell, path: Path, title: str = "") -> None:
    """Write the diagram as PNG."""
    figure, axes = subplots(size=(9.5, 6.0))
    draw_campbell(axes, diagram)
    axes.set_title(title)
    save(figure, path, dpi=110)


def draw_campbell(axes: Axes, diagram: Campbell) -> None:
    """Draw modes over the speed (rpm, and rad/s above), engine-order lines, crossings and veerings."""
    low, high = diagram.rpm[[0, -1]]
    top = 1.06 * float(np.nanmax(diagram.frequencies_hz))
    for order in diagram.orders:
        end = min(high, 60.0 * top / order)
        if end <= low:
            continue
        axes.plot([low, end], [order * low / 60.0, order * end / 60.0], "--", color=_ORDER, linewidth=0.9)
        right: dict[str, Any] = {"xytext": (4, 0), "va": "center"}
        shift = right if end == high else {"xytext": (5, -3), "va": "top"}
        axes.annotate(
            f"EO {order:g}", (end, order * end / 60.0), textcoords="offset points", color=_ORDER, fontsize=9, **shift
        )
    for number, (mode, frequencies) in enumerate(zip(diagram.modes, diagram.frequencies_hz, strict=True)):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(diagram.rpm, frequencies, color=colour, linewidth=1.8, label=diagram.label(mode))
    veerings, crossings = diagram.veerings, diagram.crossings
    if veerings:
        axes.plot(
            [veering.rpm for veering in veerings], [veering.frequency_hz for veering in veerings], "D", markersize=11,
            markerfacecolor="none", markeredgecolor=_MARK, markeredgewidth=1.4, label="veering",
        )  # fmt: skip
    if crossings:
        axes.plot(
            [crossing.rpm for crossing in crossings], [crossing.frequency_hz for crossing in crossings], "o",
            markersize=6, markerfacecolor="white", markeredgecolor=_MARK, label="crossing",
        )  # fmt: skip
    axes.set(xlim=(low, high), ylim=(0.0, top), xlabel="speed, rpm", ylabel="natural frequency, Hz")
    above = axes.secondary_xaxis("top", functions=(_speed, _rpm))
    above.set_xlabel("rad/s")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=4, frameon=False)
    draw_grid(axes)


def _speed(rpm: Any) -> Any:
    return np.asarray(rpm) / RPM


def _rpm(speed: Any) -> Any:
    return np.asarray(speed) * RPM
