"""What a run with bodies in the plane keeps beside its amplitudes: samples of the motion, loss of each impact."""

import json

import numpy as np
import pytest

from tests.tools.planar import planar_scene, still_table
from tests.tools.sensitive_scenes import scene_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import load
from vanedamp.files.toml_input import InputError, validate

BLOCK = {"shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": 0.3, "restitution": 0.6}
#: corners from the centre, in half lengths and half heights
CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
GAP, PLAY = 2e-3, 1e-3


def mixed(**changes):
    """A block, a disc and a slider in cavities of their own on an oscillator that also turns them."""
    data = {
        "structure": {"model": "rigid", "mass": 20.0, "stiffness": 8e5, "damping_ratio": 0.01},
        "excitation": {"frequency": 30.0, "force": 100.0},
        "initial": {"velocity": 0.2},
        "cavity": [
            {"name": "one", "gap": GAP, "play": PLAY, "normal_motion": 0.2, "rotation": 0.5},
            {"name": "two", "gap": GAP, "play": PLAY},
            {"name": "three", "gap": GAP},
        ],
        "damper": [
            BLOCK | {"cavity": "one", "tilt": 1e-3},
            {"cavity": "two", "shape": "disc", "radius": 0.01, "mass": 0.5, "friction": 0.2, "restitution": 0.5},
            {"cavity": "three", "mass": 0.5, "friction": 0.2, "restitution": 0.5},
        ],
        "time": {"periods": 12, "transient": 4},
    }  # fmt: skip
    return data | changes


@pytest.mark.parametrize(
    "solver",
    [{}, {"method": "moreau", "steps_per_period": 2000}, {"method": "solve_ivp", "steps_per_period": 100}],
)
def test_gaps_are_those_of_the_sampled_poses(solver):
    """In the frame of the cavity a corner is at the body's place, less its height times the tilt; so are its gaps."""
    periods = {"time": {"periods": 4, "transient": 1}} if solver.get("method") == "solve_ivp" else {}
    response = simulate(validate(Scene, mixed(solver=solver, **periods), "scene"), samples_per_period=100)
    plane, slip = response.in_plane, response.body_displacement
    assert [sum(body == k for body, _, _ in plane.contacts) for k in range(3)] == [8, 4, 2]
    half = np.array([0.01, 0.005])
    along, lift, tilt = slip[:, 0], plane.body_lift[:, 0], plane.body_tilt[:, 0]
    for place, (body, side, corner) in enumerate(plane.contacts):
        gap = plane.contact_gap[:, place]
        if body == 0:
            a, b = CORNERS[corner] * half
            expected = {
                "left": GAP / 2 + along - b * tilt, "right": GAP / 2 - along + b * tilt,
                "floor": lift + a * tilt, "ceiling": PLAY - lift - a * tilt,
            }[side]  # fmt: skip
        elif body == 1:
            x, y = slip[:, 1], plane.body_lift[:, 1]
            expected = {"left": GAP / 2 + x, "right": GAP / 2 - x, "floor": y, "ceiling": PLAY - y}[side]
        else:
            expected = GAP / 2 + slip[:, 2] * (1 if side == "left" else -1)
        np.testing.assert_allclose(gap, expected, rtol=0, atol=1e-9 * GAP)
    np.testing.assert_allclose(plane.floor_along[:, 0], response.displacement, rtol=0, atol=1e-12)
    np.testing.assert_allclose(plane.floor_across[:, 0], 0.2 * response.displacement, rtol=0, atol=1e-12)
    np.testing.assert_allclose(plane.floor_rotation[:, 0], 0.5 * response.displacement, rtol=0, atol=1e-12)
    assert np.isnan(plane.body_tilt[:, 2]).all()
    first = response.transient * 100
    # tilts turn round at impacts, between samples that are 1 % of a period apart
    assert np.abs(tilt[first:]).max() >= 0.8 * response.tilt_max[0]
    assert np.abs(tilt[first:]).max() <= response.tilt_max[0] * (1 + 1e-12)
    closed = plane.contact_closed
    assert closed.any()
    assert not closed.all(axis=0).any()
    if not solver:
        assert np.abs(plane.contact_gap[closed]).max() <= 1e-9 * GAP
        floors = [place for place, (body, side, _) in enumerate(plane.contacts) if (body, side) == (0, "floor")]
        off = 1 - closed[first:, floors].any(axis=1).mean()
        assert off == pytest.approx(response.lift_share[0], abs=0.03)  # by 800 samples of some 100 stays


def test_a_prescribed_base_carries_its_floors():
    scene = planar_scene(still_table(20.0, amplitude=2e-4), BLOCK, gap=GAP, play=PLAY)
    response = simulate(scene, samples_per_period=50)
    np.testing.assert_allclose(response.in_plane.floor_along[:, 0], response.displacement, rtol=0, atol=1e-15)
    assert np.ptp(response.displacement) == pytest.approx(4e-4, rel=1e-2)


