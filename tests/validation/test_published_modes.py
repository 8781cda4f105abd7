"""Published natural frequencies: meshes that refine, beside the figures of docs/validation.md."""

import numpy as np
import pytest

from tests.validation.modes import STEEL, Tube, bending_pairs, square_membrane


def test_square_membrane_converges(tmp_path):
    """From above, with the low order of a stress that is singular at the ends of the clamp."""
    solutions = [square_membrane(tmp_path, cells) for cells in (4, 8, 16)]
    steps = np.diff(solutions, axis=0)
    assert np.all(steps < 0.0)
    assert np.all(np.log2(steps[0] / steps[1]) > 0.5)
    limit = solutions[2] + steps[1] / (steps[0] / steps[1] - 1.0)
    # SOLIDWORKS Simulation's verification problem of this membrane, where the published reference is 222.54
    assert limit[3] == pytest.approx(224.03, rel=1e-3)


def test_tube_bends_in_pairs(tmp_path):
    """Every bending mode twice, and nearer to the theory's the finer the mesh until its own error shows."""
    tube = Tube()
    expected = tube.timoshenko(3)
    errors = []
    for along in (10, 20):
        pairs = bending_pairs(tube.frequencies(tmp_path, 8, 1, along, 12), expected)
        assert pairs[:, 1] == pytest.approx(pairs[:, 0], rel=1e-8)
        errors.append(np.abs(pairs[:, 0] / expected - 1.0))
    assert np.all(errors[1] < 0.2 * errors[0])


def test_slender_tube_is_a_beam_of_euler_and_bernoulli():
    """Free ends: (4.7300407, 7.8532046)^2 (Blevins 1979, table 8-1).

    Shear and rotary inertia take some (beta r / L)^2 (1 + E / kappa G) / 2, here 1e-7; beta is given to 5e-9.
    """
    tube = Tube(length=1000.0)
    radius = 0.5 * np.hypot(tube.outer, tube.inner)
    speed = np.sqrt(STEEL.young / STEEL.density)
    beam = np.array([4.7300407, 7.8532046]) ** 2 * radius * speed / (2 * np.pi * tube.length**2)
    assert tube.timoshenko(2) == pytest.approx(beam, rel=1e-6)
