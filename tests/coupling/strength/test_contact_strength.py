"""Forces, durations and pressures of a run's impacts against closed forms and an integrated pulse; warnings."""

import json
import math

import pytest
from scipy.integrate import solve_ivp

import vanedamp as vd
from vanedamp.coupling.contacts.collision import collision, speed_of_force
from vanedamp.coupling.response.response import Event
from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio, peak_over_mean
from vanedamp.coupling.strength.contact_strength import impacts_of
from vanedamp.files.store import load_any
from vanedamp.files.toml_input import validate

PAIR, MASS, SPEED = {"young": 2e11, "radius": 0.05, "yield_strength": 6e8}, 0.02, 0.2
CONTACT = vd.Pair(**PAIR).contact


def thrown(contact, restitution=1.0, speed=SPEED, **changes):
    """A body that hits the walls of a base at rest without gravity, one after the other."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-21}, "excitation": {"frequency": 1000.0},
        "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1e-4}],
        "damper": [{"cavity": "c", "mass": MASS, "velocity": speed, "restitution": restitution}],
        "contact": {"pair": PAIR} | contact, "time": {"periods": 2, "transient": 0},
    }  # fmt: skip
    return validate(vd.Scene, data | changes, "scene.toml")


def test_rigid_impacts_have_hertz_force_of_their_impulse():
    response = vd.simulate(thrown({"law": "newton"}, 0.7))
    assert not response.event_list
    first, second = response.contacts
    assert (first.side, second.side, first.impacts) == ("right", "left", 2)
    for found, speed in ((first, SPEED), (second, 0.7 * SPEED)):
        known = collision(CONTACT, MASS, speed)
        assert found.fastest == pytest.approx(speed, rel=1e-10)
        assert found.peak_force == pytest.approx(known.force, rel=1e-10)
        assert found.duration == pytest.approx(known.duration, rel=1e-10)
        assert found.pressure == pytest.approx(CONTACT.pressure(known.force), rel=1e-10)
        assert found.utilisation == pytest.approx(found.pressure / vd.Pair(**PAIR).first_yield, rel=1e-12)


@pytest.mark.parametrize("restitution", [1.0, 0.7, 0.2, 0.05])
def test_the_pulse_of_spring_and_dashpot(restitution):
    """Largest force over the mean one against the integrated pulse, below and above a damping ratio of 1/2 and 1."""
    ratio = damping_ratio(restitution)

    def pulse(_, y):
        return [y[1], -y[0] - 2 * ratio * y[1], y[0] + 2 * ratio * y[1]]

    def ends(t, y):
        return y[0] + 2 * ratio * y[1] if t > 0 else 1.0

    def peaks(_, y):
        force = y[0] + 2 * ratio * y[1]
        return y[1] - 2 * ratio * force

    ends.terminal, ends.direction = True, -1
    run = solve_ivp(pulse, (0, 50), [0.0, 1.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14, events=(ends, peaks))
    forces = [y[0] + 2 * ratio * y[1] for y in run.y_events[1]] + [2 * ratio]
    mean = run.y_events[0][0][2] / run.t_events[0][0]
    assert -run.y_events[0][0][1] == pytest.approx(restitution, rel=1e-9)
    assert peak_over_mean(restitution) == pytest.approx(max(forces) / mean, rel=1e-8)


def test_compliant_impacts_have_their_own_duration():
    law = {"law": "compliant", "stiffness": "hertz", "speed": SPEED}
    known = collision(CONTACT, MASS, SPEED)
    found = vd.simulate(thrown(law)).contacts[0]
    assert found.peak_force == pytest.approx(known.force, rel=1e-9)
    assert found.duration / known.duration == pytest.approx(0.8539, abs=1e-4)
    soft = thrown(law, 0.7)
    element = soft.contact.element(0.7, MASS)
    ratio = element.dashpot / (2 * math.sqrt(element.stiffness * MASS))
    angle = math.asin(ratio)
    factor = math.exp(-(math.pi / 2 - 3 * angle) * math.tan(angle))
    assert vd.simulate(soft).contacts[0].peak_force == pytest.approx(known.force * factor, rel=1e-9)


def test_springs_in_parallel_are_one_contact():
    known = collision(CONTACT, MASS, SPEED)
    found = vd.simulate(thrown({"law": "hertz", "force": known.force}), events=True)
    assert found.contacts[0].impacts == 2
    assert found.contacts[0].peak_force == pytest.approx(known.force, rel=1e-9)
    assert found.contacts[0].duration == pytest.approx(known.duration, rel=1e-3)


def test_warnings_where_the_law_of_impact_ends(tmp_path):
    limit = speed_of_force(CONTACT, MASS, CONTACT.force_of_pressure(vd.Pair(**PAIR).first_yield))
    assert vd.simulate(thrown({"law": "newton"}, speed=0.99 * limit)).warnings == ()
    speeds = {"pair": PAIR | {"restitution_speeds": [0.1, limit]}}
    response = vd.simulate(thrown({"law": "newton"} | speeds, 0.5, speed=1.01 * limit))
    yields, known = response.warnings
    assert "impacts at the right of body 0 reach 1" in yields
    assert "50% of them" in yields
    assert known.startswith("contact.pair.restitution_speeds: the fastest impact has 0.")
    assert response.contacts[0].yielding == 0.5
    found = json.loads(json.dumps(response.to_json()))["contact_strength"][0]
    assert found["utilisation"] == pytest.approx(1.01**0.4, rel=1e-9)
    response.save(tmp_path / "r.h5")
    assert "contact_strength" in load_any(tmp_path / "r.h5")[2]
    assert "of first yield" in response.contacts[0].sentence


def test_a_scene_without_a_rounded_contact_has_none():
    flat = {"law": "newton", "pair": {"young": 2e11, "length": 0.01, "area": 1e-5}}
    assert vd.simulate(thrown(flat)).contacts is None
    wide = {"law": "newton", "pair": {"young": 2e11, "radius": 0.05, "width": 0.01, "depth": 2e-6}}
    response = vd.simulate(thrown(wide))
    assert response.contacts is None
    assert "as wide as the bodies" in response.warnings[0]


def test_impacts_before_the_window_do_not_count():
    events = [Event(t, "impact", 0, "left", -1.0, 1.0, 0.02) for t in (0.0, 1.0)]
    assert len(list(impacts_of(CONTACT, False, events, 0.5))) == 1
