"""Figures by matplotlib: colours, axes, and how they are saved.

They are made without pyplot, which chooses a window system and keeps every figure until it is closed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vanedamp.files.store import replacing

BLUE, RED, GREEN, GOLD, VIOLET = "#1d4f91", "#c2410c", "#15803d", "#a16207", "#7e22ce"
GREY = "#7a7f87"
_LINES = "#e2e8f0"


def subplots(rows: int = 1, columns: int = 1, *, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of a size in inches and its axes, with the options of matplotlib's Figure.subplots."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def draw_grid(*panels: Axes) -> None:
    """Draw pale lines at the labels of the axes."""
    for axes in panels:
        axes.grid(True, which="major", color=_LINES)


def save(figure: Figure, path: Path, dpi: int = 130) -> None:
    """Write a figure as PNG."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
