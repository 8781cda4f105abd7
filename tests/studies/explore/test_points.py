"""Points of a curve in full, and moving through sweep files: what is shown is what was run."""

import json
import re
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace

import numpy as np
import pytest

from vanedamp.coupling.orbits.history import late_history
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.explore.point import PointRuns, chosen_value, values_of
from vanedamp.studies.explore.point_view import PointView, point_view, run_in_full, scene_at, view_of
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
from vanedamp.studies.explore.sweep_files import open_sweeps, places_of
from vanedamp.studies.report.motion import HIT, motion_of
from vanedamp.studies.report.motion_page import script_source
from vanedamp.studies.report.plane_history import slider_samples

BODY = {"mass": 0.003, "friction": 0.4, "restitution": 0.7}
SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2400.0, "force": 5.0},
    "cavity": [{"name": "c1", "gap": 2e-5}, {"name": "c2", "gap": 1e-5}],
    "damper": [BODY | {"cavity": "c1"}, BODY | {"cavity": "c2", "position": -1e-6}, BODY | {"cavity": "c2"}],
    "time": {"periods": 60, "transient": 0},
}
BLOCK = BODY | {"cavity": "c1", "shape": "block", "length": 0.01, "height": 0.006}
PLANAR = SCENE | {
    "cavity": [{"name": "c1", "gap": 2e-5, "play": 1e-5, "rotation": 1.0}, {"name": "c2", "gap": 1e-5, "play": 1e-5}],
    "damper": [BLOCK, BODY | {"cavity": "c2", "shape": "disc", "radius": 0.003}],
}
GAPS = [2e-5, 1e-5, 4e-5]
AXES = {
    "cavity.c1.gap": GAPS,
    "excitation.frequency": {"start": 2380.0, "stop": 2430.0, "num": 6},
    "damper.restitution": [0.3, 0.7],
}


def drawn(sweep, along, places):
    return curve_figure(sweep, chosen_curve(sweep, along, places), places)


def scene_of(data):
    return validate(Scene, data, "scene")


@pytest.mark.parametrize(
    "data",
    [SCENE, PLANAR, SCENE | {"solver": {"method": "moreau", "steps_per_period": 1000}}, SCENE | {"damper": []}],
    ids=["sliders", "planar", "moreau", "no bodies"],
)
def test_point_has_the_figures_of_the_curve(data):
    """Samples and events change no figure of a run, and the run begins as that of the curve."""
    curve = sweep(scene_of(data | {"sweep": {"excitation.frequency": [2395.0, 2405.0]}}))
    for place, frequency in enumerate((2395.0, 2405.0)):
        scene = scene_at(json.loads(json.dumps(scene_of(data).to_dict())), frequency)
        response = run_in_full(scene)
        assert response.amplitude_mean == pytest.approx(curve.amplitude_mean[place], rel=1e-12)
        assert response.amplitude_max == pytest.approx(curve.amplitude_max[place], rel=1e-12)
        assert response.classification == curve.classification[place]
        assert f"mean of peaks {1e6 * curve.amplitude_mean[place]:.4g} µm" in view_of(scene, response).summary


def test_level_is_that_of_the_resonance_of_the_curve(tmp_path):
    """A force for an amplitude at resonance is one for all frequencies of a curve, whichever resonance is near."""
    labels = {"at": [1.0, 0.3]}
    model = ReducedModel.from_matrices(np.diag([20.0, 5.0]), np.diag([1e6, 9e5]), labels, damping_ratio=0.01)
    model.save(tmp_path / "rom.h5")
    data = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {"frequency": 34.0, "resonance_amplitude": 1e-3, "at": "at"},
        "cavity": [{"name": "c1", "gap": 1e-3, "floor": "at"}],
        "damper": [BODY | {"cavity": "c1"}],
        "time": {"periods": 10, "transient": 0},
        "sweep": {"excitation.frequency": {"start": 30.0, "stop": 80.0, "num": 3}},
    }
    curve = sweep(scene_of(data))
    found = [run_in_full(scene_at(data, frequency)).amplitude_mean for frequency in (30.0, 55.0, 80.0)]
    np.testing.assert_allclose(found, curve.amplitude_mean, rtol=1e-9)
    without = {key: value for key, value in data.items() if key != "sweep"}
    alone = run_in_full(scene_at(without, 80.0)).amplitude_mean
    assert alone != pytest.approx(curve.amplitude_mean[2], rel=0.1)


