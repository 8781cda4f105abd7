"""Work of each contact against the energy balance of the whole, and against closed forms."""

import math

import numpy as np
import pytest

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel

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


def _thrown_at_a_rod(count, law, body, **structure):
    """A body of a hundredth of the mass of a clamped unit rod that hits a wall at its tip once, with 1 m/s."""
    rate = (np.arange(1, count + 1) - 0.5) * np.pi
    rod = ReducedModel.from_matrices(
        np.eye(count), np.diag(rate**2), {"tip": np.full(count, math.sqrt(2))}, damping_ratio=0.01
    )
    cavity = {"name": "c", "gap": 2.0, "floor": "tip"} | ({"play": 0.1} if "shape" in body else {})
    return simulate(Scene.of({
        "structure": {"model": "rom", "file": rod} | structure,
        "excitation": {"frequency": 0.3, "at": "tip", "force": 1e-12}, "gravity": {"acceleration": 0.0},
        "cavity": [cavity], "damper": [{"cavity": "c", "mass": 0.01, "velocity": 1.0} | body], "contact": law,
        "time": {"periods": 1, "transient": 0}, "wear": {},
    }, "scene"))  # fmt: skip


_SQUARE = {"shape": "block", "length": 0.1, "height": 0.1, "friction": 0.0}


@pytest.mark.parametrize(
    ("modes", "stiffness", "body"),
    [
        (1, 0.1, {}),
        (12, 0.1, {}),
        (60, 0.1, {}),
        (120, 0.1, {}),
        (60, 0.1, {"restitution": 0.7}),
        (60, 0.05, _SQUARE),
        (12, 0.05, _SQUARE | {"restitution": 0.7}),
        (60, 0.1, {"shape": "disc", "radius": 0.05, "friction": 0.0}),
    ],
)
def test_an_impact_on_a_spring_has_the_bodys_energy_for_every_number_of_modes(modes, stiffness, body):
    """The spring closes for longer than the modes but the first swing: that of the first mode gives way."""
    response = _thrown_at_a_rod(modes, {"law": "compliant", "stiffness": stiffness}, body)
    assert not response.event_list
    hit = [contact for contact in response.contact_work if contact.hits]
    assert {contact.side for contact in hit} == {"right"}
    assert sum(contact.impacts for contact in hit) == pytest.approx(0.5 / (1 / 0.01 + 2), rel=0.02)


def test_an_impact_on_a_boundary_without_mass_has_the_bodys_energy():
    response = _thrown_at_a_rod(120, {"law": "massless"}, {"mass": 1e-4}, natural=True, modes=12)
    energies = {contact.side: contact.impacts for contact in response.contact_work}
    assert energies["right"] == pytest.approx(0.5 * 1e-4, rel=0.01)


def test_neighbours_on_springs_collide_with_half_of_a_bodys_mass():
    """Both walls and the other body are far away; the energy is that of the relative motion."""
    still = {"cavity": "c", "mass": 0.01, "position": 0.5}
    response = _run(
        damper=[still | {"position": -0.5, "velocity": 1.0}, still], cavity=[{"name": "c", "gap": 4.0}],
        excitation={"frequency": 0.6, "force": 1e-9}, gravity={"acceleration": 0.0},
        contact={"law": "compliant", "stiffness": 10.0}, time={"periods": 1, "transient": 0},
    )  # fmt: skip
    assert {contact.side: contact.impacts for contact in response.contact_work if contact.hits} == pytest.approx(
        {"body": 0.5 * 0.005}, rel=1e-9
    )


@pytest.mark.parametrize("body", [{}, {"shape": "block", "length": 4e-3, "height": 4e-3}], ids=["slider", "block"])
def test_a_body_that_comes_to_rest_on_a_spring_has_spent_the_energy_of_its_fall(body):
    """Its bounces are a geometric series. The last contact does not end: its impulse is that of the weight.

    Dashpots give a corner the restitution, and a face that hits flat nearly.
    """
    mass, height, restitution = 0.003, 1e-3, 0.4
    tables = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-21}, "excitation": {"frequency": 10.0},
        "cavity": [{"name": "c", "gap": 2 * height} | ({"play": 1e-3} if body else {})],
        "damper": [{"cavity": "c", "mass": mass, "friction": 0.0, "restitution": restitution} | body],
        "gravity": {"orientation_deg": 90.0}, "contact": {"law": "compliant", "stiffness": 1e7},
        "time": {"periods": 4, "transient": 0},
    }  # fmt: skip
    energy = sum(contact.impacts for contact in _run(**tables).contact_work)
    assert energy == pytest.approx(mass * 9.81 * height / (1 - restitution**2), rel=0.05 if body else 0.01)


def test_methods_with_time_steps_do_not_count_wear():
    with pytest.raises(InputError, match=r"^wear: is for solver\.method exact, not moreau"):
        _run(damper=[_BODY], solver={"method": "moreau"})
