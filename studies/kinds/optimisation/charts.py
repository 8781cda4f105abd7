"""The figure of an optimisation."""

from __future__ import annotations

import plotly.graph_objects as go

from vanedamp.studies.optimisation.record import Optimisation, Optimum

#: measures that are no amplitude, and what they refer to
_COUNTS = {"stress": "stress", "life": "damage of 1 in 10,000 h", "wear": "depth of X worn off in 10,000 h"}


def optimisation_figure(record: Optimisation) -> go.Figure:
    """Draw contours of the reduction over mass ratio and gap, both optima marked."""
    table = record.study["optimise"]
    counts = "amplitude" if table["measure"].startswith("amplitude") else table["measure"]
    of = f"{table['over_band']} {_COUNTS.get(counts, counts)} in the band"
    count = record.nominal.design.bodies
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
            x=[100 * optimum.design.mass_ratio], y=[optimum.design.gap_ratio], mode="markers",
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


def _format_optimum(optimum: Optimum) -> str:
    return (
        f"{_bodies(optimum.design.bodies)}, {optimum.reduction:.0%} gained, within the tolerances "
        f"{optimum.reduction_tolerances:.0%}"
    )


def _bodies(count: int) -> str:
    return "1 body" if count == 1 else f"{count} bodies"
