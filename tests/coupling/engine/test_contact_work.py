"""Work of each contact against the energy balance of the whole, and against closed forms."""

import numpy as np
import pytest

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

_BASE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2414.0, "force": 40.0},
    "gravity": {"acceleration": 9.81},
    "cavity": [{"name": "c", "gap": 2e-5, "play": 2e-4, "rotation": 5.0, "normal_motion": 0.1}],
    "time": {"periods": 120, "transient": 20},
    "wear": {},
}
_BODY = {"cavity": "c", "mass": 0.003, "friction": 0.4, "restitution": 0.7}
_BLOCK = _BODY | {"shape": "block", "length": 6.88e-3, "height": 4.8e-3, "tilt": 1e-4}
_DISC = _BODY | {"shape": "disc", "radius": 2e-3}


def _run(**tables):
    return simulate(Scene.of(_BASE | tables, "scene"))


@pytest.mark.parametrize(
    "tables",
    [
        {"damper": [_BODY]},
        {"damper": [_BODY], "friction_damper": [{"normal_force": 5.0, "friction": 0.3}]},
        {"damper": [_BODY], "friction_damper": [{"normal_force": 5.0, "friction": 0.3, "stiffness": 1e7}]},
        {"damper": [_BLOCK]},
        {"damper": [_BLOCK, _BLOCK | {"mass": 0.002}]},
        {"damper": [_BLOCK], "contact": {"law": "compliant", "stiffness": 1e8}},
        {"damper": [_DISC], "friction_damper": [{"normal_force": 5.0, "friction": 0.3, "stiffness": 1e7}]},
    ],
    ids=["slider", "coulomb", "jenkins", "block", "row", "compliant", "disc"],
)
def test_work_of_contacts_is_the_friction_of_the_energy_balance(tables):
    response = _run(**tables)
    work = sum(contact.friction * contact.sliding for contact in response.contact_work)
    assert work > 0.0
    assert work == pytest.approx(response.energy["friction"], rel=1e-11)


def test_events_have_the_energies_of_impacts():
    scene = Scene.of(_BASE | {"damper": [_BODY], "wear": {"impact_exponent": 1.5}}, "scene")
    response = simulate(scene, events=True)
    start = response.transient / response.frequency
    mass = 1 / (1 / 0.148 + 1 / 0.003)
    for contact in response.contact_work:
        speeds = [
            event.relative_velocity_before
            for event in response.event_list
            if (event.kind, event.side) == ("impact", contact.side) and event.time >= start
        ]
        assert contact.hits == len(speeds)
        assert contact.impacts == pytest.approx(np.sum((0.5 * mass * np.square(speeds)) ** 1.5), rel=1e-12)


def test_methods_with_time_steps_do_not_count_wear():
    with pytest.raises(InputError, match=r"^wear: is for solver\.method exact, not moreau"):
        _run(damper=[_BODY], solver={"method": "moreau"})
