"""Contact laws at corners and discs: closed forms, laws of other packages, refusals."""

import math

import numpy as np
import pytest

from tests.test_coupling_restitution_law import FifthRoot
from tests.tools.planar import ledger, planar_run, planar_scene, run_planar, still_table, witness
from vanedamp.coupling.response.records import FRICTION, IMPACT, IMPACT_LOSS
from vanedamp.coupling.response.response import Status

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
