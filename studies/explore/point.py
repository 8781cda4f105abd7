"""The motion at a point of the curve, which a click or a frequency chooses, shown when a worker has run it."""

from __future__ import annotations

import base64
import math
import time
import uuid
from collections import OrderedDict
from collections.abc import Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from dash import ClientsideFunction, Dash, Input, Output, State, ctx, dcc, html, no_update

from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.errors import VanedampError
from vanedamp.studies.explore.curves import Submit
from vanedamp.studies.explore.point_view import PointView, axis_of, point_view
from vanedamp.studies.report.charts import GRAPH
from vanedamp.studies.report.forced_response import setting

#: runs that are kept for the tabs of the page, and ms between checks of them
_MOST_RUNS, _EVERY = 32, 200
_HIDDEN = {"display": "none"}


@dataclass(frozen=True, eq=False)
class _Run:
    """A run that was asked for: scene as data, its point in words, its future, and when it began (s)."""

    data: Mapping[str, Any]
    point: str
    future: Future[PointView]
    begun: float


class PointRuns:
    """The runs of points, by keys that their tabs know."""

    def __init__(self, submit: Submit) -> None:
        self._submit = submit
        self._runs: OrderedDict[str, _Run] = OrderedDict()

    def begin(self, data: Mapping[str, Any], value: float, former: str | None = None) -> str:
        """Begin the run of a scene at a value on the axis of its curve, in place of a former run. Returns its key."""
        self.forget(former)
        key, path = uuid.uuid4().hex, axis_of(data)
        future = self._submit(point_view, data, value)
        self._runs[key] = _Run(data, setting(path, value, unit_of(path)), future, time.monotonic())
        if len(self._runs) > _MOST_RUNS:
            self.forget(next(iter(self._runs)))
        return key

    def forget(self, key: str | None) -> None:
        """Give up a run, if it is known; one that a worker has begun with runs to its end."""
        run = self._runs.pop(key or "", None)
        if run is not None:
            run.future.cancel()

    def look(self, key: str | None) -> PointView | str:
        """Return the view of a run, or a line on how long it has been at work; an unknown one has failed."""
        run = self._runs.get(key or "")
        if run is None:
            return PointView("This run is not known any more: choose the point again.")
        if not run.future.done():
            what = "running" if run.future.running() else "waiting for a worker"
            return f"{run.point}: {what} for {time.monotonic() - run.begun:.0f} s …"
        try:
            return run.future.result()
        except VanedampError as error:
            return PointView(" ".join(str(error).split()))
        except (BrokenExecutor, CancelledError):
            return PointView(
                "The worker process of this run ended abruptly (killed, or out of memory): choose it again."
            )
        except Exception as error:  # a line of text in the page, whatever it is
            return PointView(" ".join(f"The run failed: {type(error).__name__}: {error}".split()))


def panel(of: str = "") -> html.Div:
    """Return the part of the page that shows the motion at a point; of: with what its identifiers begin."""
    name = f"{of}point"
    choice = [
        html.Label("at excitation frequency, Hz", id=f"{name}-label", htmlFor=f"{name}-value"),
        dcc.Input(id=f"{name}-value", type="number", step="any", debounce=True, className="point-value"),
        html.Button("Show", id=f"{name}-show", type="button"),
        html.Button("◀ lower", id=f"{name}-lower", type="button", title="next lower point of the curve"),
        html.Button("higher ▶", id=f"{name}-higher", type="button", title="next higher point of the curve"),
    ]
    views = [
        html.Details([html.Summary("All quantities"), html.Dl(id=f"{name}-quantities")]),
        dcc.Graph(id=f"{name}-history", config=GRAPH),
        html.H3("Phase planes"),
        dcc.Graph(id=f"{name}-phase", config=GRAPH),
        html.H3("Bodies in their cavities"),
        html.Iframe(
            id=f"{name}-motion", title="motion of the bodies in their cavities", sandbox="allow-scripts",
            style={"width": "100%", "height": "520px", "border": "0"},
        ),
    ]  # fmt: skip
    return html.Div(
        id=name,
        children=[
            html.H2("Motion at a point"),
            html.P("Click a point of the curve, or give its value."),
            html.Div(choice, className="row"),
            html.P(id=f"{name}-status", role="status"),
            html.P(id=f"{name}-stale"),
            html.Div(views, id=f"{name}-views", style=_HIDDEN),
            dcc.Store(id=f"{name}-run"),
            dcc.Store(id=f"{name}-shown"),
            dcc.Store(id=f"{name}-asked"),
            dcc.Interval(id=f"{name}-clock", interval=_EVERY, disabled=True),
        ],
    )


