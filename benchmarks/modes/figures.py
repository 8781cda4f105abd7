"""The figure of the eigensolvers."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, draw_grid, save, subplots


def modal_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw processor time and peak memory against the degrees of freedom, a line a solver."""
    from benchmarks.modes.solvers import COUNT, NAMES

    figure, panels = subplots(1, 3, size=(14, 5.0))
    titles = ("factorisation", f"{COUNT} modes with it", "peak memory")
    colours = dict(zip(NAMES, itertools.cycle((BLUE, GREY, RED, GOLD, GREEN)), strict=False))
    markers = dict(zip(NAMES, itertools.cycle("os^vDP"), strict=False))
    sizes = [entry for entry in result["sizes"] if entry["assembly"]["status"] == "ok"]
    for axes, title, part in zip(panels, titles, ("factorisation", "modes", "peak_bytes"), strict=True):
        for name, label in NAMES.items():
            done = [
                (e["assembly"]["dofs"], e["solvers"][name])
                for e in sizes
                if e["solvers"].get(name, {}).get("status") == "ok"
            ]
            # why the line of a solver ends
            told = f"{label}, dropped" if name in result["dropped"] else label
            values = [f[part] / 1e9 if part == "peak_bytes" else f[part]["cpu_s"] for _, f in done]
            style = {"color": colours[name], "marker": markers[name], "label": told}
            axes.loglog([dofs for dofs, _ in done], values, **style)
        axes.set_title(title)
        dofs = [entry["assembly"]["dofs"] for entry in sizes]
        axes.set_xticks(dofs, [f"{count:,}" for count in dofs])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("degrees of freedom")
        axes.set_ylabel("GB" if part == "peak_bytes" else "processor time, s")
        draw_grid(axes)
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=9, ncols=3, loc="outside lower center")
    save(figure, path, dpi=150)
