"""Sweeps from files, moved through by their axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dash import ALL, Dash, Input, Output, State, ctx, dcc, html, no_update

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.errors import VanedampError
from vanedamp.studies.explore import point
from vanedamp.studies.explore.curves import Submit
from vanedamp.studies.explore.sweep_chart import (
    abscissas,
    best_design,
    best_sentence,
    chosen_curve,
    curve_figure,
    scene_of_curve,
    start_places,
    status_sentence,
)
from vanedamp.studies.report.charts import GRAPH, axis_title
from vanedamp.studies.report.forced_response import quantity
from vanedamp.studies.report.results import collect, short_names

#: values of an axis whose slider has them all next to it
_MOST_MARKS = 8


def open_sweeps(paths: Sequence[str | Path]) -> dict[str, Sweep]:
    """Return the sweeps in files, and in all files of folders, by short names. Raises InputError, StoreError."""
    found = collect(paths).kinds["sweep"]
    names = short_names(found)
    return {names[file]: result.record for file, result in found.items()}


def panel(sweeps: Mapping[str, Sweep]) -> html.Div:
    """Return the part of the page that shows sweeps, by the names of their files; hidden without any."""
    names = list(sweeps)
    children = [
        html.H2("Sweeps from files"),
        html.Div(
            [
                html.Label("file", htmlFor="sweep-file"),
                html.Label("curve along", htmlFor="sweep-along"),
                dcc.Dropdown(names, names[0] if names else None, id="sweep-file", clearable=False),
                dcc.Dropdown([], id="sweep-along", clearable=False),
            ],
            className="choice",
        ),
        html.Div(id="sweep-axes"),
        html.P(id="sweep-best", role="status"),
        html.Button("Show the best design", id="sweep-to-best", type="button"),
        dcc.Graph(id="sweep-curve", config=GRAPH),
        html.P(id="sweep-status"),
        point.panel("sweep-"),
        dcc.Store(id="sweep-scene"),
        dcc.Store(id="sweep-sweep"),
    ]
    return html.Div(children, id="sweeps", style={} if names else {"display": "none"})


def register(app: Dash, sweeps: Mapping[str, Sweep], submit: Submit) -> None:
    """Follow the sliders over the axes of the sweeps; submit: runs a call in the page's worker processes."""
    point.register(app, submit, "sweep-")

    @app.callback(
        Output("sweep-along", "options"),
        Output("sweep-along", "value"),
        Output("sweep-best", "children"),
        Input("sweep-file", "value"),
    )
    def choose_file(name: Any) -> tuple[Any, ...]:
        sweep = sweeps.get(name)
        if sweep is None:
            return no_update, no_update, no_update
        axes = abscissas(sweep)
        return axes, axes[0], best_sentence(sweep, best_design(sweep))

    @app.callback(
        Output("sweep-axes", "children"),
        Input("sweep-along", "value"),
        State("sweep-file", "value"),
        State({"type": "sweep-axis", "path": ALL}, "value"),
        State({"type": "sweep-axis", "path": ALL}, "id"),
    )
    def choose_abscissa(along: Any, name: Any, values: list[Any], ids: list[Any]) -> Any:
        sweep = sweeps.get(name)
        if sweep is None or along not in sweep.axes:
            return no_update
        places = start_places(sweep) | places_of(sweep, values, ids)
        return [_control(sweep, path, places[path]) for path in sweep.axes if path != along]

    @app.callback(
        Output("sweep-curve", "figure"),
        Output("sweep-status", "children"),
        Output("sweep-scene", "data"),
        Output("sweep-sweep", "data"),
        Output("sweep-point-label", "children"),
        Output({"type": "sweep-value", "path": ALL}, "children"),
        Input({"type": "sweep-axis", "path": ALL}, "value"),
        Input("sweep-along", "value"),
        State({"type": "sweep-axis", "path": ALL}, "id"),
        State("sweep-file", "value"),
    )
    def draw(values: list[Any], along: Any, ids: list[Any], name: Any) -> tuple[Any, ...]:
        labelled = [output["id"]["path"] for output in ctx.outputs_list[5]]
        sweep = sweeps.get(name)
        places = {} if sweep is None else places_of(sweep, values, ids)
        others = set() if sweep is None else set(sweep.axes) - {along}
        if sweep is None or set(places) != others or not others.issuperset(labelled):
            return *[no_update] * 5, [no_update] * len(labelled)  # controls of another file are on their way
        shown = {path: _value(sweep, path, place) for path, place in places.items()}
        curve = chosen_curve(sweep, along, places)
        said = f"{curve.sentence}. {status_sentence(sweep, along, places)}"
        labels = [shown[path] for path in labelled]
        title = f"at {axis_title(along, sweep.units()[along])}"
        try:
            scene: tuple[Any, Any] = scene_of_curve(sweep, along, places)
        except VanedampError:  # of a point that is no scene, whose status says so
            scene = (None, None)
        return curve_figure(sweep, curve, places), " ".join([said, *_remarks(sweep)]), *scene, title, labels

    @app.callback(
        Output({"type": "sweep-axis", "path": ALL}, "value"),
        Input("sweep-to-best", "n_clicks"),
        State("sweep-file", "value"),
        State({"type": "sweep-axis", "path": ALL}, "id"),
        prevent_initial_call=True,
    )
    def go_to_best(_: Any, name: Any, ids: list[Any]) -> list[Any]:
        sweep = sweeps.get(name)
        if sweep is None:
            return [no_update] * len(ids)
        places = start_places(sweep)
        return [_at(sweep, each["path"], places[each["path"]]) if each["path"] in places else no_update for each in ids]


