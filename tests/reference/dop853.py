"""Hairer's DOP853 for linear motion under sines, until the first of some guards turns negative.

Steps, error estimate, interpolant and coefficients are those of scipy.integrate.DOP853 (test_dop853.py compares them),
compiled, since runs take some thousand steps with few unknowns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import DOP853

_ORDER = len(DOP853.B)
#: Rows of all stages, with those of the interpolant, which follow that at the end of the step.
_A = np.zeros((_ORDER + 1 + len(DOP853.C_EXTRA), _ORDER + 1 + len(DOP853.C_EXTRA)))
_A[:_ORDER, :_ORDER], _A[_ORDER, :_ORDER], _A[_ORDER + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
_C = np.r_[DOP853.C, 1.0, DOP853.C_EXTRA]
_E3, _E5, _D = np.array(DOP853.E3), np.array(DOP853.E5), np.array(DOP853.D)
_POWERS = 3 + len(_D)
#: Intervals of a step between whose ends the guards are bounded.
_PARTS = 4
#: Steps that one call of the compiled function takes at most.
_BLOCK = 64


class Motion:
    """A dense response: interpolants of steps that begin at ts[:-1]. A root may cut them shorter than their widths."""

    def __init__(self, ts, widths, begun, pieces) -> None:
        self.ts, self._widths, self._begun, self._pieces = ts, widths, begun, pieces

    def __call__(self, time: np.ndarray | float) -> np.ndarray:
        """(k, ...) states at times of any shape; where two pieces meet, that at the end of the first."""
        t = np.asarray(time, float)
        piece = np.clip(np.searchsorted(self.ts, t) - 1, 0, len(self._pieces) - 1)
        x = ((t - self.ts[piece]) / self._widths[piece])[..., None]
        y = np.zeros((*t.shape, self._begun.shape[1]))
        for power in range(_POWERS):
            y += self._pieces[piece, _POWERS - 1 - power]
            y *= 1.0 - x if power % 2 else x
        return np.moveaxis(y + self._begun[piece], -1, 0)


class Guards(NamedTuple):
    """rows (d, g, s): guards and their derivatives, on states with sines, cosines and 1 below; openings (g,) to add.

    order, leading (g,): the first derivative that is not zero at the start, and its value. watched: those that count.
    """

    rows: np.ndarray
    openings: np.ndarray
    order: np.ndarray
    leading: np.ndarray
    watched: np.ndarray


def march(
    rate: np.ndarray, loads: np.ndarray, orders: np.ndarray, guards: Guards,
    start: float, y: np.ndarray, end: float, longest: float, rtol: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Ends (p,), widths (p,), first states (p, k), interpolants (p, powers, k) of the steps, and the last state (k,).

    The motion is y' = rate y + loads (sin orders t, cos orders t, 1).
    """
    parts = []
    t, step, going = start, min(longest, end - start), True
    while going:
        ends, widths, begun, pieces = (
            np.empty(_BLOCK), np.empty(_BLOCK), np.empty((_BLOCK, len(y))), np.empty((_BLOCK, _POWERS, len(y)))
        )  # fmt: skip
        count, t, y, step, going = _march(
            rate, loads, orders, *guards, t == start, t, y, end, step, longest, rtol, ends, widths, begun, pieces
        )
        parts.append((ends[:count], widths[:count], begun[:count], pieces[:count]))
    return *(np.concatenate(part) for part in zip(*parts, strict=True)), y


