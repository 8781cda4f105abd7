"""The contact complementarity problem against enumeration of all states, and on redundant (singular) systems."""

import itertools

import numpy as np
import pytest

from vanedamp.coupling.numerics.codes import AT_HIGH, AT_LOW, DEPENDENT, FREE
from vanedamp.coupling.numerics.complementarity import new_problem, solve_box


def solve(a_matrix, b, lo, hi, forced=None):
    k = len(b)
    problem = new_problem(k + 1)  # room to spare: only the first k rows count
    problem.matrix[:k, :k], problem.b[:k], problem.low[:k], problem.high[:k] = a_matrix, b, lo, hi
    problem.forced[:k] = 0 if forced is None else forced
    assert solve_box(problem, k, 0.0)
    return problem.force[:k], problem.acceleration[:k], problem.state[:k]


def by_enumeration(a_matrix, b, lo, hi):
    """Accelerations of the unique solution: every combination of free and bounded rows is tried."""
    k = len(b)
    for choice in itertools.product((FREE, AT_LOW, AT_HIGH), repeat=k):
        free = [i for i in range(k) if choice[i] == FREE]
        f = np.array([{FREE: 0.0, AT_LOW: lo[i], AT_HIGH: hi[i]}[choice[i]] for i in range(k)])
        if not np.all(np.isfinite(f)):
            continue
        if free:
            f[free] = np.linalg.solve(a_matrix[np.ix_(free, free)], -(b + a_matrix @ f)[free])
        a = a_matrix @ f + b
        good = all(
            (c == FREE and lo[i] - 1e-9 <= f[i] <= hi[i] + 1e-9)
            or (c == AT_LOW and a[i] >= -1e-9)
            or (c == AT_HIGH and a[i] <= 1e-9)
            for i, c in enumerate(choice)
        )
        if good:
            return f, a
    raise AssertionError("no solution found by enumeration")


@pytest.mark.parametrize("seed", range(200))
def test_equals_enumeration(seed):
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 6))
    rows = rng.normal(size=(k, k + 2)) * 10 ** rng.uniform(-2, 2, size=(k, 1))
    a_matrix, b = rows @ rows.T, rng.normal(size=k) * 10 ** rng.uniform(-2, 2, size=k)
    contact = rng.random(k) < 0.5
    lo = np.where(contact, 0.0, -rng.random(k))
    hi = np.where(contact, np.inf, -lo)
    f, a, _ = solve(a_matrix, b, lo, hi)
    expected_f, expected_a = by_enumeration(a_matrix, b, lo, hi)
    assert f == pytest.approx(expected_f, rel=1e-7, abs=1e-9 * np.abs(b).max() / a_matrix.diagonal().min())
    assert a == pytest.approx(expected_a, abs=1e-7 * np.abs(b).max())


def test_body_pressed_on_a_wall_by_redundant_rows():
    """Friction and wall act on one body along one line: only their sum is determined, and the body stays at rest."""
    one = np.ones((2, 2))
    f, a, state = solve(one, [-3.0, -3.0], [0.0, -1.0], [np.inf, 1.0])
    assert a == pytest.approx([0, 0])
    assert f.sum() == pytest.approx(3.0)
    assert sorted(state) == [FREE, DEPENDENT]


def test_friction_takes_over_from_a_wall_that_lets_go():
    """The wall's force has just vanished: friction holds the body, the wall stays in touch without force."""
    one = np.ones((2, 2))
    f, a, state = solve(one, [0.4, 0.4], [0.0, -1.0], [np.inf, 1.0], forced=[AT_LOW, 0])
    assert a == pytest.approx([0, 0])
    assert f == pytest.approx([0.0, -0.4])
    assert list(state) == [DEPENDENT, FREE]


def test_wall_takes_over_from_friction_at_its_bound():
    one = np.ones((2, 2))
    f, a, state = solve(one, [-1.0, -1.0], [0.0, -1.0], [np.inf, 1.0], forced=[0, AT_HIGH])
    assert a == pytest.approx([0, 0])
    assert f == pytest.approx([0.0, 1.0])
    assert list(state) == [FREE, DEPENDENT]


@pytest.mark.parametrize("bodies", [2, 5, 16, 32])
def test_chain_pushed_against_a_wall(bodies):
    """A row of unit masses pushed by unit forces against a wall: the k-th contact from the free end carries k."""
    jacobian = np.eye(bodies, bodies, k=1) - np.eye(bodies)
    a_matrix = jacobian @ jacobian.T
    b = jacobian @ np.ones(bodies)
    f, a, state = solve(a_matrix, b, np.zeros(bodies), np.full(bodies, np.inf))
    assert f == pytest.approx(np.arange(1, bodies + 1))
    assert a == pytest.approx(np.zeros(bodies), abs=1e-9)
    assert np.all(state == FREE)


def test_chain_with_friction_and_wall_is_redundant_and_at_rest():
    """Every body sticks to the floor and stands in a closed row against the wall; a push is carried somehow."""
    bodies = 4
    contacts = np.eye(bodies, bodies, k=1) - np.eye(bodies)
    jacobian = np.vstack([contacts, np.eye(bodies)])
    push = np.array([2.5, 0.0, 0.0, 0.0])
    lo, hi = np.r_[np.zeros(bodies), -np.ones(bodies)], np.r_[np.full(bodies, np.inf), np.ones(bodies)]
    f, a, _ = solve(jacobian @ jacobian.T, jacobian @ push, lo, hi)
    assert a == pytest.approx(np.zeros(2 * bodies), abs=1e-9)
    assert jacobian.T @ f == pytest.approx(-push)
    assert np.all(f >= lo - 1e-12) and np.all(f <= hi + 1e-12)


@pytest.mark.parametrize("seed", range(100))
def test_a_body_without_load_at_a_wall_that_friction_holds(seed):
    """Two rows of friction lock a structure of two modes, bodies ride on it: one touches its wall without a force."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((4, 4))
    rows[1:, :2] = rng.normal(size=(3, 2))
    rows[0, :2] = -rows[2, :2]
    rows[[0, 1], [2, 3]] = 1 / np.sqrt(rng.uniform(0.01, 0.1, size=2))
    b = rows[:, :2] @ rng.normal(size=2)
    hi = np.array([np.inf, 1e-2 * rng.uniform(), 1e9, 1e9])
    _, a, _ = solve(rows @ rows.T, b, np.r_[0.0, -hi[1:]], hi)
    assert a[[0, 2, 3]] == pytest.approx(0.0, abs=1e-11 * np.abs(b).max())
