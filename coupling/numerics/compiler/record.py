"""Records of compiled functions: named tuples passed by address.

numba passes a named tuple by its items, an array as seven of them: the engine's records would be hundreds of arguments,
which take longer to pass than many a function takes, and longer to compile (numba 0.68: a period takes 2.5 us in place
of 1.6 us, the first compilation 48 s instead of 41 s). A record made with `record` is passed as one pointer to all of
them. Records never change while compiled functions run: a value loaded once stays, whatever has been written to the
arrays meanwhile.

A type may have the lengths of the arrays in it: functions are compiled for these lengths then.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

Class = TypeVar("Class", bound=type[tuple[Any, ...]])
Named = TypeVar("Named", bound=tuple[Any, ...])


class RecordType(types.Type):
    """The type of a record: its class, the types of its fields, and the lengths that it is compiled for.

    lengths: of each field None, the value of an integer, or the shape of an array, None in it for an axis that may be
    of any length.
    """

    def __init__(self, kind: type, fields: dict[str, types.Type], lengths: dict[str, Any] | None = None) -> None:
        self.kind, self.fields, self.lengths = kind, fields, lengths or {}
        sizes = f"; {self.lengths}" if lengths else ""
        super().__init__(name=f"{kind.__module__}.{kind.__qualname__}({', '.join(map(str, fields.values()))}{sizes})")

    @property
    def key(self) -> tuple[Any, ...]:
        """The key of a type."""
        return self.kind, *self.fields.items(), *self.lengths.items()


#: of each class the names of integers that are lengths, and the number of first axes that may be of any length
_LENGTHS: dict[type, tuple[Sequence[str], int]] = {}


def record(kind: Class) -> Class:
    """Make a class of named tuples a record of compiled functions."""
    return record_with()(kind)


def record_with(sizes: Sequence[str] = (), free_axes: int = 0) -> Callable[[Class], Class]:
    """As `record`; sizes: integers that are lengths; free_axes: so many first axes of arrays may be of any length."""

    def made(kind: Class) -> Class:
        _LENGTHS[kind] = sizes, free_axes

        @typeof_impl.register(kind)
        def type_of(values, context):
            return _type(values)

        return kind

    return made


def room(kind: type[Named], sizes: Mapping[str, int], **given: Any) -> Named:
    """Return a record of zeros. given: fields that are something else.

    Fields are annotated with their shapes, whose words are sizes or numbers, and unless they are floats with a type:
    `Annotated[np.ndarray, "s 2m", complex]` is of shape (sizes["s"], 2 * sizes["m"]).
    """
    known = {"": 1, **sizes}
    made: dict[str, Any] = {
        name: number() if shape is None else np.zeros([factor * known[size] for factor, size in shape], number)
        for name, shape, number in _fields_with_room(kind)
        if name not in given
    }
    return kind(**made, **given)


@functools.cache
def _fields_with_room(kind: type) -> list[tuple[str, list[tuple[int, str]] | None, type]]:
    """Return name, shape (None: a number) and type of number of each annotated field of a record."""
    fields: list[tuple[str, list[tuple[int, str]] | None, type]] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if hint in (bool, int, float):
            fields.append((name, None, hint))
        if get_origin(hint) is Annotated:
            words, number = (*hint.__metadata__, float)[:2]
            parts = [re.fullmatch(r"(\d*)(\w*)", word) for word in words.split()]
            fields.append((name, [(int(part[1] or 1), part[2]) for part in parts if part], number))
    return fields


def is_record(value: Any) -> bool:
    """Whether a value is a record of compiled functions."""
    return type(value) in _LENGTHS


def sized_type(values: Any) -> RecordType:
    """Return the type of a record with the lengths of its arrays in it."""
    return _type(values, dict(zip(values._fields, lengths(values), strict=True)))


def lengths(values: Any) -> tuple[Any, ...]:
    """Return the lengths of a record's fields, as `RecordType` holds them."""
    sizes, free = _LENGTHS[type(values)]
    return tuple(
        (None,) * min(free, value.ndim) + value.shape[free:]
        if isinstance(value, np.ndarray)
        else (value if name in sizes else None)
        for name, value in zip(values._fields, values, strict=True)
    )


def _type(values: Any, of_lengths: dict[str, Any] | None = None) -> RecordType:
    fields = {name: typeof(value) for name, value in zip(values._fields, values, strict=True)}
    return RecordType(type(values), fields, of_lengths)


