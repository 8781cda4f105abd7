"""Static deflection under the bodies' loads, the motion about it, and which bodies count as stuck."""

import math

import numpy as np
import pytest

from vanedamp import ReducedModel, Scene, Sweep, ramp, simulate, sweep
from vanedamp.coupling.system.linear_response import linear_amplitudes, linear_responses
from vanedamp.files.toml_input import validate
from vanedamp.studies.report.forced_response import forced_responses

MASS, BODY, NATURAL = 1.0, 0.02, 100.0
STIFFNESS = MASS * (2 * math.pi * NATURAL) ** 2
HELD = {"friction": 0.5, "normal_load": 1000.0}


def scene(body, pull=0.0, ratio=0.9, force=0.1, **tables):
    """A rigid structure with one body, which a field of `pull` m/s^2 draws along its cavity to the left wall."""
    data = {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": 0.02},
        "excitation": {"frequency": ratio * NATURAL, "force": force},
        "gravity": {"acceleration": pull, "orientation_deg": 90.0},
        "cavity": [{"name": "c", "gap": 1e-3}],
        "damper": [{"cavity": "c", "mass": BODY} | body],
        "time": {"periods": 160, "transient": 120},
    }  # fmt: skip
    return validate(Scene, data | tables, "scene")


def fixed(of):
    return float(linear_responses(of)[1].amplitude(np.array([of.frequency]))[0])


def method(name):
    return {} if name in ("exact", "solve_ivp") else {"steps_per_period": 400}


@pytest.mark.parametrize(
    ("name", "tolerance"), [("exact", 1e-6), ("moreau", 1e-3), ("penalty", 1e-3), ("cosim", 5e-3), ("solve_ivp", 1e-3)]
)
def test_a_stuck_body_leaves_the_fixed_amplitude_about_its_static_deflection(name, tolerance):
    """Every method: the structure sags by m g / k and swings about that as with the body fixed."""
    held = scene(HELD, pull=500.0, solver={"method": name} | method(name))
    response = simulate(held)
    assert response.status == "ok"
    sag = -BODY * 500.0 / STIFFNESS
    assert response.static_deflection == pytest.approx(sag, rel=1e-3)
    assert response.amplitude_mean > 10 * fixed(held)
    assert response.amplitude_mean_dynamic == pytest.approx(fixed(held), rel=tolerance, abs=1e-5 * abs(sag))
    assert response.amplitude_max_dynamic == pytest.approx(fixed(held), rel=10 * tolerance, abs=1e-4 * abs(sag))


def test_a_body_that_strikes_gives_the_structure_its_weight_in_the_mean():
    """Balance of momentum: whatever the impacts, the mean force of a body that stays in its cavity is its load."""
    response = simulate(scene({"restitution": 0.5}, pull=30.0, ratio=1.0, force=100.0))
    assert response.impacts_per_period > 1.0
    assert response.static_deflection == pytest.approx(-BODY * 30.0 / STIFFNESS, rel=0.05)


def slow_model(folder):
    """A file of a model with quick modes, one slow beside the excitation, and one that hardly moves in a period."""
    natural = 2 * np.pi * NATURAL * np.array([1.0, 3.3, 0.03, 2e-4])
    rows = {"tip": [1, 0.4, 0.2, 0.1], "left": [1, -0.3, 0.2, 0.1], "right": [1, -0.2, 0.2, 0.1]}
    model = ReducedModel.from_matrices(
        np.eye(4), np.diag(natural**2), rows, damping_ratio=0.02, directions={row: [1.0, 0.0, 0.0] for row in rows}
    )
    model.save(folder / "slow.h5")
    return str(folder / "slow.h5")


def test_mean_position_and_swings_are_those_of_samples(tmp_path):
    """The integral and the extremes of the response in closed form, slow modes and impacts included."""
    several = scene(
        {"restitution": 0.6, "friction": 0.1}, pull=30.0, force=200.0, ratio=0.98,
        structure={"model": "rom", "file": slow_model(tmp_path)},
        excitation={"frequency": 0.98 * NATURAL, "force": 200.0, "at": "tip"},
        gravity={"acceleration": 30.0, "direction": [-1.0, 0.0, 0.0]},
        cavity=[{"name": "c", "gap": 1e-3, "left": "left", "right": "right"}], time={"periods": 12, "transient": 4},
    )  # fmt: skip
    samples = 4000
    response = simulate(several, samples_per_period=samples)
    assert response.impacts_per_period > 1.0
    x = response.displacement[4 * samples :]
    largest = np.abs(x).max()
    ends = 0.5 * (response.section[-1, 0] - x[0]) / len(x)  # the trapezoid's rule
    assert response.static_deflection == pytest.approx(x.mean() + ends, abs=1e-6 * largest)
    about = np.abs(x - response.static_deflection).reshape(-1, samples).max(axis=1)
    assert response.amplitude_mean_dynamic == pytest.approx(about.mean(), rel=1e-4)


