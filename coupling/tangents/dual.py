"""Numbers with their derivatives, on which plain numpy works: formulas of quantities need no change.

Assembly makes its arrays by `zeros` and `array`: within `numbers(P)` they have derivatives by P numbers, and else they
are numpy's. There a decision between equal values that turn apart is a kink, and raises NotSmooth.
"""

from __future__ import annotations

import cmath
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any

import numpy as np

from vanedamp.coupling.tangents.differences import NotSmooth

#: derivatives of functions by each of their arguments; None: 1
_SLOPES: dict[np.ufunc, Callable[..., tuple[Any, ...]]] = {
    np.add: lambda a, b: (None, None),
    np.subtract: lambda a, b: (None, -1.0),
    np.multiply: lambda a, b: (b, a),
    np.true_divide: lambda a, b: (1.0 / b, -a / b / b),
    np.power: lambda a, b: (b * a ** (b - 1.0), a**b * np.log(a)),
    np.negative: lambda a: (-1.0,),
    np.sqrt: lambda a: (0.5 / np.sqrt(a),),
    np.maximum: lambda a, b: (np.greater_equal(a, b), np.less(a, b)),
    np.minimum: lambda a, b: (np.less_equal(a, b), np.greater(a, b)),
    np.hypot: lambda a, b: (a / np.hypot(a, b), b / np.hypot(a, b)),
    np.arctan2: lambda y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
}
#: functions that act on values and derivatives alike; those of values alone; and those that compare
_LINEAR, _OF_VALUES = {np.conjugate, np.positive}, {np.isfinite, np.isinf, np.isnan, np.sign, np.rint}
_COMPARE = {np.greater, np.greater_equal, np.less, np.less_equal, np.equal, np.not_equal}
_PLAIN, _DECIDE = _OF_VALUES | _COMPARE, _COMPARE | {np.maximum, np.minimum}


class _Active(threading.local):
    count: int | None = None


_ACTIVE = _Active()


@contextmanager
def numbers(count: int | None) -> Iterator[None]:
    """Let `zeros` and `array` make numbers with derivatives by `count` numbers; None: plain ones."""
    before, _ACTIVE.count = _ACTIVE.count, count
    try:
        with nullcontext() if count is None else np.errstate(all="ignore"):  # nan: unknown
            yield
    finally:
        _ACTIVE.count = before


class Dual(np.lib.mixins.NDArrayOperatorsMixin):
    """Numbers with their derivatives: value (...), turns (..., P)."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: Any, turns: Any) -> None:
        self.value: np.ndarray = np.asarray(value)
        self.turns: np.ndarray = np.asarray(turns)

    def __array__(self, *_: Any) -> np.ndarray:
        raise TypeError("numbers with derivatives are no plain numbers")

    def __bool__(self) -> bool:
        if _ACTIVE.count is not None and self.value == 0.0 and self.turns.any():
            raise NotSmooth
        return bool(self.value)

    def __len__(self) -> int:
        return len(self.value)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        out = options.pop("out", None)
        if method != "__call__" or options:
            return NotImplemented
        result = _called(ufunc, *inputs)
        if out is None or result is NotImplemented:
            return result
        out[0][...] = result
        return out[0]

    def __array_function__(self, function: Any, types: Any, given: tuple[Any, ...], options: dict[str, Any]) -> Any:
        rule = _FUNCTIONS.get(function.__name__)
        return NotImplemented if rule is None else rule(*given, **options)

    def __getitem__(self, key: Any) -> Dual:
        return Dual(self.value[key], self.turns[_of_turns(key)])

    def __setitem__(self, key: Any, given: Any) -> None:
        self.value[key] = values(given)
        self.turns[_of_turns(key)] = given.turns if isinstance(given, Dual) else 0.0

    def __iter__(self) -> Iterator[Dual]:
        return (self[index] for index in range(len(self.value)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Their shape."""
        return self.value.shape

    @property
    def ndim(self) -> int:
        """Number of their axes."""
        return self.value.ndim

    @property
    def size(self) -> int:
        """Number of them."""
        return self.value.size

    @property
    def T(self) -> Dual:
        """The transpose of a matrix."""
        return Dual(self.value.T, self.turns.swapaxes(0, 1) if self.ndim == 2 else self.turns)

    @property
    def real(self) -> Dual:
        """Their real parts."""
        return Dual(self.value.real, self.turns.real)

    @property
    def imag(self) -> Dual:
        """Their imaginary parts."""
        return Dual(self.value.imag, self.turns.imag)

    def copy(self) -> Dual:
        """Return a copy."""
        return Dual(self.value.copy(), self.turns.copy())

    def reshape(self, *shape: int) -> Dual:
        """Return them in another shape."""
        value = self.value.reshape(*shape)
        return Dual(value, self.turns.reshape(*value.shape, self.turns.shape[-1]))

    def sum(self, axis: int = -1, keepdims: bool = False) -> Dual:
        """Return the sum along an axis."""
        along = axis % self.value.ndim
        return Dual(self.value.sum(along, keepdims=keepdims), self.turns.sum(along, keepdims=keepdims))

    def mean(self) -> Dual:
        """Return the mean along the last axis."""
        return self.sum() / self.value.shape[-1]

    def max(self) -> Dual:
        """Return the largest along the only axis."""
        return self[int(np.argmax(self.value))]

    def any(self, *options: Any, **more: Any) -> Any:
        """Return whether any is, or may become, other than zero."""
        return ((self.value != 0) | (self.turns != 0).any(axis=-1)).any(*options, **more)


