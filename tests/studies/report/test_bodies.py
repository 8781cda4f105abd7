"""Bodies in the plane in the report: drawings touch where gaps close, the page has the run's numbers."""

import base64
import csv
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace

import h5py
import numpy as np
import pytest

from tests.studies.report.test_report import charts
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.store import load
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import main
from vanedamp.studies.report.motion import CLOSED, HIT, OPEN
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect
from vanedamp.studies.report.time_history import TimeHistory

SAMPLES, PERIODS, DROPPED = 60, 12, 4
GAP, PLAY = 2e-3, 1e-3
BODY = {"mass": 0.3, "friction": 0.3, "restitution": 0.6}
#: blocks of several heights and a disc in one cavity, discs in another, a slider in the third
DAMPERS = [
    BODY | {"cavity": "row", "shape": "block", "length": 0.02, "height": 0.012, "tilt": 1e-3, "position": -2e-4},
    BODY | {"cavity": "row", "shape": "disc", "radius": 0.005},
    BODY | {"cavity": "row", "shape": "block", "length": 0.015, "height": 0.010},
    BODY | {"cavity": "row", "shape": "block", "length": 0.008, "height": 0.014},
    BODY | {"cavity": "discs", "shape": "disc", "radius": 0.01},
    BODY | {"cavity": "discs", "shape": "disc", "radius": 0.01, "restitution": 0.3},
    BODY | {"cavity": "slider <!--<script>"},
]
RIGID = {
    "structure": {"model": "rigid", "mass": 20.0, "stiffness": 8e5, "damping_ratio": 0.01},
    "excitation": {"frequency": 31.0, "force": 60.0}, "initial": {"velocity": 0.2},
    "cavity": [
        {"name": "row", "gap": GAP, "play": PLAY, "normal_motion": 0.2, "rotation": 3.0},
        {"name": "discs", "gap": GAP, "play": PLAY}, {"name": "slider <!--<script>", "gap": GAP},
    ],
    "damper": DAMPERS, "time": {"periods": PERIODS, "transient": DROPPED}, "solver": {"linearisation": 1.0},
}  # fmt: skip
ALONE = {"damper": DAMPERS[:1], "cavity": RIGID["cavity"][:1]}


def reduced(folder):
    """A cavity on a reduced model of two modes: its walls part, it rises and turns."""
    labels = {
        "at": [1.0, 0.0], "left": [1.0, -0.3], "right": [1.0, 0.4], "floor": [1.0, 0.1], "floor.normal": [0.1, 0.5],
        "floor.rotation": [2.0, 4.0],
    }  # fmt: skip
    mass, stiffness = np.diag([20.0, 5.0]), np.array([[1e6, -2e5], [-2e5, 6e5]])
    ReducedModel.from_matrices(mass, stiffness, labels, damping_ratio=0.01).save(folder / "rom.h5")
    cavity = {"name": "row", "gap": GAP, "play": PLAY, "left": "left", "right": "right", "floor": "floor"}
    return {
        "structure": {"model": "rom", "file": str(folder / "rom.h5")},
        "excitation": {"frequency": 31.0, "force": 150.0, "at": "at"}, "cavity": [cavity], "damper": DAMPERS[:4],
        "initial": {},
    }  # fmt: skip


def run_of(path, events=True, samples=SAMPLES, **changes):
    scene = validate(Scene, RIGID | changes, "scene")
    response = simulate(scene, events=events, samples_per_period=samples)
    assert response.periods == PERIODS
    response.save(path, {"scene": scene.to_dict()})
    return response


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("bodies")


@pytest.fixture(scope="module")
def response(folder):
    return run_of(folder / "run.h5")


@pytest.fixture(scope="module")
def page(folder, response):
    write_report(collect([folder / "run.h5"]), folder / "report.html")
    return (folder / "report.html").read_text(encoding="utf-8")


