"""Figure of the maps of failure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import NullFormatter

from vanedamp.studies.figures import save, subplots

_SHADES = LinearSegmentedColormap.from_list("failure", ["#f8fafc", "#fca5a5"])


def maps_figure(maps: Mapping[str, Any], path: Path) -> None:
    """Draw a panel a map: shares of failure as shades, measured edges as points, analytic limits as lines."""
    figure, axes = subplots(2, 4, size=(19, 9))
    for panel, (name, grid) in zip(axes.flat, maps.items(), strict=True):
        modes = "modes" in grid["x_label"]
        shades = _SHADES.reversed() if modes else _SHADES
        mesh = panel.pcolormesh(grid["x"], grid["y"], grid["value"], cmap=shades, vmin=0, vmax=1, shading="nearest")
        panel.plot(grid["x"], np.array(grid["limit"], float), "--", color="#475569", label="analytic limit")
        panel.plot(grid["x"], np.array(grid["edge"], float), "o", color="#b91c1c", label="measured edge")
        if not modes:
            panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_ylim(grid["y"][0], grid["y"][-1])
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_minor_formatter(NullFormatter())
        if modes or "missed" in name:
            label = "momentum of the first impact, of that without modes" if modes else "share of touches missed"
            figure.colorbar(mesh, ax=panel, label=label)
        panel.set_title(name)
        panel.set_xlabel(grid["x_label"])
        panel.set_ylabel(grid["y_label"])
        panel.legend(fontsize=9, loc="lower right" if modes else "best")
    save(figure, path)
