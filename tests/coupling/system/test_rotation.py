"""Speed of rotation in a scene: engine orders, and structures that become stiffer or softer by it."""

import math

import numpy as np
import pytest

from vanedamp import InputError, ReducedModel, Scene, Sweep, orbits, simulate, sweep
from vanedamp.coupling.model_order.choices import with_choices
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.modal_basis import modal_transfer
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModelError
from vanedamp.studies.report.charts import axis_title
from vanedamp.studies.report.forced_response import forced_responses

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
        greatest_speed=100.0, directions={row: [0.0, 0.0, 1.0] for row in rows}, positions=np.full((3, 3), 0.01),
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


def test_a_state_at_standstill_stays_where_it_is_when_the_structure_begins_to_turn(turning_model):
    """Left by a scene without [rotation], whose modes are those of standstill."""
    _, file = turning_model
    tables = {
        "structure": {"model": "rom", "file": file}, "time": {"periods": 2, "transient": 0},
        "excitation": {"frequency": 5.0, "force": 1.0, "at": "tip"},
    }  # fmt: skip
    still = validate(Scene, tables, "scene")
    final = simulate(still).final
    moved = at_speed_of(validate(Scene, tables | {"rotation": {"speed": 80.0}}, "scene"), final)
    transfer = modal_transfer(still.structure, 0.0, 80.0)
    assert np.abs(transfer - np.eye(6)).max() > 0.1
    np.testing.assert_allclose(moved.displacement, transfer @ final.displacement, rtol=1e-12)


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
    rows = [line_system(assemble(each)).of_structure.J for each in (at_first, faster)]
    displacement = [row @ state.displacement for row, state in zip(rows, (final, start), strict=True)]
    size = np.abs(displacement[0]).max()
    assert size > 0.0 and displacement[1] == pytest.approx(displacement[0], rel=1e-10, abs=1e-12 * size)
    assert simulate(faster, start=final).final.speed == pytest.approx([80.0])
    assert at_speed_of(faster, start) is start
    again = at_speed_of(faster, RestartState.from_list(final.to_list()))
    assert np.array_equal(again.displacement, start.displacement) and np.array_equal(again.velocity, start.velocity)


def along_order(order=4, **changes):
    """A sweep of the speed along an engine order, whose line the resonance meets once."""
    return scene(
        excitation={"engine_order": order, "resonance_amplitude": 1e-3},
        sweep={"rotation.speed": {"start": 4.0, "stop": 6.0, "num": 41}}, time={"periods": 400, "transient": 300},
        **changes,
    )  # fmt: skip


def test_a_sweep_along_an_engine_order_has_the_level_of_its_crossing():
    """k + W^2 k1 = m (order W)^2: there the undamped curve is as high as resonance_amplitude says, and nowhere else.

    The peak along the line is that of the frequency at one speed but for terms of the damping's square, 1e-4.
    """
    found = sweep(along_order())
    crossing = math.sqrt(STIFFNESS / (MASS * 4**2 - ADDED))
    assert found.peaks["undamped_peak"] == pytest.approx(1e-3, rel=1e-4)
    assert found.peaks["undamped_peak_frequency"] == pytest.approx(4 * crossing / (2 * math.pi), rel=2e-4)
    # along the line the natural frequency rises with the speed, so that the resonance is wider than at one speed
    rise = ADDED * crossing / (MASS * 4 * crossing) / 4
    natural = 4 * crossing / (2 * math.pi)
    assert found.peaks["half_power_width"] == pytest.approx(2 * 0.01 * natural / (1 - rise), rel=1e-3)
    # one force for all speeds
    k = STIFFNESS + np.array([4.0, 6.0]) ** 2 * ADDED
    omega = 4 * np.array([4.0, 6.0])
    force = found.amplitude_undamped[[0, -1]] * np.abs(k - MASS * omega**2 + 2j * 0.01 * np.sqrt(k * MASS) * omega)
    assert force == pytest.approx(np.full(2, force[0]), rel=1e-12)
    assert found.units() == {"rotation.speed": "rad/s"}
    (curve,) = forced_responses(found)
    assert curve.headline.undamped_peak_at == pytest.approx(crossing, rel=2e-4)
    assert "of the maximum without bodies 0.001 m, at rotation.speed = 5.05 rad/s" in curve.sentence
    assert axis_title(curve.axis, curve.units, curve.hertz) == (
        "speed of rotation, rad/s (along the engine order 0.63662 Hz a rad/s)"
    )


