"""The figure of how commands begin."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.studies.figures import BLUE, draw_grid, save, subplots

_TITLES = {"ratio": "processes", "parts": "parts of a run", "imports": "its imports by package"}


def start_figure(result: Mapping[str, Any], path: Path) -> None:
    """Draw processes, the parts of a run and its imports as bars, in units of `import numpy, numba`."""
    figure, panels = subplots(1, 3, size=(18, 4.8))
    for axes, (group, title) in zip(panels, _TITLES.items(), strict=True):
        names = list(result[group])[::-1]
        values = [result[group][name] for name in names]
        middle = [value["median"] for value in values]
        around = [[v["median"] - v["low"] for v in values], [v["high"] - v["median"] for v in values]]
        axes.barh(names, middle, xerr=around, color=BLUE, capsize=3)
        axes.set_title(title)
        axes.set_xlabel(f"processor time over that of `{result['unit']}`")
        draw_grid(axes)
    save(figure, path)
