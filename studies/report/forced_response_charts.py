"""Interactive charts of forced responses (plotly), for pages that carry plotly themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.sweep.sweep import LOSSES
from vanedamp.studies.report.charts import COLOURS, DASHES, axis_title, dressed
from vanedamp.studies.report.forced_response import ForcedResponse

_LOSS_COLOURS = {"viscous": "#94a3b8", "friction": "#eab308", "impact": "#dc2626", "contact": "#2563eb"}
_PANELS = 3  # energy panels side by side


def responses_figure(responses: Sequence[ForcedResponse]) -> go.Figure:
    """Draw undamped, fixed and damped (maximum and mean) amplitudes, relative to the undamped maximum."""
    figure = go.Figure()
    linear: list[np.ndarray] = []
    for response, colour in zip(responses, _cycle(responses), strict=True):
        styles: list[tuple[str, str, dict[str, Any], str]] = [
            ("undamped", "undamped", {"dash": "dot", "width": 1.6}, "lines"),
            ("fixed", "bodies fixed", {"dash": "dash", "width": 1.6}, "lines"),
            ("damped_max", "damped, maximum", {"width": 0.8}, "lines+markers"),
            ("damped_mean", "damped, mean of peaks", {"width": 2.8}, "lines"),
        ]
        for curve, title, line, mode in styles:
            values = getattr(response, curve)
            if curve in ("undamped", "fixed"):
                if any(np.array_equal(values, other) for other in linear):
                    continue  # sweeps of gaps, friction ... share their linear curves
                linear.append(values)
            figure.add_scatter(
                x=response.x, y=values / response.reference, name=title, mode=mode, line=line | {"color": colour},
                marker={"size": 4}, legendgroup=response.name, legendgrouptitle_text=response.name,
                customdata=values * 1e6,
                hovertemplate=f"{response.name}, {title}: %{{y:.3f}} (%{{customdata:.3g}} µm)<extra></extra>",
            )  # fmt: skip
    figure.update_yaxes(title_text="amplitude / undamped maximum", rangemode="tozero")
    return _finish(figure, responses, height=560)


def mistuning_figure(responses: Sequence[ForcedResponse]) -> go.Figure:
    """Draw attached mass fraction and impacts per period."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for response, colour in zip(responses, _cycle(responses), strict=True):
        curves = (response.attached_mass_fraction, response.impacts_per_period)
        for row, values in enumerate(curves, start=1):
            figure.add_scatter(
                x=response.x, y=values, name=response.name, mode="lines+markers", marker={"size": 4},
                line={"color": colour, "width": 1.6}, legendgroup=response.name, showlegend=row == 1, row=row, col=1,
            )  # fmt: skip
    figure.add_hline(y=1, line={"color": "#94a3b8", "width": 1, "dash": "dash"}, row=1, col=1)
    figure.update_yaxes(title_text="attached mass fraction", row=1, col=1)
    figure.update_yaxes(title_text="impacts per period", rangemode="tozero", row=2, col=1)
    return _finish(figure, responses, height=560)


def energy_figure(responses: Sequence[ForcedResponse]) -> go.Figure:
    """Draw where the energy goes: stacked shares of the losses, one panel a response."""
    columns = min(len(responses), _PANELS)
    rows = -(-len(responses) // columns)
    figure = make_subplots(
        rows=rows, cols=columns, shared_yaxes=True, subplot_titles=[response.name for response in responses],
        horizontal_spacing=0.04, vertical_spacing=0.25 / rows,
    )  # fmt: skip
    for number, response in enumerate(responses):
        for index, loss in enumerate(LOSSES):
            if not any((other.energy_share[:, index] > 0).any() for other in responses):
                continue
            figure.add_scatter(
                x=response.x, y=100 * response.energy_share[:, index], name=loss, stackgroup=str(number), mode="lines",
                line={"width": 0.5, "color": _LOSS_COLOURS[loss]}, legendgroup=loss, showlegend=number == 0,
                hovertemplate=f"{loss}: %{{y:.1f}} %<extra></extra>",
                row=number // columns + 1, col=number % columns + 1,
            )  # fmt: skip
    figure.update_yaxes(range=[0, 100])
    figure.update_annotations(font_size=12)
    figure.update_yaxes(title_text="share of the energy lost, %", col=1)
    _finish(figure, responses, height=400 * rows)
    return figure.update_xaxes(title_font_size=11) if columns == _PANELS else figure


def plane_figure(responses: Sequence[ForcedResponse]) -> go.Figure:
    """Draw largest tilt, share of the time off the floor and what small tilts neglect, of each body in the plane."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for response, colour in zip(responses, _cycle(responses), strict=True):
        for body, name in bodies_in_plane(response):
            dash = DASHES[body % len(DASHES)]
            panels = (
                (1e3 * response.in_plane["tilt_max"], "%{y:.4g} mrad"), (response.in_plane["lift_share"], "%{y:.3f}"),
                (100 * response.in_plane["linearisation"], "%{y:.2g} %"),
            )  # fmt: skip
            for row, (values, shown) in enumerate(panels, start=1):
                figure.add_scatter(
                    x=response.x, y=values[:, body], name=name, mode="lines+markers", marker={"size": 4},
                    line={"color": colour, "width": 1.6, "dash": dash}, legendgroup=name, showlegend=row == 1,
                    hovertemplate=f"{name}: {shown}<extra></extra>", row=row, col=1,
                )  # fmt: skip
    figure.update_yaxes(rangemode="tozero")
    for row, title in enumerate(("largest tilt, mrad", "time off the floor", "neglected, %"), start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    return _finish(figure, responses, height=720)


def bodies_in_plane(response: ForcedResponse) -> list[tuple[int, str]]:
    """Return numbers, from 0, and names of the bodies with extent of a response."""
    if not response.in_plane:
        return []
    extended = np.flatnonzero(np.isfinite(response.in_plane["tilt_max"]).any(axis=0)).tolist()
    several = response.in_plane["tilt_max"].shape[1] > 1
    return [(body, f"{response.name}, body {body + 1}" if several else response.name) for body in extended]


def _cycle(responses: Sequence[ForcedResponse]) -> list[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(len(responses))]


def _finish(figure: go.Figure, responses: Sequence[ForcedResponse], height: int) -> go.Figure:
    orders = {response.hertz for response in responses}
    hertz = orders.pop() if len(orders) == 1 else math.nan
    figure.update_xaxes(hoverformat=".6g")
    for axis in figure.select_xaxes():
        if axis.showticklabels is not False:  # of panels above each other, the lowest carries the title
            axis.update(title_text=axis_title(responses[0].axis, responses[0].units, hertz))
    figure.update_layout(hovermode="x unified")
    return dressed(figure, height)
