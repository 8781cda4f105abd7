"""Stops: contact of the structure with the ground or with itself, against closed forms and independent methods."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.reference.orbit_impact_oscillator import ImpactOscillator
from tests.tools.laws_by_event import check_events
from tests.tools.random_scenes import random_reduced, random_scene
from tests.tools.tiers import cases
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Initial
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.report.time_history import TimeHistory, history_figure

DAMPING, RESTITUTION, GAP = 0.1, 0.8, 1.0


def oscillator(force, **tables) -> Scene:
    """x'' + 0.1 x' + x = force sin t with a stop at 1."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": DAMPING},
        "excitation": {"frequency": 1 / (2 * math.pi), "force": force},
        "stop": [{"side": "right", "gap": GAP, "restitution": RESTITUTION}],
        "time": {"periods": 500, "transient": 400},
    }
    return validate(Scene, data | tables, "scene")


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(("share", "hits"), [(1 - 1e-9, False), (1 + 1e-9, True)])
def test_it_grazes_at_the_amplitude_of_the_gap(side, share, hits):
    """From rest the amplitude grows to force/damping; after 500 periods e^-157 of the transient is left."""
    response = simulate(oscillator(0.1 * share, stop=[{"side": side, "gap": GAP, "restitution": RESTITUTION}]))
    assert response.status is Status.OK
    assert (response.impacts_per_period > 0) == hits


def test_one_impact_a_period_has_the_speed_of_its_closed_form():
    response = simulate(oscillator(1.0), events=True)
    assert response.status is Status.OK
    assert response.energy_residual < 1e-12
    hits = [event for event in response.event_list if event.kind == "impact"][-50:]
    assert {(event.side, event.damper) for event in hits} == {("stop", 0)}
    speed = ImpactOscillator(k=1.0, c=DAMPING, A=1.0, w=1.0, d=GAP, e=RESTITUTION).speed
    # what is left of the transient: the orbit's multipliers are k^2 e^(-0.1 T) in product
    assert [event.relative_velocity_before for event in hits] == pytest.approx([-speed] * 50, rel=1e-12)
    assert [event.relative_velocity_after for event in hits] == pytest.approx([RESTITUTION * speed] * 50, rel=1e-12)


@pytest.mark.parametrize(
    ("solver", "tolerance"),
    [
        ({"method": "solve_ivp", "rtol": 1e-10}, 1e-8), ({"method": "moreau", "steps_per_period": 20_000}, 1e-3),
        # a soft contact of 2 steps^(1/3) steps: as long a share of the period as that
        ({"method": "penalty", "steps_per_period": 20_000}, 1e-2),
        ({"method": "penalty", "scheme": "newmark", "steps_per_period": 20_000}, 1e-2),
        ({"method": "cosim", "steps_per_period": 20_000}, 1e-2),
    ],
)  # fmt: skip
def test_every_method_finds_the_orbit(solver, tolerance):
    time = {"periods": 140, "transient": 100}  # of the transient less than e^-31 is left
    exact = simulate(oscillator(1.0, time=time))
    response = simulate(oscillator(1.0, solver=solver, time=time))
    assert response.status is Status.OK
    assert response.impacts_per_period == 1.0
    assert response.amplitude_rms == pytest.approx(exact.amplitude_rms, rel=tolerance)


def test_a_spring_as_stop_is_a_bilinear_oscillator():
    """Gap 0 and a spring without loss: half the time at w, half at sqrt(w^2 + k/m), in free motion."""
    stiffness = 8.0
    data = oscillator(
        0.0, contact={"law": "compliant", "stiffness": stiffness}, stop=[{"side": "right", "gap": 0.0}],
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0},
        initial={"velocity": 1.0}, time={"periods": 20, "transient": 0},
    )  # fmt: skip
    response = simulate(data, events=True)
    period = math.pi * (1 + 1 / math.sqrt(1 + stiffness))
    begun = [event.time for event in response.event_list if event.kind == "impact"]
    assert begun[:12] == pytest.approx([i * period for i in range(12)], rel=1e-12, abs=1e-12)
    assert response.amplitude_max == pytest.approx(1.0, rel=1e-12)
    assert response.energy_residual < 1e-12