for _name, _ufunc in zip(
    ("add", "sub", "mul", "truediv", "matmul"),
    (np.add, np.subtract, np.multiply, np.true_divide, np.matmul),
    strict=True,
):
    # straight to their derivatives: the way through numpy takes as long as these
    setattr(Dual, f"__{_name}__", lambda one, other, of=_ufunc: _called(of, one, other))
    setattr(Dual, f"__r{_name}__", lambda one, other, of=_ufunc: _called(of, other, one))


def _called(ufunc: np.ufunc, *inputs: Any) -> Any:
    """Return a function of numbers, some of which have derivatives."""
    if ufunc.__name__ == "matmul":  # numpy's own, or another function
        return _product(*inputs)
    plain = [one.value if isinstance(one, Dual) else one for one in inputs]
    value = ufunc(*plain)
    if ufunc in _DECIDE and _ACTIVE.count is not None:
        _check_apart(*inputs)
    if ufunc in _PLAIN:
        return value
    if ufunc in _LINEAR:
        return Dual(value, ufunc(inputs[0].turns))
    if ufunc is np.absolute:
        return Dual(value, _of_size(inputs[0], value))
    if ufunc not in _SLOPES:
        return NotImplemented
    turns: Any = None
    for one, slope in zip(inputs, _SLOPES[ufunc](*plain), strict=True):
        if isinstance(one, Dual):
            term = one.turns if slope is None else np.asarray(slope)[..., None] * one.turns
            turns = term if turns is None else turns + term
    shape = (*np.shape(value), turns.shape[-1])
    return Dual(value, turns if turns.shape == shape else np.broadcast_to(turns, shape).copy())


def _of_size(one: Dual, size: Any) -> Any:
    """Return the derivatives of absolute values."""
    if not np.iscomplexobj(one.value):
        return np.sign(one.value)[..., None] * one.turns
    return (np.conjugate(one.value)[..., None] * one.turns).real / np.asarray(size)[..., None]


def _check_apart(one: Any, other: Any) -> None:
    """Raise NotSmooth where equal values turn apart."""
    equal = values(one) == values(other)
    if np.any(equal):
        equal = np.asarray(equal)
        apart = [np.broadcast_to(_turns(each), (*equal.shape, _turns(each).shape[-1])) for each in (one, other)]
        if (equal & (apart[0] != apart[1]).any(axis=-1)).any():
            raise NotSmooth


def _product(one: Any, other: Any) -> Dual:
    """Return a product of matrices or vectors."""
    a, b = values(one), values(other)
    turns: Any = 0.0
    if isinstance(one, Dual):
        turns = one.turns.swapaxes(-1, -2) @ b
        turns = turns if b.ndim == 1 else turns.swapaxes(-1, -2)
    if isinstance(other, Dual):
        along, *more = other.turns.shape
        turns = turns + (a @ other.turns.reshape(along, math.prod(more))).reshape(*a.shape[:-1], *more)
    return Dual(np.matmul(a, b), turns)


def _of_turns(key: Any) -> Any:
    """Return the key of derivatives: an ellipsis stands for the axes of values."""
    if key is Ellipsis:
        return key
    steps = key if isinstance(key, tuple) else (key,)
    return (*steps, slice(None)) if any(step is Ellipsis for step in steps) else key


def values(one: Any) -> Any:
    """Return numbers without their derivatives."""
    return one.value if isinstance(one, Dual) else one


def _turns(one: Any) -> Any:
    return one.turns if isinstance(one, Dual) else np.zeros(1)


def _like(parts: Sequence[Any]) -> list[Dual]:
    """Return parts as numbers with derivatives, of which one has some."""
    count = next(value.turns.shape[-1] for value in parts if isinstance(value, Dual))
    return [value if isinstance(value, Dual) else Dual(value, np.zeros((*np.shape(value), count))) for value in parts]