def test_views_show_the_run():
    scene = scene_at(SCENE, 2405.0)
    response = run_in_full(scene)
    view = view_of(scene, response)
    traces = {trace.name: trace for trace in view.history.data}
    late = slice(10 * 200, None)  # what a page carries
    np.testing.assert_allclose(traces["structure"].y, 1e6 * response.displacement[late])
    np.testing.assert_allclose(traces["body 2 in its cavity"].y, 1e6 * response.body_displacement[late, 1])
    begin = response.time[late][0]
    impacts = sum(event.kind == "impact" and event.time >= begin for event in response.event_list)
    assert sum(len(trace.x) for name, trace in traces.items() if name.startswith("impacts")) == impacts > 100
    assert {shape.y0 for shape in view.history.layout.shapes} == {-10.0, 10.0}  # of the only body of its cavity
    planes = [trace for trace in view.phase.data if trace.name == "structure"]
    assert len(planes[0].x) == 25 * 200
    starts = next(trace for trace in view.phase.data if trace.name == "starts of periods")
    np.testing.assert_allclose(starts.x, 1e6 * response.section[:, 0])
    styles = [trace.line.dash for trace in view.phase.data if str(trace.name).startswith("body")]
    assert len(set(styles)) == 3
    assert view.motion.count("<script") == 2
    data = json.loads(re.search(r'application/json">(.*?)</script>', view.motion, re.S).group(1))
    assert [cavity["name"] for cavity in data["cavities"]] == ["c1", "c2"]
    assert [body["number"] for cavity in data["cavities"] for body in cavity["bodies"]] == [1, 2, 3]


def test_velocities_are_those_of_the_sections():
    """Differences between impacts, of second order: at the starts of periods the run has the velocities themselves."""
    response = run_in_full(scene_at(SCENE, 2405.0))
    history, speed = late_history(response, 25), 2 * np.pi * 2405.0
    section = response.section[-26:-1]
    step = 2 * np.pi / 200
    bound = 2 / 3 * step**2 * speed * np.abs(response.displacement).max()
    np.testing.assert_allclose(history.velocity[::200], section[:, 1], rtol=0, atol=bound)
    np.testing.assert_allclose(history.displacement[::200], section[:, 0], rtol=0, atol=1e-12)
    rates = response.slip_velocity[-26:-1]
    known = np.isfinite(history.slip_velocity[::200])
    np.testing.assert_allclose(history.slip_velocity[::200][known], rates[known], rtol=0, atol=2 * bound)
    assert known.mean() > 0.9


def test_sliders_are_drawn_from_wall_to_wall():
    """A row fills its cavity but for its free travel: faces meet where impacts are, and never overlap."""
    scene = scene_at(SCENE, 2405.0)
    response = run_in_full(scene)
    plane = slider_samples(scene, response.displacement, response.body_displacement)
    hits = [(e.time, (e.damper, e.side, e.corner)) for e in response.event_list if e.kind == "impact"]
    motion = motion_of(scene, response.time, response.displacement, response.body_displacement, plane, hits)
    unit = motion.scale * motion.factor
    for cavity, given in zip(motion.cavities, scene.cavity, strict=True):
        faces = [cavity.left[:, 0]]
        for body in cavity.bodies:
            faces += [body.outline[:, 0, 0], body.outline[:, 1, 0]]
        faces.append(cavity.right[:, 0])
        gaps = np.array([right - left for left, right in zip(faces[::2], faces[1::2], strict=True)]) / unit
        assert gaps.min() > -1e-9 * given.gap
        np.testing.assert_allclose(gaps.sum(axis=0), given.gap, rtol=1e-9)
        for contact, gap in zip(cavity.contacts, gaps, strict=True):
            struck = contact.light == HIT
            late = [moment for moment, place in hits if place == contact.place and moment >= 57 / 2405.0]
            assert struck.any() == bool(late)
            assert (gap[struck] < 0.3 * given.gap).all()  # within 3 % of a period
        np.testing.assert_allclose(cavity.shift[:, 0] / motion.scale / motion.swing, motion.displacement, rtol=1e-9)
    assert not motion.has_extent


