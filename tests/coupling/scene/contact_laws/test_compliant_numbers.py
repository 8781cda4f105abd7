"""Compliant contacts whose stiffness comes from geometry and materials: runs against Hertz's closed form."""

import math

import pytest

import vanedamp as vd
from tests.tools.schemas import faults
from vanedamp.coupling.contacts.collision import collision
from vanedamp.coupling.scene.ranges import read
from vanedamp.files.toml_input import InputError, validate

PAIR = {"young": 2e11, "radius": 0.05}
MASS, SPEED = 0.02, 0.2


def thrown(contact, speed=SPEED, **changes):
    """A body that hits the wall of a base at rest without gravity: one collision within the first period."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-21}, "excitation": {"frequency": 1000.0},
        "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1e-4}],
        "damper": [{"cavity": "c", "mass": MASS, "velocity": speed}],
        "contact": contact, "time": {"periods": 1, "transient": 0},
    }  # fmt: skip
    return validate(vd.Scene, data | changes, "scene.toml")


def collided(scene):
    """Duration and rebound of the first collision of a run."""
    events = vd.simulate(scene, events=True).event_list
    hit = next(event for event in events if event.kind == "impact")
    left = next(event for event in events if event.kind == "detach" and event.time > hit.time)
    return left.time - hit.time, -left.relative_velocity_after / hit.relative_velocity_before


@pytest.mark.parametrize("match", ["force", "duration"])
def test_the_spring_of_a_collision(match):
    scene = thrown({"law": "compliant", "stiffness": "hertz", "match": match, "speed": SPEED, "pair": PAIR})
    known = collision(scene.contact.pair.contact, MASS, SPEED)
    stiffness = scene.contact.element(1.0, MASS).stiffness
    duration, rebound = collided(scene)
    assert rebound == pytest.approx(1.0, rel=1e-10)
    if match == "duration":
        assert duration == pytest.approx(known.duration, rel=1e-10)
    else:
        assert SPEED * math.sqrt(stiffness * MASS) == pytest.approx(known.force, rel=1e-10)
        assert duration / known.duration == pytest.approx(0.8539, abs=1e-4)


def test_ranges_of_a_stiffness_and_of_a_pair():
    """As in the ensembles' files: a list of two numbers where one belongs, or two speeds where two belong."""
    data = thrown({"law": "compliant", "stiffness": 1e8}).to_dict()
    contact = {"law": "compliant", "stiffness": [1e8, 2e8]}
    assert dict(read(vd.Scene, data | {"contact": contact}, "s").ranges) == {"contact.stiffness": (1e8, 2e8)}
    pair = PAIR | {"young": [2e11, 2.1e11], "restitution_speeds": [0.1, 0.3]}
    scene = read(vd.Scene, data | {"contact": {"law": "newton", "pair": pair}}, "s")
    assert dict(scene.ranges) == {"contact.pair.young": (2e11, 2.1e11)}
    assert scene.contact.pair.restitution_speeds == (0.1, 0.3)
    for tables in ({"contact": contact}, {"contact": {"law": "newton", "pair": pair}}):
        assert faults("scene", data | tables) == []


def test_tangent_at_a_preload():
    law = thrown({"law": "compliant", "stiffness": "hertz", "match": "tangent", "preload": 30.0, "pair": PAIR}).contact
    approach = law.pair.contact.approach(30.0)
    assert law.element(1.0, MASS).stiffness == pytest.approx(1.5 * 30.0 / approach, rel=1e-12)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ({"stiffness": "herz"}, r"contact.stiffness: should be 'hertz' or 'patch' \(got 'herz'\)"),
        ({"stiffness": "hertz", "speed": 1.0}, 'contact: pair: stiffness = "hertz" needs .contact.pair. with young .*'),
        ({"stiffness": "hertz", "pair": PAIR}, 'contact: speed: missing; stiffness = "hertz" that .* force .*'),
        ({"stiffness": "hertz", "pair": PAIR, "match": "tangent"}, "contact: preload: missing; .* the tangent .*"),
        ({"stiffness": 1e8, "speed": 1.0}, 'contact: speed: is of stiffness = "hertz" that matches otherwise; .*'),
        ({"stiffness": "patch", "pair": PAIR}, 'contact: pair: stiffness = "patch" needs .* young, length and area .*'),
        ({"stiffness": "patch", "pair": {"young": 2e11, "length": 0.01, "area": 1e-5}},
         "contact: the residual flexibility is that of a reduced model; .*"),
        ({"stiffness": "hertz", "speed": -1.0, "pair": PAIR}, r"contact.speed: should be greater than 0 \(got -1.0\)"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(contact, message):
    with pytest.raises(InputError, match=f"^scene.toml: {message}$"):
        thrown({"law": "compliant"} | contact)
