"""Records some of whose keys other code adds: their tables are read, written and described with these keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import lru_cache
from typing import Any

from pydantic import GetJsonSchemaHandler, TypeAdapter, model_serializer, model_validator
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import ArgsKwargs, CoreSchema, SchemaValidator, core_schema

from vanedamp.files.toml_input import STRICT

#: validators kept
_KEPT = 100


@dataclass(frozen=True, config=STRICT, repr=False)
class OpenRecord:
    """Base of such records.

    added: values of the keys that a record has beyond its fields; None: no such keys
    """

    added: dict[str, Any] | None = field(default=None, kw_only=True)

    @classmethod
    def keys_added(cls) -> Mapping[str, Any]:
        """Return the types of the keys that other code adds, by name."""
        raise NotImplementedError(f"{cls.__qualname__} does not say what may be added")

    @model_validator(mode="before")
    @classmethod
    def _read(cls, table: Any) -> Any:
        called = isinstance(table, ArgsKwargs)  # the constructor, not a file
        keys = (table.kwargs or {}) if called else table
        if not isinstance(keys, Mapping):
            return table
        if "added" in keys and not called:
            raise ValueError("added: unknown key")
        further = [key for key in keys if key not in cls.__dataclass_fields__]
        types = cls.keys_added() if further else {}
        own = {key: keys[key] for key in further if key in types}
        if not own:
            return table
        rest = {key: value for key, value in keys.items() if key not in own}
        rest["added"] = (rest.get("added") or {}) | cls._validated(own, types)
        return ArgsKwargs(table.args, rest) if called else rest

    @classmethod
    def _validated(cls, values: Mapping[str, Any], types: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of keys that other code adds, by their types. Raises pydantic's ValidationError."""
        found: dict[str, Any] = _validator(tuple((key, types[key]) for key in values)).validate_python(values)
        return found

    @model_serializer(mode="wrap")
    def _write(self, handler: Any) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        return table | (table.pop("added", None) or {})

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        json_schema = handler(schema)
        properties = handler.resolve_ref_schema(json_schema)["properties"]
        del properties["added"]
        for key, kind in cls.keys_added().items():
            told = (one for one in getattr(kind, "__metadata__", ()) if isinstance(one, FieldInfo))
            about = next((one.description for one in told), None)
            properties[key] = handler(_schema(kind)) | ({} if about is None else {"description": about})
        return json_schema


@lru_cache(_KEPT)
def _validator(kinds: tuple[tuple[str, Any], ...]) -> SchemaValidator:
    """Return what validates tables of these keys and types."""
    schemas = {key: core_schema.typed_dict_field(_schema(kind)) for key, kind in kinds}
    return SchemaValidator(core_schema.typed_dict_schema(schemas))


def _schema(kind: Any) -> CoreSchema:
    """Return the schema of a type, built now where that was put off."""
    adapter = TypeAdapter(kind)
    adapter.rebuild()
    return adapter.core_schema
