"""What an input file means, without running it: a module for each kind of file (studies.file_kinds), with `facts`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from vanedamp.files.reference import FileKind, key_in, options, table_at


def defaults(kind: FileKind, data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of the file's tables that it leaves at their defaults, by their dotted paths."""
    schema = kind.schema
    return dict(_defaults(schema, schema, data, ""))


def _defaults(
    schema: dict[str, Any], node: dict[str, Any], data: Mapping[str, Any], prefix: str
) -> Iterator[tuple[str, Any]]:
    table = table_at(schema, node, data)
    for key, property_ in table.get("properties", {}).items():
        if key not in data and "default" in property_ and property_["default"] not in ([], {}):
            yield f"{prefix}{key}", property_["default"]
    for key, value in data.items():
        inner = key_in(table, key)
        if isinstance(value, Mapping):
            yield from _defaults(schema, inner, value, f"{prefix}{key}.")
        elif isinstance(value, list):
            items: dict[str, Any] = next((one["items"] for one in options(schema, inner) if "items" in one), {})
            for index, entry in enumerate(value):
                if isinstance(entry, Mapping):
                    yield from _defaults(schema, items, entry, f"{prefix}{key}.{index}.")
