"""Forces, durations and pressures of a run's impacts against closed forms and an integrated pulse; warnings."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vanedamp as vd
from vanedamp.coupling.contacts.collision import collision, speed_of_force
from vanedamp.coupling.response.records import DETACHES, IMPACT
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


def log(*entries):
    """Entries of one contact: time, kind, row, speeds before and after, impulse."""
    return np.array(entries, float).reshape(-1, 6)


def test_impacts_before_the_window_do_not_count():
    entries = log(*((t, IMPACT, 0, -1.0, 1.0, 0.02) for t in (0.0, 1.0)))
    assert impacts_of(entries, False, 0.5).entry.tolist() == [1]


def test_springs_that_close_one_in_another_are_one_impact():
    """An end without a beginning is none of them; one that has not ended by the end of the run has no impulse yet."""
    entries = log(
        (0.0, DETACHES, 0, 1.0, 1.0, 0.0),
        (1.0, IMPACT, 0, -2.0, 2.0, 0.1), (1.1, IMPACT, 1, -1.9, 1.9, 0.2), (1.3, DETACHES, 1, 0.0, 1.9, 0.2),
        (1.4, DETACHES, 0, 0.0, 2.0, 0.1), (2.0, IMPACT, 0, -1.0, 0.5, 0.3), (2.5, DETACHES, 0, 0.0, 0.5, 0.3),
        (2.6, DETACHES, 1, 0.0, 0.5, 0.3), (3.0, IMPACT, 0, -1.0, 0.0, 0.0),
    )  # fmt: skip
    found = impacts_of(entries, True, 0.0)
    assert found.entry.tolist() == [1, 5] and found.one.tolist() == [False, True]
    assert found.impulse == pytest.approx([0.3, 0.3]) and found.duration == pytest.approx([0.4, 0.5])
    assert impacts_of(entries, True, 1.5).entry.tolist() == [5]


def by_turns(entries, begin):
    """Entry, impulse, end and number of springs of impacts on springs, entry by entry."""
    begun, closed, ended, found, until = [], 0, {}, [], -np.inf
    for place, (_, kind, *_) in enumerate(entries):
        if kind == IMPACT:
            begun, closed = [*begun, place], closed + 1
        elif closed:
            closed -= 1
            if not closed:
                ended[begun[0]] = entries[place, 0], entries[begun, 5].sum(), len(begun)
                begun = []
    for place, (time, kind, _, speed, _, impulse) in enumerate(entries.tolist()):
        if kind == IMPACT and time >= max(begin, until) and speed and impulse:
            end, total, springs = ended.get(place, (np.nan, impulse, 0))
            until = until if springs == 1 else np.fmax(end, time)
            found.append((place, total, end - time, springs == 1))
    return found


def test_impacts_of_random_logs():
    random = np.random.default_rng(1)
    for count in (1, 2, 3, 7, 40, 300):
        entries = np.column_stack([
            np.sort(random.random(count)), random.choice([IMPACT, DETACHES], count), np.zeros(count),
            -random.choice([0.0, 1.0, 2.0], count), random.random(count), random.choice([0.0, 0.5, 1.0], count),
        ])  # fmt: skip
        known, found = by_turns(entries, 0.2), impacts_of(entries, True, 0.2)
        columns = np.transpose([found.entry, found.impulse, found.duration, found.one])
        assert columns == pytest.approx(np.reshape(np.array(known, float), (-1, 4)), nan_ok=True)


BLOCK = {"shape": "block", "length": 6.88e-3, "height": 4.8e-3, "tilt": 1e-4}


@pytest.mark.parametrize(
    ("contact", "restitution", "body"),
    [
        ({"law": "newton"}, 0.7, {}),
        ({"law": "newton"}, 0.7, BLOCK),
        ({"law": "poisson"}, 0.7, BLOCK),
        ({"law": "compliant", "stiffness": "hertz", "speed": SPEED}, 0.7, {}),
        ({"law": "hertz", "force": 500.0}, 1.0, {}),
    ],
    ids=["newton", "block", "poisson", "compliant", "hertz"],
)
def test_no_events_are_built_that_nobody_asked_for(contact, restitution, body, monkeypatch):
    """In runs and in sweeps, whose contacts are those of a run that lists its events."""
    damper = {"cavity": "c", "mass": MASS, "velocity": SPEED, "restitution": restitution} | body
    made = thrown(contact, damper=[damper], cavity=[{"name": "c", "gap": 1e-4, "play": 2e-4}])
    known = vd.simulate(made, events=True)
    assert known.contacts and known.event_list

    def none(*_):
        raise AssertionError("an event is built")

    monkeypatch.setattr("vanedamp.coupling.response.event_log.Event", none)
    assert vd.simulate(made).contacts == known.contacts
    found = vd.sweep(made.replace({"sweep": {"damper.0.velocity": [SPEED, 2 * SPEED]}}))
    assert all(status == known.status for status in found.status)