def places_of(sweep: Sweep, values: Sequence[Any], ids: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Return the places on the axes of a sweep that controls have; those that it does not have are left out."""
    places = {}
    for each, value in zip(ids, values, strict=True):
        path = each["path"]
        if path in sweep.axes and isinstance(value, int | float) and 0 <= value < len(sweep.axes[path]):
            places[path] = int(_rising(sweep, path)[int(value)])
    return places


def _rising(sweep: Sweep, path: str) -> np.ndarray:
    """Return the places on an axis in the order in which its control has them: numbers rise."""
    values = sweep.axes[path]
    return np.argsort(values, kind="stable") if values.dtype.kind in "if" else np.arange(len(values))


def _at(sweep: Sweep, path: str, place: int) -> int:
    """Return the value of an axis' control at a place."""
    return int(np.flatnonzero(_rising(sweep, path) == place)[0])


def _remarks(sweep: Sweep) -> list[str]:
    """Return the warnings to be read before results are used."""
    remarks = [f"Warning: {warning}." for warning in sweep.provenance.get("warnings", ())]
    if sweep.scene.continuation.direction != "independent":
        remarks.append("Runs of this sweep begin where their neighbours end; a motion at a point begins as the scene.")
    return remarks


def _value(sweep: Sweep, path: str, place: int) -> str:
    return quantity(sweep.axes[path].tolist()[place], sweep.units()[path])


def _control(sweep: Sweep, path: str, place: int) -> html.Div:
    """Return the control of an axis: a slider over its numbers, or a list of its words."""
    shown = [_value(sweep, path, at) for at in _rising(sweep, path).tolist()]
    name, value, last = {"type": "sweep-axis", "path": path}, _at(sweep, path, place), len(shown) - 1
    if sweep.axes[path].dtype.kind in "if":
        marked = range(len(shown)) if len(shown) <= _MOST_MARKS else (0, last)
        control: Any = dcc.Slider(
            0, last, 1, value=value, id=name, marks={k: shown[k] for k in marked}, included=False, disabled=not last,
            updatemode="drag", allow_direct_input=False,
        )  # fmt: skip
    else:
        control = dcc.Dropdown(
            [{"label": text, "value": k} for k, text in enumerate(shown)], value, id=name, clearable=False
        )
    title = [html.Span(f"{path} = "), html.Strong(shown[value], id={"type": "sweep-value", "path": path})]
    return html.Div([html.Label(title), control], className="axis")