def test_a_structure_pressed_on_its_stop_rests_there():
    """Slow force, low restitution: chatter ends, the stop carries F sin t - x, and lets go where that vanishes."""
    data = oscillator(
        5.0, stop=[{"side": "right", "gap": GAP, "restitution": 0.3}],
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 1.6},
        excitation={"frequency": 0.002, "force": 5.0}, time={"periods": 3, "transient": 0},
    )  # fmt: skip
    response = simulate(data, events=True, samples_per_period=400)
    assert response.status is Status.OK
    assert response.energy_residual < 1e-12
    omega = 2 * math.pi * 0.002
    left = [event.time for event in response.event_list if event.kind == "detach"]
    assert left == pytest.approx([(math.pi - math.asin(GAP / 5.0)) / omega + i / 0.002 for i in range(3)], rel=1e-12)
    rests = [event.time for event in response.event_list if event.kind == "rest"]
    assert len(rests) == 3
    held = (response.time > rests[1]) & (response.time < left[1])
    assert held.sum() > 100
    assert np.abs(response.displacement[held] - GAP).max() < 1e-14


def chain(folder):
    """Two masses of 1 kg, each on a spring to the ground, without damping: nothing but a stop couples them."""
    labels = {"one": [1.0, 0.0], "two": [0.0, 1.0]}
    model = ReducedModel.from_matrices(np.eye(2), np.diag([4.0, 9.0]), labels, damping=np.zeros((2, 2)))
    model.save(folder / "chain.h5")
    return str(folder / "chain.h5")


def test_two_points_that_meet_exchange_momentum(tmp_path):
    """Equal masses, elastic: they swap their speeds; the first impact is where the driven one has crossed the gap."""
    data = {
        "structure": {"model": "rom", "file": chain(tmp_path)},
        "excitation": {"frequency": 0.25, "force": 1.0, "at": "one"},
        "stop": [{"at": "one", "to": "two", "side": "right", "gap": 0.05}],
        "time": {"periods": 30, "transient": 0},
    }
    scene = validate(Scene, data, "scene")
    response = simulate(scene, events=True)
    assert response.status is Status.OK
    assert response.energy_residual < 1e-11
    omega = math.pi / 2

    def place(t):
        return (math.sin(omega * t) - omega / 2 * math.sin(2 * t)) / (4 - omega**2)

    hits = [event for event in response.event_list if event.kind == "impact"]
    assert hits[0].time == pytest.approx(brentq(lambda t: place(t) - 0.05, 0.1, 1.0, xtol=1e-15), rel=1e-12)
    speed = omega * (math.cos(omega * hits[0].time) - math.cos(2 * hits[0].time)) / (4 - omega**2)
    # the mass of the contact is half of one
    assert hits[0].relative_velocity_before == pytest.approx(-speed, rel=1e-12)
    assert hits[0].impulse == pytest.approx(speed, rel=1e-12)
    other = simulate(scene.replace({"solver.method": "solve_ivp", "solver.rtol": 1e-12}), events=True)
    theirs = [event.time for event in other.event_list if event.kind == "impact"]
    assert [event.time for event in hits[:8]] == pytest.approx(theirs[:8], rel=1e-9)


