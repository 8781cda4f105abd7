"""The page: its parts, and their callbacks."""

from __future__ import annotations

import copy
import math
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from dash import ClientsideFunction, Dash, Input, Output, State, dcc, html, no_update
from dash.exceptions import PreventUpdate

from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.files.errors import VanedampError
from vanedamp.files.toml_input import validate
from vanedamp.files.toml_output import commented, write_commented
from vanedamp.studies.explore import point
from vanedamp.studies.explore.chart import key_figures, remarks, response_figure
from vanedamp.studies.explore.controls import Control, controls_of, moved, number_in
from vanedamp.studies.explore.curves import EVALUATED, Band, Curve, Curves, Submit, ends_of, explorable, seen
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.numbers import check_number
from vanedamp.studies.report.charts import GRAPH
from vanedamp.studies.report.forced_response import forced_responses

#: steps of a slider, and the longest that a request waits for the next form of a curve, s
_STEPS, _PATIENCE = 200, 0.5
#: said while there is no point of a curve yet
_FIRST = "computing; the first time that it runs, the engine is compiled, which takes a minute or two"


@dataclass(frozen=True)
class Exploration:
    """A scene to explore: its source, what moves in it, the texts of its band's fields, the file it is written to."""

    scene: Scene
    source: str
    controls: list[Control]
    band: Mapping[str, str]
    output: Path | None = None

    @classmethod
    def of(cls, scene: Scene, source: str, output: Path | None = None, wanted: Sequence[str] = ()) -> Exploration:
        """Return the exploration of a scene, also of the numbers at wanted paths.

        Raises InputError where no curve can be drawn, and for a path that is no number of the scene.
        """
        plain = explorable(scene)
        for path in wanted:
            check_number(plain, path, (), "--vary")
        low, high = ("" if end is None else f"{end:.12g}" for end in ends_of(scene))
        exploration = cls(
            plain, source, controls_of(plain, wanted), {"low": low, "high": high, "evaluated": str(EVALUATED)}, output
        )
        exploration.seen(exploration.texts)
        return exploration

    @property
    def texts(self) -> dict[str, str]:
        """The texts of all fields, by their names, as the page begins."""
        return {control.name: control.text for control in self.controls} | dict(self.band)

    def seen(self, texts: Mapping[str, str]) -> Scene:
        """Return the scene that the texts of the fields ask for, with its [sweep]. Raises InputError."""
        return seen(moved(self.scene, self.controls, texts), _band(texts))


def _band(texts: Mapping[str, str]) -> Band:
    """Return the band in its fields; a frequency that is left out is found. Raises InputError."""
    low, high = (
        number_in(texts[name], label, "Hz") if texts[name].strip() else None
        for name, label in (("low", "frequencies from"), ("high", "frequencies to"))
    )
    return Band(low, high, int(number_in(texts["evaluated"], "periods evaluated", whole=True)))


def layout(exploration: Exploration) -> html.Main:
    """Return a page of its own: each tab of the browser has one."""
    source, output = exploration.source, exploration.output
    place = f" and as {output}" if output else ""
    names = list(exploration.texts)
    return html.Main(
        [
            dcc.Store(id="tab", data=uuid.uuid4().hex), dcc.Store(id="names", data=names),
            dcc.Store(id="wanted"), dcc.Store(id="request"), dcc.Store(id="answer"),
            dcc.Store(id="scene"), dcc.Store(id="sweep"),
            dcc.Interval(id="clock", interval=3000), dcc.Download(id="file"),
            html.Section(
                [
                    html.H2(source),
                    *(_control(control) for control in exploration.controls),
                    html.Div(
                        [
                            "frequencies", _field("low", "lowest frequency, Hz", exploration.band["low"], "auto"),
                            "to", _field("high", "highest frequency, Hz", exploration.band["high"], "auto"), "Hz",
                        ],
                        className="row",
                    ),
                    html.Div(
                        [
                            "periods evaluated",
                            _field("evaluated", "periods evaluated", exploration.band["evaluated"], ""),
                        ],
                        className="row",
                    ),
                    html.Div(
                        [
                            html.Button("write scene", id="write", title=f"save the TOML file of what is seen{place}"),
                            html.Span(id="written", role="status"),
                        ],
                        className="row",
                    ),
                ],
                **_named("controls"),
            ),
            html.Section(
                [
                    html.Div(
                        dcc.Graph(
                            id="curve", figure={"layout": {"height": 480}}, config=GRAPH
                        ),
                        id="frame",
                    ),
                    html.P("computing", id="message", className="message", role="status"),
                    html.Div(id="figures"),
                ],
                **_named("forced response"),
            ),
            html.Section(point.panel(), className="wide", **_named("motion at a point")),
        ]
    )  # fmt: skip


def register(app: Dash, exploration: Exploration, submit: Submit, apart: Submit) -> None:
    """Let the sliders move the curve; submit: runs a call in a worker process, apart: in one that waits for points."""
    curves = Curves(submit)
    for control in exploration.controls:
        app.clientside_callback(
            ClientsideFunction("explore", "agree"),
            Output(f"slider-{control.name}", "value"), Output(f"number-{control.name}", "value"),
            Input(f"slider-{control.name}", "value"), Input(f"number-{control.name}", "value"),
            State(f"control-{control.name}", "data"), prevent_initial_call=True,
        )  # fmt: skip
    app.clientside_callback(
        ClientsideFunction("explore", "gather"),
        Output("wanted", "data"), *(Input(f"number-{name}", "value") for name in exploration.texts),
        State("names", "data"),
    )  # fmt: skip
    app.clientside_callback(
        ClientsideFunction("explore", "pump"),
        Input("wanted", "data"), Input("answer", "data"), Input("clock", "n_intervals"), State("tab", "data"),
    )  # fmt: skip

    @app.callback(
        Output("answer", "data"), Output("curve", "figure"), Output("figures", "children"),
        Output("scene", "data"), Output("sweep", "data"),
        Output("message", "children"), Output("message", "className"), Output("frame", "className"),
        Input("request", "data"), prevent_initial_call=True,
    )  # fmt: skip
    def draw(request: dict[str, Any]) -> Changes:
        return changes(exploration, curves, request)

    @app.callback(
        Output("file", "data"), Output("written", "children"),
        Input("write", "n_clicks"), State("scene", "data"), State("sweep", "data"), prevent_initial_call=True,
    )  # fmt: skip
    def write(_clicks: int, scene: dict[str, Any] | None, sweep: dict[str, Any]) -> tuple[Any, ...]:
        if scene is None:
            return no_update, "no curve yet"
        return _write(exploration, validate(Scene, scene | {"sweep": sweep}, "scene"))

    point.register(app, apart)