def test_sliders_have_the_gaps_that_the_plane_has():
    """A scene of sliders on springs runs in the plane, whose record has the gaps and the floor's motion itself."""
    bodies = [body | {"stiffness": 1e3} for body in SCENE["damper"]]
    scene = scene_at(SCENE | {"damper": bodies}, 2405.0)
    response = run_in_full(scene)
    mine = slider_samples(scene, response.displacement, response.body_displacement)
    places = [mine.contacts.index(place) for place in response.in_plane.contacts]
    assert sorted(places) == list(range(len(mine.contacts)))
    np.testing.assert_allclose(mine.contact_gap[:, places], response.in_plane.contact_gap, rtol=0, atol=1e-15)
    np.testing.assert_allclose(mine.floor_along, response.in_plane.floor_along, rtol=0, atol=1e-15)


def test_floor_of_a_reduced_model_moves_as_its_mode(tmp_path):
    labels = {"at": [1.0, 0.0], "here": [1.0, 0.0], "there": [-0.5, 0.0]}
    ReducedModel.from_matrices(np.diag([20.0, 5.0]), np.diag([1e6, 9e8]), labels, damping_ratio=0.01).save(
        tmp_path / "rom.h5"
    )
    data = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {"frequency": 34.0, "force": 50.0, "at": "at"},
        "cavity": [{"name": name, "gap": 1e-3, "floor": name} for name in ("here", "there")],
        "damper": [BODY | {"cavity": name} for name in ("here", "there")],
        "time": {"periods": 10, "transient": 0},
    }
    view = point_view(data, 36.0)
    shown = json.loads(re.search(r'application/json">(.*?)</script>', view.motion, re.S).group(1))
    here, there = (np.array(cavity["shift"])[:, 0] for cavity in shown["cavities"])
    assert np.abs(here).max() > 1.0
    np.testing.assert_allclose(there, -here / 2, atol=2e-3)
    assert "mode nearest to the excitation" in view.motion


@pytest.mark.parametrize("data", [SCENE, PLANAR], ids=["sliders", "planar"])
def test_motion_needs_no_network_and_one_script(data):
    """A policy that names the hash of the player's script lets the document play, and nothing else run."""
    import base64
    import hashlib

    document = point_view(data, 2405.0).motion
    (script,) = re.findall(r"<script>(.*?)</script>", document, re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert script_source() == f"'sha256-{digest}'"
    assert set(re.findall(r"https?://[^\"' ]+", document)) <= {"http://www.w3.org/2000/svg"}
    assert not re.search(r"\b(src|href|srcset)=|url\(|@import|\son\w+=", document)


def test_prescribed_motion_and_engine_order_are_shown():
    table = SCENE | {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-5},
        "excitation": {"frequency": 50.0},
    }
    assert "50 Hz" in point_view(table, 50.0).summary
    order = SCENE | {"excitation": {"engine_order": 4, "force": 5.0}, "rotation": {"rpm": 100.0}}
    order["cavity"] = [cavity | {"radius": 0.3} for cavity in SCENE["cavity"]]
    order["sweep"] = {"rotation.rpm": [30000.0, 36000.0]}
    scene = scene_at(order, 36000.0)
    assert scene.frequency == pytest.approx(2400.0, rel=1e-12)
    assert "2400 Hz" in view_of(scene, run_in_full(scene)).summary


