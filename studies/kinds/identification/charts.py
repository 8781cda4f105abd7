"""The figures of an identification: measurements over the model, profiles of the numbers, and their correlations."""

from __future__ import annotations

import math

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.scene.units import unit_of
from vanedamp.studies.identification.record import Identification, Proposal
from vanedamp.studies.report.charts import COLOURS, axis_title

_PALE, _BAND = "#94a3b8", "rgba(29, 79, 145, 0.18)"
#: columns of panels, and their distance as a fraction of the width, with space for axis titles
_COLUMNS, _APART = 3, 0.13
#: rise of the misfit beyond which a profile is not drawn, over the threshold
_HIGH = 3.0


def data_figure(record: Identification) -> go.Figure:
    """Draw every measured channel with its errors over the model and its 95 % band."""
    count = len(record.channels)
    columns = min(count, _COLUMNS)
    titles = [f"{channel['measurement']}, {channel['quantity']}" for channel in record.channels]
    figure = make_subplots(
        rows=math.ceil(count / columns), cols=columns, subplot_titles=titles, vertical_spacing=0.18,
        horizontal_spacing=_APART,
    )  # fmt: skip
    for number, channel in enumerate(record.channels):
        cell = {"row": number // columns + 1, "col": number % columns + 1}
        of_channel = record.data_channel == number
        order = np.argsort(record.data_at[of_channel], kind="stable")
        at, value, deviation, model, band, repeats = (
            getattr(record, f"data_{name}")[of_channel][order]
            for name in ("at", "value", "deviation", "model", "band", "repeats")
        )
        edges = np.concatenate([model + band, (model - band)[::-1]])
        first = number == 0
        figure.add_scatter(
            x=np.concatenate([at, at[::-1]]), y=edges, mode="lines", fill="toself", fillcolor=_BAND, line={"width": 0},
            hoverinfo="skip", name="its 95 % band", showlegend=first, **cell,
        )  # fmt: skip
        figure.add_scatter(
            x=at, y=model, mode="lines+markers", name="model", showlegend=first, line={"color": COLOURS[0]},
            marker={"symbol": np.where(repeats, "circle", "circle-open").tolist(), "size": 5}, **cell,
        )  # fmt: skip
        figure.add_scatter(
            x=at, y=value, mode="markers", name="measured", showlegend=first,
            marker={"color": COLOURS[1], "symbol": "x-thin", "line": {"width": 2, "color": COLOURS[1]}},
            error_y={"array": deviation, "color": COLOURS[1], "thickness": 1}, **cell,
        )  # fmt: skip
        figure.update_xaxes(title="frequency, Hz" if channel["at_unit"] == "Hz" else "time, s", **cell)
        figure.update_yaxes(title=f"{channel['quantity']}, {channel['unit']}", **cell)
    return figure


def profile_figure(record: Identification) -> go.Figure:
    """Draw the rise of the misfit versus each number, the others at their optimum, and the ends of its interval."""
    count = len(record.paths)
    columns = min(count, _COLUMNS)
    figure = make_subplots(
        rows=math.ceil(count / columns), cols=columns, vertical_spacing=0.2, horizontal_spacing=_APART
    )  # fmt: skip
    for number, path in enumerate(record.paths):
        cell = {"row": number // columns + 1, "col": number % columns + 1}
        of_number = record.profile_number == number
        value, rise = record.profile_value[of_number], record.profile_rise[of_number]
        figure.add_scatter(
            x=value, y=rise, mode="lines+markers", line={"color": COLOURS[0], "shape": "spline"}, showlegend=False,
            name=path, **cell,
        )  # fmt: skip
        figure.add_hline(y=record.threshold, line={"color": _PALE, "dash": "dash"}, **cell)
        for end, is_open in zip(record.interval[number], record.open[number], strict=True):
            if not is_open:
                figure.add_vline(x=end, line={"color": _PALE, "dash": "dot"}, **cell)
        figure.update_xaxes(title=axis_title(path, unit_of(path)), **cell)
        figure.update_yaxes(title="rise of the misfit", range=[0.0, _HIGH * record.threshold], **cell)
    return figure


def correlation_figure(record: Identification) -> go.Figure:
    """Draw the correlations of the numbers."""
    names = list(record.paths)
    figure = go.Figure(
        go.Heatmap(
            z=record.correlation,
            x=names,
            y=names,
            zmin=-1.0,
            zmax=1.0,
            colorscale="RdBu",
            texttemplate="%{z:.2f}",
            colorbar={"title": "correlation"},
        )
    )
    figure.update_yaxes(autorange="reversed")
    return figure


def proposal_figure(record: Identification, proposal: Proposal) -> go.Figure:
    """Draw the remaining uncertainty of the worst number after each further measurement, one line per level."""
    figure, last = go.Figure(), len(proposal.axes) - 1
    levels = list(dict.fromkeys(map(tuple, proposal.points[:, :last].tolist())))
    for number, level in enumerate(levels):
        at_level = (proposal.points[:, :last] == level).all(axis=1)
        name = ", ".join(f"{path} = {value:.4g}" for path, value in zip(proposal.axes, level, strict=False))
        figure.add_scatter(
            x=proposal.points[at_level, last], y=proposal.shrink[at_level, proposal.worst], mode="lines+markers",
            line={"color": COLOURS[number % len(COLOURS)]}, name=name or "measurement",
        )  # fmt: skip
    figure.update_xaxes(title=axis_title(proposal.axes[last], unit_of(proposal.axes[last])))
    figure.update_yaxes(title=f"uncertainty left of {record.paths[proposal.worst]}", rangemode="tozero")
    return figure
