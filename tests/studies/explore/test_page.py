"""The page of `vanedamp explore` without a browser: what moves, the curve under way, the address, nonsense."""

import contextlib
import json
import math
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dash", reason="the page is made with dash")

from tests.commands.test_interrupts import heed_interrupts, members
from tests.tools.processes import PATIENCE, environment, until, without_stages
from vanedamp.coupling.model_order.choices import NOTHING
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.sweep.worker import Task, run_points
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.onset import swing
from vanedamp.files.toml_input import InputError
from vanedamp.files.toml_output import commented
from vanedamp.studies.cli import main
from vanedamp.studies.explore import page, server
from vanedamp.studies.explore.chart import key_figures, response_figure
from vanedamp.studies.explore.controls import controls_of, moved
from vanedamp.studies.explore.curves import (
    POINTS,
    Band,
    Curve,
    Curves,
    ends_of,
    explorable,
    seen,
    transient_note,
)
from vanedamp.studies.explore.sweep_chart import curve_figure
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.report.forced_response import forced_responses, linear_between
from vanedamp.studies.report.forced_response_charts import LOOKS, responses_figure

TABLES = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "resonance_amplitude": 1e-3},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6, "position": 5e-5}],
}


def scene(**tables):
    return Scene.of(TABLES | tables, "scene.toml")


def texts(of, **changed_texts):
    return page.Exploration.of(of, "scene.toml").texts | changed_texts


def at_once(function, *arguments):
    """A call whose result is there at once, in place of a worker's."""
    future = Future()
    future.set_result(function(*arguments))
    return future


class Waiting:
    """Calls that no worker begins with."""

    def __init__(self):
        self.futures = []
        self.tasks = []

    def __call__(self, function, *arguments):
        self.futures.append(Future())
        self.tasks.append(list(arguments[-1].points))
        return self.futures[-1]

    @property
    def points(self):
        """The points of all tasks, in their order."""
        return [point for task in self.tasks for point in task]


# --- what moves -----------------------------------------------------------------------------------------------------


def test_fields_that_are_not_touched_change_nothing():
    exact = scene(cavity=[{"name": "c1", "gap": 2.00000123e-4}])
    controls = controls_of(exact)
    assert moved(exact, controls, {control.name: control.text for control in controls}) is exact


def test_each_control_moves_its_number():
    controls = {control.name: control for control in controls_of(scene())}
    assert list(controls) == [
        "bodies", "gap", "mass", "friction", "restitution", "position", "velocity", "damping_ratio",
        "resonance_amplitude", "orientation",
    ]  # fmt: skip
    wanted = {
        "bodies": "1", "gap": "300", "mass": "20", "friction": "0.1", "restitution": "0.5", "damping_ratio": "2",
        "resonance_amplitude": "500", "orientation": "45",
    }  # fmt: skip
    other = moved(scene(), list(controls.values()), wanted)
    (cavity,), (damper,) = other.cavity, other.damper
    assert cavity.gap == pytest.approx(3e-4)
    assert (damper.mass, damper.friction, damper.restitution) == (pytest.approx(0.02), 0.1, 0.5)
    assert damper.position == pytest.approx(5e-5 * 1.5)  # its place is kept as a share of the free travel
    assert other.structure.damping_ratio == pytest.approx(0.02)
    assert other.excitation.resonance_amplitude == pytest.approx(5e-4)
    assert other.gravity.orientation_deg == 45.0


def test_bodies_stand_evenly_in_every_cavity():
    two = scene(cavity=[{"name": "a", "gap": 1e-4}, {"name": "b", "gap": 3e-4}], damper=[
        {"cavity": "a", "mass": 0.01}, {"cavity": "b", "mass": 0.01}
    ])  # fmt: skip
    controls = controls_of(two)
    # gaps differ: one control each; the bodies are alike: one for all
    assert {"bodies", "gap-0", "gap-1", "mass"} <= {control.name for control in controls}
    more = moved(two, controls, {"bodies": "2", "gap-1": "150"})
    assert [damper.cavity for damper in more.damper] == ["a", "a", "b", "b"]
    assert more.positions == pytest.approx([-1e-4 / 6, 1e-4 / 6, -2.5e-5, 2.5e-5])