@njit(cache=True)
def _march(
    rate, loads, orders, rows, openings, order, leading, watched, fresh, t, y, end, step, longest, rtol,
    ends, widths, begun, pieces,
):  # fmt: skip
    """One block of steps: their number, time and state at its end, length of the next step, whether it continues."""
    K, harmonics = np.empty((len(_C), len(y))), np.empty(2 * len(orders) + 1)
    _slope(rate, loads, orders, t, y, harmonics, K[0])
    for count in range(len(ends)):
        step, rejected = min(step, longest), False
        while True:
            new = min(t + step, end)
            h = new - t
            for stage in range(1, _ORDER + 1):
                y_new = y + h * _combined(_A[stage], K, stage)
                _slope(rate, loads, orders, t + _C[stage] * h, y_new, harmonics, K[stage])
            error = _error(y, y_new, K, h, rtol)
            factor = 10.0 if error == 0 else min(10.0, 0.9 * error**-0.125)
            if error < 1:
                step = h * (min(1.0, factor) if rejected else factor)
                break
            step, rejected = h * max(0.2, factor), True
            if t + step / 10 <= t:
                raise ArithmeticError("DOP853 finds no step short enough")
        for stage in range(_ORDER + 1, len(_C)):
            _slope(rate, loads, orders, t + _C[stage] * h, y + h * _combined(_A[stage], K, stage), harmonics, K[stage])
        piece = pieces[count]
        piece[0] = y_new - y
        piece[1] = h * K[0] - piece[0]
        piece[2] = 2 * piece[0] - h * (K[_ORDER] + K[0])
        for power in range(len(_D)):
            piece[3 + power] = h * _combined(_D[power], K, len(_C))
        widths[count], begun[count] = h, y
        if not fresh:
            order = np.zeros_like(order)
        fresh = False
        root = _first(rows, openings, order, leading, watched, orders, t, new, h, y, piece)
        if root < np.inf:
            ends[count] = root
            return count + 1, root, _state(y, piece, (root - t) / h), step, False
        ends[count], t, y = new, new, y_new
        if t >= end:
            return count + 1, t, y, step, False
        K[0] = K[_ORDER]
    return len(ends), t, y, step, True


@njit(cache=True)
def _combined(weights, K, count):
    total = weights[0] * K[0]
    for stage in range(1, count):
        if weights[stage] != 0.0:
            total += weights[stage] * K[stage]
    return total


@njit(cache=True)
def _harmonics(orders, t, out):
    for index in range(len(orders)):
        out[index], out[len(orders) + index] = np.sin(orders[index] * t), np.cos(orders[index] * t)
    out[-1] = 1.0


@njit(cache=True)
def _slope(rate, loads, orders, t, y, harmonics, out):
    _harmonics(orders, t, harmonics)
    for row in range(len(out)):
        out[row] = _dot(rate[row], y) + _dot(loads[row], harmonics)


@njit(cache=True)
def _dot(a, b):
    total = 0.0
    for index in range(len(a)):
        total += a[index] * b[index]
    return total


@njit(cache=True)
def _error(y, y_new, K, h, rtol):
    five, three = _combined(_E5, K, len(_E5)), _combined(_E3, K, len(_E3))
    scale = rtol * (1e-3 + np.maximum(np.abs(y), np.abs(y_new)))
    fifth, third = np.sum((five / scale) ** 2), np.sum((three / scale) ** 2)
    if fifth == 0 and third == 0:
        return 0.0
    return h * fifth / np.sqrt((fifth + 0.01 * third) * len(y))


@njit(cache=True)
def _state(y, piece, x):
    """The interpolant at a share x of its step."""
    total = np.zeros_like(y)
    for power in range(_POWERS):
        total = (total + piece[_POWERS - 1 - power]) * (1.0 - x if power % 2 else x)
    return total + y


