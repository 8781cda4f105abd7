"""Tables of a file that are one of several records, named by a key: ours, and records added by other code."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

from pydantic import GetJsonSchemaHandler, TypeAdapter
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, SchemaSerializer, SchemaValidator, core_schema

from vanedamp.files.extensions import ExtensionError, added_parts

Base = TypeVar("Base")
Record = TypeVar("Record")


class Variants(Generic[Base]):
    """The records that a table may be: frozen dataclasses derived from a base, whose field `key` names them.

    kind: in words, for messages; group: of entry points, whose values are the classes.
    `Annotated[Base, variants]` is a field of a record that is one of them, those that are registered later included.
    """

    def __init__(self, kind: str, base: type[Base], key: str, group: str) -> None:
        self._kind, self._base, self._key, self._group = kind, base, key, group
        self._records: dict[str, Any] = {}
        self._compiled: tuple[CoreSchema, SchemaValidator, SchemaSerializer] | None = None
        self._loaded = False

    def register(self, record: type[Record]) -> type[Record]:
        """Add a record that files may name; may decorate the class.

        An installed package does the same without a call, for the command line too, in its pyproject.toml:

            [project.entry-points."vanedamp.contact_laws"]
            power = "acme.power_law:PowerLaw"

        Raises ExtensionError for a class that is no such record, and for a name that is taken.
        """
        base: Any = self._base
        field = getattr(record, "__dataclass_fields__", {}).get(self._key)
        if field is None or not (issubclass(record, base) and isinstance(field.default, str)):
            raise ExtensionError(
                f"{record!r}: is no {self._kind}: derive a dataclass from {base.__name__}, "
                f"with a default of `{self._key}`"
            )
        registered = self._records.setdefault(field.default, record)
        if registered is not record:
            raise ExtensionError(
                f"{record.__module__}.{record.__qualname__}: there is a {self._kind} named {field.default} already; "
                "name it otherwise"
            )
        self._compiled = None
        return record

    def _union(self) -> tuple[CoreSchema, SchemaValidator, SchemaSerializer]:
        """Return the union of the records: its schema, validator and serialiser."""
        if not self._loaded:
            for record in added_parts(self._kind, self._group).values():
                self.register(record)
            self._loaded = True
        if self._compiled is None:
            choices = {name: _schema(record) for name, record in self._records.items()}
            schema = core_schema.tagged_union_schema(choices, self._key) if choices else self._nothing()
            self._compiled = schema, SchemaValidator(schema), SchemaSerializer(schema)
        return self._compiled

    def _nothing(self) -> CoreSchema:
        """Return the schema while there is no record: it rejects every table."""
        reason = f"there is no {self._kind}; other packages add them (entry points {self._group})"
        return core_schema.custom_error_schema(
            core_schema.none_schema(), custom_error_type="no_variant", custom_error_message=reason
        )  # fmt: skip

    def _validate(self, value: Any) -> Any:
        return self._union()[1].validate_python(value)

    def _plain(self, record: Base) -> Any:
        return self._union()[2].to_python(record, mode="json", exclude_none=True)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self._validate, serialization=core_schema.plain_serializer_function_ser_schema(self._plain)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return handler(self._union()[0])


def _schema(record: Any) -> CoreSchema:
    """Return the schema of a record, built now where that was put off."""
    adapter = TypeAdapter(record)
    adapter.rebuild()
    return adapter.core_schema
