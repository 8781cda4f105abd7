"""Several bodies in one cavity: random scenes end, balance and stay inside, and follow DOP853."""

import numpy as np
import pytest

from tests.reference.integrator import with_horizon
from tests.tools.random_scenes import random_scene
from tests.tools.tiers import seeds
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate


@pytest.mark.parametrize("structure", ["rigid", "prescribed"])
@pytest.mark.parametrize("bodies", [2, 3, 6])
@pytest.mark.parametrize("seed", seeds(10, fast=[0, 1, 2]))
def test_random_rows_of_bodies(structure, bodies, seed):
    scene = random_scene(seed, structure, bodies, shared=True).replace({"time.periods": 10, "time.transient": 0})
    response = simulate(scene, samples_per_period=32)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    slips = response.body_displacement / scene.cavity[0].gap
    assert np.abs(slips).max() <= 0.5 + 1e-11
    # in file order from left to right, always
    assert np.diff(slips, axis=1).min() >= -1e-11


@pytest.mark.parametrize("seed", seeds(8, fast=[5, 6, 7]))
def test_two_bodies_in_one_cavity_equal_dop853(seed):
    periods = 3
    scene = random_scene(seed, "rigid", 2, shared=True).replace({"time.periods": periods, "time.transient": 0})
    reference, end = with_horizon(scene, periods)
    response = simulate(scene, samples_per_period=64)
    time = response.time[response.time < end]
    assert len(time) > 8
    for body in range(2):
        followed = response.body_displacement[: len(time), body] - reference.r(body, time)
        assert np.abs(followed).max() <= 2e-7 * scene.cavity[0].gap