@njit(cache=True)
def _first(rows, openings, order, leading, watched, orders, t, new, h, y, piece):
    """The earliest root of the guards in a step, infinite without one.

    Derivatives at the samples, doubled, bound those of the guards in the step: as the step is a small fraction of the
    fastest period, they cannot grow more. Halving goes on until the bounds say that a part holds no root, or one.
    A guard that is zero at an event, where the step starts, has order > 0 and leaves zero with its leading derivative.
    """
    k, parts = len(y), np.linspace(t, new, _PARTS + 1)
    width = parts[1] - parts[0]
    samples = np.empty((_PARTS + 1, rows.shape[2]))
    for sample in range(_PARTS + 1):
        samples[sample, :k] = _state(y, piece, (parts[sample] - t) / h)
        _harmonics(orders, parts[sample], samples[sample, k:])
    earliest, values, bounds = np.inf, np.empty((len(rows), _PARTS + 1)), np.empty(len(rows))
    nested = np.empty((2, _POWERS + 1))
    for guard in watched:
        for derivative in (0, 2, 1, 3, 4, 5):
            if derivative == 1 and not (order[guard] > 0 or _close(values[0], bounds[2] * width**2 / 8)):
                break
            for sample in range(_PARTS + 1):
                values[derivative, sample] = _dot(rows[derivative, guard], samples[sample])
            bounds[derivative] = 2 * np.abs(values[derivative]).max()
            if derivative == 0:
                values[0] += openings[guard]
        else:
            for derivative in range(2):
                nested[derivative, -1] = _dot(rows[derivative, guard, :k], y)
                for power in range(_POWERS):
                    nested[derivative, power] = _dot(rows[derivative, guard, :k], piece[_POWERS - 1 - power])
            for part in range(_PARTS):
                root = _root(
                    rows[:2, guard, k:], openings[guard], order[guard] if part == 0 else 0, leading[guard], bounds,
                    nested, orders, t, h, parts[part], parts[part + 1], values[:2, part], values[:2, part + 1],
                )  # fmt: skip
                if root < np.inf:
                    earliest = min(earliest, root)
                    break
    return earliest


@njit(cache=True)
def _close(values, least):
    return np.minimum(values[:-1], values[1:]).min() <= least


@njit(cache=True)
def _root(loads, opening, order, leading, bounds, nested, orders, t, h, a, b, at_a, at_b):
    """First root of a guard in a <= t <= b, given the guard and its rate at both; infinite without one.

    order > 0: it is zero at a.
    """
    further, states, waiting = np.empty(64), np.empty((64, 2)), 0
    while True:
        width = b - a
        if order > 0:
            none = leading * (order + 1) > bounds[order + 1] * width
        elif at_a[0] <= 0:
            return a
        else:
            none = min(at_a[0], at_b[0]) > bounds[2] * width**2 / 8
            if at_b[0] < 0 and max(at_a[1], at_b[1]) + bounds[3] * width**2 / 8 < 0:
                return _crossing(loads, opening, nested, orders, t, h, a, b)
        if not none and width < 1e-14:
            if at_b[0] < 0:
                return b
            none = True
        if none:
            if waiting == 0:
                return np.inf
            waiting -= 1
            a, at_a, order = b, at_b, 0
            b, at_b = further[waiting], states[waiting].copy()
        else:
            further[waiting], states[waiting] = b, at_b
            waiting += 1
            b = (a + b) / 2
            at_b = _value(loads, opening, nested, orders, t, h, b)


@njit(cache=True)
def _crossing(loads, opening, nested, orders, t, h, a, b):
    """Root of a guard that falls from a positive value at a to a negative one at b: Newton's method, in brackets."""
    x = b
    for _ in range(100):
        value = _value(loads, opening, nested, orders, t, h, x)
        if value[0] == 0:
            return x
        if value[0] > 0:
            a = x
        else:
            b = x
        following = x - value[0] / value[1] if value[1] < 0 else a
        if not a < following < b:
            following = (a + b) / 2
        if abs(following - x) <= 1e-15 + 4e-16 * x:
            return following
        x = following
    return x


@njit(cache=True)
def _value(loads, opening, nested, orders, t, h, time):
    """A guard and its rate, (2,): its row times the interpolant, whose powers are nested, and times the harmonics."""
    x, harmonics = (time - t) / h, np.empty(2 * len(orders) + 1)
    _harmonics(orders, time, harmonics)
    values = np.empty(2)
    for derivative in range(2):
        total = 0.0
        for power in range(_POWERS):
            total = (total + nested[derivative, power]) * (1.0 - x if power % 2 else x)
        values[derivative] = total + nested[derivative, -1] + _dot(loads[derivative], harmonics)
    values[0] += opening
    return values
