"""Orbits as time histories and in phase planes, and the phase planes of a run with its starts of periods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.orbits.history import OrbitHistory, late_history
from vanedamp.coupling.response.response import Response
from vanedamp.studies.report.charts import COLOURS, DASHES, Table, dressed

_STRUCTURE, _IMPACT = "#0f172a", "#d55e00"
_ROW = 330  # pixels
#: distance of panels, relative to the width: space for ticks and a title on a page of 800 pixels
_APART = 0.13
#: periods that are drawn, and starts of periods
_PERIODS, _MOST_STARTS = 25, 2000


def orbits_figure(histories: Mapping[str, OrbitHistory]) -> go.Figure:
    """Draw one row per orbit, by its name: displacements versus time, and the phase planes."""
    bodies = any(history.slip.shape[1] for history in histories.values())
    rows = len(histories)
    figure = make_subplots(
        rows=rows, cols=2 + bodies, column_widths=[0.4, 0.3, 0.3] if bodies else [0.6, 0.4],
        horizontal_spacing=_APART, vertical_spacing=0.3 / rows,
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
    states = (history.displacement, history.velocity, history.slip, history.slip_velocity)
    for column, curve in _curves(states):
        figure.add_scatter(
            x=1e6 * curve.values, y=1e3 * curve.rate, name=curve.name, legendgroup=curve.name, mode="lines",
            line={"color": curve.colour, "width": 1.4, "dash": curve.dash}, showlegend=False,
            hovertemplate="%{x:.5g} µm, %{y:.5g} mm/s", row=row, col=col + column,
        )  # fmt: skip
    planes = [("structure", history.displacement)]
    if history.slip.shape[1]:
        planes.append(("in the cavity", history.slip))
    for panel, (what, values) in enumerate(planes, start=col):
        reach = 1.06e6 * np.abs(values).max(initial=1e-12)  # bodies move from wall to wall: show the frame apart
        figure.update_xaxes(title_text=f"{what}, µm", range=[-reach, reach], row=row, col=panel)
        figure.update_yaxes(title={"text": "mm/s", "font_size": 12, "standoff": 2}, row=row, col=panel)


def add_starts(figure: go.Figure, states: Sequence[np.ndarray], name: str, row: int, col: int, size: int) -> None:
    """Mark the states at starts of periods in the phase planes of `add_planes`.

    states: displacement and velocity (n,) of the structure, slip and its velocity (n, bodies); size: of a mark, pixels.
    """
    for column, curve in _curves(states):
        legend: dict[str, Any] = {"legendgroup": curve.name, "showlegend": False}
        if column == 0:
            legend = {"name": name, "legendgroup": "start", "showlegend": row == 1}
        figure.add_scatter(
            x=1e6 * curve.values, y=1e3 * curve.rate, mode="markers", marker={"color": curve.colour, "size": size},
            hoverinfo="skip", row=row, col=col + column, **legend,
        )  # fmt: skip


def _add_times(figure: go.Figure, history: OrbitHistory, row: int) -> None:
    for _, curve in _curves((history.displacement, history.velocity, history.slip, history.slip_velocity)):
        figure.add_scatter(
            x=1e3 * history.time, y=1e6 * curve.values, name=curve.name, legendgroup=curve.name, mode="lines",
            line={"color": curve.colour, "width": 1.5, "dash": curve.dash}, showlegend=row == 1,
            hovertemplate="%{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
        )  # fmt: skip
    at = np.interp(history.impact_time, history.time, history.displacement)
    figure.add_scatter(
        x=1e3 * history.impact_time, y=1e6 * at, name="impacts", legendgroup="impacts", mode="markers",
        marker={"color": _IMPACT, "symbol": "x", "size": 7}, showlegend=row == 1,
        hovertemplate="impact, %{x:.6g} ms: %{y:.5g} µm", row=row, col=1,
    )  # fmt: skip
    figure.update_xaxes(title_text="time, ms", row=row, col=1)
    figure.update_yaxes(title={"text": "displacement, µm", "font_size": 12, "standoff": 2}, row=row, col=1)


class _StateCurve(NamedTuple):
    """Name and look of a curve, its values (n,), m, and their rates (n,), m/s."""

    name: str
    colour: str
    dash: str
    values: np.ndarray
    rate: np.ndarray


def _curves(states: Sequence[np.ndarray]) -> Iterator[tuple[int, _StateCurve]]:
    """Yield the plane, 0 or 1, and the curve of the structure and of each body; states: as of `add_starts`."""
    displacement, velocity, slip, slip_velocity = states
    yield 0, _StateCurve("structure", _STRUCTURE, "solid", displacement, velocity)
    for body, (values, rate) in enumerate(zip(slip.T, slip_velocity.T, strict=True)):
        colour, dash = COLOURS[body % len(COLOURS)], DASHES[body % len(DASHES)]
        yield 1, _StateCurve(f"body {body + 1} in its cavity", colour, dash, values, rate)


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

    A motion that repeats after k periods has k points, a non-periodic one fills an area. response: with samples and
    events.
    """
    history = late_history(response, _PERIODS)
    bodies = response.slip.shape[1]
    columns = 1 + bool(bodies)
    figure = make_subplots(rows=1, cols=columns, horizontal_spacing=_APART)
    add_planes(figure, history, row=1, col=1)
    figure.update_traces(showlegend=True, opacity=0.55)
    late = slice(max(response.transient, len(response.section) - _MOST_STARTS), None)
    states = (response.section[late, 0], response.section[late, 1], response.slip[late], response.slip_velocity[late])
    add_starts(figure, states, "starts of periods", row=1, col=1, size=5)
    for col, values in enumerate(((history.displacement, states[0]), (history.slip, states[2]))[:columns], start=1):
        reach = 1.06e6 * max(1e-12, *(np.abs(array).max(initial=0.0) for array in values))
        figure.update_xaxes(range=[-reach, reach], row=1, col=col)
    return dressed(figure, height=430).update_layout(legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
