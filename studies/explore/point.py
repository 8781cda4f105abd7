"""The motion at a point of the curve, which a click or a frequency chooses, shown when a worker has run it."""

from __future__ import annotations

import base64
import time
import uuid
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Future
from dataclasses import dataclass
from typing import Any

import numpy as np
from dash import Dash, Input, Output, State, ctx, dcc, html, no_update

from vanedamp.files.errors import VanedampError
from vanedamp.studies.explore.point_view import PointView, point_view

#: runs that are kept for the tabs of the page, and ms between looks at them
_MOST_RUNS, _EVERY = 32, 200
_HIDDEN = {"display": "none"}
#: what a chart's bar of buttons has: nothing that sends data anywhere
GRAPH = {"displaylogo": False, "responsive": True, "modeBarButtons": [["toImage", "zoom2d", "pan2d", "resetScale2d"]]}


@dataclass(frozen=True, eq=False)
class _Run:
    """A run that was asked for: scene as data, frequency (Hz), its future, and when it began (s)."""

    data: Mapping[str, Any]
    frequency: float
    future: Future[PointView]
    begun: float


class PointRuns:
    """The runs of points, by keys that their tabs know."""

    def __init__(self, submit: Callable[..., Future[Any]]) -> None:
        self._submit = submit
        self._runs: OrderedDict[str, _Run] = OrderedDict()

    def begin(self, data: Mapping[str, Any], frequency: float, former: str | None = None) -> str:
        """Begin the run of a scene at a frequency, Hz, in place of a former one. Returns its key."""
        self.forget(former)
        key = uuid.uuid4().hex
        future = self._submit(point_view, data, frequency)
        self._runs[key] = _Run(data, frequency, future, time.monotonic())
        if len(self._runs) > _MOST_RUNS:
            self.forget(next(iter(self._runs)))
        return key

    def forget(self, key: str | None) -> None:
        """Give up a run, if it is known; one that a worker has begun with runs to its end."""
        run = self._runs.pop(key or "", None)
        if run is not None:
            run.future.cancel()

    def scene_of(self, key: str | None) -> Mapping[str, Any] | None:
        """Return the scene of a run as data; None of one that is not known."""
        run = self._runs.get(key or "")
        return None if run is None else run.data

    def look(self, key: str | None) -> PointView | str:
        """Return what a run shows, or a line on how long it has been at work; an unknown one has failed."""
        run = self._runs.get(key or "")
        if run is None:
            return PointView("This run is not known any more: choose the point again.")
        if not run.future.done():
            return f"{run.frequency:.6g} Hz: running for {time.monotonic() - run.begun:.0f} s …"
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


def panel() -> html.Div:
    """Return the part of the page that shows the motion at a point."""
    choice = [
        html.Label("at frequency, Hz ", htmlFor="point-frequency"),
        dcc.Input(id="point-frequency", type="number", min=0, step="any", debounce=True),
        html.Button("Show", id="point-show", type="button"),
        html.Button("◀ lower", id="point-lower", type="button", title="next lower frequency of the curve"),
        html.Button("higher ▶", id="point-higher", type="button", title="next higher frequency of the curve"),
    ]
    views = [
        dcc.Graph(id="point-history", config=GRAPH),
        html.H3("Phase planes"),
        dcc.Graph(id="point-phase", config=GRAPH),
        html.H3("Bodies in their cavities"),
        html.Iframe(
            id="point-motion", title="motion of the bodies in their cavities", sandbox="allow-scripts",
            style={"width": "100%", "height": "520px", "border": "0"},
        ),
    ]  # fmt: skip
    return html.Div(
        id="point",
        children=[
            html.H2("Motion at a point"),
            html.P("Click a point of the curve, or give a frequency.", className="note"),
            html.Div(choice, id="point-choice", className="row"),
            html.P(id="point-status", role="status", **{"aria-live": "polite"}),
            html.P(id="point-stale", className="note"),
            html.Div(views, id="point-views", style=_HIDDEN),
            dcc.Store(id="point-run"),
            dcc.Interval(id="point-clock", interval=_EVERY, disabled=True),
        ],
    )


