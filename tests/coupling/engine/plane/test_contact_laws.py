"""Contact laws at corners and discs: closed forms, laws of other packages, refusals."""

import math
import tomllib

import numpy as np
import pytest

from tests.coupling.scene.contact_laws.test_own_law import FifthRoot
from tests.tools.input_files import SCENE
from tests.tools.planar import ledger, planar_run, planar_scene, run_planar, still_table, witness
from vanedamp.coupling.response.records import FRICTION, IMPACT, IMPACT_LOSS
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate

G = 9.81
#: the law of another package, restitution 1 - c (1 - e) v^(1/5) with e of the body
ROOT = {"law": FifthRoot.law}


def table(law, frequency=1.0, gravity=G):
    return still_table(frequency, gravity=gravity) | {"contact": law}


def bounces(count, c, drop):
    """Times of the first impacts on the floor of a body that falls from rest, and the speeds before them."""
    speeds = [math.sqrt(2 * G * drop)]
    times = [speeds[0] / G]
    for _ in range(count - 1):
        speeds.append(speeds[-1] * (1 - c * speeds[-1] ** 0.2))
        times.append(times[-1] + 2 * speeds[-1] / G)
    return np.array(times), np.array(speeds)


@pytest.mark.parametrize(
    "shape", [{"shape": "block", "length": 0.02, "height": 0.04}, {"shape": "disc", "radius": 0.01}]
)
def test_bounces_with_a_restitution_that_depends_on_the_speed(shape):
    """Both corners of a block that falls flat have the restitution of their speed; bodies slide on meanwhile."""
    c, drop = 0.3, 1e-3
    body = shape | {"mass": 1.3, "friction": 0.0, "restitution": 0.25, "lift": drop, "velocity": 1e-2}
    run = planar_run(table(ROOT | {"c": c}), body, periods=1)
    assert run.status is Status.OK
    impacts = run.events(IMPACT)
    first = impacts[impacts[:, 2] == impacts[0, 2]][:40]
    times, speeds = bounces(len(first), 0.75 * c, drop)
    assert len(first) == 40
    np.testing.assert_allclose(first[:, 0], times, rtol=1e-10)
    np.testing.assert_allclose(-first[:, 3], speeds, rtol=1e-10)
    np.testing.assert_allclose(first[:, 4] / speeds, 1 - 0.75 * c * speeds**0.2, rtol=1e-10)
    assert run.state.ledger[IMPACT_LOSS] == pytest.approx(1.3 * G * drop, rel=1e-9)
    assert run.state.ledger[FRICTION] == 0.0
    assert abs(ledger(run)) <= 1e-12 * 1.3 * G * drop


def test_each_contact_has_the_restitution_of_its_own_speed():
    """A tilted block hits the floor with one corner, then with the other."""
    c = 0.4
    body = {
        "shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": 0.2, "restitution": 0.0,
        "lift": 3e-4, "tilt": 2e-4, "tilt_rate": 0.05, "velocity": 0.05,
    }  # fmt: skip
    run = planar_run(table(ROOT | {"c": c}, 50.0), body, periods=1, gap=2e-3, play=1e-3)
    impacts = run.events(IMPACT)
    speed = -impacts[:, 3]
    judged = speed > 1e-3
    assert np.count_nonzero(judged) >= 4
    assert len(set(impacts[judged, 2])) >= 2
    # an impact that would bring energy has less: those here do not
    np.testing.assert_allclose(impacts[judged, 4], ((1 - c * speed**0.2) * speed)[judged], rtol=1e-10)
    assert abs(ledger(run)) <= 1e-12 * 1.3 * G * 3e-4


