"""The figures of an optimisation."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.scene.units import label_of, unit_of
from vanedamp.studies.optimisation.record import Optimisation, Optimum
from vanedamp.studies.report.charts import COLOURS, axis_title

#: measures that are no amplitude, and what they refer to
_COUNTS = {"stress": "stress", "life": "damage of 1 in 10,000 h", "wear": "depth of X worn off in 10,000 h"}


def optimisation_figure(record: Optimisation) -> go.Figure:
    """Draw contours of the reduction over mass ratio and gap, both optima marked; along_figure without a map."""
    if not record.map_amplitude.size:
        return along_figure(record)
    of, count = _gained_of(record), record.nominal.design.bodies
    figure = go.Figure(
        go.Contour(
            x=100 * record.map_mass_ratio, y=record.map_gap_ratio, z=100 * (1 - record.map_amplitude.T),
            colorscale="Viridis", contours={"showlabels": True, "labelfont": {"color": "white"}},
            colorbar={"title": {"text": f"gained of the {of}, %", "side": "right"}},
            hovertemplate="mass %{x:.2f} %<br>gap %{y:.3f} X<br>%{z:.1f} % gained<extra></extra>",
        )
    )  # fmt: skip
    for name, optimum, symbol, colour in (
        ("optimum as designed", record.nominal, "x", "#ffffff"),
        ("robust optimum", record.robust, "star", "#f97316"),
    ):
        figure.add_scatter(
            x=[100 * (optimum.design.mass_ratio or 0.0)], y=[optimum.design.gap_ratio], mode="markers",
            name=f"{name}: {_format_optimum(optimum)}", hovertext=_format_optimum(optimum), hoverinfo="text+name",
            marker={"symbol": symbol, "size": 15, "color": colour, "line": {"color": "#111827", "width": 1.5}},
        )  # fmt: skip
    figure.update_xaxes(title_text="mass of the bodies over that of the structure, %")
    figure.update_yaxes(title_text=f"gap over the amplitude without bodies X = {1e6 * record.amplitude:.3g} µm")
    figure.update_layout(
        title=f"Reduction with {_bodies(count)}", template="plotly_white",
        legend={"orientation": "h", "yanchor": "top", "y": -0.2, "x": 0.0},
    )  # fmt: skip
    return figure


def along_figure(record: Optimisation) -> go.Figure:
    """Draw the reduction along each variable without an axis of the map, the rest as in the best design as designed."""
    names = record.along
    figure = make_subplots(rows=max(len(names), 1), cols=1, vertical_spacing=0.3 / max(len(names), 2))
    for row, (name, values, amplitudes) in enumerate(
        zip(names, record.along_value, record.along_amplitude, strict=True), start=1
    ):
        best = record.nominal.design.values[name]
        points = np.array(sorted([*zip(values, 1 - amplitudes, strict=True), (best, record.nominal.reduction)]))
        figure.add_scatter(
            x=points[:, 0], y=100 * points[:, 1], mode="lines+markers", line={"color": COLOURS[0]},
            hovertext=label_of(name), showlegend=False, row=row, col=1,
        )  # fmt: skip
        figure.add_scatter(
            x=[best], y=[100 * record.nominal.reduction], mode="markers", showlegend=row == 1,
            name="optimum as designed", marker={"symbol": "x", "size": 12, "color": COLOURS[1]}, row=row, col=1,
        )  # fmt: skip
        scale = record.choice.all[name].scale
        figure.update_xaxes(title_text=axis_title(name, unit_of(name)), type=scale, row=row, col=1)
        figure.update_yaxes(title_text="gained, %", row=row, col=1)
    figure.update_layout(title=f"Reduction: gained of the {_gained_of(record)}", template="plotly_white")
    return figure


def _gained_of(record: Optimisation) -> str:
    """Return what counts of the band, in words."""
    table = record.study["optimise"]
    counts = "amplitude" if table["measure"].startswith("amplitude") else table["measure"]
    return f"{table['over_band']} {_COUNTS.get(counts, counts)} in the band"


def _format_optimum(optimum: Optimum) -> str:
    return (
        f"{_bodies(optimum.design.bodies)}, {optimum.reduction:.0%} gained, within the tolerances "
        f"{optimum.reduction_tolerances:.0%}"
    )


def _bodies(count: int) -> str:
    return "1 body" if count == 1 else f"{count} bodies"