@register_model(RecordType)
class _Place(models.PrimitiveModel):
    """A pointer to the fields, each as numba holds it in a variable."""

    def __init__(self, manager, type):
        places = [manager.lookup(field).get_data_type() for field in type.fields.values()]
        super().__init__(manager, type, ir.LiteralStructType(places).as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, record, name):
        return record.fields.get(name)


@lower_getattr_generic(RecordType)
def _get(context, builder, type, value, name):
    """Load a field. All loads are marked as invariant."""
    field, length = type.fields[name], type.lengths.get(name)
    if isinstance(field, types.Integer) and length is not None:
        return context.get_constant(field, length)
    pointer = cgutils.gep_inbounds(builder, value, 0, list(type.fields).index(name))
    loaded = _load(builder, pointer, builder.module.add_metadata([]))
    whole = context.data_model_manager[field].from_data(builder, loaded)
    whole = whole if length is None else _with_lengths(context, builder, field, whole, length)
    return impl_ret_borrowed(context, builder, field, whole)


def _with_lengths(context: Any, builder: Any, field: Any, value: Any, shape: Sequence[int | None]) -> Any:
    """Return an array, ordered as in C, with these lengths and its strides known to the compiler."""
    array = context.make_array(field)(context, builder, value)
    lengths = [
        known if length is None else context.get_constant(types.intp, length)
        for length, known in zip(shape, cgutils.unpack_tuple(builder, array.shape), strict=True)
    ]
    strides = [context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(field.dtype)))]
    for length in reversed(lengths[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    array.shape, array.strides = (cgutils.pack_array(builder, parts) for parts in (lengths, strides))
    array.nitems = functools.reduce(builder.mul, lengths)
    return array._getvalue()


def _load(builder: Any, pointer: Any, never: Any) -> Any:
    """Load from a pointer, the parts of a structure one by one: a load of all would lose its mark."""
    kind = pointer.type.pointee
    if not isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        loaded = builder.load(pointer)
        loaded.set_metadata("invariant.load", never)
        return loaded
    whole = ir.Constant(kind, ir.Undefined)
    for i in range(len(kind)):
        entry = _load(builder, cgutils.gep_inbounds(builder, pointer, 0, i), never)
        whole = builder.insert_value(whole, entry, i)
    return whole


def changed(record: Named, name: str, number: float) -> Named:
    """Return a record with another number in a field: `changed(system, "period", 0.5)`, in compiled functions.

    It stays valid until the next change at the same line.
    """
    return record._replace(**{name: number})  # type: ignore[attr-defined]


@overload(changed, inline="always", prefer_literal=True)
def _changed_compiled(record, name, number):
    return lambda record, name, number: _changed(record, name, number)


@intrinsic
def _changed(typing_context, record, name, number):
    """Put a copy of the fields, with another number, on the stack."""

    def code(context, builder, signature, values):
        kind = context.get_value_type(record).pointee
        copy = cgutils.alloca_once(builder, kind)
        builder.store(builder.load(values[0]), copy)
        index = list(record.fields).index(name.literal_value)
        builder.store(values[2], cgutils.gep_inbounds(builder, copy, 0, index))
        # loads from a record are marked as invariant: none may be taken from before this point
        pointer = cgutils.alloca_once(builder, copy.type)
        builder.store_atomic(copy, pointer, "seq_cst", 8)
        builder.fence("seq_cst")
        return builder.load_atomic(pointer, "seq_cst", 8)

    if not (isinstance(record, RecordType) and isinstance(name, types.StringLiteral)):
        return None
    return record(record, name, record.fields[name.literal_value]), code


@unbox(RecordType)
def _take(type, values, c):
    """Put the fields on the stack of the call from Python."""
    pointer = cgutils.alloca_once(c.builder, c.context.get_value_type(type).pointee)
    failed = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    cleanups = []
    for i, field in enumerate(type.fields.values()):
        native = c.unbox(field, c.pyapi.tuple_getitem(values, i))
        data = c.context.data_model_manager[field].as_data(c.builder, native.value)
        c.builder.store(data, cgutils.gep_inbounds(c.builder, pointer, 0, i))
        with c.builder.if_then(native.is_error, likely=False):
            c.builder.store(cgutils.true_bit, failed)
        if native.cleanup is not None:
            cleanups.append(native.cleanup)

    def cleanup():
        for one in reversed(cleanups):
            one()

    return NativeValue(pointer, cleanup=cleanup if cleanups else None, is_error=c.builder.load(failed))
