"""Runs of bodies in the plane that begin where another has ended."""

import numpy as np
import pytest

from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError, validate

#: a cavity that moves along, across and turns, with two blocks, and one with a slider on a spring
DATA = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 400.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 3.1, "force": 2.0},
    "initial": {"velocity": 0.1},
    "gravity": {"acceleration": 0.05},
    "cavity": [
        {"name": "c1", "gap": 0.02, "play": 0.002, "normal_motion": 0.1, "rotation": 0.05}, {"name": "c2", "gap": 0.03},
    ],
    "damper": [
        {
            "cavity": "c1", "shape": "block", "length": 0.03, "height": 0.02, "mass": 0.05, "friction": 0.3,
            "restitution": 0.8, "position": -0.006, "tilt": 0.01, "lift": 5e-4,
        },
        {
            "cavity": "c1", "shape": "block", "length": 0.02, "height": 0.025, "mass": 0.04, "friction": 0.2,
            "restitution": 0.8, "position": 0.004,
        },
        {"cavity": "c2", "mass": 0.03, "stiffness": 8.0, "restitution": 0.5, "friction": 0.1},
    ],
}  # fmt: skip


def scene(periods, **changes):
    return validate(Scene, DATA | {"time": {"periods": periods, "transient": 0}} | changes, "scene")


@pytest.mark.parametrize("cut", [1, 3])
def test_a_run_in_two_parts_is_the_run_in_one(cut):
    """To what some forty impacts make of the round-off of the state."""
    whole = simulate(scene(cut + 1), events=True)
    first = simulate(scene(cut))
    second = simulate(scene(1), start=RestartState.from_list(first.final.to_list()))
    assert sum(event.time > cut / 3.1 for event in whole.event_list) > 20
    scale = np.abs(whole.section).max(axis=0)
    np.testing.assert_allclose(second.section / scale, whole.section[cut:] / scale, rtol=0, atol=1e-8)
    np.testing.assert_allclose(second.peak, whole.peak[cut:], rtol=1e-8)
    for name in ("displacement", "velocity", "slip", "slip_velocity", "lift", "tilt"):
        one, other = getattr(whole.final, name), getattr(second.final, name)
        np.testing.assert_allclose(other, one, atol=1e-8 * max(np.abs(one).max(), 1e-3))


#: a body on springs with dashpots that gravity presses onto a floor and a wall
SPRUNG = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 400.0, "damping_ratio": 0.02},
    "excitation": {"frequency": 3.1, "force": 2.0},
    "gravity": {"acceleration": 9.81, "orientation_deg": 20.0},
    "cavity": [{"name": "c1", "gap": 0.02, "play": 0.002}],
    "initial": {},
}  # fmt: skip
BODIES = {"block": {"length": 0.03, "height": 0.02}, "disc": {"radius": 0.01}}


@pytest.mark.parametrize(
    ("shape", "stiffness", "frequency", "gravity"),
    [("block", 200.0, 3.1, 9.81), ("block", 60.0, 3.7, 1.0), ("disc", 30.0, 4.3, 9.81)],
)
def test_a_cut_leaves_springs_as_they_are(shape, stiffness, frequency, gravity):
    """Contacts that are compressed at the cut, or lag behind a body that leaves, are no impacts of the next run."""
    body = {"cavity": "c1", "mass": 0.05, "friction": 0.2, "restitution": 0.3, "position": -0.004}
    tables = SPRUNG | {
        "damper": [body | {"shape": shape} | BODIES[shape]], "contact": {"law": "compliant", "stiffness": stiffness},
        "excitation": {"frequency": frequency, "force": 2.0}, "gravity": SPRUNG["gravity"] | {"acceleration": gravity},
    }  # fmt: skip
    whole, system = simulate(scene(20, **tables)), assemble(scene(1, **tables))
    pressed = lags = 0
    for cut in (3, 8, 10, 13, 16, 17):
        first = simulate(scene(cut, **tables))
        second = simulate(scene(20 - cut, **tables), start=RestartState.from_list(first.final.to_list()))
        for part in ("section", "slip", "slip_velocity", "peak"):
            expected = getattr(whole, part)
            np.testing.assert_allclose(getattr(second, part), expected[cut:], atol=1e-9 * np.abs(expected).max())
        assert first.counters["impacts"] + second.counters["impacts"] == whole.counters["impacts"]
        assert second.energy_residual < 1e-12
        q, v = motion_of(system, first.final)
        gap, speed = system.rest + system.J[: len(system.rest)] @ q, system.J[: len(system.rest)] @ v
        inside = np.isfinite(system.spring) & (gap < -1e-9)
        pushes = np.where(inside, system.spring, 0.0) * gap + system.dashpot * speed < 0.0
        pressed, lags = pressed + (inside & pushes).sum(), lags + (inside & ~pushes).sum()
    assert pressed > 5 and (lags > 3 or gravity * stiffness > 1e3)


