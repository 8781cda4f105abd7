"""Pictures of orbits: their motion in time, and the runs of sweeps that belong beside their branches."""

from dataclasses import replace

import numpy as np
import pytest

from tests.test_coupling_continuation import BISTABLE, HALF_GAP
from vanedamp.coupling.engine import simulate
from vanedamp.coupling.orbits.history import SAMPLES, orbit_history
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import validate
from vanedamp.studies.report.sweep_beside import points_beside

#: beside the resonance, where the motion with two impacts a period is symmetric
FREQUENCY = 1.01 / (2 * np.pi)
HITTING = BISTABLE | {
    "excitation": {"frequency": FREQUENCY, "force": 1.0},
    "damper": [BISTABLE["damper"][0] | {"velocity": 30.0}],
    "time": {"periods": 1000, "transient": 900},
    "sweep": {},
}


@pytest.fixture(scope="module")
def hitting():
    """A scene whose body hits both walls once a period, and the end of its run."""
    scene = validate(Scene, HITTING, "scene")
    return scene, simulate(scene)


def test_history_is_the_motion_along_the_orbit(hitting):
    """It closes, has the structure's peak, is its own mirror image, and impacts reverse the body's speed."""
    scene, settled = hitting
    along = period_map(scene)
    history = orbit_history(along, along.state_of(settled.final))
    assert history.time[[0, -1]] == pytest.approx([0.0, 1 / FREQUENCY])
    half = SAMPLES // 2
    for name in ("displacement", "velocity", "slip", "slip_velocity"):
        values = getattr(history, name)
        scale = np.abs(values).max()
        # velocities beside an impact are differences to one side; all others are the same half a period later
        away = np.abs(history.time[:half, None] - np.ravel(history.impact_time) % (0.5 / FREQUENCY)).min(axis=1)
        kept = away > 4 * history.time[1]
        kept[0] = False
        np.testing.assert_allclose(values[:half][kept], -values[half:-1][kept], atol=1e-6 * scale)
    assert np.abs(history.displacement).max() == pytest.approx(settled.amplitude_mean, rel=1e-3)
    assert np.abs(history.slip).max() == pytest.approx(HALF_GAP, rel=0.02)
    assert history.velocity[0] == pytest.approx(settled.section[-1, 1], rel=5e-3)
    assert history.slip_velocity[0, 0] == pytest.approx(settled.slip_velocity[-1, 0], rel=5e-3)
    assert history.impact_body.tolist() == [0, 0]
    for impact in history.impact_time:
        after = np.searchsorted(history.time, impact)
        before, rebound = history.slip_velocity[after - 1, 0], history.slip_velocity[after, 0]
        assert rebound / before == pytest.approx(-0.7, rel=0.02)


def test_runs_beside_branches_are_those_of_the_same_scene(hitting):
    scene, _ = hitting
    gaps, speeds, frequencies = [100.0, 2 * HALF_GAP], [0.0, 30.0], [0.155, 0.158, 0.16]
    axes = {"cavity.c.gap": gaps, "excitation.frequency": frequencies, "damper.0.velocity": speeds}
    found = sweep(scene.replace({"sweep": axes, "time.periods": 1100, "time.transient": 1000}))
    x, amplitude = points_beside(scene, "excitation.frequency", found)
    np.testing.assert_array_equal(x, np.repeat(frequencies, 2))
    np.testing.assert_array_equal(amplitude, found.amplitude_mean[1].ravel())
    x, amplitude = points_beside(scene.replace({"excitation.frequency": 0.158}), "cavity.c.gap", found)
    np.testing.assert_array_equal(x, np.repeat(gaps, 2))
    np.testing.assert_array_equal(amplitude, found.amplitude_mean[:, 1].ravel())
    assert len(points_beside(scene, "damper.0.mass", found)[0]) == 0
    for other in ({"damper.0.mass": 0.006}, {"cavity.c.gap": 99.0}, {"cavity.c.name": "d", "damper.0.cavity": "d"}):
        assert len(points_beside(scene.replace(other), "excitation.frequency", found)[0]) == 0
    status = found.status.copy()
    status[1, 0, 1] = "undecided_contact"
    x, _ = points_beside(scene, "excitation.frequency", replace(found, status=status))
    np.testing.assert_array_equal(x, np.repeat(frequencies, 2)[1:])
