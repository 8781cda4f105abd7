"""Dotted paths to the numbers of a scene, and ranges of their values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

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


def assign(node: Any, steps: list[str], value: Any, path: str) -> None:
    """Change plain scene data at the end of `steps`, which stand in `path`. Raises InputError for an unknown place."""
    if not steps:
        raise InputError(f"scene: {path}: names a table, not a value")
    head, rest = steps[0], steps[1:]
    if not isinstance(node, dict) and not (isinstance(node, list) and all(isinstance(entry, dict) for entry in node)):
        raise InputError(f"scene: {path}: no table holds '{head}'; leave it out and give the whole value")
    if isinstance(node, list):
        entries, rest = _entries(node, head, steps, path)
        for entry in entries:
            assign(entry, rest, value, path)
    elif rest:
        if head not in node:
            raise InputError(f"scene: {path}: no table '{head}'; {nearest(head, list(node))}")
        assign(node[head], rest, value, path)
    else:
        node[head] = value


def _entries(nodes: list[Any], head: str, steps: list[str], path: str) -> tuple[list[Any], list[str]]:
    if head.isdecimal():
        if int(head) >= len(nodes):
            raise InputError(f"scene: {path}: there are only {len(nodes)} entries, counted from 0")
        return [nodes[int(head)]], steps[1:]
    named = [node for node in nodes if node.get("name") == head] or [
        node
        for node in nodes
        if str(node.get("name")).partition("@")[0] == head  # its copies in sectors of a ring
    ]
    if named:
        return named, steps[1:]
    if len(steps) > 1:
        names = [str(node["name"]) for node in nodes if "name" in node]
        raise InputError(f"scene: {path}: no entry '{head}'; {nearest(head, names) if names else 'use its index'}")
    return nodes, steps


def number_at(node: Any, path: str) -> float:
    """Return the number at the end of a path in plain scene data, of a list's entries the one that all have.

    Raises InputError for a place that is unknown, or holds no number or several.
    """
    nodes = [node]
    steps = path.split(".")
    while steps:
        head, *steps = steps
        inner = []
        for one in nodes:
            if isinstance(one, list):
                entries, rest = _entries(one, head, [head, *steps], path)
                if len(rest) > len(steps):  # the step is a key of every entry
                    entries = [entry[head] for entry in entries if head in entry]
                inner += entries
            elif isinstance(one, dict) and head in one:
                inner.append(one[head])
            else:
                known = f"; {nearest(head, list(one))}" if isinstance(one, dict) else ""
                raise InputError(f"scene: {path}: the scene holds no '{head}' there{known}")
        nodes = inner
    values = {float(value) for value in nodes if isinstance(value, int | float) and not isinstance(value, bool)}
    if len(values) != 1 or len(nodes) == 0:
        shown = "several numbers; name one entry by its index" if len(values) > 1 else "no number"
        raise InputError(f"scene: {path}: names {shown}")
    return values.pop()