def test_bodies_that_differ_have_controls_of_their_own():
    two = scene(damper=[{"cavity": "c1", "mass": 0.01, "position": -5e-5}, {"cavity": "c1", "mass": 0.02}])
    controls = controls_of(two)
    assert {"mass-0", "mass-1", "friction"} <= {control.name for control in controls}
    assert "bodies" not in {control.name for control in controls}
    assert [damper.mass for damper in moved(two, controls, {"mass-1": "30"}).damper] == pytest.approx([0.01, 0.03])


def test_bodies_of_a_cavity_begin_each_at_a_place_of_its_own():
    body = {"cavity": "c1", "mass": 0.05, "shape": "block", "length": 0.01, "height": 0.005, "restitution": 0.6}
    row = scene(
        cavity=[{"name": "c1", "gap": 2e-4, "play": 1e-5}],
        damper=[body | {"position": -4e-5}, body | {"position": 4e-5}],
    )
    controls = controls_of(row)
    assert {"position-0", "position-1", "velocity", "lift", "tilt"} <= {control.name for control in controls}
    other = moved(row, controls, {"position-1": "60", "lift": "5"})
    assert [damper.position for damper in other.damper] == pytest.approx([-4e-5, 6e-5])
    assert [damper.lift for damper in other.damper] == pytest.approx([5e-6, 5e-6])


def test_play_is_for_bodies_with_extent():
    cavity = [{"name": "c1", "gap": 2e-4, "play": 1e-5}]
    block = [{"cavity": "c1", "mass": 0.05, "shape": "block", "length": 0.01, "height": 0.005, "restitution": 0.6}]
    assert "play" not in {control.name for control in controls_of(scene(cavity=cavity))}
    assert "play" in {control.name for control in controls_of(scene(cavity=cavity, damper=block))}


def test_numbers_of_other_tables_have_the_label_and_range_of_their_keys():
    damper = {"normal_force": 2.0, "friction": 0.3, "stiffness": 1e6}
    held = scene(
        friction_damper=[damper, damper | {"stiffness": 2e6}], stop=[{"side": "right", "gap": 1e-4, "restitution": 0.5}]
    )
    controls = {control.name: control for control in controls_of(held, ["cavity.c1.centrifugal_deg", "structure.mass"])}
    stiffness, bounded = controls["friction_damper-1-stiffness"], controls["stop-restitution"]
    assert (stiffness.label, stiffness.unit) == (
        "tangential stiffness in series with the contact (friction_damper.1.stiffness)", "N/m",
    )  # fmt: skip
    assert stiffness.log and (stiffness.low, stiffness.high) == (1e5, 4e7)
    assert (bounded.low, bounded.high, bounded.log) == (0.0, 1.0, False)
    assert {"friction_damper-friction", "friction_damper-0-stiffness", "structure-mass"} <= set(controls)
    assert controls["stop-gap"].unit == "µm" and controls["stop-gap"].value == pytest.approx(100.0)
    assert (controls["cavity-c1-centrifugal_deg"].low, controls["cavity-c1-centrifugal_deg"].high) == (-90.0, 90.0)
    other = moved(held, list(controls.values()), {"friction_damper-1-stiffness": "3e6", "structure-mass": "1.5"})
    assert [one.stiffness for one in other.friction_damper] == [1e6, 3e6] and other.structure.mass == 1.5


def test_a_slider_of_no_number_is_rejected():
    for path, told in (("cavity.c1.width", "no 'width' there"), ("time.tolerance", "is no number of structure")):
        with pytest.raises(InputError, match=f"--vary: .*{told}"):
            page.Exploration.of(scene(), "scene.toml", wanted=[path])


