"""The guaranteed search against dense sampling, and on the roots that step-end signs miss."""

import numpy as np
import pytest
from numba import njit

from vanedamp.coupling.engine.root_search import (
    DEGREE,
    _bounds,
    eighth_root_of_ratio,
    expand,
    new_expansion,
    shift,
    step_or_stop,
)
from vanedamp.coupling.numerics.codes import FORCE, POSITION, VELOCITY
from vanedamp.coupling.numerics.exponentials import exp_minus_line, exp_minus_one


def search(order, k0, k1, k2, g, eigenvalue, end):
    """First root in (0, end), or inf: the engine's loop for one event function."""
    rates = np.argsort(np.abs(eigenvalue))
    return search_in_order(order, k0, k1, k2, g[rates], eigenvalue[rates], end, new_expansion(len(g)))


@njit
def search_in_order(order, k0, k1, k2, g, eigenvalue, end, work):
    t, steps = 0.0, 0
    while t < end:
        noise, second, calm, fast = expand(order, k1, k2, g, eigenvalue, 0, len(g), t, work)
        step, found, _ = step_or_stop(work, 1.0, k0, np.inf, noise, second, calm, fast, end - t, 1e-15 * end)
        t += step
        if found:
            return t, steps
        steps += 1
    return np.inf, steps


@njit
def remainders(z):
    """exp(z) - 1 and exp(z) - 1 - z as the engine has them."""
    first = exp_minus_one(z)
    return first, exp_minus_line(z, first)


@njit
def bounds(a, sign, f, h):
    """Bounds of the lower polynomial on a step."""
    return _bounds(a, sign, f, h)


@njit
def moved(a, sign, h, shifted):
    """That polynomial from another time on."""
    return shift(a, sign, h, shifted)


@njit
def ratio(x, y):
    """Eighth root of a ratio."""
    return eighth_root_of_ratio(x, y)


def value(order, k0, k1, k2, g, eigenvalue, t):
    z = eigenvalue[:, None] * t
    e = {POSITION: np.exp(z) - 1 - z, VELOCITY: np.exp(z) - 1, FORCE: np.exp(z)}[order]
    return k0 + k1 * t + 0.5 * (k2 if order == POSITION else 0) * t**2 + (g[:, None] * e).real.sum(axis=0)


def evenly(order, k0, k1, k2, g, eigenvalue, t):
    """The same at evenly spaced times: exponentials of sums are products of exponentials."""
    block = int(np.sqrt(len(t)))
    waves = (g * np.exp(np.multiply.outer(t[::block], eigenvalue))) @ np.exp(
        np.multiply.outer(eigenvalue, t[:block] - t[0])
    )
    line = np.array([0.0 if order == FORCE else g.sum(), (g * eigenvalue).sum() if order == POSITION else 0.0]).real
    curve = 0.5 * (k2 if order == POSITION else 0)
    return waves.real.ravel()[: len(t)] + (k0 - line[0]) + (k1 - line[1]) * t + curve * t**2


@pytest.mark.parametrize("order", [POSITION, VELOCITY, FORCE])
@pytest.mark.parametrize("seed", range(40))
def test_first_root_equals_dense_sampling(seed, order):
    rng = np.random.default_rng(seed)
    modes = int(rng.integers(1, 7))
    eigenvalue = -rng.uniform(0, 0.5, modes) + 1j * rng.uniform(0.3, 12, modes)
    g = rng.normal(size=modes) + 1j * rng.normal(size=modes)
    k1, k2 = (rng.normal(size=2) * 0.3) if order != FORCE else (0.0, 0.0)
    k2 = k2 if order == POSITION else 0.0
    t = np.linspace(0, 2 * np.pi, 200_001)
    shape = evenly(order, 0.0, k1, k2, g, eigenvalue, t)
    # half of the scenes come within 1e-7 of a touch, above or below
    lowest = -shape[1:].min()
    k0 = lowest + rng.choice([-1e-7, 1e-7]) if seed % 2 else lowest * rng.uniform(0.2, 1.1)
    k0 = max(k0, 0.01 - shape[0])
    found, steps = search(order, k0, k1, k2, g, eigenvalue, 2 * np.pi)
    negative = np.flatnonzero(shape + k0 <= 0)
    if len(negative) == 0:
        # nothing between the samples either, or a touch that they step over
        assert found == np.inf or abs(value(order, k0, k1, k2, g, eigenvalue, np.array([found]))[0]) < 1e-10
    else:
        assert t[negative[0] - 1] - 1e-9 <= found <= t[negative[0]] + 1e-9
    assert steps < 400


