"""The tables and keys of an input file with units, defaults and meanings, from the JSON Schema of its record.

The reference in the documentation and `help` of the record are made from them.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Container, Iterator
from dataclasses import MISSING, fields
from typing import Any, NamedTuple, TypeVar

from pydantic import ValidationError
from pydantic_core import ArgsKwargs

from vanedamp.files.reference import constants, making_schema, options, schema
from vanedamp.files.toml_input import validate

Record = TypeVar("Record")
Schema = dict[str, Any]
#: the part of a key's path that the file chooses: [interface.<name>]
NAME = "<name>"
#: a default that the description states in words
DEFAULT = re.compile(r" \(default: ([^()]+)\)")
#: types of JSON in words
WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}


class Key(NamedTuple):
    """A key of a table: its name, permitted values, unit, default and meaning; required ones have no default."""

    name: str
    value: str
    unit: str
    default: str
    meaning: str


class KeyTable(NamedTuple):
    """A table of a file.

    path: dotted, `excitation.harmonic`; heading: as in the file, `[[excitation.harmonic]]`; variant: the value of the
    key that distinguishes tables of one name, such as a method's, "" without one; text: its meaning.
    """

    path: str
    heading: str
    variant: str
    text: str
    keys: tuple[Key, ...]

    def anchor(self, key: str = "") -> str:
        """Return the anchor of the table, or of a key in it."""
        return ".".join(name for name in (self.path, self.variant, key) if name).replace(NAME, "name")

    def dotted(self, key: str) -> str:
        """Return the dotted name of a key, without the variant."""
        return f"{self.path}.{key}" if self.path else key


def tables(schema: Schema) -> Iterator[KeyTable]:
    """Yield the tables of a file in their order, each before those inside it; one that variants share once."""
    top = _keys(schema, schema)
    if top:
        yield KeyTable("", "Before the first table", "", "", top)
    yield from dict.fromkeys(_inner(schema, schema, ""))


def _inner(schema: Schema, table: Schema, path: str, text: str = "") -> Iterator[KeyTable]:
    for name, node in table.get("properties", {}).items():
        yield from _tables_at(schema, node, f"{path}.{name}" if path else name, node.get("description", ""))
    others = table.get("additionalProperties")
    if isinstance(others, dict):
        yield from _tables_at(schema, others, f"{path}.{NAME}", text)


def _tables_at(schema: Schema, node: Schema, path: str, text: str) -> Iterator[KeyTable]:
    """Yield the tables that a key stands for: one, the variants of one, or a list's."""
    tables = _own_tables(schema, node)
    brackets = "[[{}]]" if any("items" in option for option in options(schema, node)) else "[{}]"
    for table in tables:
        tags = _distinguishing(table, tables)
        heading = brackets.format(path) + "".join(f' {key} = "{value}"' for key, value in tags.items())
        others = table.get("additionalProperties")
        values = others if isinstance(others, dict) and not _own_tables(schema, others) else None
        if "properties" in table or values is not None:
            free = () if values is None else (_key(schema, NAME, {"description": text} | values, False),)
            said = "" if values is not None and "description" not in values else table.get("description", text)
            yield KeyTable(path, heading, "".join(tags.values()), said, _keys(schema, table, tags) + free)
        yield from _inner(schema, table, path, text)


def _own_tables(schema: Schema, node: Schema) -> list[Schema]:
    """Return the tables of a file that a node stands for, including tables in a list.

    Inline tables are values, and so are names with values where a list or a text would do as well.
    """
    tables, some = [], options(schema, node)
    for option in some:
        if isinstance(option.get("items"), dict):
            tables += _own_tables(schema, option["items"])
        elif option.get("type") == "object" and "x-inline" not in option and ("properties" in option or len(some) == 1):
            tables.append(option)
    return tables


def _distinguishing(table: Schema, among: list[Schema]) -> dict[str, str]:
    """Return the key that distinguishes a table from others of its name, with its value."""
    if len(among) < 2:
        return {}
    here = constants(table)
    return {key: here[key] for key in list(here)[:1]}


def _keys(schema: Schema, table: Schema, first: Container[str] = ()) -> tuple[Key, ...]:
    """Return the keys of a table that are no tables themselves, some of them first."""
    required = table.get("required", ())
    nodes = sorted(table.get("properties", {}).items(), key=lambda item: item[0] not in first)
    return tuple(_key(schema, name, node, name in required) for name, node in nodes if not _own_tables(schema, node))


