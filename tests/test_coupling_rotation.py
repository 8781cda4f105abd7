"""Speed of rotation in a scene: engine orders, and structures that become stiffer or softer by it."""

import math

import numpy as np
import pytest

from vanedamp import InputError, ReducedModel, Scene, simulate
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.modal_basis import modal_transfer
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModelError

MASS, STIFFNESS, ADDED, SPEED = 2.0, 800.0, 0.5, 30.0


def scene(**changes):
    data = {
        "structure": {
            "model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": 0.01,
            "centrifugal_stiffness": ADDED,
        },
        "excitation": {"engine_order": 4, "force": 1.0},
        "rotation": {"speed": SPEED},
    }  # fmt: skip
    return validate(Scene, data | changes, "scene")


def test_an_engine_order_follows_the_speed():
    assert scene().frequency == pytest.approx(4 * SPEED / (2 * math.pi), rel=1e-14)
    turning = scene(rotation={"rpm": 600.0})
    assert turning.frequency == pytest.approx(40.0, rel=1e-14)
    assert turning.replace({"rotation.rpm": 300.0}).frequency == pytest.approx(20.0, rel=1e-14)


def test_a_rigid_structure_gains_stiffness_with_the_squared_speed():
    free, _ = linear_responses(scene())
    assert free.stiffness[0] == pytest.approx((STIFFNESS + SPEED**2 * ADDED) / MASS, rel=1e-14)
    assert free.damping[0, 0] == pytest.approx(2 * 0.01 * math.sqrt(free.stiffness[0]), rel=1e-14)


def test_a_reduced_model_is_taken_at_the_speed_of_the_scene(tmp_path):
    stiffness, added = np.array([[800.0, -100.0], [-100.0, 300.0]]), np.array([[2.0, -0.5], [-0.5, 1.0]])
    model = ReducedModel.from_matrices(
        np.eye(2), stiffness, {"tip": [0.0, 1.0]}, damping_ratio=0.02, centrifugal_stiffness=added,
        rotation_axis=[0.0, 0.0, 1.0], rotation_point=[0.0, 0.0, 0.0], greatest_speed=50.0,
    )  # fmt: skip
    model.save(tmp_path / "rom.h5")
    assert ReducedModel.load(tmp_path / "rom.h5").greatest_speed == 50.0
    structure = {"model": "rom", "file": str(tmp_path / "rom.h5")}
    turning = scene(structure=structure, excitation={"engine_order": 2, "force": 1.0, "at": "tip"})
    free, _ = linear_responses(turning)
    assert free.stiffness == pytest.approx(np.linalg.eigvalsh(stiffness + SPEED**2 * added), rel=1e-12)
    with pytest.raises(InputError, match="basis holds from 0 to 50 rad/s, not at 60"):
        linear_responses(turning.replace({"rotation.speed": 60.0}))
    with pytest.raises(ReducedModelError, match="does not rotate"):
        model.at_speed(10.0).at_speed(20.0)


@pytest.fixture
def turning_model(tmp_path):
    """A file of a model of six coordinates whose modes turn into each other as the speed rises."""
    rng = np.random.default_rng(3)
    factor, added = rng.standard_normal((2, 6, 6))
    rows = dict(zip(("tip", "left", "right"), np.eye(6)[:3], strict=True))
    model = ReducedModel.from_matrices(
        np.eye(6) + 0.1 * factor @ factor.T, 1e3 * (factor @ factor.T + np.eye(6)), rows, damping_ratio=0.01,
        centrifugal_stiffness=added @ added.T, rotation_axis=[0.0, 0.0, 1.0], rotation_point=[0.0, 0.0, 0.0],
        greatest_speed=100.0,
    )  # fmt: skip
    model.save(tmp_path / "turning.h5")
    return model, str(tmp_path / "turning.h5")


def test_a_state_stays_where_it_is_when_the_speed_changes(turning_model):
    model, file = turning_model
    structure = Rom("rom", file)
    p = np.random.default_rng(4).standard_normal(6)
    transfer = modal_transfer(structure, 0.0, 100.0)
    before, after = model.natural[1], model.at_speed(100.0).natural[1]
    assert np.abs(transfer - np.eye(6)).max() > 0.1, "the modes do not turn"
    assert after @ transfer @ p == pytest.approx(before @ p, rel=1e-10, abs=1e-12)
    fewer = Rom("rom", file, modes=2, natural=True)
    assert modal_transfer(fewer, 100.0, 100.0) == pytest.approx(np.eye(2), abs=1e-12)


def test_a_run_goes_on_at_another_speed_from_where_it_was(turning_model):
    _, file = turning_model
    body = {"cavity": "c", "mass": 0.01, "friction": 0.1, "restitution": 0.5}
    at_first = scene(
        structure={"model": "rom", "file": file}, excitation={"frequency": 7.0, "force": 1.0, "at": "tip"},
        cavity=[{"name": "c", "gap": 1e-3, "left": "left", "right": "right", "floor": "tip"}], damper=[body],
        rotation={"speed": 0.0}, time={"periods": 12, "transient": 2}, contact={"law": "newton"},
    )  # fmt: skip
    final = simulate(at_first).final
    faster = at_first.replace({"rotation.speed": 80.0})
    start = at_speed_of(faster, final)
    rows = [assemble(each).of_structure.J for each in (at_first, faster)]
    displacement = [row @ state.displacement for row, state in zip(rows, (final, start), strict=True)]
    size = np.abs(displacement[0]).max()
    assert size > 0.0 and displacement[1] == pytest.approx(displacement[0], rel=1e-10, abs=1e-12 * size)
    assert simulate(faster, start=final).final.speed == pytest.approx([80.0])
    assert at_speed_of(faster, start) is start


def test_speeds_that_mean_nothing_are_refused():
    with pytest.raises(InputError, match="engine_order"):
        scene(excitation={"engine_order": 0, "force": 1.0})
    with pytest.raises(InputError, match="give one of frequency"):
        scene(excitation={"engine_order": 2, "frequency": 10.0, "force": 1.0})
    with pytest.raises(InputError, match="engine_order: its frequency follows the speed"):
        scene(rotation={"speed": 0.0})
    with pytest.raises(InputError, match="give one of speed"):
        scene(rotation={"speed": 1.0, "rpm": 1.0})
    softened = scene().replace({"structure.centrifugal_stiffness": -1.0})
    with pytest.raises(InputError, match=r"unstable from 28\.2843 rad/s on"):
        linear_responses(softened)