def _joined(join: Any, parts: Sequence[Any], axis: int = 0) -> Dual:
    both = _like(parts)
    value = join([part.value for part in both], axis=axis)
    return Dual(value, join([part.turns for part in both], axis=axis % value.ndim))


def _where(chosen: np.ndarray, *both: Any) -> Dual:
    return Dual(np.where(chosen, *map(values, both)), np.where(chosen[..., None], *map(_turns, both)))


def _diag(one: Dual) -> Dual:
    made = np.zeros((len(one), len(one), one.turns.shape[-1]))
    made[np.arange(len(one)), np.arange(len(one))] = one.turns
    return Dual(np.diag(one.value), made)


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "concatenate": lambda parts, axis=0: _joined(np.concatenate, parts, axis),
    "vstack": lambda parts: _joined(np.concatenate, [part if part.ndim > 1 else part.reshape(1, -1) for part in parts]),
    "hstack": lambda parts: _joined(np.concatenate, parts, -1),
    "stack": lambda parts, axis=0: _joined(np.stack, parts, axis),
    "where": _where,
    "outer": lambda one, other: one.reshape(-1, 1) * other.reshape(1, -1),
    "diag": _diag,
    "cross": lambda one, other: Dual(np.cross(one.value, other), np.cross(one.turns.T, other).T),
    "norm": lambda one: np.sqrt((one * one).sum()),
    "shape": lambda one: one.value.shape,
}


def active() -> int | None:
    """Return by how many numbers derivatives are wanted; None: none."""
    return _ACTIVE.count


def zeros(shape: tuple[int, ...] | int, count: int | None = None, dtype: type = float) -> Any:
    """Return zeros, with derivatives by `count` numbers (default: as many as `numbers` says)."""
    value: np.ndarray = np.zeros(shape, dtype)
    count = _ACTIVE.count if count is None else count
    return value if count is None else Dual(value, np.zeros((*value.shape, count), dtype))


def array(given: Any, dtype: type = float) -> Any:
    """Return an array of numbers, in nested lists, of which some may have derivatives."""
    if _ACTIVE.count is None:
        return np.array(given, dtype)
    value: np.ndarray = np.array(_plain(given), dtype)
    turns: np.ndarray = np.zeros((*value.shape, _ACTIVE.count), dtype)
    for index, one in _numbers_in(given):
        turns[index] = one.turns
    return Dual(value, turns)


def _plain(given: Any) -> Any:
    return [_plain(one) for one in given] if isinstance(given, list | tuple) else values(given)


def _numbers_in(given: Any, index: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], Dual]]:
    if isinstance(given, Dual):
        yield index, given
    elif isinstance(given, list | tuple):
        for number, one in enumerate(given):
            yield from _numbers_in(one, (*index, number))


def scalar(one: Any) -> Any:
    """Return a number as Python's, unless it has derivatives."""
    return one if isinstance(one, Dual) else float(one)


def vanishes(one: Any) -> bool:
    """Return whether a number is zero and stays so."""
    return bool(values(one) == 0.0) and not (isinstance(one, Dual) and one.turns.any())


def inverse(matrix: Any) -> Any:
    """Return the inverse (n, n) of a matrix."""
    inverted = np.linalg.inv(values(matrix))
    return (
        Dual(inverted, -(inverted @ (Dual(matrix.value, matrix.turns) @ inverted)).turns)
        if isinstance(matrix, Dual)
        else inverted
    )


def solve(matrix: Any, right: Any) -> Any:
    """Return the solution (n,) of a system of equations."""
    solution = np.linalg.solve(values(matrix), values(right))
    if not isinstance(matrix, Dual) and not isinstance(right, Dual):
        return solution
    left = right - matrix @ solution
    return Dual(solution, np.linalg.solve(values(matrix), left.turns))


def _scalar(function: Callable[[float], float], slope: Callable[[float], float]) -> Callable[[Any], Any]:
    def of(one: Any) -> Any:
        if not isinstance(one, Dual):
            return function(one)
        return Dual(function(float(one.value)), slope(float(one.value)) * one.turns)

    return of


sin, cos = _scalar(math.sin, math.cos), _scalar(math.cos, lambda x: -math.sin(x))
sqrt = _scalar(math.sqrt, lambda x: 0.5 / math.sqrt(x))
#: angles in radians of those in degrees
radians = _scalar(math.radians, lambda _: math.pi / 180)


def rect(size: Any, angle: Any) -> Any:
    """Return the complex number of a size and an angle, rad."""
    if not isinstance(size, Dual) and not isinstance(angle, Dual):
        return cmath.rect(size, angle)
    return size * cos(angle) + 1j * (size * sin(angle))
