"""Forced responses of the demonstration as pictures, and the curves in them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.axes import Axes

from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.figures import draw_grid, save, subplots
from vanedamp.studies.report.charts import COLOURS

GREY, DARK = "#94a3b8", "#475569"


def responses_picture(curves: Mapping[str, DampedCurve], title: str, path: Path) -> None:
    """Draw forced responses by their labels, with the undamped and fixed curves of the first."""
    figure, axes = subplots(size=(9.5, 5.2))
    draw_linear(axes, next(iter(curves.values())))
    for (label, curve), colour in zip(curves.items(), COLOURS, strict=False):
        draw_damped(axes, curve, label, colour)
    finish(axes, title)
    save(figure, path, dpi=110)


def draw_linear(axes: Axes, curve: DampedCurve) -> None:
    axes.plot(curve.frequency, 100 * curve.undamped, ":", color=DARK, linewidth=1.4, label="without bodies")
    axes.plot(curve.frequency, 100 * curve.fixed, "--", color=GREY, linewidth=1.4, label="bodies fixed")


def draw_damped(axes: Axes, curve: DampedCurve, label: str, colour: str) -> None:
    axes.plot(
        curve.frequency, 100 * curve.largest, ".", color=colour, markersize=3.5, alpha=0.7, label=f"{label}, maximum"
    )
    low, high = curve.mean - curve.confidence, curve.mean + curve.confidence
    axes.fill_between(curve.frequency, 100 * low, 100 * high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(curve.frequency, 100 * curve.smooth, color=colour, linewidth=2, label=f"{label}, smoothed mean")


def finish(axes: Axes, title: str, ylabel: bool = True) -> None:
    axes.set_xlabel("excitation frequency, Hz")
    if ylabel:
        axes.set_ylabel("amplitude / maximum without bodies, %")
    axes.set_ylim(0, 105)
    axes.margins(x=0)
    axes.set_title(title)
    draw_grid(axes)
    axes.legend(fontsize=8)
