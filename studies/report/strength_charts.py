"""Figures of strength: a Haigh diagram, and lives of hot spots with their scatter."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vanedamp.coupling.strength.haigh import permissible_amplitude, utilisation
from vanedamp.coupling.strength.life import life_at
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.studies.figures import BLUE, GOLD, GREEN, GREY, RED, VIOLET, draw_grid, subplots

_COLOURS = (BLUE, RED, GREEN, GOLD, VIOLET)
_MPA = 1e-6


class SpotPoint(NamedTuple):
    """A hot spot in the figures: its name, amplitude and mean of the stress that counts, Pa, and fatigue data."""

    name: str
    amplitude: float
    mean: float
    fatigue: Fatigue


class SpotLife(NamedTuple):
    """A hot spot's median life, in the unit of the figure, and its fatigue data."""

    name: str
    life: float
    fatigue: Fatigue


def haigh_diagram(points: Sequence[SpotPoint]) -> Figure:
    """Draw permissible amplitudes over the mean stress and the hot spots, each with its utilisation.

    Materials that differ have a line each; where a yield strength is known, that of yield is dashed.
    """
    figure, axes = subplots(size=(8.0, 5.0))
    materials: dict[Fatigue, None] = dict.fromkeys(point.fatigue for point in points)
    for material, colour in zip(materials, _COLOURS * len(materials), strict=False):
        own = [point for point in points if point.fatigue == material]
        which = "" if len(materials) == 1 else f" ({', '.join(point.name for point in own)})"
        _draw_lines(axes, material, own, colour, which)
        for point in own:
            used = float(utilisation(point.amplitude, point.mean, material))
            axes.plot(_MPA * point.mean, _MPA * point.amplitude, "o", color=colour)
            axes.annotate(
                f"{point.name}: {used:.2f}" if math.isfinite(used) else f"{point.name}: beyond the line",
                (_MPA * point.mean, _MPA * point.amplitude), (6, 6), textcoords="offset points",
            )  # fmt: skip
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.set_xlabel("mean stress, MPa")
    axes.set_ylabel("stress amplitude, MPa")
    axes.set_ylim(bottom=0.0)
    draw_grid(axes)
    axes.legend(frameon=False)
    return figure


def _draw_lines(axes: Axes, material: Fatigue, points: Sequence[SpotPoint], colour: str, which: str) -> None:
    """Draw the lines of a material, from the lowest mean stress of its points to the end of its line."""
    assert material.strength is not None
    end = material.limit if math.isfinite(material.limit) else 2.0 * material.strength
    low = min(0.0, *(point.mean for point in points)) - 0.1 * end
    high = max(end, *(1.1 * point.mean for point in points))
    mean = np.union1d(np.linspace(low, high, 301), [0.0, min(end, high)])
    label = "fatigue strength" if material.mean_stress == "none" else str(material.mean_stress).capitalize()
    axes.plot(_MPA * mean, _MPA * permissible_amplitude(mean, material), color=colour, label=f"{label}{which}")
    if material.yield_strength is not None:
        axes.plot(
            _MPA * mean, _MPA * np.maximum(material.yield_strength - np.abs(mean), 0.0),
            color=colour, linestyle="--", linewidth=0.9, label=f"yield{which}",
        )  # fmt: skip


def life_chart(lives: Sequence[SpotLife], unit: str = "h") -> Figure:
    """Draw the median lives of hot spots with their quantiles from 10 % to 90 % failure; unit: "h", "starts" ...

    Hot spots without damage are named as such.
    """
    figure, axes = subplots(size=(8.0, 1.6 + 0.5 * len(lives)))
    for height, spot in enumerate(lives):
        if math.isfinite(spot.life) and spot.life > 0.0:
            early, late = (life_at(spot.life, spot.fatigue, chance) for chance in (0.1, 0.9))
            axes.plot([early, late], [height, height], color=BLUE, linewidth=4.0, alpha=0.4, solid_capstyle="butt")
            axes.plot(spot.life, height, "o", color=BLUE)
        else:
            text = "no damage" if spot.life > 0.0 else "fails at once"
            axes.annotate(text, (0.5, height), xycoords=("axes fraction", "data"), ha="center", va="center")
    axes.set_xscale("log")
    axes.set_yticks(range(len(lives)), [spot.name for spot in lives])
    axes.set_ylim(len(lives) - 0.5, -0.5)
    axes.set_xlabel(f"life, {unit} (median; bars from 10 % to 90 % failure)")
    draw_grid(axes)
    return figure


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    picture = io.BytesIO()
    figure.savefig(picture, dpi=120, format="png")
    return picture.getvalue()