def nearest_wall(cavity, body, side, corner, outline):
    """Distance (n,) from a body as drawn to a surface of its cavity as drawn."""
    centre, (a, b) = outline[:, 0], body.half
    x, y = outline[:, corner].T if corner >= 0 else centre.T
    if not body.form.extended:
        x = outline.mean(axis=1)[:, 0]
    round_one = corner < 0
    if side in ("left", "right"):
        face = (cavity.left if side == "left" else cavity.right)[:, 0]
        return (x - face if side == "left" else face - x) - a * round_one
    if side == "floor":
        return y - b * round_one
    above = cavity.ceiling[cavity.bodies.index(body)].heights
    return (above.mean(axis=1) if round_one else above[:, 1 if corner == 2 else 0]) - y - b * round_one


@pytest.mark.parametrize("model", ["rigid", "reduced"])
def test_gaps_are_drawn_as_they_are(model, folder, response):
    """In units of the drawing a gap is `scale * factor` times as large, whatever cavity and body do."""
    if model == "reduced":
        response = run_of(folder / "reduced.h5", **reduced(folder))
    motion = TimeHistory.load(folder / ("run.h5" if model == "rigid" else "reduced.h5")).motion()
    frames, met = slice(-3 * SAMPLES, None), set()
    for cavity in motion.cavities:
        by_number = {body.number: body for body in cavity.bodies}
        for contact in cavity.contacts:
            number, side, corner = contact.place
            if side == "body":
                continue
            (place,) = (i for i, other in enumerate(response.in_plane.contacts) if other == contact.place)
            body = by_number[number]
            drawn = nearest_wall(cavity, body, side, corner, body.outline)
            gap = response.in_plane.contact_gap[frames, place] * motion.factor * motion.scale
            np.testing.assert_allclose(drawn, gap, rtol=0, atol=1e-9 * motion.scale * motion.factor * GAP)
            met.add((type(body.form), side))
    assert len(met) == (10 if model == "rigid" else 6)
    if model == "reduced":
        moved = motion.cavities[0]
        assert np.ptp(moved.right[:, 0] - moved.left[:, 0]) > 0.01 * motion.scale * motion.factor * GAP
        assert (np.ptp(moved.shift, axis=0) > 0).all()


def test_walls_and_ceilings_that_turn_are_drawn_so(folder):
    """A gap at one corner that is larger for an instant: there the surface has moved away, by as much as it says."""
    run_of(folder / "alone.h5", **ALONE)
    history = TimeHistory.load(folder / "alone.h5")
    more = 1e-4
    for side, corner in (("right", 2), ("left", 0), ("ceiling", 3)):
        gap = history.plane.contact_gap.copy()
        gap[-1, history.plane.contacts.index((0, side, corner))] += more
        changed = replace(history, plane=replace(history.plane, contact_gap=gap)).motion()
        (before,), (after,) = history.motion().cavities, changed.cavities
        unit = changed.scale * changed.factor * more
        shares = {
            "left": (after.left - before.left) / unit, "right": (after.right - before.right) / unit,
            "ceiling": (after.ceiling[0].heights - before.ceiling[0].heights) / unit,
        }  # fmt: skip
        tall = after.height / (2 * after.bodies[0].half[1])
        expected = {"right": (0.0, tall), "left": (-1.0, tall - 1.0), "ceiling": (1.0, 0.0)}[side]
        for name, moved in shares.items():
            np.testing.assert_allclose(moved[-1], expected if name == side else (0.0, 0.0), atol=1e-9)
            np.testing.assert_allclose(moved[:-1], 0.0, atol=1e-9)


