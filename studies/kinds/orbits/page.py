"""Branches of periodic orbits versus their parameter, with points of sweeps, Floquet multipliers and orbits."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from vanedamp.coupling.orbits.border import Border
from vanedamp.coupling.orbits.branch import Branch, Branches, SpecialPoint
from vanedamp.coupling.orbits.history import OrbitHistory, orbit_history
from vanedamp.coupling.orbits.orbits import map_along
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.errors import VanedampError
from vanedamp.studies.kinds.orbits.borders import borders_figure, borders_table, maps_of
from vanedamp.studies.kinds.orbits.motions import orbits_figure, orbits_table
from vanedamp.studies.report.charts import Table, axis_title, dressed
from vanedamp.studies.report.forced_response import for_people, quantity
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result
from vanedamp.studies.report.sweep_beside import sweeps_beside, system_of

ORDER = 80
#: orbits of a file that are drawn
_MOST_ORBITS = 6
_BIFURCATIONS = ("fold", "pitchfork", "period doubling", "neimark-sacker")
#: kinds of special points in the table; branches of bodies that stick have many changes of the sequence
_LISTED = (*_BIFURCATIONS, "grazing")
#: colours that the colour-blind tell apart (Okabe and Ito 2008), after black
_COLOURS = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
#: symbols of special points by their kind
_SYMBOLS = {
    "fold": "square", "pitchfork": "diamond", "period doubling": "triangle-up", "neimark-sacker": "circle",
    "grazing": "x-thin", "sequence": "cross-thin", "end": "line-ns",
}  # fmt: skip
_POINT = "#9ca3af"  # of a sweep
#: smaller moduli are drawn at this value
_SMALLEST = 1e-3


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return charts, branches and special points for every scene and parameter; several files may belong to one."""
    groups: dict[str, dict[str, Branches]] = {}
    for file, result in results.items():
        record = result.record
        system = system_of(record.scene, {}, record.parameter)
        groups.setdefault(json.dumps([record.parameter, system]), {})[file] = record
    return [_group(records, page) for records in groups.values()]


def figure(record: Branches) -> go.Figure:
    """Draw the borders of branches, or the branches."""
    return borders_figure(record) if record.borders else branches_figure(record)


def _group(records: Mapping[str, Branches], page: Page) -> dict[str, Any]:
    branches, files = joined(list(records.values())), list(records)
    beside = sweeps_beside(branches.scene, branches.parameter, page.results.kinds["sweep"])
    figure = branches_figure(branches, {page.names[file]: points for file, points in beside.items()})
    shown: dict[str, Any] = {"file": files[0], "record": branches, "units": unit_of(branches.parameter), "orbits": None}
    shown["quantities"] = _ranges(branches)
    shown["rows"] = [_row(branches, number) for number in range(len(branches.branches))]
    shown["chart"] = page.chart("branches", figure, *_branches_table(branches), [*files, *beside])
    shown["multipliers"] = page.chart(
        "multipliers", _multipliers_figure(branches), *_multipliers_table(branches), files
    )
    tracked = {record.second: record for record in records.values() if record.borders}
    shown["borders"] = [
        _borders(replace(record, borders=joined_borders(list(records.values()), second)), page, files)
        for second, record in tracked.items()
    ]
    named, shown["missing"] = _histories(branches)
    if named:
        shown["orbits"] = page.chart("orbits", orbits_figure(named), *orbits_table(named), files)
    return shown


def _borders(branches: Branches, page: Page, files: list[str]) -> dict[str, Any]:
    """Return the chart of borders over the first sweep with the same two axes."""
    sweeps = {file: result.record for file, result in page.results.kinds["sweep"].items()}
    maps = maps_of(branches, sweeps)
    figure = borders_figure(branches, next(iter(maps.values()), None))
    return {
        "record": branches, "units": unit_of(branches.second),
        "chart": page.chart("borders", figure, *borders_table(branches), [*files, *list(maps)[:1]]),
    }  # fmt: skip


def _row(branches: Branches, number: int) -> dict[str, Any]:
    """Return a branch with its name, where it comes from, and its special points with their amplitudes."""
    branch = branches.branches[number]
    special = [(point, amplitude_at(branches, branch, point)) for point in branch.special if point.kind in _LISTED]
    source = ""
    if branch.source is not None:
        parent, index = branch.source
        source = f"{branches.branches[parent].special[index].kind} on branch {parent}"
    return {"name": branch_name(number, branch), "branch": branch, "special": special, "source": source}