@pytest.mark.parametrize("order", [POSITION, VELOCITY, FORCE])
@pytest.mark.parametrize("seed", range(10))
def test_nothing_dips_below_zero_before_the_root(seed, order):
    """Fifty functions with slow and fast modes each: every local minimum before the root is positive, sought closely.

    A third comes within 1e-3 to 1e-13 of a touch, a third starts at zero, as a gap does after an impact.
    """
    rng = np.random.default_rng([seed, 1])
    looked = 0
    for trial in range(50):
        modes = int(rng.integers(1, 9))
        rate = np.r_[1.0, np.exp(rng.uniform(np.log(0.3), np.log(60.0), modes - 1))]
        eigenvalue = -rate * np.exp(rng.uniform(-9, -0.5, modes)) + 1j * rate
        eigenvalue[0] = 1j
        g = (rng.normal(size=modes) + 1j * rng.normal(size=modes)) / rate ** rng.uniform(0, 2.5)
        k1, k2 = (rng.normal(size=2) * 0.3) if order != FORCE else (0.0, 0.0)
        t = np.linspace(0, 2 * np.pi, 6001)
        shape = evenly(order, 0.0, k1, k2, g, eigenvalue, t)
        k0 = (0.0, -shape[5:].min(), -shape[5:].min() * rng.uniform(0.2, 1.0))[trial % 3]
        if trial % 3 == 1:
            k0 += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-13, -3)
        shape += k0
        if shape[0] < 0.0 or shape[1] <= 0.0:
            continue
        found, steps = search(order, k0, k1, k2, g, eigenvalue, t[-1])
        assert steps < 200
        scale = abs(k0) + abs(k1) + abs(k2) + np.abs(g * (1 + rate)).sum()
        before = np.flatnonzero((shape[1:-1] <= shape[:-2]) & (shape[1:-1] <= shape[2:]) & (t[1:-1] < found)) + 1
        for i in before:
            near = np.linspace(t[i - 1], min(t[i + 1], found), 4001)
            assert evenly(order, k0, k1, k2, g, eigenvalue, near).min() > -1e-14 * scale
        looked += len(before)
        assert shape[t <= found].min() > -1e-14 * scale
        if found < np.inf:
            assert abs(value(order, k0, k1, k2, g, eigenvalue, np.array([found]))[0]) < 2e-14 * scale
    assert looked >= 10


def test_tangential_touch_is_found():
    """1 - cos t touches zero at 2 pi: no sign change. A function lifted by 1e-12 does not touch."""
    g, eigenvalue = np.array([-1.0 + 0j]), np.array([1j])
    found, _ = search(FORCE, 1.0, 0.0, 0.0, -g * np.exp(-1j), eigenvalue, 8.0)  # 1 + cos(t - 1)
    assert found == pytest.approx(np.pi + 1, abs=1e-6)
    above, _ = search(FORCE, 1.0 + 1e-12, 0.0, 0.0, -g * np.exp(-1j), eigenvalue, 8.0)
    assert above == np.inf


def test_quadratic_convergence():
    """A falling line with a little curvature costs a handful of evaluations."""
    found, steps = search(POSITION, 1.0, -1.0, 0.1, np.array([0.01 + 0j]), np.array([-0.1 + 3j]), 10.0)
    assert value(POSITION, 1.0, -1.0, 0.1, np.array([0.01]), np.array([-0.1 + 3j]), np.array([found]))[0] == (
        pytest.approx(0, abs=1e-14)
    )
    assert steps <= 9


