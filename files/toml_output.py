"""Input files written for people: TOML with what its keys mean, and their units, as comments."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.container import Container
from tomlkit.items import Float, Item, Table, Trivia

from vanedamp.files.reference import FileKind, key_in, options, table_at
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import plain

#: widest line that a comment at its end may make; longer comments stand above
_WIDTH = 120


def write_commented(path: str | Path, data: Mapping[str, Any], kind: FileKind) -> None:
    """Write tables as a commented TOML file, and the JSON Schema of its kind beside it. Raises StoreError."""
    made = kind.schema
    with replacing(Path(path).with_name(schema_name(kind.name))) as temporary:
        temporary.write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    with replacing(path) as temporary:
        temporary.write_text(commented(data, made, kind.name), encoding="utf-8")


def schema_name(kind: str) -> str:
    """Return the name of the file with the JSON Schema of a kind, which stands beside the files of that kind."""
    return f"{kind}.schema.json"


def toml(data: Mapping[str, Any]) -> str:
    """Return tables as TOML text without comments; values of None are left out."""
    return _text(data, {})


def commented(data: Mapping[str, Any], schema: dict[str, Any], kind: str) -> str:
    """Return tables as TOML text with the descriptions of their keys as comments, from the JSON Schema of their kind.

    The first line names the schema for editors; values of None are left out.
    """
    return f"#:schema ./{schema_name(kind)}\n\n{_text(data, schema)}"


def _text(data: Mapping[str, Any], schema: dict[str, Any]) -> str:
    document = tomlkit.document()
    _fill(document, plain(data), schema, schema, set())
    return tomlkit.dumps(document)


def _fill(
    place: Container | Table, data: Mapping[str, Any], schema: dict[str, Any], node: dict[str, Any], told: set[str]
) -> None:
    """Add the keys of a table to a place in the document, values first, then tables.

    told: keys that need no comment any more, since a table of the same list explains them; those of this one join them.
    """
    table = table_at(schema, node, data)
    given = {key: (value, key_in(table, key)) for key, value in data.items() if value is not None}
    tables = {key for key, (value, node) in given.items() if _headed(value, schema, node)}
    for key in sorted(given, key=lambda key: key in tables):
        value, node = given[key]
        text = "" if key in told else node.get("description", "")
        if key in tables:
            place.add(key, _tables(value, text, schema, node))
        else:
            _add(place, key, _item(value), text)
    told |= set(given)


def _headed(value: Any, schema: dict[str, Any], node: dict[str, Any]) -> bool:
    """Return whether a value is a table with a heading, or a list of them."""
    if isinstance(value, list) and value:
        return all(isinstance(entry, Mapping) for entry in value)
    return isinstance(value, Mapping) and not table_at(schema, node, value).get("x-inline", False)


def _tables(value: Any, text: str, schema: dict[str, Any], node: dict[str, Any]) -> Item:
    """Return a table or a list of them."""
    if isinstance(value, Mapping):
        return _table(value, text, schema, node, set())
    items: dict[str, Any] = next((option["items"] for option in options(schema, node) if "items" in option), {})
    tables, told = tomlkit.aot(), set[str]()
    for entry in value:
        tables.append(_table(entry, "" if len(tables) else text, schema, items, told))
    return tables


def _table(value: Mapping[str, Any], text: str, schema: dict[str, Any], node: dict[str, Any], told: set[str]) -> Table:
    """Return a table with its heading, which one of tables only does not need."""
    table = tomlkit.table(is_super_table=bool(value) and all(isinstance(entry, Mapping) for entry in value.values()))
    if text:
        table.comment(text)
    _fill(table, value, schema, node, told)
    return table


def _add(place: Container | Table, key: str, item: Item, text: str) -> None:
    """Add a value with its comment at the end of the line, or above where that is too long."""
    if text and len(f"{key} = {item.as_string()} # {text}") > _WIDTH:
        for line in textwrap.wrap(text, _WIDTH - 2):
            place.add(tomlkit.comment(line))
    elif text:
        item.comment(text)
    place.add(key, item)


def _item(value: Any) -> Item:
    """Return a value as it stands in a line; tables in it are inline ones."""
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        for key, entry in value.items():
            inline.append(key, _item(entry))
        return inline
    if isinstance(value, list):
        array = tomlkit.array()
        for entry in value:
            array.append(_item(entry))
        return array
    if isinstance(value, float):
        return Float(value, Trivia(), _digits(value))
    return tomlkit.item(value)


def _digits(value: float) -> str:
    """Return the digits of a number, all that it has: 2e11 rather than 200000000000.0."""
    if value == 0.0 or 1e-4 <= abs(value) < 1e6:
        return repr(value)
    return np.format_float_scientific(value, trim="-", exp_digits=1).replace("e+", "e")