def test_faces_meet_where_they_are_drawn(folder, response):
    """The points of a contact between neighbours, on the left one, are a gap apart from the right one."""
    motion = TimeHistory.load(folder / "run.h5").motion()
    row, discs, _ = motion.cavities
    unit = motion.scale * motion.factor
    gaps = response.in_plane.contact_gap[-3 * SAMPLES :]
    places = response.in_plane.contacts
    (between,) = (i for i, place in enumerate(places) if place == (4, "body", -1))
    left, right = (body.outline[:, 0, 0] for body in discs.bodies)
    np.testing.assert_allclose(right - left - 2 * discs.bodies[0].half[0], gaps[:, between] * unit, atol=1e-9 * unit)
    faces = [i for i, place in enumerate(places) if place == (2, "body", -1)]
    points = [contact.points for contact in row.contacts if contact.place == (2, "body", -1)]
    taller = row.bodies[3].outline
    for upper, (at, point) in enumerate(zip(faces, points, strict=True)):
        corner = row.bodies[2].outline[:, 2 if upper else 1]
        np.testing.assert_allclose(point, corner, atol=1e-9 * unit)
        share = upper * row.bodies[2].half[1] / row.bodies[3].half[1]
        face = (1 - share) * taller[:, 0, 0] + share * taller[:, 3, 0]
        np.testing.assert_allclose(face - point[:, 0], gaps[:, at] * unit, atol=1e-9 * unit)


def test_contacts_are_lit_while_closed_and_after_hits(folder, response):
    motion = TimeHistory.load(folder / "run.h5").motion()
    frames, period = slice(-3 * SAMPLES, None), 1 / 31.0
    closed = response.in_plane.contact_closed[frames]
    hits = {}
    for event in response.event_list:
        if event.kind == "impact":
            hits.setdefault((event.damper, event.side, event.corner), []).append(event.time)
    seen = set()
    for contact in (contact for cavity in motion.cavities for contact in cavity.contacts):
        for place in (i for i, other in enumerate(response.in_plane.contacts) if other == contact.place):
            since = response.time[frames, None] - np.array(hits.get(contact.place, [np.inf]))
            hit = ((since >= 0) & (since < 0.03 * period)).any(axis=1)
            if contact.place[1] != "body":
                np.testing.assert_array_equal(contact.light == HIT, hit)
                np.testing.assert_array_equal(contact.light[~hit] == CLOSED, closed[~hit, place])
        seen |= set(contact.light.tolist())
    assert seen == {OPEN, CLOSED, HIT}
    assert any((contact.light == HIT).any() for cavity in motion.cavities for contact in cavity.contacts)


def player_data(page):
    (text,) = re.findall(r'<script type="application/json">(.*?)</script>', page, flags=re.DOTALL)
    return json.loads(text)


def test_page_plays_the_samples(page, folder):
    values, _ = load(folder / "run.h5", "response")
    data, frames = player_data(page), slice(-3 * SAMPLES, None)
    np.testing.assert_allclose(data["time"], values["time"][frames] * 31.0, atol=1e-4)
    np.testing.assert_allclose(data["displacement"], 1e6 * values["displacement"][frames], atol=1e-3)
    assert data["each"] == SAMPLES
    bodies = [body for cavity in data["cavities"] for body in cavity["bodies"]]
    assert [body["number"] for body in bodies] == [1, 2, 3, 4, 5, 6, 7]
    for k, body in enumerate(bodies):
        np.testing.assert_allclose(body["along"], 1e6 * values["body_displacement"][frames, k], atol=1e-3)
        if body["tilt"] is None:
            assert body["lift"] is None
            continue
        np.testing.assert_allclose(body["lift"], 1e6 * values["body_lift"][frames, k], atol=1e-3)
        np.testing.assert_allclose(body["tilt"], 1e3 * values["body_tilt"][frames, k], atol=1e-4)
    motion = TimeHistory.load(folder / "run.h5").motion()
    outline = motion.cavities[0].bodies[0].outline * (1, -1)
    np.testing.assert_allclose(np.reshape(bodies[0]["outline"], outline.shape), outline, atol=0.01)
    assert f"drawn {motion.factor:.6g} times as large" in page
    lights = {contact["light"] for cavity in data["cavities"] for contact in cavity["contacts"]}
    assert {len(light) for light in lights} == {3 * SAMPLES}
    link = re.search(r'download="motion-0.csv" href="data:text/csv;charset=utf-8;base64,([^"]+)"', page).group(1)
    table = list(csv.DictReader(io.StringIO(base64.b64decode(link).decode())))
    np.testing.assert_array_equal(
        [float(row["body_1_tilt"]) for row in table], values["body_tilt"][frames, 0]
    )  # fmt: skip


