"""Steady or not: motions that look steady long before they are, and the slowest decay of all that is linear."""

import math

import numpy as np
import pytest

from tests.tools.steady_scenes import KINDS, outcome_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.transient import Transient, left_over
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

OWN = 100.0
#: two scenes of each kind of tests.tools.steady_scenes
SEEDS = (0, 12, 19, 25, 20, 26, 9, 27, 22, 142, 5, 23)
STIFFNESS = (2 * math.pi * OWN) ** 2


def absorber(dashpot_ratio=1e-5, mass=0.02, **time):
    """A structure at resonance with a body on a spring of its frequency, far from any wall."""
    own = 2 * math.pi * OWN
    body = {"stiffness": mass * own**2, "dashpot": 2 * dashpot_ratio * mass * own}
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": STIFFNESS, "damping_ratio": 0.002},
        "excitation": {"frequency": OWN, "force": 1.0},
        "cavity": [{"name": "c", "gap": 1.0}],
        "damper": [{"cavity": "c", "mass": mass, **body}],
        "time": time,
    }
    return validate(Scene, data, "absorber")


def coupled(folder, damping, **time):
    """Modes at 100 and 100.2 Hz, damped as one."""
    squares = (2 * np.pi * np.array([OWN, 1.002 * OWN])) ** 2
    model = ReducedModel.from_matrices(
        np.eye(2), np.diag(squares), {"tip": [1.0, 0.3]}, damping=damping * np.ones((2, 2))
    )
    model.save(folder / "coupled.h5")
    data = {
        "structure": {"model": "rom", "file": str(folder / "coupled.h5")},
        "excitation": {"frequency": OWN, "force": 1.0, "at": "tip"},
        "time": time,
    }
    return validate(Scene, data, "coupled")


def steady(scene, spring, dashpot=0.0, inertia=0.0, outwards=0.0):
    """Return the steady amplitude of a structure with one body attached, from its 2 x 2 dynamic stiffness.

    inertia: kg, against its slip; outwards: N/m, that drives it from where it is.
    """
    system = assemble(scene)
    w, m, structure, floor = system.omega, scene.damper[0].mass, system.of_structure, float(system.floor[0, 0])
    bound = spring + 1j * w * dashpot - w**2 * inertia
    own = structure.stiffness[0] - w**2 + 1j * w * structure.damping[0, 0]
    dynamic = [[own + bound * floor**2, -bound * floor], [-bound * floor, bound - outwards - w**2 * m]]
    load = np.r_[structure.load[0], system.of_bodies.load[0]]
    return abs(np.linalg.solve(dynamic, load)[0] * system.response[0])


def test_rates_of_an_absorber():
    """The transient of both modes decays at their complex eigenvalues, those of the state matrix."""
    scene = absorber(dashpot_ratio=1e-3, mass=0.05)
    body, w = scene.damper[0], 2 * math.pi * OWN
    M, K = np.diag([1.0, body.mass]), body.stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    C = body.dashpot * np.array([[1.0, -1.0], [-1.0, 1.0]])
    K[0, 0] += STIFFNESS
    C[0, 0] += 2 * 0.002 * w
    state = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), -np.linalg.solve(M, np.hstack([K, C]))])
    slowest = -np.linalg.eigvals(state).real.max()
    found = Transient(scene)
    assert found.slowest(10)[0] == pytest.approx(slowest / OWN, rel=1e-9)
    assert left_over(scene, 3000) / left_over(scene, 2000) == pytest.approx(math.exp(-slowest / OWN * 1000), rel=1e-3)


def test_an_absorber_of_hardly_any_damping():
    """The structure almost stands still in the end, which takes longer than its own damping says."""
    given = simulate(absorber(periods=1500, transient=1000))
    assert given.status == "not_steady"
    response = simulate(absorber())
    body = absorber().damper[0]
    right = steady(absorber(), body.stiffness, body.dashpot)
    assert given.amplitude_mean > 3 * right
    assert response.status == "ok"
    assert abs(response.amplitude_mean - right) <= response.amplitude_mean_confidence <= 0.02 * right


