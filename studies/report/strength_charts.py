"""Figures of strength: stress over a sweep, a Haigh diagram, and lives of hot spots with their scatter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.strength.haigh import permissible_amplitude, utilisation
from vanedamp.coupling.strength.life import life_at
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.studies.report.charts import COLOURS

_MPA = 1e-6
#: curves of stress and how they are drawn
CURVES = {"with the bodies": "solid", "without bodies": "dot", "bodies fixed": "dash"}


class SpotPoint(NamedTuple):
    """A hot spot in the figures: name, amplitude and mean of its equivalent stress, Pa, and fatigue data."""

    name: str
    amplitude: float
    mean: float
    fatigue: Fatigue


class SpotLife(NamedTuple):
    """A hot spot's median life, in the unit of the figure, and its fatigue data."""

    name: str
    life: float
    fatigue: Fatigue


def stress_figure(x: np.ndarray, title: str, curves: Mapping[str, Mapping[str, np.ndarray]]) -> go.Figure:
    """Draw amplitudes of von Mises stress (n,), Pa, over an axis with its title: by hot spot, by names of CURVES."""
    figure = go.Figure()
    for number, (name, of_spot) in enumerate(curves.items()):
        for curve, values in of_spot.items():
            figure.add_scatter(
                x=x, y=_MPA * values, mode="lines", name=f"{name} {curve}", legendgroup=name,
                line={"color": COLOURS[number % len(COLOURS)], "dash": CURVES[curve]},
                hovertemplate=f"{name}, {curve}: %{{y:.4g}} MPa<extra></extra>",
            )  # fmt: skip
    figure.update_xaxes(title_text=title)
    figure.update_yaxes(title_text="amplitude of von Mises stress, MPa", rangemode="tozero")
    return figure


def lines_figure(x: np.ndarray, title: str, values: np.ndarray, names: Sequence[str], label: str) -> go.Figure:
    """Draw named columns (n, k) over an axis with its title; label: of the values, with their unit."""
    figure = go.Figure()
    for number, (name, column) in enumerate(zip(names, values.T, strict=True)):
        colour = COLOURS[number % len(COLOURS)]
        figure.add_scatter(x=x, y=column, mode="lines", name=name, line={"color": colour}, showlegend=len(names) > 1)
    figure.update_xaxes(title_text=title)
    figure.update_yaxes(title_text=label, rangemode="tozero", exponentformat="power")
    return figure


def haigh_figure(points: Sequence[SpotPoint]) -> go.Figure:
    """Draw permissible amplitudes over the mean stress and the hot spots, each with its utilisation.

    Each material has a line; the yield line is dashed, if the yield strength is known.
    """
    figure = go.Figure()
    materials: dict[Fatigue, None] = dict.fromkeys(point.fatigue for point in points)
    for number, material in enumerate(materials):
        dots, colour = [point for point in points if point.fatigue == material], COLOURS[number % len(COLOURS)]
        which = "" if len(materials) == 1 else f" ({', '.join(point.name for point in dots)})"
        _add_lines(figure, material, dots, colour, which)
        used = [float(utilisation(point.amplitude, point.mean, material)) for point in dots]
        labels = [f"{value:.2f}" if math.isfinite(value) else "beyond the line" for value in used]
        figure.add_scatter(
            x=[_MPA * point.mean for point in dots], y=[_MPA * point.amplitude for point in dots], mode="markers+text",
            text=[f"{point.name}: {label}" for point, label in zip(dots, labels, strict=True)], showlegend=False,
            textposition="top right", marker={"color": colour, "size": 9}, hoverinfo="text",
        )  # fmt: skip
    figure.update_xaxes(title_text="mean stress, MPa", zeroline=True, zerolinecolor="#64748b")
    figure.update_yaxes(title_text="stress amplitude, MPa", rangemode="tozero")
    return figure


def _add_lines(figure: go.Figure, material: Fatigue, points: Sequence[SpotPoint], colour: str, which: str) -> None:
    """Add the lines of a material, from the lowest mean stress of its points to the end of its line."""
    assert material.strength is not None
    end = material.limit if math.isfinite(material.limit) else 2.0 * material.strength
    low = min(0.0, *(point.mean for point in points)) - 0.1 * end
    high = max(end, *(1.1 * point.mean for point in points))
    mean = np.union1d(np.linspace(low, high, 301), [0.0, min(end, high)])
    label = "fatigue strength" if material.mean_stress == "none" else str(material.mean_stress).capitalize()
    lines = {label: (permissible_amplitude(mean, material), "solid")}
    if material.yield_strength is not None:
        lines["yield"] = np.maximum(material.yield_strength - np.abs(mean), 0.0), "dash"
    for name, (amplitude, dash) in lines.items():
        figure.add_scatter(
            x=_MPA * mean, y=_MPA * amplitude, mode="lines", name=name + which, line={"color": colour, "dash": dash},
            hoverinfo="skip",
        )  # fmt: skip


def lives_figure(lives: Sequence[SpotLife], unit: str = "h") -> go.Figure:
    """Draw the median lives of hot spots with their quantiles from 10 % to 90 % failure; unit: "h", "starts" ...

    Hot spots without damage are labelled as such.
    """
    figure = go.Figure()
    for spot in lives:
        if math.isfinite(spot.life) and spot.life > 0.0:
            early, late = (life_at(spot.life, spot.fatigue, chance) for chance in (0.1, 0.9))
            figure.add_scatter(
                x=[spot.life], y=[spot.name], mode="markers", showlegend=False, marker={"color": COLOURS[0], "size": 9},
                error_x={"symmetric": False, "array": [late - spot.life], "arrayminus": [spot.life - early]},
                hovertemplate=f"{spot.name}: %{{x:.4g}} {unit}<extra></extra>",
            )  # fmt: skip
        else:
            text = "no damage" if spot.life > 0.0 else "fails at once"
            figure.add_annotation(x=0.5, xref="paper", y=spot.name, text=text, showarrow=False)
    figure.update_xaxes(title_text=f"life, {unit} (median; bars from 10 % to 90 % failure)", type="log")
    figure.update_yaxes(
        title_text="hot spot", type="category", categoryorder="array",
        categoryarray=[spot.name for spot in reversed(lives)],
    )  # fmt: skip
    return figure


def wear_figure(names: Sequence[str], depth_rate: Sequence[float], spread: Sequence[float]) -> go.Figure:
    """Draw the depths of wear per hour of faces, m/h, with half widths of their 95 % intervals."""
    figure = go.Figure(
        go.Bar(
            x=list(names), y=[1e9 * rate for rate in depth_rate], marker={"color": COLOURS[0]},
            error_y={"array": [1e9 * half for half in spread], "color": COLOURS[1]},
            hovertemplate="%{x}<br>%{y:.4g} nm/h<extra></extra>",
        )
    )  # fmt: skip
    figure.update_xaxes(title_text="contact")
    figure.update_yaxes(title_text="depth of wear, nm/h", rangemode="tozero", exponentformat="power")
    return figure