class Changes(NamedTuple):
    """Changes of the page by a request: the properties of its parts, in the order of the callback's outputs."""

    answer: dict[str, Any]
    figure: Any = no_update
    figures: Any = no_update
    scene: Any = no_update
    sweep: Any = no_update
    message: Any = no_update
    tone: Any = no_update
    frame: Any = no_update


def changes(exploration: Exploration, curves: Curves, request: dict[str, Any]) -> Changes:
    """Return what changes for a request: {tab, serial, version, values, have}, the last the points that it has.

    Waits a little for more of its curve. Raises PreventUpdate for a request that is overtaken.
    """
    have, version = request["have"], request["version"]
    answer = {"serial": request["serial"], "version": version, "have": 0, "complete": True}
    try:
        curve = curves.take(request["tab"], version, lambda: exploration.seen(request["values"]))
    except VanedampError as error:
        return Changes(answer, message=str(error), tone="message bad", frame="old")
    if curve is None:
        raise PreventUpdate
    curve.wait(curve.coarse if have < curve.coarse else curve.size, _PATIENCE)
    if not curve.wanted:
        raise PreventUpdate
    answer |= {"have": curve.done, "complete": curve.done == curve.size}
    if curve.done == have > 0:
        return Changes(answer)
    figure, figures, text = _drawn(curve, version)
    drawn = Changes(answer, figure, figures, message=text, tone="message", frame="")
    if have:  # further forms of a curve are of the same scene
        return drawn
    data = curve.scene.to_dict()
    return drawn._replace(scene=data | {"sweep": {}}, sweep=data["sweep"])


def _drawn(curve: Curve, version: int) -> tuple[dict[str, Any], html.Div, str]:
    """Return figure, key results and a line on the progress of a curve."""
    sweep = curve.sweep()
    (response,) = forced_responses(sweep)
    count, complete = len(sweep.status), len(sweep.status) == curve.size
    notes = [*([curve.note] if curve.note else []), *remarks(sweep, response, complete)]
    rows = [
        part(text, className="" if complete or figure.closed else "unfinished")
        for figure in key_figures(response, curve.onset)
        for part, text in ((html.Dt, figure.name), (html.Dd, figure.value))
    ]
    figures = html.Div(
        [
            html.Dl(rows),
            html.Ul([html.Li(note) for note in notes], className="remarks"),
        ]
    )
    text = f"{count} frequencies" if complete else f"{count} of {curve.size} frequencies so far" if count else _FIRST
    marks = {"version": version, "points": count, "complete": complete}
    return response_figure(sweep, response, curve.linear, marks), figures, text


def _write(exploration: Exploration, scene: Scene) -> tuple[Any, str]:
    """Return the file for the browser, and what to say; writes the file of the command line, too."""
    said, data = "saved by the browser", short_form(scene)
    if exploration.output is not None:
        replaced = ", in place of the file that was there" if exploration.output.exists() else ""
        try:
            named = relative(copy.deepcopy(data), exploration.output)
            write_commented(exploration.output, named, KINDS["scene"])
            said = f"{exploration.output} written{replaced}; {said}"
        except (OSError, VanedampError) as error:
            said = f"{exploration.output} cannot be written ({error}); {said}"
    text = commented(relative(data, None), KINDS["scene"].schema, "scene")
    return {"content": text, "filename": "scene.toml", "type": "application/toml"}, said


def _control(control: Control) -> html.Div:
    """Return slider and field of a control."""
    name, unit = control.name, f", {control.unit}" if control.unit else ""
    low, high, place = ((math.log10(x) if control.log else x) for x in (control.low, control.high, control.value))
    step = 1 if control.whole else (high - low) / _STEPS
    data = {"name": name, "log": control.log, "whole": control.whole, "low": low, "high": high, "unit": control.unit}
    return html.Div(
        [
            html.Label(control.label, htmlFor=f"slider-{name}"),
            dcc.Input(id=f"slider-{name}", type="range", min=low, max=high, step=step, value=place),
            html.Div(
                [_field(name, f"{control.label}{unit}", control.text, ""), html.Span(control.unit)], className="field"
            ),
            dcc.Store(id=f"control-{name}", data=data),
        ],
        className="control",
    )  # fmt: skip


def _named(name: str) -> dict[str, Any]:
    """Return what tells a part of the page to who cannot see it."""
    return {"aria-label": name}


def _field(name: str, label: str, text: str, empty: str) -> html.Div:
    """Return a field for a number, with a label for who cannot see its surroundings."""
    field = dcc.Input(
        id=f"number-{name}", type="text", inputMode="numeric", value=text, debounce=0.4, placeholder=empty,
        autoComplete="off",
    )  # fmt: skip
    return html.Div([html.Label(label, htmlFor=f"number-{name}", className="hidden"), field])