def test_revolutions_a_minute_are_an_axis_as_well(tmp_path):
    rpm = [value * 30 / math.pi for value in np.linspace(4.0, 6.0, 41)]
    of_rpm = sweep(along_order().replace({"sweep": {"rotation.rpm": rpm}, "rotation": {"rpm": 40.0}}))
    of_speed = sweep(along_order())
    assert of_rpm.amplitude_undamped == pytest.approx(of_speed.amplitude_undamped, rel=1e-9)
    assert of_rpm.peaks["undamped_peak_frequency"] == pytest.approx(of_speed.peaks["undamped_peak_frequency"], rel=1e-8)
    assert of_rpm.units() == {"rotation.rpm": "rpm"}
    of_rpm.save(tmp_path / "sweep.h5")
    again = Sweep.load(tmp_path / "sweep.h5")
    place = forced_responses(again)[0].headline.undamped_peak_at
    assert place == pytest.approx(forced_responses(of_speed)[0].headline.undamped_peak_at * 30 / math.pi, rel=1e-8)


def reduced_sweep(file, speeds, **changes):
    body = {"cavity": "c", "mass": 0.02, "friction": 0.1, "restitution": 0.5}
    return scene(
        structure={"model": "rom", "file": file, "modes": 3, "natural": True},
        excitation={"engine_order": 3, "resonance_amplitude": 1e-3, "at": "tip"},
        cavity=[{"name": "c", "gap": 5e-4, "left": "left", "right": "right", "floor": "tip"}], damper=[body],
        sweep={"rotation.speed": speeds}, rotation={"speed": 1.0}, time={"periods": 30, "transient": 20}, **changes,
    )  # fmt: skip


def test_runs_of_a_sweep_over_the_speed_continue_from_each_other(turning_model):
    """Each begins where the one before has ended, in the modes of its own speed."""
    swept = reduced_sweep(turning_model[1], [10.0, 11.0, 12.0], continuation={"direction": "up"})
    found = sweep(swept)
    assert (found.status == "ok").all()
    state, base = None, grid(swept).base
    for place, speed in enumerate(found.axes["rotation.speed"]):
        response = simulate(base.replace({"rotation.speed": speed}), start=state)
        assert found.amplitude_mean[place] == response.amplitude_mean
        state = response.final
        assert state.speed[0] == speed


def test_a_sweep_of_speed_and_frequency_takes_each_speed_once(turning_model):
    """Small eigenproblems, one set a speed: not one a point."""
    from vanedamp.coupling.system import modal_basis

    swept = reduced_sweep(turning_model[1], np.linspace(10.0, 60.0, 30).tolist()).replace(
        {"excitation": {"frequency": 6.0, "force": 1.0, "at": "tip"}, "damper": [], "cavity": []}
    )
    swept = swept.replace({"sweep": {"excitation.frequency": [5.0, 6.0, 7.0], **swept.to_dict()["sweep"]}})
    modal_basis._rom_basis.cache_clear()
    assert np.isfinite(sweep(swept).amplitude_mean).all()
    assert modal_basis._rom_basis.cache_info().misses == 30


def test_modes_are_chosen_for_the_slowest_and_the_fastest_points(turning_model):
    """The whole range of speeds has one number of modes, no less than each end by itself needs."""
    contact = {"law": "compliant", "stiffness": 1e5}
    auto = {"model": "rom", "file": turning_model[1], "modes": "auto", "tolerance": 0.2}
    swept = reduced_sweep(turning_model[1], [10.0, 50.0, 90.0], contact=contact)
    swept = swept.replace({"structure": auto, "time.periods": 40_000})  # fewer take the whole model
    points = grid(swept)
    chosen = [with_choices(points.base.replace({"rotation.speed": x}), points.choices).scene for x in (10.0, 90.0)]
    assert chosen[0].structure == chosen[1].structure and isinstance(chosen[0].structure.modes, int)
    alone = [grid(swept.replace({"sweep": {"rotation.speed": [x]}})) for x in (10.0, 90.0)]
    assert points.estimate["modes"] >= max(each.estimate["modes"] for each in alone)


def test_speeds_of_a_sweep_are_checked_before_its_runs(turning_model, tmp_path):
    with pytest.raises(InputError, match=r"rotation: .*basis holds from 0 to 100 rad/s, not at 101"):
        grid(reduced_sweep(turning_model[1], [10.0, 101.0]))
    with pytest.raises(InputError, match=r"sweep: at rotation.speed = 0.0: .*engine_order"):
        grid(reduced_sweep(turning_model[1], [0.0, 10.0]))
    ReducedModel.from_matrices(np.eye(2), np.eye(2), {"tip": [0.0, 1.0]}, damping_ratio=0.01).save(
        tmp_path / "still.h5"
    )
    still = {"model": "rom", "file": str(tmp_path / "still.h5")}
    with pytest.raises(InputError, match=r"^rotation: .*still.h5: the model does not rotate .* reduce again$"):
        grid(reduced_sweep(turning_model[1], [10.0]).replace({"structure": still, "cavity": [], "damper": []}))
    softened = {"model": "rigid", "mass": 2.0, "stiffness": 800.0, "damping_ratio": 0.01, "centrifugal_stiffness": -1.0}
    with pytest.raises(InputError, match=r"unstable from 28\.2843 rad/s on"):
        grid(along_order(structure=softened).replace({"sweep": {"rotation.speed": [1.0, 29.0]}}))


