"""A run that begins where another has ended goes on as if it had never ended."""

import numpy as np
import pytest

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate

BODY = {"cavity": "c", "mass": 0.1, "friction": 0.3, "restitution": 0.6}
DATA = {
    "structure": {"model": "rigid", "mass": 2.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 11.0, "force": 20.0},
    "cavity": [{"name": "c", "gap": 5e-3}],
    "damper": [BODY],
}
SCENES = {
    "newton": {},
    "compliant": {"contact": {"law": "compliant", "stiffness": 3e4}},
    "pressed": {
        "contact": {"law": "compliant", "stiffness": 2e3}, "gravity": {"orientation_deg": 90.0},
        "damper": [BODY | {"restitution": 0.1}],
    },
    "resting": {"gravity": {"orientation_deg": 90.0}, "excitation": {"frequency": 11.0, "force": 1.0}},
    "row": {"damper": [BODY, BODY | {"position": 1e-3}], "gravity": {"orientation_deg": 30.0}},
    "held spring": {"friction_damper": [{"normal_force": 500.0, "friction": 0.3, "stiffness": 2e3}]},
    "sliding spring": {"friction_damper": [{"normal_force": 20.0, "friction": 0.3, "stiffness": 2e4}]},
    "rubbing": {"friction_damper": [{"normal_force": 20.0, "friction": 0.3}]},
    "table": {
        "structure": {"model": "prescribed", "displacement_amplitude": 5e-3}, "excitation": {"frequency": 11.0}
    },
}  # fmt: skip


def scene(name, periods, **changes):
    return validate(Scene, DATA | SCENES[name] | {"time": {"periods": periods, "transient": 0}} | changes, "scene")


@pytest.mark.parametrize("name", SCENES)
def test_two_halves_are_the_whole(name):
    """Cut at several periods; chaos parts trajectories, so that runs are short."""
    whole = simulate(scene(name, 8))
    for cut in (2, 3, 5):
        first = simulate(scene(name, cut))
        second = simulate(scene(name, 8 - cut), start=first.final)
        assert first.final is not None and second.status == "ok"
        for part in ("section", "slip", "slip_velocity"):
            expected = getattr(whole, part)[cut:]
            scale = np.abs(getattr(whole, part)).max(axis=0)
            assert np.abs(getattr(second, part) - expected).max() <= 1e-8 * scale.max()
        assert first.counters["impacts"] + second.counters["impacts"] == whole.counters["impacts"]
        assert second.energy_residual < 1e-11


def test_scenes_move_as_they_should():
    """The scenes above are what their names say."""
    assert simulate(scene("newton", 8)).counters["impacts"] > 4
    assert simulate(scene("table", 8)).counters["impacts"] > 4
    assert simulate(scene("pressed", 8)).slip.min() < -2.5e-3
    assert simulate(scene("resting", 8)).final.slip[0] == -2.5e-3
    assert abs(simulate(scene("sliding spring", 8)).final.elongation[0]) == pytest.approx(6.0 / 2e4, rel=0.5)
    assert simulate(scene("sliding spring", 8)).energy["friction"] > 0


def test_velocity_and_place_are_physical():
    """The next structure may have another mass."""
    final = simulate(scene("newton", 3)).final
    heavy = scene("newton", 1, structure=DATA["structure"] | {"mass": 3.0})
    begun = simulate(heavy, start=final)
    assert begun.section[0] == pytest.approx([final.displacement[0], final.velocity[0]], rel=1e-12)
    assert begun.slip[0, 0] == pytest.approx(final.slip[0], rel=1e-12)


def test_a_smaller_gap_takes_the_bodies_in():
    final = simulate(scene("row", 3)).final
    tight = scene("row", 1, cavity=[{"name": "c", "gap": 1e-4}], damper=[BODY, BODY])
    begun = simulate(tight, start=final)
    assert np.abs(begun.slip[0]).max() <= 5e-5 * (1 + 1e-12)
    assert begun.slip[0, 0] <= begun.slip[0, 1]
    assert begun.status == "ok"


def test_plain_data_is_exact():
    final = simulate(scene("row", 3)).final
    again = RestartState.from_list(final.to_list())
    for first, second in zip(final.to_list(), again.to_list(), strict=True):
        assert first == second


def test_another_size_is_refused():
    final = simulate(scene("row", 2)).final
    with pytest.raises(InputError, match=r"2 bodies .* does not fit a scene of 1, 1 and 0"):
        simulate(scene("newton", 2), start=final)


def test_stepping_methods_are_refused():
    final = simulate(scene("newton", 2)).final
    with pytest.raises(InputError, match=r"solver.method exact, not moreau"):
        simulate(scene("newton", 2, solver={"method": "moreau"}), start=final)
    assert simulate(scene("newton", 2, solver={"method": "moreau"})).final is None


def test_a_run_that_broke_off_hands_over_nothing():
    assert simulate(scene("newton", 8, solver={"max_events": 5})).final is None