def test_springs_of_a_smaller_cavity_are_not_compressed():
    """A block on compliant contacts is put into a cavity with less play; in its own it stays as it is."""
    body = {"cavity": "c1", "mass": 0.05, "shape": "block", "restitution": 0.9} | BODIES["block"]
    tables = SPRUNG | {"damper": [body], "contact": {"law": "compliant", "stiffness": 200.0}}
    given = scene(1, **tables)
    state = simulate(given).final
    for gap, play in ((0.02, 0.002), (0.02, 0.0005), (0.003, 0.002)):
        smaller = scene(1, **tables | {"cavity": [{"name": "c1", "gap": gap, "play": play}]})
        system = assemble(smaller)
        begun = start_of(smaller, system, state)
        gaps = (system.rest + system.J[: len(system.rest)] @ motion_of(system, begun).q)[: system.contacts]
        if (gap, play) == (0.02, 0.002):
            assert begun.to_list() == state.to_list() and gaps.min() < -1e-4
        else:
            changed = system.travels != state.gap
            assert changed.any() and gaps[changed].min() >= -1e-12 * play


def test_the_state_is_relative_to_the_cavity():
    final = simulate(scene(4)).final
    assert final.lift.shape == final.tilt.shape == (3,)
    assert final.lift[2] == final.tilt_rate[2] == 0.0
    # inside its cavity, whatever the structure does
    assert np.all(np.abs(final.tilt[:2]) <= 0.002 / np.array([0.03, 0.02]) * (1 + 1e-9))
    assert np.all((final.lift >= -1e-12) & (final.lift <= 0.002))


def test_a_smaller_cavity_takes_the_bodies_in():
    final = simulate(scene(4)).final
    cavity = [DATA["cavity"][0] | {"gap": 0.013, "play": 0.001}, DATA["cavity"][1] | {"gap": 0.02}]
    begun = simulate(scene(2, cavity=cavity, solver={"linearisation": 0.1}), start=final)
    assert begun.status == "ok"
    assert np.abs(begun.slip[:, :2]).max() <= 0.0065 * (1 + 1e-9)
    assert np.abs(begun.slip[:, 2]).max() <= 0.01 * (1 + 1e-9)


def test_states_of_sliders_and_of_blocks_do_not_mix():
    sliders = [{"cavity": "c1", "mass": 0.05}, {"cavity": "c1", "mass": 0.05}, {"cavity": "c2", "mass": 0.03}]
    final = simulate(scene(1)).final
    with pytest.raises(InputError, match="continuation: a state of bodies that move in the plane"):
        simulate(scene(1, damper=sliders), start=final)
    with pytest.raises(InputError, match="continuation: a state of bodies that move in the plane"):
        simulate(scene(1), start=simulate(scene(1, damper=sliders)).final)


def test_time_stepping_leaves_no_state():
    with pytest.raises(InputError, match=r"continuation: is for solver\.method exact, not moreau"):
        simulate(scene(1, solver={"method": "moreau"}), start=simulate(scene(1)).final)


def test_continuation(tmp_path):
    """Each point begins with the state of the one before; a sweep resumed from its checkpoint is the same."""
    linked = {"sweep": {"excitation.frequency": [3.0, 3.1, 3.2]}, "continuation": {"direction": "up"}}
    result = sweep(scene(5, **linked))
    state = None
    for k, frequency in enumerate(result.axes["excitation.frequency"]):
        response = simulate(scene(5, excitation={"frequency": frequency, "force": 2.0}), start=state)
        assert result.amplitude_mean[k] == response.amplitude_mean
        state = response.final

    def interrupt(done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(scene(5, **linked), progress=interrupt, checkpoint=tmp_path / "sweep.partial")
    resumed = sweep(scene(5, **linked), checkpoint=tmp_path / "sweep.partial")
    np.testing.assert_array_equal(resumed.amplitude_mean, result.amplitude_mean)
