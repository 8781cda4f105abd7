"""What a run keeps beside its sums is asked for before it, and its response is made once."""

import pickle

import numpy as np
import pytest

from vanedamp.coupling.methods.registry import respond, run_of
from vanedamp.coupling.response import evaluation
from vanedamp.coupling.response.evaluation import Needs, Observer
from vanedamp.coupling.response.event_log import entries_of, rows_of_units
from vanedamp.coupling.response.observers import EVENT_LIST, samples
from vanedamp.coupling.response.records import DETACHES, IMPACT, RESTS, WIDTH
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble

SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.05},
    "excitation": {"frequency": 2414.0, "force": 400.0},
    "cavity": [{"name": "c", "gap": 2e-5}],
    "damper": [{"cavity": "c", "mass": 0.003, "friction": 0.4, "restitution": 0.7}],
    "contact": {"law": "compliant", "stiffness": 2e7, "pair": {"young": 2e11, "radius": 0.05}},
    "wear": {"coefficient": 2e-4, "hardness": 2.5e9, "impact_rate": 1e-15, "width": 0.01},
    "time": {"periods": 60, "transient": 20},
}
MADE = Scene.of(SCENE, "scene")


@pytest.mark.parametrize(("options", "runs"), [({}, 1), ({"events": True, "moved_start": True}, 2)])
def test_a_response_is_made_once(options, runs, monkeypatch):
    made, init = [], Response.__init__

    def counted(self, *args, **given):
        made.append(given)
        init(self, *args, **given)

    monkeypatch.setattr(Response, "__init__", counted)
    response = simulate(MADE, **options)
    assert len(made) == runs and response.contacts and response.wear and response.scene is MADE


def test_linear_amplitudes_are_found_when_they_are_read(monkeypatch):
    """F/|k - m w^2 + i c w|, the body's mass added to m; the damping is the structure's."""
    asked, found = [], evaluation.linear_responses

    def counted(*given):
        asked.append(given)
        return found(*given)

    monkeypatch.setattr(evaluation, "linear_responses", counted)
    response = simulate(MADE)
    assert response.amplitude_mean > 0.0 and not asked
    omega, (mass, stiffness, ratio) = 2 * np.pi * 2414.0, (0.148, 3.4e7, 0.05)
    damping = 2j * ratio * np.sqrt(mass * stiffness) * omega
    expected = [400.0 / abs(stiffness - m * omega**2 + damping) for m in (mass, mass + 0.003)]
    assert [response.amplitude_undamped, response.amplitude_fixed] == pytest.approx(expected, rel=1e-12)
    count = len(asked)
    assert count and pickle.loads(pickle.dumps(response)).amplitude_fixed == response.amplitude_fixed
    assert len(asked) == count


def test_an_observer_sees_the_run_and_fills_its_fields():
    """Samples are those that most need, the log is kept if one needs it, and warnings are added up."""
    seen = []

    class Own(Observer):
        def look(self, run, dropped):
            seen.append((run.outcome().periods, dropped))

    def tell(scene, run, known):
        assert scene is MADE and run.records.samples_per_period == 12 and run.log
        return {"provenance": {"impacts": known["quantities"]["impacts_per_period"]}, "warnings": ("one",)}

    own = Own(tell, Needs(samples=12, log=True))
    response = respond(MADE, [samples(4), own, Observer(lambda *_: {"warnings": ("two",)})])
    assert response.provenance == {"impacts": response.impacts_per_period} and response.warnings == ("one", "two")
    assert seen == [(0, 20), (20, 20)]
    plain = respond(MADE, [samples(4)])
    assert response.displacement == pytest.approx(plain.displacement, rel=1e-6, abs=1e-12) and len(plain.time) == 240
    assert not response.event_list and len(respond(MADE, [EVENT_LIST]).event_list) == response.events


def test_a_run_keeps_no_log_and_no_sums_that_nobody_asked_for():
    run = run_of(MADE)
    run.advance_to(60)
    outcome = run.outcome()
    assert not outcome.log and not outcome.records.samples.size and not outcome.records.worn.size
    assert not respond(MADE).wear and respond(MADE).contacts is None


def test_impacts_on_springs_have_what_their_last_end_brought():
    """Rows of springs; the last one is rigid."""
    rows = rows_of_units(assemble(MADE))
    rows = rows._replace(spring=np.r_[np.full(2, 1e7), np.inf])
    random = np.random.default_rng(0)
    for count in (0, 1, 5, 60):
        log = random.random((count, WIDTH))
        log[:, 1], log[:, 2] = random.choice([IMPACT, DETACHES, RESTS], count), random.integers(0, 3, count)
        expected, begun = log.copy(), {}
        for place, (_, kind, row, *_) in enumerate(log):
            if kind == IMPACT and row < 2:
                begun[row] = place
            elif kind == DETACHES and row in begun:
                expected[begun[row], 4:] = log[place, 4:]
        assert np.array_equal(entries_of(rows, np.array_split(log, 3)), expected)