def test_impacts_are_those_of_the_evaluated_periods(page, response):
    begin = DROPPED / 31.0
    impacts = [event for event in response.event_list if event.kind == "impact" and event.time >= begin]
    traces = charts(page)["impacts-0"]
    assert len(traces) == 4 * len(DAMPERS)
    mine = [event for event in impacts if event.damper == 0]
    count, normal, tangential, loss = (trace for trace in traces if trace["name"] == "body 1")
    assert sum(count["y"]) == pytest.approx(len(mine) / (PERIODS - DROPPED))
    assert sum(loss["y"]) == pytest.approx(1e6 * sum(event.loss for event in mine) / (PERIODS - DROPPED))
    places = {"floor<br>left corner": ("floor", 0), "left wall<br>upper corner": ("left", 3)}
    for place, (side, corner) in places.items():
        here = [event for event in mine if (event.side, event.corner) == (side, corner)]
        at = list(count["x"]).index(place)
        assert count["y"][at] == pytest.approx(len(here) / (PERIODS - DROPPED))
        assert normal["y"][at] == pytest.approx(1e3 * np.mean([event.impulse for event in here]))
        assert tangential["y"][at] == pytest.approx(1e3 * np.mean([abs(event.tangential_impulse) for event in here]))
    told = float(re.search(r"These impacts take ([-+.\de]+) J", page).group(1))
    assert told == pytest.approx(sum(event.loss for event in impacts), rel=1e-3)


def test_runs_without_events_or_samples_make_a_page(folder):
    for name, options, found in (
        ("silent", {"events": False}, {"history-0"}), ("events", {"samples": 0}, {"impacts-0"}),
        ("bare", {"events": False, "samples": 0}, set()),
    ):  # fmt: skip
        run_of(folder / f"{name}.h5", **options, **ALONE)
        write_report(collect([folder / f"{name}.h5"]), folder / f"{name}.html")
        text = (folder / f"{name}.html").read_text(encoding="utf-8")
        assert set(charts(text)) == found
        assert ("<code>--events</code> shows the impacts" in text) == (name == "silent")
        assert ('class="motion"' in text) == (name == "silent")
        assert "largest tilt, mrad" in text


def test_files_of_earlier_versions_make_a_page(folder, page):
    """Files had no samples in the plane, and no loss of an impact."""
    shutil.copy(folder / "run.h5", folder / "old.h5")
    with h5py.File(folder / "old.h5", "r+") as file:
        for name in list(file):
            if name in ("body_lift", "body_tilt", "event_loss", "contact") or name.startswith(("floor_", "contact_")):
                del file[name]
    write_report(collect([folder / "old.h5"]), folder / "old.html")
    text = (folder / "old.html").read_text(encoding="utf-8")
    assert set(charts(text)) == {"history-0", "impacts-0"}
    assert 'class="motion"' not in text
    assert "These impacts take" not in text
    assert len(charts(text)["impacts-0"]) == 3 * len(DAMPERS)


SWEEP = '[sweep]\n"excitation.frequency" = [30.0, 31.0, 32.0, 33.0]\n'
SCENE = f"""\
[structure]
model = "rigid"
mass = 20.0
stiffness = 8e5
damping_ratio = 0.01
[excitation]
frequency = 31.0
force = 60.0
[initial]
velocity = 0.2
[[cavity]]
name = "c"
gap = {GAP}
play = {PLAY}
[[damper]]
cavity = "c"
shape = "block"
length = 0.02
height = 0.012
tilt = 1e-3
mass = 0.3
friction = 0.3
restitution = 0.6
[time]
periods = {PERIODS}
transient = {DROPPED}
"""