NONSENSE = (
    ("gap", "abc", "gap: expected a number in µm, not 'abc'"),
    ("gap", "", "gap: expected a number in µm, not ''"),
    ("gap", "nan", "gap: expected a number"),
    ("gap", "1e999", "gap: expected a number"),
    ("gap", "-5", "gap: cavity[0].gap: should be greater than 0"),
    ("gap", "1e-300", "gap: cavity[0].gap: expected at least"),
    ("mass", "x" * 999, "mass of a body: expected a number in g, not 'xxx"),
    ("restitution", "1.2", "restitution: damper[0].restitution: should be less than or equal to 1"),
    ("damping_ratio", "0", "excitation.resonance_amplitude: an undamped resonance has no amplitude"),
    ("orientation", "120", "orientation of gravity: damper[0]: gravity lifts the body off the floor"),
    ("bodies", "1.5", "number of bodies: expected a whole number"),
    ("bodies", "1e9", "number of bodies: expected 1 to"),
    ("low", "abc", "frequencies from: expected a number in Hz"),
    ("low", "99", "frequencies: expected two above zero, the lower one first, not 99 and"),
    ("evaluated", "0", "periods evaluated: expected 1 to"),
    ("evaluated", "", "periods evaluated: expected a whole number"),
)


def test_nonsense_is_said_in_one_line_and_the_curve_stays():
    exploration = page.Exploration.of(scene(), "scene.toml")
    curves = Curves(at_once)
    drawn = draw(exploration, curves, 1)
    assert (drawn.message, drawn.tone, drawn.frame) == (f"{POINTS} frequencies", "message", "")
    for version, (name, text, said) in enumerate(NONSENSE, start=2):
        old = draw(exploration, curves, version, **{name: text})
        assert old.message.startswith(said) and "\n" not in old.message and len(old.message) < 200
        assert (old.tone, old.frame) == ("message bad", "old")
        assert (old.figure, old.figures, old.scene, old.sweep) == (page.no_update,) * 4
        assert old.answer == {"serial": version, "version": version, "have": 0, "complete": True}
    assert draw(exploration, curves, 99).message == drawn.message


def draw(exploration, curves, version, have=0, **changed_texts):
    request = {"tab": "t", "serial": version, "version": version, "values": exploration.texts | changed_texts}
    return page.changes(exploration, curves, request | {"have": have})


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"structure": {"model": "prescribed", "displacement_amplitude": 1e-3}, "excitation": {"frequency": 1.0}},
         "structure.model: a prescribed motion has no forced response"),
        ({"excitation": {"engine_order": 2, "force": 1.0}, "rotation": {"rpm": 1000.0}},
         "excitation.engine_order: the curve is drawn over excitation.frequency"),
        ({"excitation": {"frequency": 15.9}}, "excitation: nothing moves the structure"),
    ],
)  # fmt: skip
def test_scenes_without_a_forced_response_over_the_frequency_are_refused(tables, said):
    cavity = [{"name": "c1", "gap": 2e-4, "radius": 0.5}]
    with pytest.raises(InputError, match=re.escape(said)):
        page.Exploration.of(scene(**tables, cavity=cavity), "scene.toml")


# --- the curve ------------------------------------------------------------------------------------------------------


def test_band_holds_both_resonances_and_runs_their_transient():
    shown = seen(explorable(scene()), Band())
    low, high = ends_of(shown)
    free = math.sqrt(1e4) / (2 * math.pi)
    assert low < free / math.sqrt(1.05) < free < high
    # exp(-2 pi zeta n) of the linear transient is left after n periods at the resonance: 1 % after 73
    assert 73 <= shown.time.transient <= 100
    assert shown.time.simulated == shown.time.transient + 200


def test_transient_that_is_too_long_to_run_is_warned_of():
    assert transient_note(seen(explorable(scene()), Band())) is None
    slow = seen(explorable(scene(structure=TABLES["structure"] | {"damping_ratio": 1e-4})), Band())
    assert slow.time.transient == 2000
    # the natural motion begins as fast as the steady one, r times its own rate, and decays for 2000 / r of its periods;
    # with the body held, of a mass m = 1.05, its rate is less by sqrt(m) and its damping ratio, too
    r, m = ends_of(slow)[1] / (math.sqrt(1e4) / (2 * math.pi)), 1.05
    said = re.search(r"after 2000 periods (\d+)% of its own transient is left", transient_note(slow))
    assert int(said[1]) == pytest.approx(
        100 * r * math.sqrt(m) * math.exp(-2 * math.pi * 1e-4 * 2000 / (r * m)), abs=1.0
    )