def test_run_that_is_not_ok_says_so():
    stopped = SCENE | {"solver": {"max_events": 40}}
    assert "status event_budget" in point_view(stopped, 2405.0).summary
    early = point_view(SCENE | {"solver": {"max_events": 1}}, 2405.0)
    assert "nothing to draw" in early.summary
    assert early.history is None


@pytest.mark.parametrize(
    ("data", "frequency", "told"),
    [
        (SCENE, -3.0, "frequency"),
        (SCENE | {"sweep": {"cavity.c1.gap": [1e-5, 2e-5]}}, -1e-5, "gap"),
        (SCENE | {"damper": [BODY | {"cavity": "c9"}]}, 2400.0, "no cavity 'c9'"),
        (SCENE | {"time": {"periods": 1_000_000}}, 2400.0, "time.periods"),
    ],
)
def test_nonsense_is_one_line(data, frequency, told):
    with pytest.raises(InputError, match=told):
        point_view(data, frequency)
    with ThreadPoolExecutor(1) as pool:
        runs = PointRuns(pool.submit)
        key = runs.begin(data, frequency)
    shown = runs.look(key)
    assert told in shown.summary
    assert "\n" not in shown.summary
    assert shown.history is None


def test_run_is_looked_at_until_it_is_done():
    futures = []

    def submit(function, *arguments):
        futures.append(Future())
        return futures[-1]

    runs = PointRuns(submit)
    key = runs.begin(SCENE, 2400.0)
    assert runs.look(key).startswith("frequency = 2400 Hz: waiting for a worker")
    futures[0].set_running_or_notify_cancel()
    assert runs.look(key).startswith("frequency = 2400 Hz: running for 0 s")
    futures[0].set_result(PointView("done"))
    assert runs.look(key).summary == "done"
    assert runs.look(key).summary == "done"  # a page that was slow asks again
    later = runs.begin(SCENE, 2410.0, former=key)
    assert "not known" in runs.look(key).summary
    other = runs.begin(SCENE, 2420.0)  # of another tab
    assert futures[1].cancel()
    assert "ended abruptly" in runs.look(later).summary
    futures[2].set_exception(BrokenProcessPool("gone"))
    assert "ended abruptly" in runs.look(other).summary
    for number in range(40):
        runs.begin(SCENE, 2400.0 + number)
    assert sum(not future.cancelled() for future in futures[3:]) == 32
    assert "not known" in runs.look(None).summary


def test_frequencies_are_chosen_by_click_field_and_neighbour():
    figure = {
        "data": [
            {"customdata": [2400.0, 2380.0]}, {"customdata": None}, {},
            {"customdata": {"dtype": "f8", "bdata": "AAAAAADQokAAAAAAACqkQA=="}},
        ]
    }  # fmt: skip
    assert values_of(figure).tolist() == [2380.0, 2400.0, 2408.0, 2581.0]
    click = {"points": [{"customdata": 2400.0}]}
    assert chosen_value("curve", click, 1.0, figure) == 2400.0
    assert chosen_value("curve", {"points": [{"customdata": [2400.0]}]}, None, figure) == 2400.0
    assert chosen_value("point-value", click, 2390.5, figure) == 2390.5
    assert chosen_value("point-higher", click, 2400.0, figure) == 2408.0
    assert chosen_value("point-lower", click, 2390.0, figure) == 2380.0
    assert chosen_value("point-lower", click, 10.0, figure) == 2380.0
    assert chosen_value("point-higher", click, 1e6, figure) == 2581.0
    for nonsense in (None, "abc", [], float("nan"), float("inf")):
        assert chosen_value("point-show", click, nonsense, figure) is None
    for nothing in ({}, None, {"points": []}, {"points": [{}]}):
        assert chosen_value("curve", nothing, 5.0, figure) is None
    assert chosen_value("point-higher", None, 7.0, {}) == 7.0


