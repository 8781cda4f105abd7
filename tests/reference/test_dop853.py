"""The compiled DOP853 against scipy's, and the roots of its guards against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.reference.dop853 import Guards, Motion, march

ORDERS = np.array([1.0, 3.0])


#: at 1 for ever
GUARD = Guards(np.zeros((6, 1, 9)), np.ones(1), np.zeros(1, int), np.zeros(1), np.array([0]))


@pytest.mark.parametrize(("longest", "rtol"), [(0.08, 1e-12), (np.inf, 1e-6), (np.inf, 1e-9)])
def test_steps_and_interpolants_are_those_of_scipy(longest, rtol):
    rng = np.random.default_rng(3)
    rate, loads, start = rng.standard_normal((4, 4)) - np.eye(4), rng.standard_normal((4, 5)), rng.standard_normal(4)

    def slope(t, y):
        return rate @ y + loads @ np.r_[np.sin(ORDERS * t), np.cos(ORDERS * t), 1.0]

    expected = solve_ivp(
        slope, (0.5, 4.0), start, "DOP853",
        dense_output=True, rtol=rtol, atol=1e-3 * rtol, max_step=longest, first_step=min(longest, 3.5),
    )  # fmt: skip
    *steps, last = march(rate, loads, ORDERS, GUARD, 0.5, start, 4.0, longest, rtol)
    found = Motion(np.r_[0.5, steps[0]], *steps[1:])
    assert found.ts == pytest.approx(expected.t, rel=1e-6)
    assert last == pytest.approx(expected.y[:, -1], rel=1e-10 if rtol > 1e-12 else 1e-13)
    times = np.linspace(0.5, 4.0, 300).reshape(3, 100)
    assert found(times).reshape(4, -1) == pytest.approx(expected.sol(times.ravel()), rel=0.1 * rtol, abs=0.1 * rtol)


@pytest.mark.parametrize("depth", [1e-13, 1e-9, 0.3, 1.999])
def test_a_guard_that_is_negative_for_a_moment_is_seen(depth):
    """1 - depth + cos t is negative about pi, for 1e-6 radians if the depth is 1e-13."""
    turns = np.array([[0, 1, 1 - depth], [-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], float)
    rows = np.pad(turns, ((0, 0), (1, 0)))[:, None]
    guards = Guards(rows, np.zeros(1), np.zeros(1, int), np.zeros(1), np.array([0]))
    *steps, last = march(-np.eye(1), np.zeros((1, 3)), np.ones(1), guards, 0.0, np.ones(1), 4.0, 0.08, 1e-12)
    half = 2 * math.asin(math.sqrt(depth / 2))
    assert steps[0][-1] == pytest.approx(math.pi - half, rel=0, abs=1e-15 + 1e-15 / math.sin(half))
    assert last[0] == pytest.approx(math.exp(-steps[0][-1]), rel=1e-12)