def test_band_is_that_of_the_scenes_own_sweep():
    swept = scene(sweep={"excitation.frequency": {"start": 14.0, "stop": 17.0, "num": 4}, "cavity.c1.gap": [1e-4]})
    exploration = page.Exploration.of(swept, "scene.toml")
    assert (exploration.band["low"], exploration.band["high"]) == ("14", "17")
    assert exploration.seen(exploration.texts).sweep == seen(exploration.scene, Band(14.0, 17.0)).sweep


def test_curve_is_the_sweep_of_the_scene_that_is_written(tmp_path):
    exploration = page.Exploration.of(scene(), "scene.toml")
    curve = Curve(exploration.seen(exploration.texts | {"gap": "150", "bodies": "2", "evaluated": "20"}), at_once)
    assert curve.done == curve.size == POINTS
    (tmp_path / "scene.toml").write_text(commented(short_form(curve.scene), KINDS["scene"].schema, "scene"))
    written = Scene.load(tmp_path / "scene.toml")
    assert written.to_dict() == curve.scene.to_dict()
    drawn, again = curve.sweep(), sweep(written)
    assert np.array_equal(drawn.axes["excitation.frequency"], again.axes["excitation.frequency"])
    for name in ("amplitude_mean", "amplitude_max", "amplitude_undamped", "impacts_per_period"):
        assert getattr(drawn, name) == pytest.approx(getattr(again, name), rel=1e-12, nan_ok=True)
    for name, height in again.peaks.items():
        assert drawn.peaks[name] == pytest.approx(height, rel=1e-12)
    assert (again.impacts_per_period > 0).any()  # bodies take part


def test_coarse_form_comes_first_and_has_the_ends():
    exploration = page.Exploration.of(scene(), "scene.toml")
    submit = Waiting()
    curve = Curve(exploration.seen(exploration.texts), submit)
    assert sorted(submit.points) == list(range(POINTS))
    first = submit.points[: curve.coarse]
    assert {0, POINTS - 1} <= set(first) and 14 <= len(first) <= 17
    assert np.diff(sorted(first)).max() <= 4


def test_parts_of_a_curve_are_sweeps_of_what_is_done():
    exploration = page.Exploration.of(scene(), "scene.toml")
    calls = []

    def three(function, *arguments):
        calls.append(function)
        return at_once(function, *arguments) if len(calls) <= 3 else Future()

    curve = Curve(exploration.seen(exploration.texts), three)
    part = curve.sweep()
    frequencies = np.linspace(*ends_of(curve.scene), POINTS)[[*range(0, POINTS, 4), POINTS - 1]]
    found = part.axes["excitation.frequency"]
    assert 3 < len(found) <= len(frequencies) and set(found) <= set(frequencies)
    assert list(part.status) == ["ok"] * len(found)


@pytest.fixture
def still(monkeypatch):
    """Between the requests of tabs no time passes."""
    monkeypatch.setattr("vanedamp.studies.explore.curves.time.monotonic", lambda: 1000.0)


def test_newer_curve_cancels_the_one_before_of_its_tab_only(still):
    exploration, submit = page.Exploration.of(scene(), "scene.toml"), Waiting()
    curves = Curves(submit)

    def take(tab, version):
        return curves.take(tab, version, lambda: exploration.seen(exploration.texts))

    first, tasks = take("one", 1), len(submit.futures)
    other = take("two", 1)
    assert take("one", 1) is first
    second = take("one", 2)
    assert (first.wanted, other.wanted, second.wanted) == (False, True, True)
    assert all(future.cancelled() for future in submit.futures[:tasks])
    assert not any(future.cancelled() for future in submit.futures[tasks:]) and len(submit.futures) == 3 * tasks
    first.wait(POINTS, 60.0)  # returns at once
    assert take("one", 1) is None  # a request that came late
    with pytest.raises(InputError):
        curves.take("one", 3, lambda: exploration.seen(exploration.texts | {"gap": "x"}))
    assert second.wanted


