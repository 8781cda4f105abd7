"""Meaning of the keys of an input file: JSON Schema of a record, with the docstrings after its fields.

A field of a record read from a file is followed by a string literal, a phrase with its unit in brackets at the end:

    gap: Positive
    \"\"\"total free travel of a body along the cavity [m]\"\"\"

A ratio has the unit [-], a name or a switch none. The literals are read from the source when they are asked for.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Mapping
from contextvars import ContextVar
from functools import lru_cache
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_UNIT = re.compile(r"\[([^\[\]]+)\]$")
#: constraints that pydantic leaves as they are behind validators of ours, and their names in JSON Schema
_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}

#: whether a schema is being made, whose descriptions are docstrings without keys (key_tables.KeyedDocstring)
making_schema = ContextVar("making_schema", default=False)


class FileKind(NamedTuple):
    """A kind of input file.

    name; place: of its record, "module:class", loaded when needed; tables: tables that distinguish it from other kinds;
    completed: "module:function" that takes the schema of the record and adds other ways to write the same, "": none;
    command: main command for such a file, "": of its name.
    """

    name: str
    place: str
    tables: tuple[str, ...] = ()
    completed: str = ""
    command: str = ""

    @property
    def record(self) -> Any:
        """The record that a file of this kind is read as."""
        return _at(self.place)

    @property
    def schema(self) -> dict[str, Any]:
        """JSON Schema of the record: every key with its meaning."""
        return schema(self.record)

    @property
    def file_schema(self) -> dict[str, Any]:
        """JSON Schema of the files of this kind, by which editors check them."""
        return _at(self.completed)(self.schema) if self.completed else self.schema


def _at(address: str) -> Any:
    module, name = address.split(":")
    return getattr(import_module(module), name)


def schema(record: Any) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of the files that are read as a record.

    Properties have a "description", a "default", and the "x-unit" of numbers ("-" of ratios).
    """
    token = making_schema.set(True)
    try:
        generated: dict[str, Any] = TypeAdapter(record).json_schema(schema_generator=_Generator)
    finally:
        making_schema.reset(token)
    return {"$schema": DIALECT} | generated


def field_docstrings(record: type) -> dict[str, str]:
    """Return the docstrings after the fields of a class, or members of an Enum, its bases' included, by their names."""
    docstrings: dict[str, str] = {}
    for base in reversed(record.__mro__):
        docstrings |= _literals(base.__module__).get(base.__qualname__, {})
    return docstrings


def unit_in(text: str) -> str | None:
    """Return the unit in brackets at the end of a field's docstring, None if there is none."""
    match = _UNIT.search(text)
    return match[1] if match else None


def options(schema: dict[str, Any], node: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the nodes of a schema that a node of it stands for: references followed, unions spread out."""
    if "$ref" in node:
        return options(schema, schema["$defs"][node["$ref"].rsplit("/", 1)[1]])
    some = node.get("anyOf", []) + node.get("oneOf", [])
    return [deep for option in some for deep in options(schema, option)] if some else [node]


def constants(node: dict[str, Any]) -> dict[str, str]:
    """Return the keys of a table's schema that hold one value only, which distinguish variants of it."""
    return {name: item["const"] for name, item in node.get("properties", {}).items() if "const" in item}


def table_at(schema: dict[str, Any], node: dict[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of a table among the variants that a node stands for: the one whose constants it has."""
    tables = [option for option in options(schema, node) if option.get("type") == "object"]
    fitting = [
        variant for variant in tables if all(table.get(key) == value for key, value in constants(variant).items())
    ]
    return max(fitting, key=lambda variant: len(constants(variant))) if fitting else next(iter(tables), {})


def key_in(table: dict[str, Any], key: str) -> dict[str, Any]:
    """Return the schema of a key of a table, its own or the one for all others; nothing for a key it does not have."""
    others = table.get("additionalProperties")
    node: dict[str, Any] = table.get("properties", {}).get(key, others if isinstance(others, dict) else {})
    return node


def require(table: dict[str, Any], key: str) -> None:
    """Demand a key in the schema of a table, which then has no default."""
    table["required"] = sorted({*table.get("required", ()), key})
    table["properties"][key].pop("default", None)


class _Generator(GenerateJsonSchema):
    """Puts docstrings and units of fields into their properties; TOML has no null, and keys are no titles."""

    def generate(self, schema: CoreSchema, mode: Any = "validation") -> JsonSchemaValue:
        return _plain(super().generate(schema, mode))

    def dataclass_schema(self, schema: core_schema.DataclassSchema) -> JsonSchemaValue:
        return _described(super().dataclass_schema(schema), schema["cls"])

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        return _described(super().model_schema(schema), schema["cls"])

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        if schema.get("default", ...) is None:
            return self.generate_inner(schema["schema"])
        return super().default_schema(schema)

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        """Return the union, whose tables must name their record, even if it is the default."""
        union = super().tagged_union_schema(schema)
        tag = schema["discriminator"]
        if isinstance(tag, str):
            for option in union["oneOf"]:
                require(self.resolve_ref_schema(option), tag)
        return union

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def _described(table: JsonSchemaValue, record: type) -> JsonSchemaValue:
    """Return the schema of a record with descriptions and units of its properties."""
    described = {}
    fields: Any = getattr(record, "__pydantic_fields__", {})
    for name, text in field_docstrings(record).items():
        key = getattr(fields.get(name), "alias", None) or name
        described[key] = {"description": text} | ({"x-unit": unit} if (unit := unit_in(text)) else {})
    properties = {key: node | described.get(key, {}) for key, node in table.get("properties", {}).items()}
    return table | {"properties": properties}


def _plain(node: Any) -> Any:
    """Return a schema whose bounds have the names of JSON Schema."""
    if isinstance(node, dict):
        return {
            _BOUNDS.get(key, key) if isinstance(value, int | float) else key: _plain(value)
            for key, value in node.items()
        }
    return [_plain(value) for value in node] if isinstance(node, list) else node


@lru_cache(maxsize=128)
def _literals(module: str) -> dict[str, dict[str, str]]:
    """Return the literals after fields by classes of a module and fields; nothing of a module without source."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or not file.endswith(".py"):
        return {}
    docstrings: dict[str, dict[str, str]] = {}
    _collect(ast.parse(Path(file).read_text(encoding="utf-8")).body, "", docstrings)
    return docstrings


def _collect(body: list[ast.stmt], prefix: str, docstrings: dict[str, dict[str, str]]) -> None:
    for statement in body:
        if isinstance(statement, ast.ClassDef):
            name = f"{prefix}{statement.name}"
            docstrings[name] = {
                target.id: " ".join(cleandoc(text.value.value).split())
                for field, text in zip(statement.body, statement.body[1:], strict=False)
                if isinstance(field, ast.AnnAssign | ast.Assign)  # a member of an Enum has no annotation
                and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
                and isinstance(text.value.value, str)
                for target in (field.targets if isinstance(field, ast.Assign) else [field.target])
                if isinstance(target, ast.Name)
            }  # fmt: skip
            _collect(statement.body, f"{name}.", docstrings)