@pytest.mark.parametrize(
    ("structure", "seed"), cases(itertools.product(["rigid", "rom"], range(6)), fast=[("rigid", 2), ("rom", 3)])
)
def test_laws_hold_event_by_event_beside_bodies(structure, seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if structure == "rom":
        random_reduced(seed).save(f"random-{seed}.h5")
    scene = random_scene(seed, structure, 1 + seed % 2).replace({"time.periods": 60, "time.transient": 0})
    scene = replace(scene, initial=Initial())
    reach = simulate(scene).amplitude_max
    sides = [{"side": "right", "gap": 0.4 * reach, "restitution": 0.7}, {"side": "left", "gap": 0.6 * reach}]
    if structure == "rom":
        sides = [sides[0] | {"at": "a"}, sides[1] | {"at": "a", "to": "b"}]
    scene = scene.replace({"stop": sides})
    response = simulate(scene, events=True)
    assert response.status in (Status.OK, Status.NOT_STEADY)
    assert response.energy_residual < 1e-9
    assert sum(event.side == "stop" for event in response.event_list) > 10
    worst = check_events(scene, 600)
    assert worst.impacts > 10


def test_a_sweep_of_the_gap_goes_on_from_its_neighbour():
    """Down the gap the structure stands beyond the stop at times, and is put before it."""
    found = sweep(oscillator(1.0, sweep={"stop.0.gap": [1.0, 0.5, 0.25]}, continuation={"direction": "down"}))
    ups = sweep(oscillator(1.0, sweep={"stop.0.gap": [1.0, 0.5, 0.25]}))
    assert set(found.status.ravel()) == {"ok"}
    assert found.amplitude_mean == pytest.approx(ups.amplitude_mean, rel=1e-9)


def test_modes_are_not_chosen_without_knowing_the_stops(tmp_path):
    scene = validate(
        Scene,
        {
            "structure": {"model": "rom", "file": chain(tmp_path), "modes": "auto"},
            "excitation": {"frequency": 0.25, "force": 1.0, "at": "one"},
            "stop": [{"at": "one", "side": "right", "gap": 0.05}],
        },
        "scene",
    )
    with pytest.raises(InputError, match="not those of stops"):
        simulate(scene)
    with_all = scene.replace({"structure.modes": 2, "structure.natural": True, "time": {"periods": 5, "transient": 0}})
    assert any(warning.startswith("contact: Newton's law") for warning in simulate(with_all).warnings)


def test_the_history_shows_stop_and_impacts(tmp_path):
    scene = oscillator(1.0, time={"periods": 30, "transient": 0})
    simulate(scene, events=True, samples_per_period=50).save(tmp_path / "run.h5", {"scene": scene.to_dict()})
    history = TimeHistory.load(tmp_path / "run.h5")
    assert len(history.struck)
    assert set(history.struck) == {-1}
    figure = history_figure(history)
    assert [trace.name for trace in figure.data] == ["structure", "impacts on stops"]
    assert [line.y0 for line in figure.layout.shapes] == [1e6 * GAP]
    at = np.interp(history.impacts, history.time, history.displacement)
    assert np.abs(at[5:] - GAP).max() < 0.1  # between two samples, where the motion turns round


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"initial": {"displacement": 1.1}}, r"initial.displacement: .* beyond stop\[0\]"),
        ({"stop": [{"side": "up", "gap": 1.0}]}, "'left' or 'right'"),
        ({"stop": [{"side": "left", "gap": -1.0}]}, r"stop\[0\].gap"),
        ({"stop": [{"side": "left", "gap": 1.0, "at": "tip"}]}, r"stop\[0\].at: .* leave it out"),
        ({"stop": [{"side": "left", "gap": 1.0, "restitution": 0.0}],
          "contact": {"law": "compliant", "stiffness": 1.0}}, r"stop\[0\].restitution: .* above 0"),
        ({"structure": {"model": "prescribed", "displacement_amplitude": 1.0}, "excitation": {"frequency": 1.0}},
         "stop: a prescribed motion feels no force"),
        ({"structure": {"model": "rom", "file": "x.h5"}, "excitation": {"frequency": 1.0, "at": "tip"}},
         r"stop\[0\].at: name the interface label"),
    ],
)  # fmt: skip
def test_bad_stops_are_refused_in_a_sentence(tables, words):
    with pytest.raises(InputError, match=words):
        simulate(oscillator(1.0, **tables))