def test_time_stepping_converges_with_such_a_law():
    body = {
        "shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": 0.3, "restitution": 0.0,
        "lift": 3e-4, "velocity": 0.3, "tilt": 2e-4, "tilt_rate": 0.02,
    }  # fmt: skip
    scene = planar_scene(table(ROOT | {"c": 0.6}, 50.0), body, gap=2e-3, play=1e-3)
    exact = run_planar(scene, 1)
    reach = np.abs(exact.system.J).max(axis=0)
    for steps in (4000, 16000):
        run, status = witness(scene, 1, steps)
        assert status is Status.OK
        # 4 times the speeds that end a flight within a step
        assert np.abs((run.motion.q - exact.state.q) * reach).max() <= 1.2 / 50.0 / steps
    losses = [ended.records.ledger[1, [FRICTION, IMPACT_LOSS]] for ended in (run, exact)]
    np.testing.assert_allclose(losses[0], losses[1], rtol=0.02)


def tilted(mu, restitution, velocity, **more):
    """A block that falls on one corner."""
    return {
        "shape": "block", "length": 0.6, "height": 0.2, "mass": 1.0, "friction": mu, "restitution": restitution,
        "lift": 0.01, "lift_velocity": -0.3, "velocity": velocity, "tilt": 0.04,
    } | more  # fmt: skip


def corner_impact(law, body):
    """Impulses (2,) of the first impact, speeds (2,) of its corner before and after it, mobilities, loss and energy."""
    run = planar_run(table({"law": law}, gravity=0.0), body, periods=1, events=1)
    (hit,) = run.events(IMPACT)
    rows, system = [int(hit[2]), len(run.system.rest) + int(hit[2])], run.system
    after = system.J[rows] @ run.state.v
    mobility = system.delassus[np.ix_(rows, rows)]
    energy = 0.5 * system.mass @ run.state.v**2
    return hit[5:7], after - mobility @ hit[5:7], after, mobility, run.state.ledger[IMPACT_LOSS], energy


