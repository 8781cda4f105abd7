"""The figure of the eigensolvers."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, draw_grid, save, subplots


def modal_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw processor time and peak memory against the degrees of freedom, a line a solver."""
    from vanedamp.studies.bench.modes.solvers import COUNT, NAMES

    figure, panels = subplots(1, 3, size=(14, 4.6))
    titles = ("factorisation", f"{COUNT} modes with it", "peak memory")
    colours = dict(zip(NAMES, itertools.cycle((BLUE, GREY, RED, GOLD, GREEN)), strict=False))
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
            axes.loglog([dofs for dofs, _ in done], values, "o-", color=colours[name], label=told)
        axes.set_title(title)
        dofs = [entry["assembly"]["dofs"] for entry in sizes]
        axes.set_xticks(dofs, [f"{count:,}" for count in dofs])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("degrees of freedom")
        axes.set_ylabel("GB" if part == "peak_bytes" else "processor time, s")
        draw_grid(axes)
    panels[0].legend(fontsize=9)
    save(figure, path, dpi=150)