@pytest.fixture(scope="module")
def grid():
    return sweep(scene_of(SCENE | {"sweep": AXES}))


def test_curve_is_that_of_the_chosen_values(grid):
    gap = int(best_design(grid).places["cavity.c1.gap"]) - 1  # another one: the best design has a curve of its own
    places = {"cavity.c1.gap": gap % len(GAPS), "damper.restitution": 0}
    gap = places["cavity.c1.gap"]
    assert abscissas(grid) == ["excitation.frequency", "cavity.c1.gap", "damper.restitution"]
    figure = {trace.name: trace for trace in drawn(grid, "excitation.frequency", places).data}
    np.testing.assert_allclose(figure["damped, mean of peaks"].x, np.linspace(2380.0, 2430.0, 6))
    np.testing.assert_allclose(figure["damped, mean of peaks"].y, 1e6 * grid.amplitude_mean[gap, :, 0])
    for name, kept, peak in (
        ("without bodies", grid.amplitude_undamped, grid.peaks["undamped_peak"]),
        ("bodies fixed", grid.amplitude_fixed, grid.peaks["fixed_peak"]),
    ):
        points = np.isin(figure[name].x, grid.axes["excitation.frequency"])
        np.testing.assert_allclose(figure[name].y[points], 1e6 * kept[gap, :, 0])
        assert figure[name].y.max() == pytest.approx(1e6 * peak[gap, 0], rel=1e-2)  # between the points as well
    behind = [value for value in figure["other values"].y if value is not None]
    others = [grid.amplitude_mean[g, :, k] for g in range(3) for k in range(2) if (g, k) != (gap, 0)]
    np.testing.assert_allclose(behind, 1e6 * np.concatenate(others))
    styles = {figure[name].line.dash for name in ("without bodies", "bodies fixed", "best design")}
    assert len(styles | {figure["damped, mean of peaks"].line.dash}) == 4


def test_any_axis_is_the_abscissa_and_numbers_rise(grid):
    places = {"excitation.frequency": 3, "damper.restitution": 1}
    figure = {trace.name: trace for trace in drawn(grid, "cavity.c1.gap", places).data}
    np.testing.assert_allclose(figure["damped, mean of peaks"].x, [10.0, 20.0, 40.0])
    np.testing.assert_allclose(figure["damped, mean of peaks"].y, 1e6 * grid.amplitude_mean[[1, 0, 2], 3, 1])
    assert "gap" in drawn(grid, "cavity.c1.gap", places).layout.xaxis.title.text
    assert "frequency" in chosen_curve(grid, "cavity.c1.gap", places).name
    ids = [{"type": "sweep-axis", "path": path} for path in ("cavity.c1.gap", "damper.restitution", "gone")]
    assert places_of(grid, [0, 1, 0], ids) == {"cavity.c1.gap": 1, "damper.restitution": 1}
    assert places_of(grid, [7, None, 0], ids) == {}


@pytest.mark.parametrize("along", ["excitation.frequency", "cavity.c1.gap", "damper.restitution"])
def test_points_of_a_sweep_run_again(grid, along):
    """Whatever the abscissa is, a point carries its value, and its run has the sweep's amplitude."""
    places = {"cavity.c1.gap": 2, "excitation.frequency": 4, "damper.restitution": 1}
    figure = {trace.name: trace for trace in drawn(grid, along, places).data}
    value = figure["damped, mean of peaks"].customdata[1]
    scene, axis = json.loads(json.dumps(scene_of_curve(grid, along, places)))
    assert value in axis[along]
    place = tuple(axis[along].index(value) if path == along else at for path, at in places.items())
    response = run_in_full(scene_at(scene | {"sweep": axis}, value))
    assert response.amplitude_mean == pytest.approx(grid.amplitude_mean[place], rel=1e-12)


