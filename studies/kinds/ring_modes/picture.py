"""Interference diagram of a ring as a picture (matplotlib)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vanedamp.modal.records.campbell import RPM
from vanedamp.modal.records.interference import Interference
from vanedamp.studies.figures import draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS

_ORDER, _MARK = "#64748b", "#111827"


def interference_picture(found: Interference, path: Path) -> None:
    """Write frequency versus nodal diameter by family, folded lines of engine orders, and their meetings, as PNG."""
    figure, axes = subplots(size=(9.5, 6.0))
    modes = found.modes
    for speed, style in zip(found.folded_speeds, ("-", ":"), strict=False):
        label = f"engine orders at {speed * RPM:.6g} rpm"
        axes.plot(*found.zigzag(speed), style, color=_ORDER, linewidth=1.0, label=label)
    for family in np.unique(modes.families).tolist():
        rows = np.flatnonzero(modes.families == family)
        rows = rows[np.argsort(modes.diameters[rows])]
        colour, name = COLOURS[family % len(COLOURS)], f"family {family + 1}"
        axes.plot(found.diameters[rows], modes.frequencies_hz[rows], "o-", color=colour, markersize=5, label=name)
    for point in found.in_operation:
        at = (found.diameters[point.mode], point.frequency_hz)
        axes.annotate(f"{point.order:g}", at, textcoords="offset points", xytext=(7, 0), va="center", fontsize=8)
    if met := found.in_operation:
        axes.plot(
            found.diameters[[point.mode for point in met]], [point.frequency_hz for point in met], "o", markersize=10,
            markerfacecolor="none", markeredgecolor=_MARK, label="meetings, with their engine orders",
        )  # fmt: skip
    axes.set(xlim=(-0.3, 0.5 * modes.sectors + 0.6), ylim=(0.0, found.top), xlabel="nodal diameter")
    axes.set_ylabel("natural frequency, Hz")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    draw_grid(axes)
    save(figure, path, dpi=110)
