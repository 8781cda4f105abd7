"""Derivatives of smooth functions of one number by differences of high order, with a judgement of their error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vanedamp.files.toml_input import InputError

#: step, relative to the size of the number: truncation and round-off of the longest formula are some 1e-14
_STEP = 5e-3
#: by which it is shortened where formulas differ: modes close to each other turn fast
_SHRINKS = (1.0, 0.2, 0.04)
#: round-off of a function, and largest difference of the two longest formulas, relative to its size
_NOISE, _AGREE = 16 * np.finfo(float).eps, 1e-9
#: bend at a kink, relative to the change of the function over the step; bends below are round-off of eigenvectors
_KINK, _ROUGH = 1e-3, 1e-12
#: weights of antisymmetric formulas of order 2, 4, 6 and 8
_CENTRAL = {
    2: (1 / 2,), 4: (2 / 3, -1 / 12), 6: (3 / 4, -3 / 20, 1 / 60), 8: (4 / 5, -1 / 5, 4 / 105, -1 / 280),
}  # fmt: skip
#: of formulas to one side, of order 7 and 8, with the value at the start first
_ONE_SIDED = {
    7: (-363 / 140, 7.0, -21 / 2, 35 / 3, -35 / 4, 21 / 5, -7 / 6, 1 / 7),
    8: (-761 / 280, 8.0, -14.0, 56 / 3, -35 / 2, 56 / 5, -14 / 3, 8 / 7, -1 / 8),
}


class NotSmooth(ArithmeticError):
    """A function has a kink, or changes its shape, near the value at which its derivative is wanted."""


def derivative(function: Callable[[float], np.ndarray], at: float, size: float, here: np.ndarray) -> np.ndarray:
    """Return the derivative (n,) of a function of a number.

    here: its value (n,) at the number, of the order of 1; size: of the number, over which the function changes by as
    much. At the end of the range, where the function raises InputError beyond, the derivative is one-sided. Raises
    InputError for a number without neighbours on either side, and NotSmooth.
    """
    for shrink in _SHRINKS:
        try:
            return _at_step(function, at, shrink * _STEP * size, here)
        except NotSmooth:
            if shrink == _SHRINKS[-1]:
                raise
    raise AssertionError


def _at_step(function: Callable[[float], np.ndarray], at: float, step: float, here: np.ndarray) -> np.ndarray:
    try:
        return _central(function, at, step, here)
    except InputError as error:
        refused = error
    for way in (1.0, -1.0):
        try:
            return _one_sided(function, at, way * step, here)
        except InputError:
            continue
    raise refused


def _central(function: Callable[[float], np.ndarray], at: float, step: float, here: np.ndarray) -> np.ndarray:
    known: list[tuple[np.ndarray, np.ndarray]] = []

    def formula(order: int) -> np.ndarray:
        weights = _CENTRAL[order]
        while len(known) < len(weights):
            k = len(known) + 1
            known.append((function(at + k * step), function(at - k * step)))
        return np.asarray(sum(w * (up - down) for w, (up, down) in zip(weights, known, strict=False)) / step)

    low, high = formula(2), formula(4)
    size = np.maximum(1.0, np.maximum(*np.abs(known[0])))
    changes = np.abs(known[0][0] - here) + np.abs(known[0][1] - here)
    if np.any(np.abs(_bend(known, here, (-4.0, 1.0))) > _KINK * changes + _ROUGH * size):
        formula(8)
        if np.any(np.abs(_bend(known, here, (-56.0, 28.0, -8.0, 1.0))) > 20 * _KINK * changes + 20 * _ROUGH * size):
            raise NotSmooth
    if np.all(np.abs(low - high) * step <= _NOISE * size):
        return low  # a straight line, or a parabola
    return _checked(formula(6), formula(8), step, size)


def _bend(known: list[tuple[np.ndarray, np.ndarray]], here: np.ndarray, weights: tuple[float, ...]) -> np.ndarray:
    """Return an even difference of high order (n,), in which a kink stays and smooth functions vanish."""
    return np.asarray(sum(w * (up + down - 2 * here) for w, (up, down) in zip(weights, known, strict=False)))


def _one_sided(function: Callable[[float], np.ndarray], at: float, step: float, here: np.ndarray) -> np.ndarray:
    values = [here, *(function(at + k * step) for k in range(1, 9))]
    low, high = (
        np.asarray(sum(w * value for w, value in zip(weights, values, strict=False)) / step)
        for weights in _ONE_SIDED.values()
    )
    return _checked(low, high, step, np.maximum(1.0, np.abs(values).max(axis=0)))


def _checked(low: np.ndarray, high: np.ndarray, step: float, size: np.ndarray) -> np.ndarray:
    """Return the better of two derivatives. Raises NotSmooth where they differ."""
    bound = _AGREE * (np.abs(high) + size * _STEP / abs(step)) + 1e3 * _NOISE * size / abs(step)
    if np.any(np.abs(low - high) > bound):
        raise NotSmooth
    return high