def test_sweep_runs_its_peak_for_the_report(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.replace(f"transient = {DROPPED}", "transient = 0") + SWEEP)
    options = ["-o", str(tmp_path / "sweep.h5"), "--peak", str(tmp_path / "peak.h5"), "--workers", "1"]
    assert main(["sweep", str(tmp_path / "scene.toml"), *options]) == 0
    sweep = Sweep.load(tmp_path / "sweep.h5")
    top = int(np.argmax(sweep.amplitude_mean))
    _, attributes = load(tmp_path / "peak.h5", "response")
    assert attributes["frequency"] == sweep.axes["excitation.frequency"][top]
    assert attributes["amplitude_mean"] == sweep.amplitude_mean[top]
    names = [str(tmp_path / name) for name in ("sweep.h5", "peak.h5")]
    assert main(["report", *names, "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    tilt, lift, neglected = charts(page)["plane-0"]
    np.testing.assert_allclose(tilt["x"], [30.0, 31.0, 32.0, 33.0])
    np.testing.assert_allclose(tilt["y"], 1e3 * sweep.in_plane["tilt_max"][:, 0])
    np.testing.assert_allclose(lift["y"], sweep.in_plane["lift_share"][:, 0])
    np.testing.assert_allclose(neglected["y"], 100 * sweep.in_plane["linearisation"][:, 0])
    assert player_data(page)["each"] == 200


def test_peak_is_refused_where_it_could_not_be_run(tmp_path, capsys):
    slider = re.sub(r"shape.*\nlength.*\nheight.*\ntilt.*\n", "", SCENE)
    (tmp_path / "linked.toml").write_text(slider + SWEEP + '[continuation]\ndirection = "up"\n')
    steps = '[solver]\nmethod = "moreau"\nsteps_per_period = 300\n'
    (tmp_path / "steps.toml").write_text(SCENE + SWEEP + steps)
    for name, told in (("linked", "--peak: a point of this sweep begins"), ("steps", "200")):
        options = ["-o", str(tmp_path / "sweep.h5"), "--peak", str(tmp_path / "peak.h5"), "--workers", "1"]
        assert main(["sweep", str(tmp_path / f"{name}.toml"), *options]) == 2
        assert told in capsys.readouterr().err
        assert not list(tmp_path.glob("*.h5*"))


def test_no_peak_is_told(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(SCENE + SWEEP + "[solver]\nmax_events = 1\n")
    options = ["-o", str(tmp_path / "sweep.h5"), "--peak", str(tmp_path / "peak.h5"), "--workers", "1"]
    assert main(["sweep", str(tmp_path / "scene.toml"), *options]) == 0
    assert "--peak: no point is ok" in capsys.readouterr().err
    assert [file.name for file in tmp_path.glob("*.h5*")] == ["sweep.h5"]


def test_sweep_of_sliders_has_no_section_of_tilt(tmp_path):
    (tmp_path / "scene.toml").write_text(re.sub(r"shape.*\nlength.*\nheight.*\ntilt.*\n", "", SCENE) + SWEEP)
    assert main(["sweep", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "sweep.h5"), "--workers", "1"]) == 0
    write_report(collect([tmp_path]), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Tilt and lift" not in page
    assert "plane-0" not in charts(page)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_browser_plays_the_motion(page, folder):
    """Without network: the first frame stands there, a click moves on, nothing complains."""
    press = '<script>document.querySelector(".motion button").click();</script></body>'
    (folder / "playing.html").write_text(page.replace("</body>", press), encoding="utf-8")
    shown = {}
    for name in ("report", "playing"):
        command = [
            "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
            "--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=3000", "--dump-dom",
            f"file://{folder / name}.html",
        ]  # fmt: skip
        finished = subprocess.run(command, capture_output=True, text=True, check=True)
        assert [line for line in finished.stderr.splitlines() if "CONSOLE" in line] == []
        shown[name] = finished.stdout
    data = player_data(page)
    for name, dom in shown.items():
        assert dom.count('aria-label="cavity') == 3
        moment = float(re.search(r"<output>period ([\d.]+),", dom).group(1))
        assert (moment == pytest.approx(data["time"][data["first"]], abs=1e-3)) == (name == "report")
    points = re.search(r'<polygon class="body"[^>]* points="([^"]+)"', shown["report"]).group(1)
    expected = data["cavities"][0]["bodies"][0]["outline"][data["first"]]
    np.testing.assert_allclose([float(value) for value in points.split()], expected)