def test_without_loads_on_the_bodies_nothing_is_subtracted():
    response = simulate(scene({"restitution": 0.5}, ratio=1.0, force=100.0))
    assert response.static_deflection == 0.0
    assert response.amplitude_mean_dynamic == response.amplitude_mean
    assert response.amplitude_max_dynamic == response.amplitude_max


@pytest.mark.parametrize(
    ("body", "pull", "classification"),
    [
        ({"friction": 0.0}, 0.0, "no-contact"),  # at rest in space
        ({"friction": 0.0, "stiffness": 0.3 * BODY * (2 * math.pi * NATURAL) ** 2}, 0.0, "no-contact"),
        (HELD, 500.0, "stuck"),
        ({"friction": 0.0, "position": -5e-4}, 500.0, "stuck"),  # lies on the wall
    ],
)
def test_stuck_bodies_do_not_move_in_their_cavities(body, pull, classification):
    """At the resonance, too, where the motion turns round at the start of every period: sections alone see no speed."""
    response = simulate(scene(body, pull, ratio=1.0))
    assert response.impacts_per_period == 0.0
    assert response.classification == classification


def test_a_disc_that_rolls_is_not_stuck():
    disc = {"shape": "disc", "radius": 2e-3, "friction": 0.5}
    rolls = scene(
        disc, ratio=1.0, gravity={"acceleration": 9.81}, cavity=[{"name": "c", "gap": 1e-3, "play": 1e-4}],
        time={"periods": 40, "transient": 30},
    )  # fmt: skip
    response = simulate(rolls)
    assert response.impacts_per_period == 0.0
    assert np.ptp(response.slip[:, 0]) > 0.0
    assert response.classification == "no-contact"


def test_curves_compare_motions_about_the_static_deflection(tmp_path):
    """A sweep of a stuck body under a large pull: its headline is that of the fixed curve, from a file as well."""
    held = scene(HELD, pull=500.0, sweep={"excitation.frequency": [80.0, 99.0, 110.0]})
    result = sweep(held)
    assert result.amplitude_mean_dynamic == pytest.approx(result.amplitude_fixed, rel=1e-4)
    assert np.all(result.amplitude_mean > 4 * result.amplitude_fixed)
    (curve,) = forced_responses(result)
    assert curve.headline.damped_peak == pytest.approx(result.amplitude_fixed.max(), rel=1e-4)
    result.save(tmp_path / "sweep.h5")
    assert np.array_equal(Sweep.load(tmp_path / "sweep.h5").amplitude_mean_dynamic, result.amplitude_mean_dynamic)


def test_a_slow_ramp_follows_the_fixed_curve_about_the_static_deflection():
    """A stuck body again: from a steady start the distance from the sag is the fixed amplitude of each frequency."""
    up = scene(HELD, pull=500.0, ramp={"from": 70.0, "to": 75.0, "periods": 400, "start": "steady"})
    (run,) = (record := ramp(up)).runs
    assert run.status == "ok"
    _, glued = linear_amplitudes(scene(HELD, pull=500.0), run.frequency)
    assert run.amplitude_dynamic == pytest.approx(glued, rel=0.01)
    assert run.peak > 20 * glued.max()
    assert record.share(run) == pytest.approx(glued.max() / record.tops["undamped_peak"], rel=0.01)


@pytest.mark.parametrize("modes", [2, 7])
def test_mean_position_beside_a_body_on_a_spring_is_that_of_samples(tmp_path, modes):
    """Bodies on springs run in the plane's engine: integrals by nodes for few modes, in closed form for many."""
    natural, rng = 2 * np.pi * NATURAL * np.linspace(1.0, 4.0, modes), np.random.default_rng(1)
    rows = {name: rng.uniform(0.5, 1.0, modes) for name in ("tip", "left", "right")}
    model = ReducedModel.from_matrices(
        np.eye(modes), np.diag(natural**2), rows, damping_ratio=0.02, directions={row: [1.0, 0.0, 0.0] for row in rows}
    )
    model.save(tmp_path / "rom.h5")
    sprung = scene(
        {"restitution": 0.6, "stiffness": 0.5 * BODY * natural[0] ** 2},
        structure={"model": "rom", "file": str(tmp_path / "rom.h5")},
        excitation={"frequency": 0.98 * NATURAL, "force": 200.0, "at": "tip"},
        gravity={"acceleration": 30.0, "direction": [-1.0, 0.0, 0.0]},
        cavity=[{"name": "c", "gap": 1e-3, "left": "left", "right": "right"}], time={"periods": 4, "transient": 1},
    )  # fmt: skip
    samples = 400
    response = simulate(sprung, samples_per_period=samples)
    assert response.impacts_per_period > 1.0
    x = response.displacement[samples:]
    ends = 0.5 * (response.section[-1, 0] - x[0]) / len(x)  # the trapezoid's rule
    assert response.static_deflection == pytest.approx(x.mean() + ends, abs=1e-4 * np.abs(x).max())
    about = np.abs(x - response.static_deflection).reshape(-1, samples).max(axis=1)
    assert response.amplitude_mean_dynamic == pytest.approx(about.mean(), rel=1e-3)
