"""Figures of failure: edges beside their limits, and maps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import NullFormatter

from vanedamp.studies.figures import GREY, draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS

_SHADES = LinearSegmentedColormap.from_list("failure", ["#f8fafc", "#fca5a5"])


def stability_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw a panel a part: measured edges of failure as points, analytic limits as lines."""
    figure, axes = subplots(2, 4, size=(19, 9))
    for panel, (name, part) in zip(axes.flat, result["parts"].items(), strict=True):
        for (curve, values), colour in zip(part["curves"].items(), COLOURS, strict=False):
            line = curve in ("limit", "1 - duration / step")
            panel.plot(
                part["x"], values, "--" if line else "o", color=GREY if line else colour,
                label="analytic limit" if curve == "limit" else curve,
            )  # fmt: skip
        if part["log"]:
            panel.set_xscale("log")
            panel.set_yscale("log")
            panel.xaxis.set_minor_formatter(NullFormatter())
            panel.yaxis.set_minor_formatter(NullFormatter())
        panel.set_title(name)
        panel.set_xlabel(part["x_label"])
        panel.set_ylabel(part["y_label"])
        draw_grid(panel)
        panel.legend(fontsize=9)
    save(figure, path)


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
