"""What counts as periodic: the motion of structure and bodies in their cavities, each state by its own scale."""

import numpy as np
import pytest

from vanedamp.coupling.response.figures import NON_PERIODIC, repetition
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate


def scene(mass, ratio, gap=0.5):
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
        "excitation": {"frequency": ratio / (2 * np.pi), "force": 0.1},
        "gravity": {"acceleration": 0.0},
        "cavity": [{"name": "c", "gap": gap}],
        "damper": [{"cavity": "c", "mass": mass, "restitution": 0.5}],
        "time": {"periods": 300, "transient": 250},
    }
    return validate(Scene, data, "scene")


@pytest.mark.parametrize("ratio", [1.0, 1.1])
@pytest.mark.parametrize("mass", [1e9, 1e12])
def test_the_response_beside_a_heavy_body_is_periodic(mass, ratio):
    """The structure hits a body that all but rests: an impact oscillator between fixed stops, once on each side.

    The body's own speed is some 1e-10 of the structure's and less, and drifts: by more than 1e-6 of itself, by less
    than that of the motion in the cavity.
    """
    response = simulate(scene(mass, ratio))
    section, speed = response.section[250:], response.slip_velocity[250:, 0]
    body = section[:, 1] + speed
    assert np.abs(body).max() < 1e-9 * np.abs(speed).max()
    assert np.ptp(body) > 1e-6 * np.abs(body).max()
    assert np.ptp(speed) < 1e-6 * np.abs(speed).max()
    assert response.impacts_per_period == 2.0
    assert response.classification == "periodic-1"


@pytest.mark.parametrize(("mass", "ratio"), [(1e3, 1.0), (1e12, 0.9)])
def test_a_motion_without_period_keeps_its_name(mass, ratio):
    """A body whose slow drift the structure feels, and an irregular motion between stops all but fixed."""
    assert simulate(scene(mass, ratio)).classification == "non-periodic"


def test_states_are_measured_by_their_scales():
    """A state that all but vanishes beside its scale says nothing; one that changes by 1e-5 of its scale does."""
    period = np.arange(40)
    steady = np.column_stack([np.ones(40), 1e-9 * np.sin(period)])
    assert repetition(steady, 0, 39, np.array([1.0, 1.0])) == 1
    assert repetition(steady, 0, 39, np.array([1.0, 1e-4])) == NON_PERIODIC
    alternating = np.column_stack([1.0 + 1e-5 * (-1.0) ** period, np.zeros(40)])
    assert repetition(alternating, 0, 39, np.array([1.0, 1.0])) == 2
    # of too few periods nothing repeats often enough
    assert repetition(alternating, 37, 39, np.array([1.0, 1.0])) == NON_PERIODIC
