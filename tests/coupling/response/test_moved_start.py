"""Where bodies begin by default, bodies that begin as one, and results that hang on the last bits of a start."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.reference.comparison import follow
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.response.moved_start import Mean, moved
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import load
from vanedamp.files.toml_input import validate
from vanedamp.studies.report.time_history import TimeHistory

GAP = 6e-3
_BODY = {"cavity": "c", "mass": 0.04, "restitution": 0.6}
#: mean amplitude of two bodies that move as one, m, and of two
ONE, TWO = 5.06e-4, 9.25e-4
_TABLES = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "force": 2.0},
    "cavity": [{"name": "c", "gap": GAP}],
    "time": {"periods": 400, "transient": 200},
}


def scene(*places: float | None, body=None, **tables) -> Scene:
    """Bodies of a cavity at positions; None: none given. body: changes of each."""
    bodies = [_BODY | (body or {}) | ({} if place is None else {"position": place}) for place in places]
    return validate(Scene, _TABLES | {"damper": bodies} | tables, "scene")


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([None], [0]), ([None, None], [-1 / 6, 1 / 6]), ([None] * 3, [-1 / 4, 0, 1 / 4]),
        ([-1 / 2, None, None], [-1 / 2, -1 / 6, 1 / 6]), ([None, 1 / 4, None], [-1 / 8, 1 / 4, 3 / 8]),
    ],
)  # fmt: skip
def test_bodies_begin_with_equal_gaps(places, expected, tmp_path):
    """Also after another gap, and after the way through a file, in which no position stands that was not given."""
    made = scene(*(None if place is None else place * GAP for place in places))
    assert made.positions == pytest.approx(np.multiply(expected, GAP), abs=1e-18)
    made.save(tmp_path / "scene.toml")
    assert Scene.load(tmp_path / "scene.toml") == made
    if not any(places):
        wider = made.replace({"cavity.c.gap": 2 * GAP, "damper.mass": 0.03})
        assert wider.positions == pytest.approx(np.multiply(expected, 2 * GAP), abs=1e-18)
        assert "position" not in wider.to_dict()["damper"][0]
        assert wider.number("damper.0.position") == wider.positions[0]


def test_a_single_body_begins_at_mid_travel_to_the_last_bit():
    assert all(scene(None, cavity=[{"name": "c", "gap": gap}]).positions == [0.0] for gap in (1e-6, 3.3e-5, 0.7))


@pytest.mark.parametrize("places", [(None, None), (0.0, 1e-12)], ids=["default", "apart by 1e-12 m"])
def test_rows_follow_an_independent_integrator(places):
    response = follow(scene(*places, initial={"velocity": 0.5}), 3)
    assert {event.side for event in response.event_list if event.kind == "impact"} >= {"body", "left", "right"}


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_two_equal_bodies_collide_as_in_closed_form(law):
    """Both move at v in a cavity at rest: the right one returns at e v, and the left one meets it."""
    speed, e, third = 0.1, 0.6, GAP / 3
    run = simulate(scene(
        None, None, body={"velocity": speed}, contact={"law": law}, time={"periods": 2, "transient": 0},
        structure={"model": "prescribed", "displacement_amplitude": 1e-12 * GAP}, excitation={"frequency": 10.0},
    ), events=True)  # fmt: skip
    wall, meeting = [event for event in run.event_list if event.kind == "impact"][:2]
    assert (wall.damper, wall.side, meeting.damper, meeting.side) == (1, "right", 0, "body")
    assert wall.time == pytest.approx(third / speed, rel=1e-9)
    assert wall.relative_velocity_after / wall.relative_velocity_before == pytest.approx(-e, rel=1e-9)
    assert meeting.time - wall.time == pytest.approx(third / (speed * (1 + e)), rel=1e-9)
    assert abs(meeting.relative_velocity_before) == pytest.approx((1 + e) * speed, rel=1e-9)
    assert meeting.relative_velocity_after / meeting.relative_velocity_before == pytest.approx(-e, rel=1e-9)


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_touching_bodies_are_warned_of(law):
    contact = {"law": law}
    for apart in (scene(None, None, contact=contact), scene(0.0, 1e-12, contact=contact), scene(0.0, contact=contact)):
        assert not warnings_of(apart)
    (warning,) = warnings_of(scene(0.0, 0.0, 0.0, contact=contact))
    assert "damper[1], damper[2]: touches the body before it at time zero" in warning
    soft = scene(0.0, 0.0, contact={"law": "compliant", "stiffness": 1e5})
    parting = scene(0.0, 0.0, contact=contact).replace({"damper.1.velocity": 0.1})
    assert not warnings_of(soft) and not warnings_of(parting)


@pytest.mark.parametrize("law", ["newton", "poisson"])
def test_bodies_that_never_part_are_warned_of(law):
    """Two that touch move as one of their whole mass, and two that lose all speed in their first impact do so too."""
    contact, one = {"contact": {"law": law}}, simulate(scene(0.0, body={"mass": 0.08}))
    both = simulate(scene(0.0, 0.0, **contact))
    assert any("damper[1]: never parts from the body before it" in warning for warning in both.warnings)
    if law == "newton":
        assert both.peak[:20] == pytest.approx(one.peak[:20], rel=1e-9)
    assert not simulate(scene(None, None, **contact)).warnings


def test_plastic_bodies_that_have_met_are_warned_of():
    (warning,) = simulate(scene(None, None, body={"restitution": 0.0})).warnings
    assert "never parts" in warning


def test_moved_bodies_keep_their_order_inside():
    for places in ((0.0, 0.0, 0.0), (-GAP / 2, 0.0, GAP / 2), (None, None), (None,), (GAP / 2, GAP / 2)):
        case = scene(*places)
        found = moved(case, case.positions)
        assert found[0] > -GAP / 2 and found[-1] < GAP / 2 and np.all(np.diff(found) > 0.0)
        change = np.abs(np.subtract(found, case.positions)) / GAP
        assert 1e-11 < change.max() < 1e-8


def test_means_agree_within_both_confidences():
    mean = Mean("ok", 1.0, 0.1)
    assert mean.agrees(Mean("ok", 1.25, 0.14), 0.02) and not mean.agrees(Mean("ok", 1.3, 0.14), 0.02)
    assert Mean("ok", 1.0, np.nan).agrees(Mean("ok", 1.01, np.nan), 0.02)
    assert not mean.agrees(Mean("energy", 1.0, 0.1), 0.02)


def test_a_run_that_hangs_on_its_start_says_so(tmp_path):
    """Bodies that touch are one of their whole mass; moved ones are two, as those that begin 1e-12 m apart."""
    found, apart = (simulate(scene(0.0, place), moved_start=True) for place in (0.0, 1e-12))
    one = simulate(scene(0.0, body={"mass": 0.08}))
    assert found.amplitude_mean == pytest.approx(one.amplitude_mean, rel=1e-6) == pytest.approx(ONE, rel=1e-2)
    told = found.moved_start
    assert told["status"] == "ok" and not told["agrees"] and apart.moved_start["agrees"]
    default = simulate(scene(None, None))
    assert told["amplitude_mean_dynamic"] == pytest.approx(apart.amplitude_mean, rel=1e-6)
    assert default.amplitude_mean == pytest.approx(apart.amplitude_mean, rel=1e-6) == pytest.approx(TWO, rel=1e-2)
    assert any("hangs on the last bits of the start: 0.000506" in warning for warning in found.warnings)
    assert not apart.warnings and not default.warnings
    found.save(tmp_path / "run.h5")
    assert json.loads(load(tmp_path / "run.h5", "response")[1]["moved_start"]) == told == found.to_json()["moved_start"]
    assert list(TimeHistory.load(tmp_path / "run.h5").measures["warnings"]) == list(found.warnings)


def test_a_run_that_goes_on_from_a_state_is_checked_from_there():
    """The state in which bodies are one: moved ones part."""
    first = simulate(scene(0.0, 0.0))
    second = simulate(scene(None, None), start=first.final, moved_start=True)
    assert second.amplitude_mean == pytest.approx(ONE, rel=1e-2)
    assert second.moved_start["amplitude_mean_dynamic"] == pytest.approx(TWO, rel=1e-2)


def test_no_second_run_without_impacts_or_bodies():
    quiet = scene(None, excitation={"frequency": 15.9, "force": 1e-6})
    stop = scene(cavity=[], stop=[{"side": "right", "gap": 1e-3, "restitution": 0.5}])
    assert simulate(quiet, moved_start=True).moved_start is None
    assert simulate(stop, moved_start=True).moved_start is None
    assert simulate(scene(0.0, 0.0)).moved_start is None


def test_impacts_of_the_transient_count():
    """They choose the steady state, even if it has none."""
    struck = scene(None, excitation={"frequency": 15.9, "force": 1e-3}, initial={"displacement": 6e-3}).replace(
        {"damper.friction": 0.3}
    )
    found = simulate(struck, moved_start=True)
    assert found.counters["impacts"] > 0 == found.impacts_per_period
    assert found.moved_start["agrees"] and not found.moved_start["impacts_per_period"]


def test_a_sweep_checks_the_peak_of_each_curve(tmp_path):
    """Bit for bit as runs by themselves; linked runs, which begin with states, are left out."""
    places, frequencies = [0.0, 1e-4], [15.9, 17.5]
    axes = {"damper.1.position": places, "excitation.frequency": frequencies}
    found = sweep(scene(0.0, 0.0, sweep=axes), moved_starts=True)
    told = found.moved_starts
    assert [peak["at"] for peak in told] == [{"damper.1.position": x, "excitation.frequency": 15.9} for x in places]
    for peak, place in zip(told, places, strict=True):
        alone = simulate(scene(0.0, place), moved_start=True).moved_start
        assert {name: alone[name] for name in peak.keys() - {"at"}}.items() <= peak.items()
    assert [peak["agrees"] for peak in told] == [False, True]
    warnings = found.to_json()["warnings"]
    for text in ("the mean amplitude hangs", "damper[1]: never parts"):
        assert any(f"at damper.1.position = 0, excitation.frequency = 15.9: {text}" in each for each in warnings)
    found.save(tmp_path / "sweep.h5")
    assert Sweep.load(tmp_path / "sweep.h5").moved_starts == told == found.to_json()["moved_starts"]
    linked = scene(0.0, 1e-4, sweep={"excitation.frequency": frequencies}, continuation={"direction": "up"})
    assert sweep(linked, moved_starts=True).moved_starts == sweep(scene(0.0, 0.0, sweep=axes)).moved_starts == []
