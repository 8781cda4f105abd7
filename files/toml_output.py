"""Input files written for people: TOML with meanings and units of the keys as comments.

tomlkit writes them. Here are comments, lines and digits: tomlkit 0.15.2 itself writes a list of 200 frequencies
as one line of 3,884 characters; here the longest has 99.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit
from tomlkit.container import Container
from tomlkit.items import Array, Float, Item, Table, Trivia

from vanedamp.files.reference import FileKind, key_in, options, table_at
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import plain

#: widest line with a comment at its end; longer comments go above
_WIDTH = 120
#: width of the lines of a long list
_LINE = 96


def write_commented(
    path: str | Path, data: Mapping[str, Any], kind: FileKind, notes: Mapping[str, str] | None = None
) -> None:
    """Write tables as a commented TOML file, and the JSON Schema of its kind in the same folder. Raises StoreError.

    notes: as in `commented`.
    """
    write_schema(Path(path).with_name(schema_name(kind.name)), kind.file_schema)
    with replacing(path) as temporary:
        temporary.write_text(commented(data, kind.schema, kind.name, notes), encoding="utf-8")


def write_schema(path: str | Path, schema: Mapping[str, Any]) -> None:
    """Write a JSON Schema to a file. Raises StoreError."""
    with replacing(path) as temporary:
        temporary.write_text(schema_text(schema), encoding="utf-8")


def schema_text(schema: Mapping[str, Any]) -> str:
    """Return a JSON Schema as text."""
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def schema_name(kind: str) -> str:
    """Return the name of the file with the JSON Schema of a kind, which lies in the folder of these files."""
    return f"{kind}.schema.json"


def toml(data: Mapping[str, Any]) -> str:
    """Return tables as TOML text without comments; values of None are left out."""
    return _Writer({}, {}).text(data)


def commented(
    data: Mapping[str, Any], schema: dict[str, Any], kind: str, notes: Mapping[str, str] | None = None
) -> str:
    """Return tables as TOML text with the descriptions of their keys as comments, from the JSON Schema of their kind.

    The first line names the schema for editors; values of None are left out. notes: further comments at the
    beginning of a table by its dotted name, of the file by "".
    """
    return f"#:schema ./{schema_name(kind)}\n\n{_Writer(schema, notes or {}).text(data)}"


class _Writer(NamedTuple):
    """Makes a document of tables. schema: {} for no comments."""

    schema: dict[str, Any]
    notes: Mapping[str, str]

    def text(self, data: Mapping[str, Any]) -> str:
        document = tomlkit.document()
        self.fill(document, plain(data), self.schema, set(), "")
        return tomlkit.dumps(document)

    def fill(
        self, parent: Container | Table, data: Mapping[str, Any], node: dict[str, Any], explained: set[str], name: str
    ) -> None:
        """Add the keys of a table to the document or to a table, values first, then tables.

        explained: keys that need no comment, since a table of the same list has explained them; this table's keys are
        added. name: the dotted name of the table.
        """
        _comment(parent, self.notes.get(name, ""))
        if not name and name in self.notes:
            parent.add(tomlkit.nl())
        table = table_at(self.schema, node, data)
        alike = isinstance(table.get("additionalProperties"), dict)  # tables by names of the user's
        explained_inside: set[str] = set()
        entries = {key: (value, key_in(table, key)) for key, value in data.items() if value is not None}
        tables = {key for key, (value, node) in entries.items() if self.headed(value, node)}
        for key in sorted(entries, key=lambda key: key in tables):
            value, node = entries[key]
            text = "" if key in explained else node.get("description", "")
            if key in tables:
                inner = explained_inside if alike else set()
                parent.add(key, self.tables(value, text, node, inner, f"{name}.{key}" if name else key))
            else:
                _add(parent, key, _item(value), text)
        explained |= set(entries)

    def headed(self, value: Any, node: dict[str, Any]) -> bool:
        """Return whether a value is a table with a heading, or a list of them."""
        if isinstance(value, list) and value:
            return all(isinstance(entry, Mapping) for entry in value)
        return isinstance(value, Mapping) and not table_at(self.schema, node, value).get("x-inline", False)

    def tables(self, value: Any, text: str, node: dict[str, Any], explained: set[str], name: str) -> Item:
        """Return a table or a list of them."""
        if isinstance(value, Mapping):
            return self.table(value, text, node, explained, name)
        items: dict[str, Any] = next(
            (option["items"] for option in options(self.schema, node) if "items" in option), {}
        )
        tables = tomlkit.aot()
        for entry in value:
            tables.append(self.table(entry, "" if len(tables) else text, items, explained, name))
        return tables

    def table(self, value: Mapping[str, Any], text: str, node: dict[str, Any], explained: set[str], name: str) -> Table:
        """Return a table with its heading, which one of tables only does not need."""
        inner = bool(value) and all(isinstance(entry, Mapping) for entry in value.values())
        table = tomlkit.table(is_super_table=inner and name not in self.notes)
        if text:
            table.comment(text)
        self.fill(table, value, node, explained, name)
        return table


def _comment(parent: Container | Table, text: str) -> None:
    """Add lines with a comment."""
    for line in textwrap.wrap(text, _WIDTH - 2, break_on_hyphens=False):
        parent.add(tomlkit.comment(line))


def _add(parent: Container | Table, key: str, item: Item, text: str) -> None:
    """Add a value with its comment at the end of the line, or above where that is too long."""
    if text and len(f"{key} = {item.as_string()} # {text}") > _WIDTH:
        _comment(parent, text)
    elif text:
        item.comment(text)
    parent.add(key, item)


def _item(value: Any) -> Item:
    """Return a value as it stands in a line; tables in it are inline ones."""
    if isinstance(value, Mapping):
        inline = tomlkit.inline_table()
        for key, entry in value.items():
            inline.append(key, _item(entry))
        return inline
    if isinstance(value, list):
        return _array([_item(entry) for entry in value])
    if isinstance(value, float):
        return Float(value, Trivia(), _digits(value))
    return tomlkit.item(value)


def _array(items: list[Item]) -> Array:
    """Return a list, in several lines where it is long."""
    array = tomlkit.array()
    if sum(len(item.as_string()) + 2 for item in items) < _WIDTH:
        array.extend(items)
        return array
    line: list[Item] = []
    for item in items:
        if sum(len(entry.as_string()) + 2 for entry in [*line, item]) > _LINE:
            array.add_line(*line)
            line = []
        line.append(item)
    array.add_line(*line)
    array.add_line(indent="")
    return array


def _digits(value: float) -> str:
    """Return the digits of a number, all that it has: 2e11 rather than 200000000000.0."""
    if value == 0.0 or 1e-4 <= abs(value) < 1e6:
        return repr(value)
    return np.format_float_scientific(value, trim="-", exp_digits=1).replace("e+", "e")
