"""The figures of a life: reduction, gaps and depths of wear over hours, and wear rates of the contacts."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.report.charts import COLOURS

_PALE = "rgba({}, {}, {}, 0.18)"


def life_figure(record: LifeRecord) -> go.Figure:
    """Draw reduction, free travel and depth of wear over hours, with their 95 % bands."""
    scene, table = record.study["scene"], record.study["life"]
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    limited = table.get("limit") is not None
    label, least = (f"margin of {table['measure']}", 0.0) if limited else ("reduction", table["threshold"])
    _curve(figure, 1, record.time, 100 * record.reduction, 100 * record.reduction_band, label, 0)
    figure.add_hline(y=100 * least, line={"dash": "dot", "color": "#64748b"}, row=1, col=1)
    for index, cavity in enumerate(scene["cavity"]):
        gap, band = 1e6 * record.gap[:, index], 1e6 * record.gap_band[:, index]
        _curve(figure, 2, record.time, gap, band, f"gap of {cavity['name']}", 1 + index)
    for number, (name, contacts) in enumerate(record.faces.items()):
        band = np.linalg.norm(record.depth_band[:, contacts], axis=1) + record.depth_error[:, contacts].sum(axis=1)
        depth = record.depth[:, contacts].mean(axis=1)
        _curve(figure, 3, record.time, 1e6 * depth, 1e6 * band / len(contacts), name, 2 + number)
    for row, title in enumerate((f"{label}, %", "gap, µm", "depth of wear, µm"), 1):
        figure.update_yaxes(title_text=title, rangemode="tozero", row=row, col=1)
    figure.update_xaxes(title_text="hours", row=3, col=1)
    for hours, dash in zip(record.hours, ("solid", "dash", "dash"), strict=True):
        if hours:
            figure.add_vline(x=hours, line={"dash": dash, "color": "#be185d", "width": 1})
    return figure


def _curve(
    figure: go.Figure, row: int, x: np.ndarray, y: np.ndarray, band: np.ndarray, name: str, colour: int
) -> None:  # fmt: skip
    """Add a curve over its band to a row of panels."""
    colour_name = COLOURS[colour % len(COLOURS)]
    rgb = (int(colour_name[digit : digit + 2], 16) for digit in (1, 3, 5))
    figure.add_scatter(
        x=np.concatenate([x, x[::-1]]), y=np.concatenate([y + band, (y - band)[::-1]]), mode="lines", fill="toself",
        fillcolor=_PALE.format(*rgb), line={"width": 0}, hoverinfo="skip", showlegend=False, row=row, col=1,
    )  # fmt: skip
    figure.add_scatter(
        x=x, y=y, mode="lines+markers", name=name, line={"color": colour_name}, marker={"size": 5}, row=row, col=1
    )
