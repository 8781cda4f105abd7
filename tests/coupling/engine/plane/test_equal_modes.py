"""Motions of subsystems two or three of whose modes are one, against the exponential of their matrix."""

import numpy as np
import pytest
from scipy.linalg import expm

from vanedamp.coupling.engine.plane.subsystems import _modes


@pytest.mark.parametrize("squares", [(1.0, 1.0, 4.0, 9.0), (1.0, 1.0, 1.0, 9.0), (1.0, 1.0, 9.0, 9.0)])
def test_they_are_those_of_the_matrix(squares):
    stiffness = 1e4 * np.diag(squares) + 200.0 * np.triu(np.ones((4, 4)), 1)
    damping, k = 3.0 * np.eye(4), 4
    value, vector, inverse = _modes(stiffness, damping)
    matrix = np.block([[np.zeros((k, k)), np.eye(k)], [-stiffness, -damping]])
    start = np.r_[1.0, -2.0, 0.5, 1.0, 100.0, 50.0, -80.0, 20.0]
    for time in (0.0, 1e-3, 0.03, 0.3):
        moved = (vector * np.exp(value * time) @ (inverse @ start)).real
        exact = expm(matrix * time) @ start
        assert np.abs((moved - exact) / np.repeat([1.0, 100.0], k)).max() < 1e-10
