"""Borders in the plane of two parameters, drawn over the map of a sweep."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from vanedamp.coupling.orbits.border import Border, BorderPoint
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.report.charts import Table, axis_title, dressed
from vanedamp.studies.report.forced_response import for_people
from vanedamp.studies.report.map_chart import Panel, map_panels
from vanedamp.studies.report.sweep_beside import system_of

#: colours of borders by their kind, which the colour-blind tell apart (Okabe and Ito 2008)
_LINES = {
    "fold": "#000000", "pitchfork": "#009e73", "period doubling": "#d55e00", "neimark-sacker": "#cc79a7",
    "grazing": "#0072b2", "sequence": "#56b4e9", "peak": "#e69f00",
}  # fmt: skip
#: symbols of named points, in the order of their names
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "star", "pentagon", "triangle-down", "cross", "hexagon")
#: named points without a marker: the sequence of events changes, and the border continues
_PLAIN = ("sequence",)


def borders_figure(branches: Branches, map_: Panel | None = None) -> go.Figure:
    """Draw the borders of branches in the plane of their two parameters, over the map of a sweep (`map_of`), if any.

    Solid where stable orbits meet, dashed where all are unstable; named points are marked.
    """
    figure = go.Figure()
    (wide, across), (high, up) = (for_people(unit_of(path)) for path in (branches.parameter, branches.second))
    if map_ is not None:
        _, x, y, values = map_
        figure.add_heatmap(
            x=wide * x, y=high * y, z=values, colorscale="Greys", opacity=0.6,
            colorbar={"title": {"text": "mean amplitude /<br>maximum without bodies"}},
            hovertemplate="%{x:.6g}, %{y:.4g}: %{z:.3f}<extra>runs</extra>",
        )  # fmt: skip
    shown = set[tuple[str, str]]()
    for number, border in enumerate(branches.borders):
        stable = border.stable_orbits.any(axis=1)
        for mask, what, dash in ((stable, "", "solid"), (~stable, ", unstable", "dash")):
            if not mask.any():
                continue
            drawn = mask | np.concatenate([[False], mask[:-1]])
            name = border.kind + what
            figure.add_scatter(
                x=np.where(drawn, wide * border.parameter, np.nan), y=np.where(drawn, high * border.second, np.nan),
                mode="lines", name=name, legendgroup=name, showlegend=(border.kind, what) not in shown,
                line={"color": _LINES[border.kind], "dash": dash, "width": 2.5}, customdata=_sides(border),
                hovertemplate=f"border {number}, {border.kind}<br>%{{x:.10g}}, %{{y:.8g}}<br>%{{customdata}}"
                "<extra></extra>",
            )  # fmt: skip
            shown.add((border.kind, what))
    _add_points(figure, branches, wide, high)
    figure.update_xaxes(title_text=axis_title(branches.parameter, across))
    figure.update_yaxes(title_text=axis_title(branches.second, up))
    return dressed(figure, height=620).update_layout(
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"}, margin_t=90
    )


def _add_points(figure: go.Figure, branches: Branches, wide: float, high: float) -> None:
    """Mark the named points, one symbol per kind."""
    points_of_kind: dict[str, list[tuple[BorderPoint, str]]] = {}
    for number, border in enumerate(branches.borders):
        for point in border.special:
            if point.kind not in _PLAIN:
                points_of_kind.setdefault(point.kind, []).append((point, f"border {number}, {border.kind}"))
    for rank, (kind, points) in enumerate(sorted(points_of_kind.items())):
        figure.add_scatter(
            x=[wide * point.parameter for point, _ in points], y=[high * point.second for point, _ in points],
            mode="markers", name=kind,
            marker={
                "symbol": _SYMBOLS[rank % len(_SYMBOLS)], "size": 11, "color": "#ffffff",
                "line": {"color": "#000000", "width": 2},
            },
            customdata=[f"{name}: {kind} {point.note}" for point, name in points],
            hovertemplate="%{customdata}<br>%{x:.10g}, %{y:.8g}<extra></extra>",
        )  # fmt: skip


def _sides(border: Border) -> list[str]:
    """Return the numbers of orbits on both sides of each point of a border, in words."""
    return [
        f"below {few} orbits, {fewer} stable; above {many} orbits, {more} stable"
        for (few, many), (fewer, more) in zip(border.orbits.tolist(), border.stable_orbits.tolist(), strict=True)
    ]


def map_of(branches: Branches, sweep: Sweep) -> Panel | None:
    """Return the relative mean amplitudes of a sweep over the two numbers of the borders of its scene; None without.

    Its other axes must be starts; the first start is used.
    """
    two, paths = (branches.parameter, branches.second), list(sweep.axes)
    other_paths = [path for path in paths if path not in two]
    if not set(two) <= set(paths) or not all(is_start(path) for path in other_paths):
        return None
    if min(len(sweep.axes[path]) for path in two) < 2:
        return None
    mine, shown = (
        system_of(scene, {branches.second: None}, branches.parameter) for scene in (branches.scene, sweep.scene)
    )
    if mine is None or mine != shown:
        return None
    return map_panels(sweep, two)[0]


def maps_of(branches: Branches, sweeps: Mapping[str, Sweep]) -> dict[str, Panel]:
    """Return the maps of `map_of` by the files of the sweeps that have one."""
    maps = {file: map_of(branches, sweep) for file, sweep in sweeps.items()}
    return {file: panel for file, panel in maps.items() if panel is not None}


def borders_table(branches: Branches) -> Table:
    """Return one row per point, borders counted from 0, in SI units."""
    rows, names = [], [name for name in branches.scalars if all(name in curve.quantities for curve in branches.borders)]
    for number, border in enumerate(branches.borders):
        columns = np.column_stack([border.parameter, border.second, *(border.quantities[name] for name in names)])
        sides = np.hstack([border.orbits, border.stable_orbits]).tolist()
        rows += [
            [number, border.kind, *values, *counts] for values, counts in zip(columns.tolist(), sides, strict=True)
        ]
    counts = ("orbits_below", "orbits_above", "stable_below", "stable_above")
    header = ["border", "kind", branches.parameter, branches.second, *names, *counts]
    return header, rows