def register(app: Dash, submit: Callable[..., Future[Any]]) -> None:
    """Take clicks on the curve and frequencies; submit: runs a call in the page's worker processes."""
    runs = PointRuns(submit)

    @app.callback(
        Output("point-run", "data"),
        Output("point-clock", "disabled"),
        Output("point-status", "children"),
        Output("point-frequency", "value"),
        Input("curve", "clickData"),
        Input("point-frequency", "value"),
        Input("point-show", "n_clicks"),
        Input("point-lower", "n_clicks"),
        Input("point-higher", "n_clicks"),
        State("curve", "figure"),
        State("scene", "data"),
        State("sweep", "data"),
        State("point-run", "data"),
        prevent_initial_call=True,
    )
    def begin(
        click: Any, given: Any, _show: Any, _lower: Any, _higher: Any, figure: Any, scene: Any, sweep: Any, former: Any
    ) -> tuple[Any, ...]:
        frequency = chosen_frequency(str(ctx.triggered_id), click, given, figure)
        if scene is None:
            return no_update, no_update, "There is no curve yet.", no_update
        if frequency is None:
            return no_update, no_update, "frequency: give a number above 0, in Hz", no_update
        key = runs.begin(scene | {"sweep": sweep or {}}, frequency, former)
        return key, False, f"{frequency:.6g} Hz: running …", frequency

    @app.callback(
        Output("point-history", "figure"),
        Output("point-phase", "figure"),
        Output("point-motion", "srcDoc"),
        Output("point-motion", "style"),
        Output("point-views", "style"),
        Output("point-status", "children", allow_duplicate=True),
        Output("point-clock", "disabled", allow_duplicate=True),
        Input("point-clock", "n_intervals"),
        State("point-run", "data"),
        State("point-motion", "style"),
        prevent_initial_call=True,
    )
    def look(_: Any, key: Any, frame: dict[str, Any]) -> tuple[Any, ...]:
        view = runs.look(key)
        if isinstance(view, str):
            return *[no_update] * 5, view, False
        if view.history is None:
            return *[no_update] * 4, _HIDDEN, view.summary, True
        shown = frame | {"display": "block" if view.motion else "none"}
        return view.history, view.phase, view.motion, shown, {}, view.summary, True

    @app.callback(
        Output("point-stale", "children"),
        Input("scene", "data"),
        Input("sweep", "data"),
        Input("point-run", "data"),
        prevent_initial_call=True,
    )
    def compare(scene: Any, sweep: Any, key: Any) -> str:
        former = runs.scene_of(key)
        same = former is None or scene is None or former == scene | {"sweep": sweep or {}}
        return "" if same else "The scene has changed since: Show runs it as it is now."


def chosen_frequency(trigger: str, click: Any, given: Any, figure: Any) -> float | None:
    """Return the frequency, Hz, that a user has chosen; None for nonsense.

    trigger: identifier of what was moved; click: plotly's data of a click; given: in the field; figure: the curve.
    """
    if trigger == "curve":
        points = (click or {}).get("points") or [{}]
        return _number(points[0].get("customdata"))
    frequency = _number(given)
    if trigger in ("point-lower", "point-higher"):
        known = frequencies_of(figure)
        if not len(known):
            return frequency
        if frequency is None:
            return float(known[len(known) // 2])
        if trigger == "point-lower":
            return float(max(known[known < frequency], default=known[0]))
        return float(min(known[known > frequency], default=known[-1]))
    return frequency


def frequencies_of(figure: Any) -> np.ndarray:
    """Return the frequencies of a curve's points, Hz, ascending, from plotly's data of its figure."""
    known: set[float] = set()
    for trace in (figure or {}).get("data", ()):
        values = trace.get("customdata")
        if isinstance(values, Mapping):  # an array as plotly packs it
            values = np.frombuffer(base64.b64decode(values["bdata"]), np.dtype(values["dtype"])).tolist()
        known |= {number for number in map(_number, values or ()) if number is not None}
    return np.array(sorted(known))


def _number(value: Any) -> float | None:
    value = value[0] if isinstance(value, list | tuple) and value else value
    return float(value) if isinstance(value, int | float) and value > 0.0 else None