def register(app: Dash, submit: Submit, of: str = "") -> None:
    """Take points of a curve; submit: runs a call in the page's worker processes.

    Further parts of the page: the graph `curve`, whose points carry their value (SI) on its axis as customdata, and the
    stores `scene` and `sweep`, data of the scene and of the [sweep] over this axis; `of` stands before all identifiers.
    """
    runs, name = PointRuns(submit), f"{of}point"

    @app.callback(
        Output(f"{name}-run", "data"),
        Output(f"{name}-status", "children"),
        Output(f"{name}-value", "value"),
        Output(f"{name}-asked", "data"),
        Input(f"{of}curve", "clickData"),
        Input(f"{name}-value", "value"),
        Input(f"{name}-show", "n_clicks"),
        Input(f"{name}-lower", "n_clicks"),
        Input(f"{name}-higher", "n_clicks"),
        State(f"{of}curve", "figure"),
        State(f"{of}scene", "data"),
        State(f"{of}sweep", "data"),
        State(f"{name}-run", "data"),
        prevent_initial_call=True,
    )
    def begin(
        click: Any, given: Any, _show: Any, _lower: Any, _higher: Any, figure: Any, scene: Any, sweep: Any, former: Any
    ) -> tuple[Any, ...]:
        trigger = str(ctx.triggered_id).removeprefix(of)
        value = chosen_value(trigger, click, given, figure)
        if scene is None:
            return no_update, "There is no curve yet.", no_update, no_update
        if value is None:
            wanted = "click a point of the damped curve" if trigger == "curve" else "give a number, in SI units"
            return no_update, f"No point: {wanted}.", no_update, no_update
        key = runs.begin(scene | {"sweep": sweep}, value, former)
        return key, "running …", value, {"scene": scene, "sweep": sweep}

    @app.callback(
        Output(f"{name}-quantities", "children"),
        Output(f"{name}-history", "figure"),
        Output(f"{name}-phase", "figure"),
        Output(f"{name}-motion", "srcDoc"),
        Output(f"{name}-motion", "style"),
        Output(f"{name}-views", "style"),
        Output(f"{name}-status", "children", allow_duplicate=True),
        Output(f"{name}-shown", "data"),
        Input(f"{name}-clock", "n_intervals"),
        State(f"{name}-run", "data"),
        State(f"{name}-motion", "style"),
        prevent_initial_call=True,
    )
    def look(_: Any, key: Any, frame: dict[str, Any]) -> tuple[Any, ...]:
        view = runs.look(key)
        if isinstance(view, str):
            return *[no_update] * 6, view, no_update
        if view.history is None:
            return *[no_update] * 5, _HIDDEN, view.summary, key
        shown = frame | {"display": "block" if view.motion else "none"}
        told = [part for one, text in view.quantities.items() for part in (html.Dt(one), html.Dd(text))]
        return told, view.history, view.phase, view.motion, shown, {}, view.summary, key

    app.clientside_callback(  # an answer that is late is of a run before: the clock goes on until the last run is shown
        ClientsideFunction("explore", "seen"),
        Output(f"{name}-clock", "disabled"),
        Input(f"{name}-run", "data"),
        Input(f"{name}-shown", "data"),
    )

    app.clientside_callback(  # in the browser: it is asked whenever the curve moves
        ClientsideFunction("explore", "stale"),
        Output(f"{name}-stale", "children"),
        Input(f"{of}scene", "data"),
        Input(f"{of}sweep", "data"),
        Input(f"{name}-asked", "data"),
    )


def chosen_value(trigger: str, click: Any, given: Any, figure: Any) -> float | None:
    """Return the value on the axis of a curve that a user has chosen; None for nonsense.

    trigger: identifier of the moved control; click: plotly's data of a click; given: in the field; figure: the curve.
    """
    if trigger == "curve":
        points = (click or {}).get("points") or [{}]
        return _number(points[0].get("customdata"))
    value = _number(given)
    if trigger in ("point-lower", "point-higher"):
        known = values_of(figure)
        if not len(known):
            return value
        if value is None:
            return float(known[len(known) // 2])
        if trigger == "point-lower":
            return float(max(known[known < value], default=known[0]))
        return float(min(known[known > value], default=known[-1]))
    return value


def values_of(figure: Any) -> np.ndarray:
    """Return the values on its axis that the points of a curve carry, ascending, from plotly's data of its figure."""
    known: set[float] = set()
    for trace in (figure or {}).get("data", ()):
        values = trace.get("customdata")
        if isinstance(values, Mapping):  # an array as plotly packs it
            values = np.frombuffer(base64.b64decode(values["bdata"]), np.dtype(values["dtype"])).tolist()
        known |= {number for number in map(_number, values or ()) if number is not None}
    return np.array(sorted(known))


def _number(value: Any) -> float | None:
    value = value[0] if isinstance(value, list | tuple) and value else value
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