@pytest.mark.parametrize("restitution", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("velocity", [-1.0, 1.0])
def test_a_corner_that_slips_on_obeys_both_laws(velocity, restitution):
    """Routh's diagram: a slip that does not end keeps the impulse on one edge of the cone."""
    mu, found = 0.1, {}
    for law in ("newton", "poisson"):
        impulse, before, after, mobility, loss, _ = corner_impact(law, tilted(mu, restitution, velocity))
        drag = -mu * np.sign(before[1])
        assert after[1] * before[1] > 0.0
        expected = -(1 + restitution) * before[0] / (mobility[0] @ [1.0, drag])
        np.testing.assert_allclose(impulse, [expected, drag * expected], rtol=1e-12)
        assert after[0] == pytest.approx(-restitution * before[0], rel=1e-12, abs=1e-15)
        assert loss == pytest.approx(-0.5 * impulse @ (before + after), rel=1e-12)
        found[law] = impulse
    np.testing.assert_allclose(found["newton"], found["poisson"], rtol=1e-12)


def test_a_corner_that_sticks_tells_the_laws_apart():
    """Compression stops both speeds; expansion keeps the slip at rest: v_N+ = -k (v_N - (G_NT/G_TT) v_T)."""
    k, mu = 0.5, 0.8
    body = tilted(mu, k, 0.05)
    impulse, before, after, g, loss, _ = corner_impact("poisson", body)
    compression = np.linalg.solve(g, -before)
    assert compression[0] > 0.0 and abs(compression[1]) < mu * compression[0]
    expansion = k * compression[0] * np.array([1.0, -g[0, 1] / g[1, 1]])
    np.testing.assert_allclose(impulse, compression + expansion, rtol=1e-12)
    assert after[0] == pytest.approx(-k * (before[0] - g[0, 1] / g[1, 1] * before[1]), rel=1e-12)
    assert abs(after[1]) <= 1e-13
    assert loss == pytest.approx(-0.5 * impulse @ (before + after), rel=1e-12) and loss > 0.0
    newton = corner_impact("newton", body)
    assert newton[2][0] == pytest.approx(-k * before[0], rel=1e-12)
    assert abs(newton[2][0] - after[0]) > 0.01 * abs(after[0])


@pytest.mark.parametrize("shape", [{"shape": "slider"}, {"shape": "disc", "radius": 0.01}])
@pytest.mark.parametrize(
    ("coefficients", "newton", "poisson"),
    [
        ((1.0, 1.0, 1.0), (-1 / 3, 2 / 3, 2 / 3), (-1 / 3, 2 / 3, 2 / 3)),
        ((0.5, 0.5, 0.5), (0.0, 0.5, 0.5), (0.0, 0.5, 0.5)),
        # the second pair returns what it was compressed by, and takes the middle body from the first
        ((0.0, 1.0, 1.0), (1 / 3, 1 / 3, 1 / 3), (1 / 6, 1 / 6, 2 / 3)),
    ],
)
def test_three_equal_bodies_in_a_row(shape, coefficients, newton, poisson):
    """Compression leaves 1/3 each, by impulses 2/3 and 1/3; pairs have the geometric mean of two coefficients."""
    places = (-1e-2, 0.0, 0.0)
    speeds = (1.0, 0.0, 0.0)
    rows = [
        shape | {"mass": 1.0, "position": place, "velocity": speed, "restitution": k, "friction": 0.0}
        for place, speed, k in zip(places, speeds, coefficients, strict=True)
    ]
    for law, expected in (("newton", newton), ("poisson", poisson)):
        if law == "newton" and shape["shape"] == "slider":
            rows[0]["dashpot"] = 0.0  # in the engine for the plane
        run = planar_run(table({"law": law}, 10.0, gravity=0.0), *rows, periods=1, gap=1.0)
        np.testing.assert_allclose(run.state.v[run.system.along], expected, atol=1e-12)


@pytest.mark.parametrize("restitution", [0.6, 1.0])
def test_poissons_law_brings_no_energy(restitution):
    """Friction that turns in expansion could; all coefficients are then smaller."""
    for velocity in np.linspace(-1.0, 1.0, 9):
        for tilt in (-0.04, 0.04):
            body = tilted(0.8, restitution, velocity, tilt=tilt, tilt_rate=1.5 * np.sign(tilt))
            *_, loss, energy = corner_impact("poisson", body)
            assert loss >= -1e-12 * energy


def test_sliders_by_poissons_law():
    """A pair collides as by Newton's law: the same motion, by the exact engine and by steps."""
    scene = validate(Scene, tomllib.loads(SCENE), "scene").replace(
        {"sweep": {}, "time": {"periods": 30, "transient": 0}}
    )
    newton, poisson = (simulate(scene.replace({"contact": {"law": law}}), events=True) for law in ("newton", "poisson"))
    np.testing.assert_allclose(poisson.peak[:10], newton.peak[:10], rtol=1e-9)
    assert poisson.impacts_per_period > 0.5
    with pytest.raises(InputError, match=r"two phases, of \"poisson\", are for solver\.method exact or moreau"):
        simulate(scene.replace({"contact": {"law": "poisson"}, "solver.method": "penalty"}))


def test_time_stepping_converges_by_poissons_law():
    bodies = [
        {"shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": 0.3, "restitution": 0.5,
         "position": -4e-4, "velocity": 0.2, "tilt": 1e-4},
        {"shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": 0.3, "restitution": 0.5,
         "position": 1e-4, "velocity": -0.1, "lift": 2e-4},
    ]  # fmt: skip
    scene = planar_scene(table({"law": "poisson"}, 50.0), *bodies, gap=2e-3, play=1e-3)
    exact = run_planar(scene, 1)
    assert exact.status is Status.OK
    reach, errors = np.abs(exact.system.J).max(axis=0), []
    for steps in (4000, 16000):
        run, status = witness(scene, 1, steps)
        assert status is Status.OK
        errors.append(np.abs((run.motion.q - exact.state.q) * reach).max())
        # 4 times the speeds that end a flight within a step
        assert errors[-1] <= 1.2 / 50.0 / steps
