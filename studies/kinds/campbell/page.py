"""Campbell diagrams: modes over the speed of rotation, crossings with engine orders, veerings."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from vanedamp.modal.records.campbell import RPM, Campbell
from vanedamp.studies.headline import format_margin
from vanedamp.studies.report.charts import COLOURS, Table, dressed
from vanedamp.studies.report.page import Page

ORDER = 40
_ORDER, _MARK = "#64748b", "#111827"
#: of modes when all colours are used
_DASHES = ("solid", "dot", "dashdot")


def shown(file: str, diagram: Campbell, page: Page) -> dict[str, Any]:
    """Return chart and tables of a diagram."""
    chart = page.chart("campbell", figure(diagram), *campbell_table(diagram), [file])
    solved = ", ".join(f"{speed * RPM:.6g}" for speed in diagram.solved)
    margins = [
        diagram.operating and format_margin(crossing.margin(diagram.operating)) for crossing in diagram.crossings
    ]
    return {"file": file, "chart": chart, "record": diagram, "solved": solved, "margins": margins}


def figure(diagram: Campbell) -> go.Figure:
    """Draw the modes versus speed, engine-order lines, crossings and veerings."""
    figure = go.Figure()
    top = 1.06 * float(np.nanmax(diagram.frequencies_hz))
    _add_orders(figure, diagram, top)
    for number, (mode, frequencies) in enumerate(zip(diagram.modes, diagram.frequencies_hz, strict=True)):
        name = diagram.label(mode)
        figure.add_scatter(
            x=diagram.rpm, y=frequencies, name=name, mode="lines", customdata=diagram.speeds,
            line={"color": COLOURS[number % len(COLOURS)], "width": 2.2, "dash": _DASHES[number // len(COLOURS) % 3]},
            hovertemplate=f"{name}<br>%{{x:.1f}} rpm (%{{customdata:.2f}} rad/s)<br>%{{y:.3f}} Hz<extra></extra>",
        )  # fmt: skip
    _add_veerings(figure, diagram)
    _add_crossings(figure, diagram)
    if diagram.operating is not None:
        first, last = (speed * RPM for speed in diagram.operating)
        figure.add_vrect(
            first, last, fillcolor="#94a3b8", opacity=0.18, line_width=0, annotation_text="operation",
            annotation_position="bottom left",
        )  # fmt: skip
    dressed(figure, height=620)
    low, high = diagram.rpm[[0, -1]]
    figure.update_xaxes(title_text="speed, rpm", range=[low, high], domain=[0.0, 0.96], tickformat=",d")
    figure.update_yaxes(title_text="natural frequency, Hz", range=[0.0, top])
    return figure.update_layout(hovermode="closest")


def _add_orders(figure: go.Figure, diagram: Campbell, top: float) -> None:
    """Add the lines of the engine orders, each with its label where it leaves the chart."""
    low, high = diagram.rpm[[0, -1]]
    drawn = [order for order in diagram.orders if order * low / 60.0 < top]
    for index, order in enumerate(drawn):
        end = min(high, 60.0 * top / order)
        figure.add_scatter(
            x=[low, end], y=[order * low / 60.0, order * end / 60.0], mode="lines", name="engine orders",
            legendgroup="engine orders", showlegend=index == 0, hoverinfo="skip",
            line={"color": _ORDER, "width": 1.1, "dash": "dash"},
        )  # fmt: skip
        figure.add_annotation(
            x=end, y=order * end / 60.0, text=f"EO {order:g}", showarrow=False, font={"size": 12, "color": _ORDER},
            xanchor="left", yanchor="middle" if end == high else "top", xshift=3,
        )  # fmt: skip


def _add_crossings(figure: go.Figure, diagram: Campbell) -> None:
    if diagram.crossings:
        figure.add_scatter(
            x=[crossing.rpm for crossing in diagram.crossings],
            y=[crossing.frequency_hz for crossing in diagram.crossings],
            name="crossings", mode="markers", hoverinfo="text",
            hovertext=[
                f"{diagram.label(crossing.mode)} meets engine order {crossing.order:g}<br>{crossing.rpm:.3f} rpm "
                f"({crossing.speed:.4f} rad/s)<br>{crossing.frequency_hz:.4f} Hz"
                for crossing in diagram.crossings
            ],
            marker={"size": 9, "color": "#ffffff", "line": {"color": _MARK, "width": 2}},
        )  # fmt: skip


def _add_veerings(figure: go.Figure, diagram: Campbell) -> None:
    if diagram.veerings:
        figure.add_scatter(
            x=[veering.rpm for veering in diagram.veerings], y=[veering.frequency_hz for veering in diagram.veerings],
            name="veerings", mode="markers", hoverinfo="text",
            hovertext=[
                f"modes {veering.first + 1} and {veering.second + 1} veer<br>{veering.rpm:.1f} rpm "
                f"({veering.speed:.3f} rad/s)<br>{veering.frequency_hz:.3f} Hz, {veering.gap_hz:.3g} Hz apart<br>"
                f"{veering.exchange:.0%} of the shapes exchanged"
                for veering in diagram.veerings
            ],
            marker={"symbol": "diamond-open", "size": 15, "color": _MARK, "line": {"width": 2}},
        )  # fmt: skip


def campbell_table(diagram: Campbell) -> Table:
    """Return the frequencies of the modes, one row per speed."""
    header = ["speed, rad/s", "speed, rpm", *(f"{diagram.label(mode)}, Hz" for mode in diagram.modes)]
    return header, np.column_stack([diagram.speeds, diagram.rpm, diagram.frequencies_hz.T]).tolist()