def test_curve_of_a_closed_tab_gives_its_workers_back(still):
    exploration, submit = page.Exploration.of(scene(), "scene.toml"), Waiting()
    curves = Curves(submit)

    def take(tab, version=1):
        return curves.take(tab, version, lambda: exploration.seen(exploration.texts))

    closed, tasks = take("closed"), len(submit.futures)
    other = take("other")
    assert take("closed") is closed
    closed.asked -= 60.0
    take("new")
    assert (closed.wanted, other.wanted) == (False, True)
    assert all(future.cancelled() for future in submit.futures[:tasks])
    again = take("closed")  # a browser that was asleep
    assert again is not closed and again.wanted


def test_worker_that_breaks_leaves_a_point_that_says_so():
    exploration = page.Exploration.of(scene(), "scene.toml")

    def broken_once(function, *arguments):
        if 4 not in arguments[-1].points:
            return at_once(function, *arguments)
        future = Future()
        future.set_exception(RuntimeError("out of order"))
        return future

    curve = Curve(exploration.seen(exploration.texts), broken_once)
    drawn = curve.sweep()
    assert curve.done == POINTS
    assert drawn.status[4] == "error: RuntimeError: out of order"
    figure = response_figure(drawn, *forced_responses(drawn), curve.linear, {})
    assert "out of order" in figure["data"][3]["text"][4]


def test_report_and_explorer_draw_the_same_curves():
    exploration = page.Exploration.of(scene(), "scene.toml")
    curve = Curve(exploration.seen(exploration.texts), at_once)
    drawn = curve.sweep()
    (response,) = forced_responses(drawn)
    explored = response_figure(drawn, response, curve.linear, {})["data"]
    reported = [each for each in responses_figure([response], [curve.linear]).data if each.fill is None]
    chosen = curve_figure(drawn, response, {}).data
    assert [trace["name"] for trace in explored] == [look.title for look in LOOKS.values()]
    for one, other in zip(explored, reported, strict=True):
        assert (one["name"], one["line"]["dash"], one["line"]["width"]) == (
            other["name"], other["line"]["dash"], other["line"]["width"],
        )  # fmt: skip
        assert one["y"] == pytest.approx(other["y"], nan_ok=True)
    ours = {look.title: (look.dash, look.width) for look in LOOKS.values()}
    assert {t["name"]: (t["line"]["dash"], t["line"]["width"]) for t in chosen if t["name"] in ours} == ours


def test_points_that_are_not_ok_are_open_and_say_why():
    exploration = page.Exploration.of(scene(), "scene.toml")
    curve = Curve(exploration.seen(exploration.texts), at_once)
    drawn = curve.sweep()
    status = drawn.status.copy()
    status[7] = "not_steady"
    marked = replace(drawn, status=status)
    figure = response_figure(marked, *forced_responses(marked), curve.linear, {})
    for trace, symbol in zip(figure["data"][2:], ("diamond", "circle"), strict=True):
        symbols = list(trace["marker"]["symbol"])
        assert symbols.pop(7) == f"{symbol}-open" and set(symbols) == {symbol}
        assert trace["text"][7].endswith("not ok: not_steady")
        assert trace["customdata"] == pytest.approx(drawn.axes["excitation.frequency"], rel=0)
    # curves differ without colour
    assert len({(trace["line"].get("dash"), trace["mode"], trace["line"]["width"]) for trace in figure["data"]}) == 4


def test_key_figures_are_those_of_the_sweep():
    exploration = page.Exploration.of(scene(), "scene.toml")
    curve = Curve(exploration.seen(exploration.texts), at_once)
    drawn = curve.sweep()
    (response,) = forced_responses(drawn)
    shown, headline = {figure.name: figure.value for figure in key_figures(response, curve.onset)}, response.headline
    # 1/sqrt(1 - 2 zeta^2) = 1.0001 below the natural frequency, where the level is reached
    assert shown["maximum without bodies X"].startswith("1000 µm at 15.91")
    assert shown["damped peak / X"] == f"{headline.peak_ratio:.3f}"
    assert shown["first point with impacts"] == f"{headline.onset:.6g} Hz"
    # room of 50 um to a wall; friction, s = mu g/w^2 = 295 um, holds the body until it slips that far
    frequency, amplitude = curve.onset
    slip = 0.3 * 9.81 / (2 * math.pi * frequency) ** 2
    assert swing(amplitude, slip) == pytest.approx(5e-5, rel=2e-3)
    assert abs(linear_responses(curve.scene)[0].amplitude(np.array([frequency]))[0]) == pytest.approx(
        amplitude, rel=1e-3
    )