@pytest.mark.parametrize("size", 10.0 ** np.arange(-14, 2))
def test_exponentials_without_cancellation(size):
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(50):
        for angle in (1.7, 2.5, np.pi / 2):
            z = size * np.exp(1j * angle)
            exact = mpmath.exp(mpmath.mpc(z)) - 1
            line = exact - mpmath.mpc(z)
            first, rest = remainders(z)
            assert abs(complex(first) / complex(exact) - 1) < 1e-15
            assert abs(complex(rest) / complex(line) - 1) < 4e-15


def test_bounds_enclose_the_polynomial():
    """Bernstein's coefficients against dense sampling; those of a line are on it."""
    rng = np.random.default_rng(4)
    for sign in (1.0, -1.0):
        for _ in range(200):
            a, h, f = rng.normal(size=DEGREE + 1), rng.uniform(0.1, 2.0), rng.uniform(0.0, 1.0)
            a[DEGREE] = abs(a[DEGREE])
            t = np.linspace(0.0, h, 1001)
            powers = t[:, None] ** np.arange(1, DEGREE + 1)
            shape = f + powers @ np.r_[sign * a[1:DEGREE], -a[DEGREE]]
            least, most = bounds(a, sign, f, h)
            ends = shape[[0, -1]]
            assert shape.min() >= min(least, *ends) - 1e-12 * np.abs(powers[-1]).max()
            assert shape.max() <= max(most, *ends) + 1e-12 * np.abs(powers[-1]).max()
    a = np.zeros(DEGREE + 1)
    a[1] = -1.0
    assert bounds(a, 1.0, 1.0, 0.5) == pytest.approx((0.55, 0.95), rel=1e-14)


def test_shifted_polynomial_is_the_same():
    rng = np.random.default_rng(5)
    a, h, t, shifted = rng.normal(size=DEGREE + 1), 0.3, np.linspace(0.0, 1.0, 7), np.zeros(DEGREE + 1)
    a[DEGREE] = abs(a[DEGREE])
    for sign in (1.0, -1.0):
        rise = moved(a, sign, h, shifted)
        whole = np.polynomial.Polynomial(np.r_[0.0, sign * a[1:DEGREE], -a[DEGREE]])
        assert rise == pytest.approx(whole(h), rel=1e-13)
        assert shifted[DEGREE] == a[DEGREE]
        from_there = np.polynomial.Polynomial(np.r_[shifted[:DEGREE], -shifted[DEGREE]])
        assert from_there(t) == pytest.approx(whole(h + t), rel=1e-12)


def test_eighth_root_by_logarithms():
    x, y = 10.0 ** np.random.default_rng(6).uniform(-150, 150, (2, 2000))
    share = np.array([ratio(*pair) for pair in zip(x, y, strict=True)]) / (x / y) ** 0.125
    assert share.min() > 0.98 and share.max() < 1.07


@njit
def expanded(order, g, eigenvalue, count, t, work):
    """The engine's expansion."""
    return expand(order, 0.3, -0.2, g, eigenvalue, 1, count, t, work)


@pytest.mark.parametrize("order", [POSITION, VELOCITY, FORCE])
@pytest.mark.parametrize("t", [0.0, 0.05, 3.0])
def test_modes_that_sleep_do_not_count(order, t):
    """Loops go beyond the modes that are awake, where amplitudes of an earlier time may be."""
    rng = np.random.default_rng(7)
    eigenvalue = np.sort(rng.uniform(1.0, 40.0, 30)) * (1j - 0.01)
    g, count = rng.normal(size=30) + 1j * rng.normal(size=30), 11
    few, all_of_them = new_expansion(count), new_expansion(30)
    bounds_of_few = expanded(order, g[:count].copy(), eigenvalue[:count], count, t, few)
    bounds_of_all = expanded(order, g, eigenvalue, count, t, all_of_them)
    assert np.allclose(bounds_of_all, bounds_of_few, rtol=1e-13)
    assert np.allclose(all_of_them.taylor, few.taylor, rtol=1e-12, atol=0.0)
