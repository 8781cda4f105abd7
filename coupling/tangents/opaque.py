"""Functions that take plain numbers only, of records whose numbers have derivatives: by differences of themselves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from typing import Any, TypeVar

import numpy as np

from vanedamp.coupling.tangents import dual
from vanedamp.coupling.tangents.differences import NotSmooth, derivative
from vanedamp.coupling.tangents.dual import Dual

Record = TypeVar("Record")


def changed(record: Record, **values: Any) -> Record:
    """Return a frozen record with other values, which are known to be valid and may have derivatives."""
    made = object.__new__(type(record))
    vars(made).update(vars(record), **values)
    return made


def with_number(record: Any, keys: Sequence[str | int], number: Any) -> Any:
    """Return nested records with a number at keys: names of fields, keys and indices of lists."""
    if not keys:
        return number
    head, rest = keys[0], keys[1:]
    if isinstance(record, Mapping):
        return {**record, head: with_number(record[head], rest, number)}
    if isinstance(record, tuple):
        return (*record[: int(head)], with_number(record[int(head)], rest, number), *record[int(head) + 1 :])
    if not hasattr(record, str(head)):  # keys that other code has added
        return changed(record, added=with_number(record.added, keys, number))
    return changed(record, **{str(head): with_number(getattr(record, str(head)), rest, number)})


def _mapped(value: Any, change: Callable[[Any], Any], wanted: Callable[[Any], bool]) -> Any:
    """Return nested records with their wanted parts changed; the same where nothing is."""
    if wanted(value):
        return change(value)
    if isinstance(value, Mapping):
        made = {key: _mapped(one, change, wanted) for key, one in value.items()}
        return value if all(made[key] is one for key, one in value.items()) else made
    if isinstance(value, tuple | list):
        parts = [_mapped(one, change, wanted) for one in value]
        if all(part is one for part, one in zip(parts, value, strict=True)):
            return value
        return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
    if is_dataclass(value) and not isinstance(value, type):
        values = {name: _mapped(one, change, wanted) for name, one in vars(value).items()}
        turned = {name: one for name, one in values.items() if one is not vars(value)[name]}
        return changed(value, **turned) if turned else value
    return value


def plain(value: Any) -> Any:
    """Return nested records without derivatives."""
    return _mapped(value, lambda one: _number(one.value), _is_dual)


def _is_dual(value: Any) -> bool:
    return isinstance(value, Dual)


def _number(value: np.ndarray) -> Any:
    return value.item() if value.ndim == 0 else value


def _numbers(value: Any) -> bool:
    return isinstance(value, float | complex | Dual) or (
        isinstance(value, np.ndarray | np.number) and np.issubdtype(value.dtype, np.inexact)
    )


def _flat(value: Any) -> list[np.ndarray]:
    """Return the numbers of nested records, complex ones as pairs."""
    leaves: list[np.ndarray] = []

    def take(one: Any) -> Any:
        values = np.atleast_1d(np.asarray(one)).ravel()
        reals = values.view(float) if np.iscomplexobj(values) else values.astype(float)
        leaves.append(np.where(np.isfinite(reals), reals, 0.0))  # infinities stay
        return one

    _mapped(value, take, _numbers)
    return leaves


def opaque(function: Callable[..., Any], *arguments: Any, unknown: bool = False) -> Any:
    """Return a function of records whose numbers may have derivatives: nested records, with derivatives of theirs.

    By differences of high order along each number that turns them; what it returns as it was given has the derivatives
    that it came with. Raises NotSmooth at a kink. unknown: derivatives are nan there, and judged by each number in
    index of the largest of an array.
    """
    count, turned = dual.active(), list[Dual]()
    if count is None:
        return function(*arguments)
    _mapped(arguments, turned.append, _is_dual)
    ways = [p for p in range(count) if any(one.turns[..., p].any() for one in turned)]
    with dual.numbers(None):
        if not turned:
            return function(*arguments)
        given = plain(arguments)
        result = function(*given)
        if (
            same := next((argument for argument, one in zip(arguments, given, strict=True) if result is one), None)
        ) is not None:
            return same
        here = _flat(result) if ways else []
        if not here:
            return result
        flat = np.concatenate(here)
        scale = np.concatenate([np.full(len(one), np.abs(one).max(initial=0.0)) for one in here])
        scale = np.abs(flat) if unknown else scale
        scale = np.where(scale > 0.0, scale, 1.0)
        turns = np.zeros((len(flat), count))
        for p in ways:

            def at(amount: float, p: int = p) -> np.ndarray:
                moved = _mapped(arguments, lambda one: _number(one.value + amount * one.turns[..., p]), _is_dual)
                values = _flat(function(*moved))
                if [len(one) for one in values] != [len(one) for one in here]:
                    raise NotSmooth
                return np.concatenate(values) / scale

            try:
                turns[:, p] = derivative(at, 0.0, 1.0, flat / scale) * scale
            except NotSmooth:
                if not unknown:
                    raise
                turns[:, p] = np.nan
    left = iter(np.split(turns, np.cumsum([len(one) for one in here])[:-1]))
    return _mapped(result, lambda one: _turned(one, left), _numbers)


def _turned(one: Any, left: Iterator[np.ndarray]) -> Any:
    """Return numbers with the next derivatives, plain where these are zero."""
    turns = next(left)
    if not turns.any():
        return one
    if np.iscomplexobj(one):
        turns = turns[0::2] + 1j * turns[1::2]
    return Dual(one, turns.reshape(*np.shape(one), -1))