def test_weight_on_a_spring():
    """A spring that carries a body by its weight m g holds (m g)^2/(2 k), and the body has given twice that."""
    hanging = absorber().replace({"gravity.orientation_deg": 90.0, "gravity.acceleration": 10.0})
    body = hanging.damper[0]
    # the structure yields to it as well
    expected = (10.0 * body.mass) ** 2 / 2 * (1 / body.stiffness + 1 / STIFFNESS)
    assert Transient(hanging).weight_energy() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rpm", [6000.0, 6600.0])
def test_a_ball_on_a_track(rpm):
    """docs/examples/self_tuning.toml: 1500 periods say that they are not steady; by default it is where it belongs."""
    scene = Scene.load("docs/examples/self_tuning.toml")
    free = scene.replace({"rotation.rpm": rpm, "sweep": {}})
    given = simulate(free.replace({"time.periods": 1500, "time.transient": 1000}))
    assert given.status == "not_steady"
    response, ball = simulate(free), free.damper[0]
    # m W^2 (R/rho) brings the ball back on its track, and m W^2 drives it outwards; it rolls
    load = ball.mass * free.speed**2
    right = steady(
        free, load * 0.42 / ball.track_radius, inertia=ball.moment_of_inertia / ball.radius**2, outwards=load
    )
    assert response.status == "ok"
    assert abs(response.amplitude_mean - right) <= response.amplitude_mean_confidence <= 0.02 * right
    assert given.amplitude_mean > 50 * right


def test_damping_that_couples_modes(tmp_path):
    """Of two modes that are damped as one, their difference is damped by next to nothing."""
    scene = coupled(tmp_path, 2.0, periods=1500, transient=1000)
    assert left_over(scene, 1000) > 0.01
    response, right = simulate(scene), float(linear_responses(scene)[0].amplitude(np.array([OWN]))[0])
    assert response.status == "not_steady"
    longer = simulate(coupled(tmp_path, 2.0))
    assert longer.status == "ok"
    assert abs(longer.amplitude_mean - right) <= longer.amplitude_mean_confidence <= 0.02 * right


def test_light_damping_among_impacts():
    """A structure that takes 8000 periods to forget its start, and impacts that take a little more energy."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 4e5, "damping_ratio": 2e-5},
        "excitation": {"frequency": 1.001 * math.sqrt(4e5) / (2 * math.pi), "force": 4.0},
        "cavity": [{"name": "c", "gap": 8e-4}],
        "damper": [{"cavity": "c", "mass": 4e-4, "restitution": 0.9}],
        "time": {"periods": 1500, "transient": 1000},
    }
    scene = validate(Scene, data, "light")
    assert simulate(scene).status == "not_steady"
    response = simulate(validate(Scene, {key: value for key, value in data.items() if key != "time"}, "light"))
    # 60,000 periods give 4.107 mm
    assert response.status == "not_steady" or abs(response.amplitude_mean / 4.107e-3 - 1) < 0.03


def test_random_scenes():
    """Of twelve scenes of tests.tools.steady_scenes, two of each kind, means of what is said to be ok are right."""
    outcomes = [outcome_of(seed) for seed in SEEDS]
    assert {KINDS[seed % len(KINDS)].__name__ for seed in SEEDS} == {kind.__name__ for kind in KINDS}
    ok = [outcome for outcome in outcomes if outcome.run.status == "ok"]
    assert len(ok) >= 10
    assert sum(outcome.covered for outcome in ok) >= len(ok) - 1
    for outcome in ok:  # a chaotic motion may have its mean anywhere in the interval
        confidence = (outcome.run.amplitude_mean_confidence or 0.0) / outcome.run.amplitude_mean
        assert outcome.error < 0.03 + confidence
