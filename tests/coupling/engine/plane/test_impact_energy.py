"""Impacts of single corners where Newton's law with friction would bring energy (Kane's paradox)."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.coupling.engine.plane.test_scenes import reference
from tests.coupling.methods.test_planar_bodies import last, run_by
from tests.tools.planar import planar_scene, run_planar, still_table, witness
from tests.tools.planar_laws import Stepper
from vanedamp.coupling.response.records import IMPACT
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.assembly import assemble


def corner(mobility, before, restitution, mu):
    """Impulses (normal, tangential) of Newton's law with Coulomb's at one contact, by trying stick and both slips.

    mobility (2, 2) and speeds (2,) before: normal, tangential.
    """
    impulse = np.linalg.solve(mobility, -before * [1 + restitution, 1.0])
    if abs(impulse[1]) <= mu * impulse[0]:
        return impulse
    for way in (-1.0, 1.0):  # of friction
        push = np.array([1.0, way * mu])
        impulse = -(1 + restitution) * before[0] / (mobility[0] @ push) * push
        if way * (before + mobility @ impulse)[1] <= 0.0:
            return impulse
    raise AssertionError("no solution")


def lossless(mobility, before, restitution, mu):
    """Impulses of the largest restitution up to the given one that brings no energy, and that restitution."""

    def gain(coefficient):
        impulse = corner(mobility, before, coefficient, mu)
        return impulse @ (before + 0.5 * mobility @ impulse)

    if gain(restitution) > 0.0:
        restitution = brentq(gain, 0.0, restitution, xtol=1e-15)
    return corner(mobility, before, restitution, mu), restitution


@pytest.mark.parametrize("restitution", [0.81, 0.9])
def test_impacts_of_a_block_are_those_of_one_corner_without_gain(restitution):
    """Figure 9's block: one corner hits at a time; at 0.9 Newton's law would bring energy in three impacts of ten.

    Never up to sqrt(1 - G_NT^2/(G_NN G_TT)) = 0.8198 of wall, floor and ceiling, below which no gain is possible.
    """
    mu = 0.4
    stepper = Stepper(reference(0.989, periods=60, transient=0, restitution=restitution, lift=8e-5, tilt=2e-3))
    system, work, u = stepper.run.system, stepper.run.scratch, len(stepper.run.system.rest)
    taken = []
    while (hits := stepper.step()) is not None:
        if len(hits) == 0:
            continue
        assert len(hits) == 1
        rows = int(hits[0, 2]) + np.array([0, u])
        mobility, before = system.delassus[np.ix_(rows, rows)], work.before_impact[rows].copy()
        impulse, share = lossless(mobility, before, restitution, mu)
        # the engine's bound of a gain is 1e-12 of the whole motion's energy
        rough = 1e-12 * 0.5 * system.mass @ stepper.run.state.v**2
        assert hits[0, 7] >= -1.1 * rough
        within = 1e-9 + 10 * rough / (0.5 * before[0] ** 2 / mobility[0, 0])
        np.testing.assert_allclose(hits[0, [5, 6]], impulse, rtol=within, atol=within * impulse[0])
        assert share >= math.sqrt(1 - mobility[0, 1] ** 2 / (mobility[0, 0] * mobility[1, 1])) - 1e-9 or share == 0.81
        taken.append(share)
    reduced = sum(share < restitution for share in taken)
    assert len(taken) > 300
    assert reduced == stepper.run.outcome().counters["reduced_impacts"]
    assert 0.2 < reduced / len(taken) < 0.4 if restitution == 0.9 else reduced == 0


@pytest.mark.parametrize("method", ["exact", "moreau", "solve_ivp"])
@pytest.mark.parametrize(("restitution", "slender"), [(0.78, 1.0), (0.9, 1.0), (0.9, 2.0), (1.0, 2.0)])
def test_largest_restitution_that_brings_no_energy(method, restitution, slender):
    """A corner that hits at the worst obliquity, v_T = -v_N G_NT/G_NN, and sticks.

    2 G_NN DT = v_N^2 (G_NT^2/(G_NN G_TT) - (1 - k^2)) G_NN G_TT/(G_NN G_TT - G_NT^2): no more than
    k = sqrt(1 - G_NT^2/(G_NN G_TT)) is possible, 0.8 for a square.
    """
    b, speed, mass, period = 0.01, 0.1, 1.3, 0.012
    a = slender * b
    inertia = mass * (a * a + b * b) / 3
    normal, cross, slip = 1 / mass + a * a / inertia, a * b / inertia, 1 / mass + b * b / inertia
    # tilted against the clock it comes down on its lower left corner: row (0, 1, -a) across, (1, 0, b) along
    block = {
        "shape": "block", "length": 2 * a, "height": 2 * b, "mass": mass, "friction": 0.6, "restitution": restitution,
        "lift": 1e-3, "tilt": 0.1, "lift_velocity": -speed, "velocity": cross / normal * speed,
    }  # fmt: skip
    scene = planar_scene(still_table(1 / period, gravity=0.0), block)
    if method == "exact":
        run = run_planar(scene, 1)
        status, v = run.status, run.state.v
    else:
        run, status = run_by(scene, method=method, steps_per_period=1000)
        v = last(run)[1]
    assert status is Status.OK
    keeps = math.sqrt(1 - cross**2 / (normal * slip))
    assert v[1] - a * v[2] == pytest.approx(min(restitution, keeps) * speed, rel=1e-8)
    assert v[0] + b * v[2] == pytest.approx(0.0, abs=1e-8 * speed)


def test_no_contact_of_time_stepping_brings_energy():
    """By Newton's law alone three of ten would, by up to a fifth of the energy of approach; loads of a step count."""
    steps = 6400
    scene = reference(0.989, periods=60, transient=0, restitution=0.9, lift=8e-5, tilt=2e-3)
    run, status = witness(scene, 60, steps)
    assert status is Status.OK
    log = np.concatenate(run.chunks)
    hits = log[log[:, 1] == IMPACT]
    rows = hits[:, 2].astype(int)
    approach = 0.5 * hits[:, 3] ** 2 / assemble(scene).delassus[rows, rows]
    strong = approach > 1e-3 * approach.max()
    assert np.count_nonzero(strong) > 200
    assert (-hits[strong, 7] / approach[strong]).max() < 0.03
