"""A scene as one would write it: without default values, and with ranges instead of long lists."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from vanedamp.coupling.scene.paths import Range, axis_values, table_at
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validated_or_none

#: values of an axis from which on a range is shorter
_FEW = 4


def short_form(scene: Scene) -> dict[str, Any]:
    """Return the least plain data that are read as this very scene."""
    data, whole = scene.to_dict(), _even(scene)
    for path, values in data.get("sweep", {}).items():
        data["sweep"][path] = _range(values)
    for keys in list(_places(data)):
        without = copy.deepcopy(data)
        try:
            del table_at(without, keys)[keys[-1]]
        except (KeyError, IndexError):  # its table is gone already
            continue
        if _reads_as(without, whole):
            data = without
    if "law" in (contact := data.get("contact", {})):  # determines the other keys
        data["contact"] = {"law": contact["law"]} | contact
    return data


def _places(node: Any, keys: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the keys of nested tables, a table before the keys in it."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield (*keys, key)
            yield from _places(value, (*keys, key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from _places(value, (*keys, index))


def _reads_as(data: dict[str, Any], whole: dict[str, Any]) -> bool:
    read = validated_or_none(Scene, data)
    return read is not None and _even(read) == whole


def _even(scene: Scene) -> dict[str, Any]:
    """Return a scene's data with ranges as lists."""
    data = scene.to_dict()
    values = {path: axis_values(axis) for path, axis in scene.axes.items()}
    return data | {"sweep": values | scene.kept}


def _range(values: Any) -> Any:
    """Return the range that has exactly these values, or else the values."""
    if not isinstance(values, list) or len(values) <= _FEW or not all(isinstance(value, float) for value in values):
        return values
    shorter = {"start": values[0], "stop": values[-1], "num": len(values)}
    return shorter if axis_values(Range(**shorter)) == values else values