def _ranges(branches: Branches) -> dict[str, list[str]]:
    """Return the description and the range on every branch of each scalar quantity, as text."""
    ranges = {}
    for name, entry in branches.scalars.items():
        ends = [(np.fmin.reduce(values), np.fmax.reduce(values)) for branch in branches.branches
                for values in [branch.quantities.get(name, np.full(1, np.nan))]]  # fmt: skip
        if np.isfinite(ends).any():
            words = [" to ".join(dict.fromkeys(quantity(float(end), entry.unit) for end in limits)) for limits in ends]
            ranges[name.replace("_", " ")] = [entry.about, *words]
    return ranges


def _histories(branches: Branches) -> tuple[dict[str, OrbitHistory], str]:
    """Return the motion along chosen orbits by their names, or the reason for none, such as a missing reduced model."""
    chosen = list(itertools.islice(_chosen(branches), _MOST_ORBITS))
    try:
        along = map_along(branches.scene)
        return {name: orbit_history(along.over(periods).at(at), state) for name, periods, at, state in chosen}, ""
    except VanedampError as error:
        return {}, str(error)


def _chosen(branches: Branches) -> Iterator[tuple[str, int, float, np.ndarray]]:
    """Yield name, periods, parameter and state of the largest stable orbit of every branch, and of its bifurcations."""
    for number, branch in enumerate(branches.branches):
        picks = []
        if branch.stable.any():
            largest = int(np.argmax(np.where(branch.stable, branch.amplitude_mean, -np.inf)))
            picks.append(("largest stable", float(branch.parameter[largest]), branch.state[largest]))
        picks += [(point.kind, point.parameter, point.state) for point in branch.special if point.kind in _BIFURCATIONS]
        for kind, parameter, state in picks:
            value = quantity(parameter, unit_of(branches.parameter))
            yield f"{branch_name(number, branch)}, {kind}, {value}", branch.periods, parameter, state


