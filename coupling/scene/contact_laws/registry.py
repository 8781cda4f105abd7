"""The laws that a scene's [contact] table may name: ours, and those that other code registers."""

from __future__ import annotations

from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, TypeVar

from pydantic import Field, GetJsonSchemaHandler, TypeAdapter
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from vanedamp.coupling.scene.contact_laws.compliant import Compliant
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.coupling.scene.contact_laws.massless import Massless
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.contact_laws.viscoelastic import Viscoelastic
from vanedamp.files.extensions import ExtensionError, added_parts

#: entry points whose value is a law's class
GROUP = "vanedamp.contact_laws"

Law = TypeVar("Law", bound=type[ContactLaw])

_LAWS: dict[str, type[ContactLaw]] = {}


def register(law: Law) -> Law:
    """Add a law, a dataclass derived from ContactLaw, to those that a scene may name; may decorate the class.

    An installed package does the same without a call, for the command line too, in its pyproject.toml:

        [project.entry-points."vanedamp.contact_laws"]
        power = "acme.power_law:PowerLaw"

    Raises ExtensionError for what is no law, and for a name that is taken.
    """
    field = getattr(law, "__dataclass_fields__", {}).get("law")
    if field is None or not (isinstance(law, type) and issubclass(law, ContactLaw) and isinstance(field.default, str)):
        raise ExtensionError(f"{law!r}: is no contact law: derive a dataclass from ContactLaw, with a default of `law`")
    other = _LAWS.setdefault(field.default, law)
    if other is not law:
        raise ExtensionError(
            f"{law.__module__}.{law.__qualname__}: there is a contact law named {field.default} already; "
            "name it otherwise"
        )
    _union.cache_clear()
    return law


@cache
def _load_added() -> None:
    """Register the laws of installed packages, once."""
    for law in added_parts("contact law", GROUP).values():
        register(law)


@cache
def _union() -> TypeAdapter[ContactLaw]:
    """Return the union of the laws, told apart by their `law`."""
    laws: Any = reduce(or_, _LAWS.values())
    return TypeAdapter(Annotated[laws, Field(discriminator="law")])


def _laws() -> TypeAdapter[ContactLaw]:
    _load_added()
    return _union()


class _Registered:
    """What pydantic does with a field that is one of the laws, those that are registered later included."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            lambda value: _laws().validate_python(value),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda law: _laws().dump_python(law, mode="json", exclude_none=True)
            ),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return handler(_laws().core_schema)


for _law in (Newton, Compliant, Massless, Viscoelastic):
    register(_law)

#: type of a scene's `contact`
Contact = Annotated[ContactLaw, _Registered()]