def _key(schema: Schema, name: str, node: Schema, required: bool) -> Key:
    values = dict.fromkeys(_value(schema, option) for option in options(schema, node))
    meaning = node.get("description", "").removesuffix(f"[{node.get('x-unit')}]").rstrip()
    default = "required" if required else _toml(node["default"]) if "default" in node else ""
    if not default and (said := DEFAULT.search(meaning)):
        default, meaning = said[1], meaning[: said.start()] + meaning[said.end() :]
    return Key(name, " or ".join(values), node.get("x-unit", ""), default, meaning)


def _value(schema: Schema, node: Schema) -> str:
    """Return the permitted values of a key in words: type and range, or a list."""
    if "const" in node:
        return _toml(node["const"])
    if "enum" in node:
        return ", ".join(map(_toml, node["enum"]))
    if node.get("type") == "array":
        return _list(schema, node)
    if node.get("type") == "object":
        others = node.get("additionalProperties")
        inner = f"{NAME} = {_value(schema, others)}" if isinstance(others, dict) else ", ".join(node["properties"])
        return "{" + inner + "}"
    return " ".join(text for text in (WORDS.get(node.get("type", ""), "any"), _range(node)) if text)


def _list(schema: Schema, node: Schema) -> str:
    if "prefixItems" in node:
        items = [" or ".join(_value(schema, kind) for kind in options(schema, item)) for item in node["prefixItems"]]
        return f"[{', '.join(items)}]"
    kinds = dict.fromkeys(_value(schema, kind) for kind in options(schema, node.get("items", {})))
    least, most = node.get("minItems", 0), node.get("maxItems")
    count = f" ({least}{'' if most == least else f' to {most}' if most else ' or more'})" if least > 1 or most else ""
    return f"list{count} of {' or '.join(kinds)}"


def _range(node: Schema) -> str:
    """Return the range of a number: "> 0", "0 to 1"."""
    low, high = node.get("minimum"), node.get("maximum")
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    signs = (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"))
    return ", ".join(f"{sign} {node[name]:g}" for name, sign in signs if name in node)


def _toml(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, list | tuple) else str(value)


def documented(record: type[Record]) -> type[Record]:
    """Let `help` of a record that is read from a file list the tables and keys of the file; decorates the class.

    Editors complete its keys, and its constructor raises the InputError that a file with the same keys would.
    """

    def __init__(self: Any, /, **keys: Any) -> None:
        try:
            self.__pydantic_validator__.validate_python(ArgsKwargs((), keys), self_instance=self)
        except ValidationError:
            validate(record, keys, record.__name__.lower())
            raise

    def __new__(cls: Any, /, *_: Any, **__: Any) -> Any:
        if record.__init__ is not __init__:  # pydantic puts its own in place when it builds the class
            _begin_with(record, __init__)
        return object.__new__(cls)

    record.__doc__ = KeyedDocstring(record)  # type: ignore[assignment]
    record.__new__ = __new__  # type: ignore[method-assign, assignment]
    _begin_with(record, __init__)
    return record


def _begin_with(record: Any, init: Callable[..., None]) -> None:
    """Give a record its constructor, with a signature of its keys; ... stands for a default that is made."""
    keys = [
        inspect.Parameter(
            key.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=(inspect.Parameter.empty if key.default_factory is MISSING else ...)
            if key.default is MISSING
            else key.default,
            annotation=key.type,
        )
        for key in fields(record)
        if key.name != "added"
    ]
    record.__init__, record.__signature__ = init, inspect.Signature(keys)


class KeyedDocstring:
    """A docstring with the keys of the file that its class is read from, made when it is asked for.

    plain: without them.
    """

    def __init__(self, record: type) -> None:
        self.plain = inspect.cleandoc(record.__doc__ or "")

    def __get__(self, instance: Any, owner: type) -> str:
        if making_schema.get():
            return self.plain
        return f"{self.plain}\n\nTables and keys of the file:\n\n{key_text(schema(owner))}"


def key_text(made: Schema) -> str:
    """Return the tables and keys of a schema as text: unit, default and meaning of each, lines of 100 characters."""
    lines = []
    for table in tables(made):
        lines += ["", f"{table.heading}  {' '.join(table.text.split())}".rstrip()]
        for key in table.keys:
            unit = f" [{key.unit}]" if key.unit else ""
            default = key.default if key.default in ("", "required") else f"default {key.default}"
            text = "; ".join(word for word in (f"{key.meaning}{unit}", key.value, default) if word)
            lines += textwrap.wrap(
                f"{key.name}: {text}", 100, initial_indent="  ", subsequent_indent="      ", break_on_hyphens=False
            )
    return "\n".join(lines).lstrip("\n")
