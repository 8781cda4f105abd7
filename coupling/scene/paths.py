"""Dotted paths to the numbers of a scene, and ranges of their values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.tangents.opaque import with_number
from vanedamp.files.toml_input import STRICT, InputError, Real, Whole, nearest


@dataclass(frozen=True, config=STRICT | ConfigDict(json_schema_extra={"x-inline": True}))
class Range:
    """Equidistant values, both ends included."""

    start: Real
    """first value [unit of the key]"""
    stop: Real
    """last value [unit of the key]"""
    num: Annotated[Whole, Field(gt=0)]
    """number of values"""


def axis_values(values: Range | Sequence[Any]) -> list[Any]:
    """Return the values of one axis of the [sweep] table."""
    if isinstance(values, Range):
        return [float(value) for value in np.linspace(values.start, values.stop, values.num)]
    return list(values)


def assign(node: Any, path: str, value: Any) -> None:
    """Change plain scene data at the end of a path. Raises InputError for an unknown place."""
    for place in list(_places(node, path)):
        table_at(node, place)[place[-1]] = value


def table_at(data: Any, place: Sequence[str | int]) -> Any:
    """Return the table, or list, that holds the value at a place of plain data."""
    for step in place[:-1]:
        data = data[step]
    return data


def with_numbers(scene: Any, data: Any, numbers: Mapping[str, Any]) -> Any:
    """Return a scene with numbers that have derivatives in place of its own, by their paths. data: its plain data."""
    for path, number in numbers.items():
        for place in _places(data, path):
            scene = with_number(scene, place, number)
    return scene


def places(data: Any, path: str) -> list[str]:
    """Return the paths of the values that a path names in plain scene data. Raises InputError for an unknown place."""
    return [".".join(map(str, place)) for place in _places(data, path)]


def namesake(data: Any, path: str, others: Iterable[str]) -> str | None:
    """Return which of some paths names a value that `path` names as well, or one within it; None: none of them.

    Values are compared by their places in plain scene data: cavity.gap, cavity.0.gap and cavity.c.gap may be one.
    """
    own = _known_places(data, path)
    for other in others:
        if any(place[: len(whole)] == whole for place in _known_places(data, other) for whole in own):
            return other
    return None


def _known_places(data: Any, path: str) -> set[tuple[Any, ...]]:
    """Return the places that a path names; none where it names no place, which is said elsewhere."""
    try:
        return set(_places(data, path))
    except InputError:
        return set()


def _places(
    node: Any, path: str, left: list[str] | None = None, before: tuple[Any, ...] = ()
) -> Iterator[tuple[Any, ...]]:
    """Yield the keys and indices that lead to each value at the end of a path. Raises InputError as `assign`."""
    steps = path.split(".") if left is None else left
    if not steps:
        raise InputError(f"scene: {path}: names a table, not a value")
    head, rest = steps[0], steps[1:]
    if not isinstance(node, dict) and not (isinstance(node, list) and all(isinstance(entry, dict) for entry in node)):
        raise InputError(f"scene: {path}: no table holds '{head}'; leave it out and give the whole value")
    if isinstance(node, list):
        entries, rest = _entries(node, head, steps, path)
        for entry in entries:
            yield from _places(node[entry], path, rest, (*before, entry))
    elif rest:
        if head not in node:
            raise InputError(f"scene: {path}: no table '{head}'; {nearest(head, list(node))}")
        yield from _places(node[head], path, rest, (*before, head))
    else:
        yield (*before, head)


def _entries(nodes: list[Any], head: str, steps: list[str], path: str) -> tuple[list[int], list[str]]:
    """Return the entries of a list that the first of `steps` names, all where it is their key, and the steps left."""
    if head.isdecimal():
        if int(head) >= len(nodes):
            raise InputError(f"scene: {path}: there are only {len(nodes)} entries, counted from 0")
        return [int(head)], steps[1:]
    names = [str(node["name"]) if "name" in node else None for node in nodes]
    named = [number for number, name in enumerate(names) if name == head] or [
        number
        for number, name in enumerate(names)
        if name is not None and name.partition("@")[0] == head  # its copies in sectors of a ring
    ]
    if named:
        return named, steps[1:]
    if len(steps) > 1:
        known = [name for name in names if name is not None]
        raise InputError(f"scene: {path}: no entry '{head}'; {nearest(head, known) if known else 'use its index'}")
    return list(range(len(nodes))), steps


def number_at(node: Any, path: str) -> float:
    """Return the number at the end of a path in plain scene data, of a list's entries the one that all have.

    Raises InputError for a place that is unknown, or holds no number or several.
    """
    found = list(_places(node, path))
    tables = [table_at(node, place) for place in found]
    values = [table[place[-1]] for table, place in zip(tables, found, strict=True) if place[-1] in table]
    if tables and not values:
        key = found[0][-1]
        raise InputError(f"scene: {path}: the scene holds no '{key}' there; {nearest(key, list(tables[0]))}")
    numbers = {float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)}
    if len(numbers) != 1:
        shown = "several numbers; name one entry by its index" if numbers else "no number"
        raise InputError(f"scene: {path}: names {shown}")
    return numbers.pop()