def test_a_prescribed_structure_may_turn():
    driven = scene(
        structure={"model": "prescribed", "displacement_amplitude": 1e-3}, excitation={"engine_order": 2},
        rotation={"rpm": 600.0},
    )  # fmt: skip
    assert simulate(driven).frequency == pytest.approx(20.0, rel=1e-14)


def test_a_branch_of_orbits_over_the_speed():
    """Without contact its amplitude is that of the linear curve along the engine order, at one level."""
    table = {"parameter": "rotation.speed", "from": 4.95, "to": 5.15, "start": "linear", "step": 0.1, "max_step": 0.2}
    apart = scene(
        excitation={"engine_order": 4, "resonance_amplitude": 1e-3}, orbit=table,
        cavity=[{"name": "c", "gap": 1.0, "radius": 1.0}],
        damper=[{"cavity": "c", "mass": 1e-9, "friction": 1e9, "restitution": 0.5}],
    )  # fmt: skip
    (branch,) = orbits(apart).branches
    assert branch.parameter[0] == 4.95 and branch.parameter[-1] == pytest.approx(5.15)
    k, omega = STIFFNESS + branch.parameter**2 * ADDED, 4 * branch.parameter
    curve = 1 / np.abs(k - MASS * omega**2 + 2j * 0.01 * np.sqrt(k * MASS) * omega)
    crossing = STIFFNESS / (MASS * 4**2 - ADDED)
    force = 1e-3 * 2 * 0.01 * (STIFFNESS + crossing * ADDED)
    assert branch.amplitude_max == pytest.approx(force * curve, rel=1e-3)  # the level errs by the damping's square


def test_a_branch_of_orbits_over_the_speed_of_a_reduced_model(turning_model):
    """Its modes turn on the way: without contact the amplitude is that of the linear curve at every speed."""
    base = reduced_sweep(turning_model[1], [10.0]).replace({"sweep": {}, "cavity.c.gap": 1.0, "damper.mass": 1e-9})
    base = base.replace({
        "structure": {"model": "rom", "file": turning_model[1]}, "damper.friction": 1e9,
        "excitation": {"engine_order": 0.5, "force": 1.0, "at": "tip"},
    })  # fmt: skip
    table = {"parameter": "rotation.speed", "from": 20.0, "to": 40.0, "start": "linear", "step": 0.5, "max_step": 1.0}
    (branch,) = orbits(base.replace({"orbit": table})).branches
    for speed, amplitude in zip(branch.parameter, branch.amplitude_max, strict=True):
        turned = base.replace({"rotation.speed": speed})
        linear = linear_responses(turned)[0].amplitude(np.array([turned.frequency]))[0]
        assert amplitude == pytest.approx(linear, rel=1e-6)
    assert branch.parameter[-1] == pytest.approx(40.0) and len(branch.parameter) > 4


def test_states_of_a_branch_are_those_of_runs_at_its_speeds(turning_model):
    """A passage with impacts ends where the engine does, and its derivative is that of differences."""
    base = reduced_sweep(turning_model[1], [10.0]).replace({"sweep": {}, "rotation.speed": 10.0, "cavity.c.gap": 2e-5})
    walked = period_map(base, "rotation.speed")
    start = walked.state_of(simulate(base).final)
    there = walked.at(14.0)
    assert there.state_of(simulate(base).final) == pytest.approx(start, rel=1e-9, abs=1e-12)
    short = there.scene.replace({"time": {"periods": 1, "transient": 0}})
    final = simulate(short, start=there.restart_of(start)).final
    passage = there(start)
    assert any(name.startswith("impact") for name in passage.sequence)
    assert there.state_of(final) == pytest.approx(passage.state, rel=1e-9, abs=1e-9 * np.abs(passage.state).max())
    # one-mode steps, small beside the motion, keep the sequence of events
    step = 1e-6 * np.abs(start[:3]).max()
    differences = [
        (there(start + step * unit).state - there(start - step * unit).state) / (2 * step)
        for unit in np.eye(len(start))[:3]
    ]
    known = passage.derivative[:, :3]
    assert np.transpose(differences) == pytest.approx(known, rel=1e-3, abs=1e-3 * np.abs(known).max())


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
