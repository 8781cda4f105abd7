"""Orbits as time histories and in phase planes, and the phase planes of a run with its starts of periods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.orbits.history import OrbitHistory, late_history
from vanedamp.coupling.response.response import Response
from vanedamp.studies.report.charts import COLOURS, DASHES, Table, dressed

_STRUCTURE, _IMPACT = "#0f172a", "#d55e00"
_ROW = 330  # pixels
#: periods that are drawn, and starts of periods
_PERIODS, _MOST_STARTS = 25, 2000


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
        _add_times(figure, history, row)
        add_planes(figure, history, row, col=2)
        starts = (history.displacement[:1], history.velocity[:1], history.slip[:1], history.slip_velocity[:1])
        add_starts(figure, starts, "start of the period", row, col=2, size=8)
    figure.update_annotations(font_size=13)
    return dressed(figure, height=_ROW * rows + 60).update_layout(
        legend={"orientation": "h", "y": 1.0 + 40 / (_ROW * rows), "yanchor": "bottom"}, margin_t=90
    )


def add_planes(figure: go.Figure, history: OrbitHistory, row: int, col: int) -> None:
    """Draw the phase plane of the structure into a column of a row, and that of the bodies into the next."""
    _add_plane(figure, "structure", _STRUCTURE, history.displacement, history.velocity, row, col)
    planes = [("structure", history.displacement)]
    for body in range(history.slip.shape[1]):
        rate = history.slip_velocity[:, body]
        _add_plane(figure, _named(body), _colour(body), history.slip[:, body], rate, row, col + 1, _dash(body))
        planes = [planes[0], ("in the cavity", history.slip)]
    for place, (what, values) in enumerate(planes, start=col):
        reach = 1.06e6 * np.abs(values).max(initial=1e-12)  # bodies move from wall to wall: show the frame apart
        figure.update_xaxes(title_text=f"{what}, µm", range=[-reach, reach], row=row, col=place)
        figure.update_yaxes(title_text="mm/s", row=row, col=place)


def add_starts(figure: go.Figure, states: Sequence[np.ndarray], name: str, row: int, col: int, size: int) -> None:
    """Mark the states at starts of periods in the phase planes of `add_planes`.

    states: displacement and velocity (n,) of the structure, slip and its velocity (n, bodies); size: of a mark, pixels.
    """
    displacement, velocity, slip, rate = states
    figure.add_scatter(
        x=1e6 * displacement, y=1e3 * velocity, name=name, mode="markers", marker={"color": _STRUCTURE, "size": size},
        showlegend=row == 1, legendgroup="start", hoverinfo="skip", row=row, col=col,
    )  # fmt: skip
    for body in range(slip.shape[1]):
        figure.add_scatter(
            x=1e6 * slip[:, body], y=1e3 * rate[:, body], mode="markers",
            marker={"color": _colour(body), "size": size}, showlegend=False, legendgroup=_named(body), hoverinfo="skip",
            row=row, col=col + 1,
        )  # fmt: skip


def _add_times(figure: go.Figure, history: OrbitHistory, row: int) -> None:
    curves = [("structure", _STRUCTURE, "solid", history.displacement)]
    curves += [
        (_named(body), _colour(body), _dash(body), history.slip[:, body]) for body in range(history.slip.shape[1])
    ]
    for name, colour, dash, values in curves:
        figure.add_scatter(
            x=1e3 * history.time, y=1e6 * values, name=name, legendgroup=name, mode="lines",
            line={"color": colour, "width": 1.5, "dash": dash}, showlegend=row == 1,
            hovertemplate="%{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
        )  # fmt: skip
    at = np.interp(history.impact_time, history.time, history.displacement)
    figure.add_scatter(
        x=1e3 * history.impact_time, y=1e6 * at, name="impacts", legendgroup="impacts", mode="markers",
        marker={"color": _IMPACT, "symbol": "x", "size": 7}, showlegend=row == 1,
        hovertemplate="impact, %{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
    )  # fmt: skip


def _add_plane(
    figure: go.Figure, name: str, colour: str, place: np.ndarray, rate: np.ndarray, row: int, col: int,
    dash: str = "solid",
) -> None:  # fmt: skip
    figure.add_scatter(
        x=1e6 * place, y=1e3 * rate, name=name, legendgroup=name, mode="lines",
        line={"color": colour, "width": 1.4, "dash": dash}, showlegend=False,
        hovertemplate="%{x:.5g} µm, %{y:.5g} mm/s", row=row, col=col,
    )  # fmt: skip


def _named(body: int) -> str:
    return f"body {body + 1} in its cavity"


def _colour(body: int) -> str:
    return COLOURS[body % len(COLOURS)]


def _dash(body: int) -> str:
    return DASHES[body % len(DASHES)]


def orbits_table(histories: Mapping[str, OrbitHistory]) -> Table:
    """Return a row per sample."""
    bodies = max(history.slip.shape[1] for history in histories.values())
    kinds = [f"{kind}_{body + 1}" for kind in ("slip", "slip_velocity") for body in range(bodies)]
    rows: list[list[object]] = []
    for name, history in histories.items():
        columns = (history.time, history.displacement, history.velocity, history.slip, history.slip_velocity)
        rows += ([name, *values] for values in np.column_stack(columns).tolist())
    return ["orbit", "time", "displacement", "velocity", *kinds], rows


def phase_figure(response: Response) -> go.Figure:
    """Draw the phase planes of structure and bodies, with a point at the start of each of the evaluated periods.

    A motion that repeats after k periods has k points, one that never does fills an area. response: with samples and
    events.
    """
    history = late_history(response, _PERIODS)
    bodies = response.slip.shape[1]
    columns = 1 + bool(bodies)
    figure = make_subplots(rows=1, cols=columns, horizontal_spacing=0.12)
    add_planes(figure, history, row=1, col=1)
    figure.update_traces(showlegend=True, opacity=0.55)
    late = slice(max(response.transient, len(response.section) - _MOST_STARTS), None)
    states = (response.section[late, 0], response.section[late, 1], response.slip[late], response.slip_velocity[late])
    add_starts(figure, states, "starts of periods", row=1, col=1, size=5)
    for col, values in enumerate(((history.displacement, states[0]), (history.slip, states[2]))[:columns], start=1):
        reach = 1.06e6 * max(1e-12, *(np.abs(each).max(initial=0.0) for each in values))
        figure.update_xaxes(range=[-reach, reach], row=1, col=col)
    return dressed(figure, height=430).update_layout(legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