def test_best_design_has_the_lowest_peak(grid):
    """At its worst restitution, which nobody chooses."""
    peaks = grid.amplitude_mean.max(axis=(1, 2))
    gap = int(np.argmin(peaks))
    best = best_design(grid)
    at, restitution = np.unravel_index(np.argmax(grid.amplitude_mean[gap]), grid.shape[1:])
    assert best.places == {"cavity.c1.gap": gap, "excitation.frequency": at, "damper.restitution": restitution}
    assert best.amplitude == peaks.min()
    assert best.relative == pytest.approx(peaks.min() / grid.peaks["undamped_peak"][gap, restitution])
    assert (best.designs, best.left_out) == (3, 0)
    assert f"gap = {1e6 * GAPS[gap]:.4g} µm" in best_sentence(grid, best)
    assert start_places(grid) == best.places


def test_designs_with_points_that_are_not_ok_are_no_best(grid):
    """A peak that is missing is no low peak."""
    best, status = best_design(grid), grid.status.copy()
    status[best.places["cavity.c1.gap"], 2, best.places["damper.restitution"]] = "event_budget"
    troubled = replace(grid, status=status)
    second = best_design(troubled)
    assert (second.left_out, second.amplitude > best.amplitude) == (1, True)
    assert "1 of 3 designs is left out" in best_sentence(troubled, second)
    assert "5 of 6 points are ok; left out: 1 event_budget" in status_sentence(
        troubled, "excitation.frequency", best.places
    )
    figure = {trace.name: trace for trace in drawn(troubled, "excitation.frequency", best.places).data}
    assert figure["not ok"].text.tolist() == ["event_budget"]
    assert figure["not ok"].x.tolist() == [2400.0]
    assert np.isnan(figure["damped, mean of peaks"].y[2])
    status[:] = "error: gone"
    broken = replace(grid, status=status)
    assert best_design(broken) is None
    assert "No design" in best_sentence(broken, None)
    assert drawn(broken, "excitation.frequency", start_places(broken)).data


def test_best_design_counts_its_worst_start():
    axes = {
        "damper.0.position": [-9e-6, 0.0, 9e-6],
        "cavity.c1.gap": [2e-5, 3e-5],
        "excitation.frequency": [2390.0, 2400.0],
    }
    data = SCENE | {"damper": SCENE["damper"][:1], "sweep": axes, "time": {"periods": 12, "transient": 0}}
    found = sweep(scene_of(data))
    worst = found.amplitude_mean.max(axis=(0, 2))
    best = best_design(replace(found, status=np.full(found.shape, "ok", object)))
    assert best.places["cavity.c1.gap"] == np.argmin(worst)
    assert best.amplitude == worst.min()
    assert best.designs == 2


def test_sweeps_without_numbers_or_frequency(tmp_path):
    words = sweep(
        scene_of(SCENE | {"sweep": {"continuation.direction": ["independent", "up"], "excitation.frequency": [2400.0]}})
    )
    assert abscissas(words) == ["continuation.direction"]
    assert drawn(words, "continuation.direction", start_places(words)).data
    gaps = sweep(scene_of(SCENE | {"sweep": {"cavity.c1.gap": [1e-5, 2e-5, 3e-5]}}))
    best = best_design(gaps)
    assert best.amplitude == gaps.amplitude_mean.min()
    assert "of the amplitude without bodies" in best_sentence(gaps, best)
    words.save(tmp_path / "words.h5")
    gaps.save(tmp_path / "gaps.h5")
    simulate(scene_of(SCENE)).save(tmp_path / "run.h5", {"scene": SCENE})
    assert set(open_sweeps([tmp_path])) == {"words.h5", "gaps.h5"}
    assert set(open_sweeps([tmp_path / "gaps.h5", tmp_path / "words.h5"])) == {"words.h5", "gaps.h5"}
    with pytest.raises(InputError, match="no such file"):
        open_sweeps([tmp_path / "none.h5"])