def branches_figure(
    branches: Branches, sweeps: Mapping[str, tuple[np.ndarray, np.ndarray]] = MappingProxyType({})
) -> go.Figure:
    """Draw amplitudes and impacts along the branches over points of sweeps, by name: parameter and mean amplitude."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.05, row_heights=[0.72, 0.28])
    wide, units = for_people(unit_of(branches.parameter))
    for name, (x, amplitude) in sweeps.items():
        figure.add_scatter(
            x=wide * x, y=1e6 * amplitude, name=f"runs of {name}", mode="markers", row=1, col=1,
            marker={"color": _POINT, "size": 6, "symbol": "circle-open"},
            hovertemplate="run, %{x:.8g}: %{y:.5g} µm<extra></extra>",
        )  # fmt: skip
    for number, branch in enumerate(branches.branches):
        name, look = branch_name(number, branch), {"color": _COLOURS[number % len(_COLOURS)]}
        unstable = ~(branch.stable | branch.undetermined)
        for mask, kind, dash, width in (
            (branch.stable, "stable", "solid", 2.2), (unstable, "unstable", "dash", 1.6),
            (branch.undetermined, "stability undetermined", "dot", 1.6),
        ):  # fmt: skip
            drawn = _drawn(mask)
            if not mask.any():
                continue
            x = np.where(drawn, wide * branch.parameter, np.nan)
            below = [(2, named, values, "%{y:.6g}") for named, values in _below(branches, branch).items()]
            for row, named, values, shown in ((1, "", 1e6 * branch.amplitude_mean, "%{y:.6g} µm"), *below):
                figure.add_scatter(
                    x=x, y=np.where(drawn, values, np.nan), mode="lines", meta=named or None,
                    visible=named in ("", *list(_shown(branches))[:1]),
                    name=f"{name}, {kind}", legendgroup=name, showlegend=row == 1, row=row, col=1,
                    line=look | {"dash": dash, "width": width},
                    hovertemplate=f"{name}, {kind}, %{{x:.10g}}: {shown}<extra></extra>",
                )  # fmt: skip
    _add_special_points(figure, branches, wide)
    figure.update_yaxes(title_text="mean of peaks, µm", row=1, col=1)
    figure.update_xaxes(title_text=axis_title(branches.parameter, units), row=2, col=1)
    _add_menu(figure, branches)
    return dressed(figure, height=720)


def _shown(branches: Branches) -> dict[str, str]:
    """Return the axis titles of quantities that the lower chart can show, by name; impacts first."""
    spreads = {name: entry for name, entry in branches.scalars.items() if entry.spread}
    order = sorted(spreads, key=lambda name: spreads[name].family != "impacts")
    return {name: axis_title(name, for_people(spreads[name].unit)[1]) for name in order}


def _below(branches: Branches, branch: Branch) -> dict[str, np.ndarray]:
    """Return the values of these quantities on a branch, in displayed units."""
    return {
        name: for_people(branches.scalars[name].unit)[0] * branch.quantities[name]
        for name in _shown(branches) if name in branch.quantities
    }  # fmt: skip


def _add_menu(figure: go.Figure, branches: Branches) -> None:
    """Add a menu for the quantity in the lower chart."""
    shown, traces = _shown(branches), [index for index, trace in enumerate(figure.data) if trace.meta]
    figure.update_yaxes(title_text=next(iter(shown.values()), ""), row=2, col=1)
    buttons = [
        {
            "label": name.replace("_", " "), "method": "update",
            "args": [
                {"visible": [figure.data[index].meta == name for index in traces]}, {"yaxis2.title.text": title}, traces
            ],
        }
        for name, title in shown.items()
    ]  # fmt: skip
    position = {"x": 0.0, "xanchor": "left", "y": 0.26, "yanchor": "bottom", "pad": {"b": 4}}
    if len(buttons) > 1:
        figure.update_layout(updatemenus=[{"buttons": buttons} | position])


def joined(records: Sequence[Branches]) -> Branches:
    """Return the branches of several files of one scene and parameter as one record, numbered consecutively."""
    branches: list[Branch] = []
    for record in records:
        first = len(branches)
        for branch in record.branches:
            source = -1 if branch.source is None else branch.source_branch + first
            branches.append(replace(branch, source_branch=source))
    warnings = dict.fromkeys(warning for record in records for warning in record.warnings)
    return replace(records[0], branches=tuple(branches), warnings=tuple(warnings))


def joined_borders(records: Sequence[Branches], second: str) -> tuple[Border, ...]:
    """Return the borders over a second number of several files, their branches numbered as in `joined`."""
    borders, first = list[Border](), 0
    for record in records:
        for border in record.borders if record.second == second else ():
            borders.append(replace(border, source=(border.source[0] + first, border.source[1])))
        first += len(record.branches)
    return tuple(borders)


def branch_name(number: int, branch: Branch) -> str:
    """Return the name of a branch, counted from 0, with the periods that its orbits take."""
    return f"branch {number}" if branch.periods == 1 else f"branch {number}, {branch.periods} periods"


def _drawn(mask: np.ndarray) -> np.ndarray:
    """Return the masked points and those just after them: a line continues to the first point of the next one."""
    return mask | np.concatenate([[False], mask[:-1]])


def amplitude_at(branches: Branches, branch: Branch, point: SpecialPoint) -> float:
    """Return the mean amplitude at a special point, m: between its neighbours, by the distances of their states."""
    near = [index for index in (point.index, point.index + 1) if index < len(branch.parameter)]
    distance = np.linalg.norm((branch.state[near] - point.state) / branches.scale, axis=1)
    weight = distance[::-1] if distance.sum() > 0 else np.ones(len(near))
    return float(np.average(branch.amplitude_mean[near], weights=weight))


def _add_special_points(figure: go.Figure, branches: Branches, wide: float) -> None:
    for kind, symbol in _SYMBOLS.items():
        points = [
            (point, amplitude_at(branches, branch, point), f"{kind} on {branch_name(number, branch)}")
            for number, branch in enumerate(branches.branches)
            for point in branch.special
            if point.kind == kind
        ]
        if points:
            figure.add_scatter(
                x=[wide * point.parameter for point, _, _ in points], y=[1e6 * amplitude for _, amplitude, _ in points],
                name=kind, mode="markers", row=1, col=1, visible=True if kind != "sequence" else "legendonly",
                customdata=[f"{name}: {point.note}".removesuffix(": ") for point, _, name in points],
                marker={"symbol": symbol, "size": 11, "color": "#ffffff", "line": {"color": "#000000", "width": 2}},
                hovertemplate="%{customdata}<br>%{x:.12g}: %{y:.6g} µm<extra></extra>",
            )  # fmt: skip


def _branches_table(branches: Branches) -> Table:
    """Return one row per point, branches counted from 0, in SI units."""
    names = list(branches.scalars)
    rows = []
    for number, branch in enumerate(branches.branches):
        unknown = np.full(len(branch.parameter), np.nan)
        columns = (branch.parameter, *(branch.quantities.get(name, unknown) for name in names))
        largest = np.abs(branch.multipliers).max(axis=1, initial=0.0)
        flags = zip(branch.stable.tolist(), branch.undetermined.tolist(), strict=True)
        for values, states in zip(np.column_stack([*columns, largest]).tolist(), flags, strict=True):
            rows.append([number, branch.periods, *values, *states])
    last = ("largest_multiplier", "stable", "undetermined")
    return ["branch", "periods", branches.parameter, *names, *last], rows


def _multipliers_figure(branches: Branches) -> go.Figure:
    """Draw the multipliers in the complex plane with the unit circle, and their moduli over the parameter.

    Outside the unit circle, the distance from it is the decimal logarithm of the modulus, so that all are visible.
    """
    figure = make_subplots(rows=1, cols=2, column_widths=[0.46, 0.54], horizontal_spacing=0.14)
    wide, units = for_people(unit_of(branches.parameter))
    angle = np.linspace(0.0, 2 * np.pi, 181)
    figure.add_scatter(
        x=np.cos(angle), y=np.sin(angle), mode="lines", line={"color": "#334155", "width": 1}, hoverinfo="skip",
        showlegend=False, row=1, col=1,
    )  # fmt: skip
    figure.add_hline(y=1.0, line={"color": "#334155", "width": 1}, row=1, col=2)
    for number, branch in enumerate(branches.branches):
        name, look = branch_name(number, branch), {"color": _COLOURS[number % len(_COLOURS)]}
        parameter = np.repeat(wide * branch.parameter, branch.multipliers.shape[1])
        values = branch.multipliers.ravel()
        size = np.maximum(np.abs(values), _SMALLEST)
        drawn = values / np.maximum(size, 1.0) * (1.0 + np.log10(np.maximum(size, 1.0)))
        shared: dict[str, Any] = {"mode": "markers", "name": name, "legendgroup": name}
        figure.add_scatter(
            x=drawn.real, y=drawn.imag, customdata=np.column_stack([parameter, values.real, values.imag]), row=1, col=1,
            showlegend=False,
            marker={"size": 5, "color": parameter, "coloraxis": "coloraxis", "symbol": number}, **shared,
            hovertemplate=f"{name}, %{{customdata[0]:.8g}}: "
            "%{customdata[1]:.5g} + %{customdata[2]:.5g} i<extra></extra>",
        )  # fmt: skip
        figure.add_scatter(
            x=parameter, y=size, customdata=np.abs(values), row=1, col=2, marker=look | {"size": 4}, **shared,
            hovertemplate=f"{name}, %{{x:.8g}}: %{{customdata:.6g}}<extra></extra>",
        )  # fmt: skip
    decades = int(np.ceil(_beyond(np.concatenate([branch.multipliers.ravel() for branch in branches.branches]))))
    for decade in range(1, decades + 1):
        figure.add_scatter(
            x=(1 + decade) * np.cos(angle), y=(1 + decade) * np.sin(angle), mode="lines", hoverinfo="skip",
            line={"color": "#94a3b8", "width": 1, "dash": "dot"}, showlegend=False, row=1, col=1,
        )  # fmt: skip
        figure.add_annotation(x=0, y=1 + decade, text=f"{10**decade:g}", showarrow=False, row=1, col=1)
    reach = 1.2 + decades
    ticks = {"tickvals": [-1, 0, 1], "range": [-reach, reach]}
    figure.update_xaxes(title_text="real part", row=1, col=1, **ticks)
    figure.update_yaxes(title_text="imaginary part", scaleanchor="x", row=1, col=1, **ticks)
    figure.update_xaxes(title_text=axis_title(branches.parameter, units), row=1, col=2)
    figure.update_yaxes(title_text="modulus", type="log", range=[np.log10(_SMALLEST), max(decades, 1)], row=1, col=2)
    bar = {"title": {"text": axis_title(branches.parameter, units), "side": "top"}, "orientation": "h", "y": -0.2}
    figure.update_layout(
        coloraxis={"colorscale": "Viridis", "colorbar": bar | {"x": 0.2, "len": 0.4, "yanchor": "top"}}
    )
    legend = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0}
    return dressed(figure, height=560).update_layout(legend=legend)


def _beyond(values: np.ndarray) -> float:
    """Return the decades by which the largest multiplier lies outside the unit circle."""
    return float(np.log10(np.abs(values[np.isfinite(values)]).max(initial=1.0)))


def _multipliers_table(branches: Branches) -> Table:
    """Return one row per multiplier."""
    return ["branch", branches.parameter, "real", "imaginary"], [
        [number, parameter, value.real, value.imag]
        for number, branch in enumerate(branches.branches)
        for parameter, values in zip(branch.parameter.tolist(), branch.multipliers, strict=True)
        for value in values.tolist()
    ]
