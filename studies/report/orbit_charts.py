"""Orbits as time histories and in the phase planes of the structure and of the bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.orbits.history import OrbitHistory
from vanedamp.studies.report.charts import COLOURS, dressed

_STRUCTURE, _IMPACT = "#0f172a", "#d55e00"
_ROW = 330  # pixels


def orbits_figure(histories: Mapping[str, OrbitHistory]) -> go.Figure:
    """Draw a row an orbit, by its name: displacements over the time, and the phase planes."""
    bodies = any(history.slip.shape[1] for history in histories.values())
    rows = len(histories)
    figure = make_subplots(
        rows=rows, cols=2 + bodies, column_widths=[0.44, 0.28, 0.28] if bodies else [0.6, 0.4],
        horizontal_spacing=0.09, vertical_spacing=0.3 / rows,
        subplot_titles=[title for name in histories for title in (name, "", "")[: 2 + bodies]],
    )  # fmt: skip
    for row, history in enumerate(histories.values(), start=1):
        _add_structure(figure, history, row)
        for body in range(history.slip.shape[1]):
            _add_body(figure, history, body, row)
        figure.update_xaxes(title_text="time, ms", row=row, col=1)
        figure.update_yaxes(title_text="displacement, µm", row=row, col=1)
        planes = (("structure", history.displacement), ("in the cavity", history.slip))
        for col, (what, values) in enumerate(planes[: 1 + bodies], start=2):
            reach = 1.06e6 * np.abs(values).max(initial=1e-12)  # bodies move from wall to wall: show the frame apart
            figure.update_xaxes(title_text=f"{what}, µm", range=[-reach, reach], row=row, col=col)
            figure.update_yaxes(title_text="mm/s", row=row, col=col)
    figure.update_annotations(font_size=13)
    return dressed(figure, height=_ROW * rows + 60).update_layout(
        legend={"orientation": "h", "y": 1.0 + 40 / (_ROW * rows), "yanchor": "bottom"}, margin_t=90
    )


def _add_structure(figure: go.Figure, history: OrbitHistory, row: int) -> None:
    line = {"color": _STRUCTURE, "width": 1.6}
    figure.add_scatter(
        x=1e3 * history.time, y=1e6 * history.displacement, name="structure", legendgroup="structure", mode="lines",
        line=line, showlegend=row == 1, hovertemplate="%{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
    )  # fmt: skip
    figure.add_scatter(
        x=1e6 * history.displacement, y=1e3 * history.velocity, name="structure", legendgroup="structure", mode="lines",
        line=line, showlegend=False, hovertemplate="%{x:.5g} µm, %{y:.5g} mm/s", row=row, col=2,
    )  # fmt: skip
    at = np.interp(history.impact_time, history.time, history.displacement)
    figure.add_scatter(
        x=1e3 * history.impact_time, y=1e6 * at, name="impacts", legendgroup="impacts", mode="markers",
        marker={"color": _IMPACT, "symbol": "x", "size": 7}, showlegend=row == 1,
        hovertemplate="impact, %{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
    )  # fmt: skip
    figure.add_scatter(
        x=1e6 * history.displacement[:1], y=1e3 * history.velocity[:1], name="start of the period", mode="markers",
        marker={"color": _STRUCTURE, "size": 8}, showlegend=row == 1, legendgroup="start", hoverinfo="skip", row=row,
        col=2,
    )  # fmt: skip


def _add_body(figure: go.Figure, history: OrbitHistory, body: int, row: int) -> None:
    name, colour = f"body {body + 1} in its cavity", COLOURS[body % len(COLOURS)]
    slip, rate = history.slip[:, body], history.slip_velocity[:, body]
    curves = (
        (1, 1e3 * history.time, 1e6 * slip, "%{x:.6g} ms: %{y:.5g} µm"),
        (3, 1e6 * slip, 1e3 * rate, "%{x:.5g} µm, %{y:.5g} mm/s"),
    )
    for col, x, y, shown in curves:
        figure.add_scatter(
            x=x, y=y, name=name, legendgroup=name, mode="lines", line={"color": colour, "width": 1.4},
            showlegend=row == 1 and col == 1, hovertemplate=shown, row=row, col=col,
        )  # fmt: skip
    figure.add_scatter(
        x=1e6 * slip[:1], y=1e3 * rate[:1], mode="markers", marker={"color": colour, "size": 8}, showlegend=False,
        legendgroup=name, hoverinfo="skip", row=row, col=3,
    )  # fmt: skip


def orbits_header(histories: Mapping[str, OrbitHistory]) -> list[str]:
    """Return the names of the columns of `orbits_rows`."""
    bodies = max(history.slip.shape[1] for history in histories.values())
    kinds = [f"{kind}_{body + 1}" for kind in ("slip", "slip_velocity") for body in range(bodies)]
    return ["orbit", "time", "displacement", "velocity", *kinds]


def orbits_rows(histories: Mapping[str, OrbitHistory]) -> Iterator[list[object]]:
    """Yield a line a sample."""
    for name, history in histories.items():
        columns = (history.time, history.displacement, history.velocity, history.slip, history.slip_velocity)
        yield from ([name, *values] for values in np.column_stack(columns).tolist())