@pytest.mark.parametrize("solver", [{}, {"method": "moreau", "steps_per_period": 20000}, {"method": "solve_ivp"}])
def test_losses_of_impacts_are_all_that_is_lost_in_flight(solver):
    """Without gravity and damping nothing takes energy but impacts, friction during them included."""
    thrown = BLOCK | {"lift": 3e-4, "velocity": 0.3, "lift_velocity": 0.1, "tilt": 2e-4, "tilt_rate": 1.0}
    scene = planar_scene(still_table(50.0, gravity=0.0), thrown, gap=GAP, play=PLAY, periods=2)
    scene = validate(Scene, scene.to_dict() | {"solver": solver}, "scene")
    response = simulate(scene, events=True)
    impacts = [event for event in response.event_list if event.kind == "impact"]
    assert len(impacts) > 5
    assert any(abs(event.tangential_impulse) > 0.01 * event.impulse for event in impacts)
    lost = sum(event.loss for event in impacts)
    assert lost == pytest.approx(response.energy["friction"] + response.energy["impact"], rel=1e-9)
    assert lost == pytest.approx(-response.energy["stored"], rel=1e-9)
    assert min(event.loss for event in impacts) >= -1e-12 * lost


def test_file_has_samples_and_events_with_their_units(tmp_path):
    response = simulate(validate(Scene, mixed(), "scene"), events=True, samples_per_period=20)
    response.save(tmp_path / "run.h5")
    values, _ = load(tmp_path / "run.h5", "response")
    sampled = [name for name in vars(response.in_plane) if name != "contacts"]
    assert len(sampled) == 7
    for name in sampled:
        np.testing.assert_array_equal(values[name], getattr(response.in_plane, name))
    places = zip(values["contact_damper"], values["contact_side"], values["contact_corner"], strict=True)
    assert tuple(places) == response.in_plane.contacts
    np.testing.assert_array_equal(values["event_loss"], [event.loss for event in response.event_list])
    tilt = load(tmp_path / "run.h5", "response")[1]["tilt_max"]
    np.testing.assert_array_equal(tilt, np.array(response.tilt_max, float))
    listed = response.to_json(events=True)["event_list"]
    assert [event["loss"] for event in listed] == [event.loss for event in response.event_list]


GRID = {"sweep": {"excitation.frequency": [30.0, 31.0], "damper.0.friction": [0.3, 0.1]}}


@pytest.fixture(scope="module")
def swept():
    return sweep(validate(Scene, mixed(**GRID), "scene"))


def test_sweep_has_the_tilt_of_every_body(swept, tmp_path):
    for i, frequency in enumerate((30.0, 31.0)):
        for j, friction in enumerate((0.3, 0.1)):
            changes = {"excitation.frequency": frequency, "damper.0.friction": friction}
            response = simulate(validate(Scene, mixed(), "scene").replace(changes))
            for name in ("tilt_max", "lift_share", "linearisation"):
                expected = np.array(getattr(response, name), float)
                np.testing.assert_array_equal(swept.in_plane[name][i, j], expected)
    swept.save(tmp_path / "sweep.h5")
    again = Sweep.load(tmp_path / "sweep.h5")
    for name, values in swept.in_plane.items():
        np.testing.assert_array_equal(again.in_plane[name], values)
    data = json.loads(json.dumps(swept.to_json()))
    assert data["units"]["tilt_max"] == "rad"
    np.testing.assert_array_equal(np.array(data["lift_share"], float), swept.in_plane["lift_share"])


def test_sweep_of_sliders_has_no_tilt(tmp_path):
    data = mixed(**GRID)
    data["damper"] = [{"cavity": "one", "mass": 0.5, "friction": 0.2, "restitution": 0.5}]
    made = sweep(validate(Scene, data, "scene"))
    assert made.in_plane == {}
    assert not {"tilt_max", "lift_share", "linearisation"} & (set(made.to_json()) | set(made.to_json()["units"]))
    made.save(tmp_path / "sweep.h5")
    assert Sweep.load(tmp_path / "sweep.h5").in_plane == {}


def test_resumed_sweep_is_the_same(swept, tmp_path):
    class Stop(Exception):
        pass

    def stop(done, _):
        if done:
            raise Stop

    scene = validate(Scene, mixed(**GRID), "scene")
    with pytest.raises(Stop):
        sweep(scene, progress=stop, checkpoint=tmp_path / "sweep.h5.partial")
    again = sweep(scene, checkpoint=tmp_path / "sweep.h5.partial")
    np.testing.assert_array_equal(again.in_plane["tilt_max"], swept.in_plane["tilt_max"])


def test_checkpoint_with_other_measures_is_refused(tmp_path):
    import h5py

    scene, file = validate(Scene, mixed(**GRID), "scene"), tmp_path / "sweep.h5.partial"
    sweep(scene, checkpoint=file)
    with h5py.File(file, "r+") as kept:
        values = kept["values"][:-1]
        del kept["values"], kept["column"]
        kept["values"] = values
    with pytest.raises(InputError, match="kept other measures"):
        sweep(scene, checkpoint=file)


@pytest.mark.parametrize("seed", [225, 243, 357])
def test_largest_tilt_is_that_of_dense_samples(seed, tmp_path):
    """Where contacts turn bodies many times faster than the excitation: maxima lie between events."""
    _, drawn = scene_of(seed, tmp_path)
    response = simulate(drawn.replace({"time": {"periods": 2, "transient": 0}}), samples_per_period=20_000)
    (tilting,) = np.flatnonzero(~np.isnan(response.tilt_max))
    dense = np.abs(response.in_plane.body_tilt[:, tilting]).max()
    assert dense * (1 - 1e-12) <= response.tilt_max[tilting] <= dense * (1 + 2e-6)
