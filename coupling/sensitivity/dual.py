"""Numbers with their derivatives, on which plain numpy works: formulas of quantities need not know of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

#: derivatives of functions by each of their arguments
_SLOPES: dict[np.ufunc, Callable[..., tuple[Any, ...]]] = {
    np.add: lambda a, b: (1.0, 1.0),
    np.subtract: lambda a, b: (1.0, -1.0),
    np.multiply: lambda a, b: (b, a),
    np.true_divide: lambda a, b: (1.0 / b, -a / b / b),
    np.power: lambda a, b: (b * a ** (b - 1.0), a**b * np.log(a)),
    np.negative: lambda a: (-1.0,),
    np.absolute: lambda a: (np.sign(a),),  # of real numbers
    np.sqrt: lambda a: (0.5 / np.sqrt(a),),
    np.maximum: lambda a, b: (np.greater_equal(a, b), np.less(a, b)),
    np.hypot: lambda a, b: (a / np.hypot(a, b), b / np.hypot(a, b)),
    np.arctan2: lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
}
#: functions that act on values and derivatives alike, and those of values alone
_LINEAR, _OF_VALUES = (np.conjugate,), (np.greater, np.greater_equal, np.less, np.less_equal)


class Dual(np.lib.mixins.NDArrayOperatorsMixin):
    """Numbers with their derivatives: value (...), turns (..., P)."""

    def __init__(self, value: Any, turns: Any) -> None:
        self.value: np.ndarray = np.asarray(value)
        self.turns: np.ndarray = np.asarray(turns)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        with np.errstate(all="ignore"):  # nan is what is not known
            value = ufunc(*map(_value, inputs))
            if ufunc in _OF_VALUES:
                return value
            if ufunc in _LINEAR:
                return Dual(value, ufunc(self.turns))
            if ufunc not in _SLOPES:
                return NotImplemented
            turns = 0.0
            for one, slope in zip(inputs, _SLOPES[ufunc](*map(_value, inputs)), strict=True):
                if isinstance(one, Dual):
                    turns = turns + np.asarray(slope)[..., None] * one.turns
            return Dual(value, np.broadcast_to(turns, (*np.shape(value), self.turns.shape[-1])))

    def __array_function__(self, function: Any, types: Any, given: tuple[Any, ...], options: dict[str, Any]) -> Any:
        if function is np.stack and options == {"axis": -1}:
            value, turns = (np.stack([*map(part, given[0])], axis=-1) for part in (_value, _turns))
            return Dual(value, np.swapaxes(turns, -1, -2))
        if function is np.where:
            chosen, *both = given
            return Dual(np.where(chosen, *map(_value, both)), np.where(chosen[..., None], *map(_turns, both)))
        return NotImplemented

    def __getitem__(self, place: Any) -> Dual:
        return Dual(self.value[place], self.turns[place])

    def __iter__(self) -> Iterator[Dual]:
        return (self[place] for place in range(len(self.value)))

    @property
    def real(self) -> Dual:
        """Their real parts."""
        return Dual(self.value.real, self.turns.real)

    @property
    def imag(self) -> Dual:
        """Their imaginary parts."""
        return Dual(self.value.imag, self.turns.imag)

    def sum(self, axis: int = -1, keepdims: bool = False) -> Dual:
        """Return the sum along an axis, counted from the end."""
        return Dual(self.value.sum(axis, keepdims=keepdims), self.turns.sum(axis - 1, keepdims=keepdims))

    def mean(self) -> Dual:
        """Return the mean along the last axis."""
        return self.sum() / self.value.shape[-1]

    def max(self) -> Dual:
        """Return the largest along the only axis."""
        return self[int(np.argmax(self.value))]


def zeros(shape: tuple[int, ...] | int, number: int, dtype: type = float) -> Dual:
    """Return zeros with derivatives by some numbers."""
    value: np.ndarray = np.zeros(shape, dtype)
    return Dual(value, np.zeros((*value.shape, number), dtype))


def _value(one: Any) -> Any:
    return one.value if isinstance(one, Dual) else one


def _turns(one: Any) -> Any:
    return one.turns if isinstance(one, Dual) else np.zeros(1)
