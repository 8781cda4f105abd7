"""Charts of a ring's modes: interference diagram (SAFE) and Campbell diagram by nodal diameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.colors import sample_colorscale

from vanedamp.modal.records.campbell import RPM, OrderCrossing
from vanedamp.modal.records.interference import Interference
from vanedamp.studies.report.charts import COLOURS, Table, dressed

_ORDER, _MARK = "#64748b", "#111827"
#: engine orders with a label at most
_MOST_LABELS = 40


def interference_figure(found: Interference) -> go.Figure:
    """Draw frequency versus nodal diameter by family, folded lines of engine orders, and their meetings with modes.

    The lines are drawn for the ends of the operating range. `customdata` of a mode is its number, from 0.
    """
    figure, modes = go.Figure(), found.modes
    for speed, dash in zip(found.folded_speeds, ("solid", "dot"), strict=False):
        _add_orders(figure, found, speed, dash)
    for family in np.unique(modes.families).tolist():
        rows = np.flatnonzero(modes.families == family)
        rows = rows[np.argsort(modes.diameters[rows])]
        figure.add_scatter(
            x=found.diameters[rows], y=modes.frequencies_hz[rows], customdata=rows, name=f"family {family + 1}",
            mode="lines+markers", line={"color": COLOURS[family % len(COLOURS)], "width": 1.5}, marker={"size": 8},
            hovertext=[found.name(row) for row in rows.tolist()],
            hovertemplate="%{hovertext}<br>%{y:.4f} Hz<extra></extra>",
        )  # fmt: skip
    met = found.in_operation
    _add_meetings(figure, found, met, [int(found.diameters[meeting.mode]) for meeting in met])
    dressed(figure, height=620)
    figure.update_xaxes(
        title_text="nodal diameter", range=[-0.3, 0.5 * modes.sectors + 0.3], dtick=max(1, round(modes.sectors / 40))
    )
    figure.update_yaxes(title_text="natural frequency, Hz", range=[0.0, found.top])
    return figure.update_layout(hovermode="closest")


def _add_orders(figure: go.Figure, found: Interference, speed: float, dash: str) -> None:
    """Add the folded line of a speed, and on it the engine orders that are considered."""
    name = f"engine orders at {speed * RPM:.6g} rpm"
    x, y = found.zigzag(speed)
    look: dict[str, Any] = {"legendgroup": name, "name": name}
    line = {"color": _ORDER, "width": 1.1, "dash": dash}
    figure.add_scatter(x=x, y=y, mode="lines", hoverinfo="skip", line=line, **look)
    orders = [order for order in found.orders if order * speed / (2.0 * np.pi) <= found.top]
    labelled = len(orders) <= _MOST_LABELS and speed == found.folded_speeds[-1]
    figure.add_scatter(
        x=[abs(found.excited(order)) for order in orders], y=[order * speed / (2.0 * np.pi) for order in orders],
        mode="markers+text", showlegend=False, text=orders if labelled else None, textposition="middle right",
        textfont={"size": 10, "color": _ORDER}, marker={"size": 4, "color": _ORDER},
        hovertext=[f"engine order {order}" for order in orders], hoverinfo="text+y", **look,
    )  # fmt: skip


def _add_meetings(
    figure: go.Figure, found: Interference, meetings: Sequence[OrderCrossing], x: Sequence[float]
) -> None:
    if meetings:
        figure.add_scatter(
            x=x, y=[meeting.frequency_hz for meeting in meetings], name="meetings", mode="markers", hoverinfo="text",
            hovertext=[
                f"{found.name(meeting.mode)}, meets engine order {meeting.order:g}<br>{meeting.rpm:.3f} rpm "
                f"({meeting.speed:.4f} rad/s)<br>{meeting.frequency_hz:.4f} Hz"
                for meeting in meetings
            ],
            marker={"size": 13, "symbol": "circle-open", "color": _MARK, "line": {"width": 2}},
        )  # fmt: skip


def ring_campbell_figure(found: Interference) -> go.Figure:
    """Draw the modes versus speed, one colour per nodal diameter, lines of engine orders, and their meetings."""
    figure = go.Figure()
    top, rpm = 1.06 * float(np.nanmax(found.over_speed_hz)), found.speeds * RPM
    for order in found.orders:
        end = min(rpm[-1], 60.0 * top / order)
        figure.add_scatter(
            x=[rpm[0], end], y=[order * rpm[0] / 60.0, order * end / 60.0], mode="lines", name="engine orders",
            legendgroup="engine orders", showlegend=order == found.orders[0], hoverinfo="skip",
            line={"color": _ORDER, "width": 0.8, "dash": "dash"},
        )  # fmt: skip
    diameters = np.unique(found.diameters)
    colours = sample_colorscale("Viridis", np.linspace(0.0, 0.9, len(diameters)).tolist())
    for mode, frequencies in enumerate(found.over_speed_hz):
        diameter = int(found.diameters[mode])
        colour, name = colours[int(np.searchsorted(diameters, diameter))], f"diameter {diameter}"
        figure.add_scatter(
            x=rpm, y=frequencies, mode="lines", name=name, legendgroup=name, line={"color": colour, "width": 2},
            showlegend=bool(found.modes.families[mode] == 0 <= found.modes.diameters[mode]),
            hovertemplate=f"{found.name(mode)}<br>%{{x:.1f}} rpm<br>%{{y:.3f}} Hz<extra></extra>",
        )  # fmt: skip
    _add_meetings(figure, found, found.meetings, [meeting.rpm for meeting in found.meetings])
    dressed(figure, height=620)
    figure.update_xaxes(title_text="speed, rpm", range=[rpm[0], rpm[-1]], tickformat=",d")
    figure.update_yaxes(title_text="natural frequency, Hz", range=[0.0, top])
    return figure.update_layout(hovermode="closest", legend={"groupclick": "togglegroup"})


def interference_table(found: Interference) -> Table:
    """Return modes with their diameters and families, and the engine orders that excite them."""
    header = ["nodal diameter", "family", "frequency, Hz", "engine orders"]
    modes = found.modes
    rows = zip(modes.diameters.tolist(), (modes.families + 1).tolist(), modes.frequencies_hz.tolist(), strict=True)
    return header, [[*row, " ".join(map(str, found.exciting(row[0])))] for row in rows]


def ring_campbell_table(found: Interference) -> Table:
    """Return the frequencies of the modes, one row per speed."""
    header = ["speed, rad/s", "speed, rpm", *(f"{found.name(mode)}, Hz" for mode in range(len(found.diameters)))]
    return header, np.column_stack([found.speeds, found.speeds * RPM, found.over_speed_hz.T]).tolist()