@pytest.mark.parametrize("done", [0, 1, 3])
def test_closed_forms_stand_from_the_first_moment_and_the_rest_is_grey(done):
    waiting = Waiting()
    exploration = page.Exploration.of(scene(), "scene.toml")
    curves = Curves(waiting)
    curve = curves.take("t", 1, lambda: exploration.seen(exploration.texts))
    whole = Curve(curve.scene, at_once).sweep()
    frequencies = whole.axes["excitation.frequency"]
    for future, task in list(zip(waiting.futures, waiting.tasks, strict=True))[:done]:
        points = [{"excitation.frequency": float(frequencies[point])} for point in task]
        future.set_result(run_points(curve.scene, NOTHING, points, Task(range(len(task)))))
    (response,) = forced_responses(curve.sweep())
    (finished,) = forced_responses(whole)
    closed = [figure for figure in key_figures(response, curve.onset) if figure.closed]
    assert closed == [figure for figure in key_figures(finished, curve.onset) if figure.closed] and len(closed) == 3
    assert response.reference == finished.reference
    _, figures, _ = page._drawn(curve, 1)
    rows = figures.children[0].children
    assert [row.className for row in rows] == [""] * 6 + ["unfinished"] * 10


@pytest.mark.parametrize(
    "key", ["length", "height", "lift", "tilt", "lift_velocity", "tilt_rate", "position", "velocity"]
)
def test_every_key_of_a_block_moves(key):
    block = {"cavity": "c1", "mass": 0.05, "shape": "block", "length": 0.01, "height": 0.005, "restitution": 0.6}
    tilted = scene(cavity=[{"name": "c1", "gap": 2e-4, "play": 1e-5}], damper=[block])
    (control,) = [control for control in controls_of(tilted) if control.name == key]
    other = moved(tilted, [control], {key: f"{control.high:.9g}"})
    assert getattr(other.damper[0], key) == pytest.approx(control.high * control.factor)


def test_linear_curves_hide_no_maximum():
    shown = seen(explorable(scene()), Band())
    linear = linear_between(shown, *ends_of(shown))
    peak = 1e4 / 1.05  # squared natural frequency with the body fixed
    assert linear.undamped.max() == pytest.approx(1e-3, rel=1e-3)
    assert linear.x[np.argmax(linear.fixed)] == pytest.approx(math.sqrt(peak) / (2 * math.pi), rel=1e-3)


# --- the address ----------------------------------------------------------------------------------------------------

HOST, UPDATE = {"Host": "127.0.0.1:4711"}, "/_dash-update-component"


@pytest.fixture
def client():
    app = server.explore_app(page.Exploration.of(scene(), "scene.toml"), {}, at_once)
    server.guard(app, 4711, "secret")
    return app.server.test_client()


