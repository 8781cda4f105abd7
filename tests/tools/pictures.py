"""What is in pictures: the figures that were saved, their panels, curves and labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure


class Curve(NamedTuple):
    """A curve, or a set of points: coordinates (n,)."""

    x: np.ndarray
    y: np.ndarray


class Panel(NamedTuple):
    """Axes of a figure: labels, title, and the curves of its legend by their labels."""

    x: str
    y: str
    title: str
    curves: dict[str, Curve]


class Pictures:
    """The figures that were saved, by the names of their files without endings; title: of the whole figure."""

    def __init__(self, monkeypatch) -> None:
        self._panels: dict[str, list[Panel]] = {}
        self.title: dict[str, str] = {}
        save = Figure.savefig

        def record(figure: Figure, path, **options) -> None:
            save(figure, path, **options)  # limits are those of the picture then
            name = path.stem.lstrip(".").rpartition("-")[0]  # files.store.replacing
            self._panels[name] = _panels(figure)
            self.title[name] = figure.get_suptitle()

        monkeypatch.setattr(Figure, "savefig", record)

    def __getitem__(self, name: str) -> list[Panel]:
        """The panels of a picture in their order; each says what it is, and something of each curve is seen."""
        panels = self._panels[name]
        assert panels
        for panel in panels:
            assert panel.x or panel.y or panel.title, f"{name}: a panel says nothing"
            for label, curve in panel.curves.items():
                assert np.isfinite(curve.x * curve.y).any(), f"{name}: nothing of '{label}' is seen"
        return panels


def _panels(figure: Figure) -> list[Panel]:
    panels = []
    for axes in filter(Axes.get_visible, figure.axes):
        curves = {}
        bars = [drawn.lines[0] for drawn in axes.containers if hasattr(drawn, "has_yerr") and drawn.lines[0]]
        labels = {id(drawn.lines[0]): drawn.get_label() for drawn in axes.containers if hasattr(drawn, "has_yerr")}
        for line in [*axes.lines, *(bar for bar in bars if bar not in axes.lines)]:
            label = labels.get(id(line), line.get_label())
            if not str(label).startswith("_") and len(line.get_xdata()):
                x, y = (np.asarray(values, dtype=float) for values in (line.get_xdata(), line.get_ydata()))
                (left, right), (low, high) = sorted(axes.get_xlim()), sorted(axes.get_ylim())
                seen = (x >= left) & (x <= right) & (y >= low) & (y <= high) if len(x) > 2 else np.ones(len(x), bool)
                curves[str(label)] = Curve(np.where(seen, x, np.nan), np.where(seen, y, np.nan))
        panels.append(Panel(axes.get_xlabel(), axes.get_ylabel(), axes.get_title(), curves))
    return panels
