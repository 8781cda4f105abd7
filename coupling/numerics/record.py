"""Records of compiled functions: named tuples that are passed by their place.

numba passes a named tuple by its items, an array as seven of them: the engine's records would be hundreds of arguments,
which take longer to pass than many a function takes, and longer to compile. A record made with `record` is passed as
one pointer to all of them. Records never change while compiled functions run: what is loaded once is known, whatever
has been written to the arrays meanwhile.
"""

from __future__ import annotations

from typing import Any, TypeVar

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

Class = TypeVar("Class", bound=type[tuple[Any, ...]])


class Record(types.Type):
    """The type of a record: its class and the types of its fields."""

    def __init__(self, kind: type, fields: tuple[tuple[str, types.Type], ...]) -> None:
        self.kind, self.fields = kind, dict(fields)
        super().__init__(name=f"{kind.__module__}.{kind.__qualname__}({', '.join(str(type) for _, type in fields)})")

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells types apart."""
        return self.kind, *self.fields.items()


def record(kind: Class) -> Class:
    """Make a class of named tuples a record of compiled functions."""

    @typeof_impl.register(kind)
    def type_of(values, context):
        return Record(kind, tuple((name, typeof(value)) for name, value in zip(kind._fields, values, strict=True)))

    return kind


@register_model(Record)
class _Place(models.PrimitiveModel):
    """A pointer to the fields, each as numba holds it in a variable."""

    def __init__(self, manager, type):
        places = [manager.lookup(field).get_data_type() for field in type.fields.values()]
        super().__init__(manager, type, ir.LiteralStructType(places).as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = Record

    def generic_resolve(self, record, name):
        return record.fields.get(name)


@lower_getattr_generic(Record)
def _get(context, builder, type, value, name):
    """Load a field. All loads are marked as those of what never changes."""
    place = cgutils.gep_inbounds(builder, value, 0, list(type.fields).index(name))
    never = builder.module.add_metadata([])
    loaded = _load(builder, place, never)
    return context.data_model_manager[type.fields[name]].from_data(builder, loaded)


def _load(builder: Any, place: Any, never: Any) -> Any:
    """Load from a place, the parts of a structure one by one: a load of all of them would lose its mark."""
    kind = place.type.pointee
    if not isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        loaded = builder.load(place)
        loaded.set_metadata("invariant.load", never)
        return loaded
    whole = ir.Constant(kind, ir.Undefined)
    for i in range(len(kind)):
        part = _load(builder, cgutils.gep_inbounds(builder, place, 0, i), never)
        whole = builder.insert_value(whole, part, i)
    return whole


@unbox(Record)
def _take(type, values, c):
    """Put the fields on the stack of the call from Python."""
    place = cgutils.alloca_once(c.builder, c.context.get_value_type(type).pointee)
    failed = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    cleanups = []
    for i, field in enumerate(type.fields.values()):
        native = c.unbox(field, c.pyapi.tuple_getitem(values, i))
        data = c.context.data_model_manager[field].as_data(c.builder, native.value)
        c.builder.store(data, cgutils.gep_inbounds(c.builder, place, 0, i))
        with c.builder.if_then(native.is_error, likely=False):
            c.builder.store(cgutils.true_bit, failed)
        if native.cleanup is not None:
            cleanups.append(native.cleanup)

    def cleanup():
        for one in reversed(cleanups):
            one()

    return NativeValue(place, cleanup=cleanup if cleanups else None, is_error=c.builder.load(failed))