def test_only_who_has_the_token_gets_the_page(client):
    for path in ("/", "/?token=wrong", "/?token=", "/_dash-layout", "/assets/explore.js"):
        refused = client.get(path, headers=HOST)
        assert refused.status_code == 403 and "token" in refused.text and "<" not in refused.text
    assert client.post("/_dash-update-component", headers=HOST, json={}).status_code == 403
    entered = client.get("/?token=secret", headers=HOST)
    assert (entered.status_code, entered.headers["Location"]) == (302, "/")
    cookie = entered.headers["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite" in cookie
    kept = HOST | {"Cookie": cookie.split(";")[0]}
    shown = client.get("/", headers=kept)
    assert shown.status_code == 200
    # nothing from elsewhere
    addresses = re.findall(r'(?:src|href)="([^"]*)"', shown.text)
    assert addresses and all(address.startswith("/") for address in addresses)
    policy = shown.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "connect-src 'self'" in policy
    assert "http" not in policy and "unsafe-eval" not in policy
    assert client.get("/_dash-layout", headers=kept).status_code == 200


@pytest.mark.parametrize("name", ["evil.example:4711", "127.0.0.1:80", "127.0.0.1", "localhost.evil.example:4711"])
def test_other_names_that_lead_here_are_refused(client, name):
    assert client.get("/?token=secret", headers={"Host": name}).status_code == 421


def malformed():
    """Bodies of requests that the page never sends, by what is wrong with them."""
    one = {"id": "request", "property": "data", "value": None}
    well = {"output": "nothing.data", "inputs": [one], "state": [], "changedPropIds": ["request.data"]}
    return {
        "empty": b"", "no JSON": b"{", "null": b"null", "number": b"1", "text": b'"a"', "list": b"[]", "object": b"{}",
        "binary": bytes(range(256)), "deep": b"[" * 100_000,
        "unknown output": json.dumps(well).encode(),
        "output of a wrong type": json.dumps(well | {"output": 1}).encode(),
        "inputs that are none": json.dumps(well | {"inputs": None}).encode(),
        "input without id": json.dumps(well | {"inputs": [{"property": "data"}]}).encode(),
        "input that is a text": json.dumps(well | {"inputs": ["a"]}).encode(),
        "state that is a number": json.dumps(well | {"state": 3}).encode(),
        "changed that is a number": json.dumps(well | {"changedPropIds": 3}).encode(),
    }  # fmt: skip


@pytest.fixture
def kept(client):
    """Headers of who has the token."""
    return HOST | {"Cookie": client.get("/?token=secret", headers=HOST).headers["Set-Cookie"].split(";")[0]}


@pytest.mark.parametrize("name", malformed())
def test_requests_that_are_none_of_the_page(client, kept, name, capfd):
    answer = client.post(UPDATE, headers=kept, data=malformed()[name], content_type="application/json")
    assert answer.status_code == 400
    assert capfd.readouterr() == ("", "")


def test_odd_values_of_each_callback_are_a_line_and_leave_the_page_alive(client, kept, capfd):
    for callback in client.get("/_dash-dependencies", headers=kept).json:
        for value in (None, 1, "a", [], {}, [[1]], {"a": {"b": 1}}):
            given = {key: [item | {"value": value} for item in callback[key]] for key in ("inputs", "state")}
            changed = [f"{item['id']}.{item['property']}" for item in callback["inputs"]]
            body = given | {"output": callback["output"], "outputs": [], "changedPropIds": changed}
            assert client.post(UPDATE, headers=kept, json=body).status_code in (200, 204, 400, 500)
    out, error = capfd.readouterr()
    assert out == "" and "Traceback" not in error
    assert all(line.startswith("vanedamp: explore: a request failed: ") for line in error.splitlines())
    assert client.get("/_dash-layout", headers=kept).status_code == 200


def test_a_body_of_300_mb_is_not_kept(client, kept):
    headers = kept | {"Content-Length": "300000000"}
    assert client.post(UPDATE, headers=headers, data=b"{}", content_type="application/json").status_code in (400, 413)


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.toml"], "none.toml: no such file"),
        (["none"], "none: no such file or folder"),
        (["."], "no results that a report shows"),
        (["scene.toml", "-o", "scene.toml"], "is an input"),
        (["scene.toml", "-o", "scene.txt"], "expected a file name ending in .toml"),
        (["--port", "99999"], "--port: 99999 is not to be had"),
        (["--port", "-1"], "expected a count"),
    ],
)
def test_bad_command_lines_get_one_line(folder, capsys, words, said):
    with contextlib.suppress(SystemExit):
        assert main(["explore", "--no-browser", *words]) == 2
    out, error = capsys.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    assert said in error


def test_ctrl_c_ends_the_server_and_its_workers_in_one_line(folder):
    command = [sys.executable, "-m", "vanedamp", "explore", "scene.toml", "--no-browser", "--workers", "2"]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=environment(), preexec_fn=heed_interrupts,
    ) as process:  # fmt: skip
        address = process.stdout.readline().strip()
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        assert b"vanedamp explore" in browser.open(address).read()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(address.split("?")[0])
        until(lambda: len(members(process.pid)) >= 3)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE)
    assert (process.returncode, without_stages(error)) == (130, "vanedamp: interrupted\n")
    until(lambda: not members(process.pid))
