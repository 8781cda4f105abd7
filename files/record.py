"""Records by declaration: a field says its dimensions and unit once; file, JSON and data set come from that.

    @dataclass(frozen=True, eq=False, repr=False)
    class Decay(Record):
        KIND: ClassVar[str] = "decay"
        time: Annotated[np.ndarray, Array(("time",), "s")]
        amplitude: Annotated[np.ndarray, Array(("time", "body"), "m")]
        status: str

A field is an array (Array), arrays by name (Columns), a tuple of small records of one class, whose fields are columns
(Rows), or plain data that pydantic knows: an attribute of the file.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Container, Iterable, Mapping
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    Self,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)  # fmt: skip

import numpy as np

from vanedamp.files import store
from vanedamp.files.display import Displayed

if TYPE_CHECKING:
    import xarray
    from pydantic import TypeAdapter


Row = TypeVar("Row")


class Array(NamedTuple):
    """An array of a record.

    dims: names of its dimensions; unit: "1" without; dtype: of its elements, object for texts, complex for a pair of
    variables, _real and _imaginary; name: in the file ("": that of the field); json: in JSON ("": that in the file);
    attribute: whether the file has it as an attribute. A field with a default may miss in files; what is None or
    `empty` is not written.
    """

    dims: tuple[str, ...]
    unit: str = "1"
    dtype: Any = float
    name: str = ""
    json: str = ""
    attribute: bool = False


class Rows(NamedTuple):
    """A tuple of dataclasses, a variable "<dim>_<field>" for each of their fields, whose units are `Unit`s."""

    dim: str


class Columns(NamedTuple):
    """A mapping of arrays by name, a variable each: of a table that knows unit, further dims and dtype of every name.

    known: returns the table; dims: first dimensions of all of them; prefix: of names in the file.
    """

    known: Callable[[], Mapping[str, Any]]
    dims: tuple[str, ...] = ()
    prefix: str = ""


class Own(NamedTuple):
    """A field that its class writes and reads by itself, in `variables`, `attributes`, `derived` and `of`."""


class Unit(NamedTuple):
    """The unit of a number."""

    unit: str


class Coded(NamedTuple):
    """Plain data of a class that is no plain data: to it, and from it with the path of the file."""

    encode: Callable[[Any], Any]
    decode: Callable[[Any, str], Any]


Layout = Array | Columns | Rows | Own | Coded | None


def empty() -> np.ndarray:
    """Return the default of an array that may miss: field(default_factory=empty)."""
    return store.frozen(())


class Record(Displayed):
    """Base of results in files: a frozen dataclass; see the module."""

    KIND: ClassVar[str]
    #: fields that JSON has; None: all
    IN_JSON: ClassVar[tuple[str, ...] | None] = None

    def __post_init__(self) -> None:
        for name, (kind, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if isinstance(layout, Array) and value is not None and not _is_tuple(kind):
                if not _is_frozen(value, layout.dtype):
                    object.__setattr__(self, name, store.frozen(value, layout.dtype))
            elif isinstance(value, np.generic):
                object.__setattr__(self, name, value.item())

    def labels(self) -> dict[str, Any]:
        """Return the names along dimensions that have some, by dimension."""
        return {}

    def dimensions(self) -> dict[str, tuple[str, ...]]:
        """Return what dimensions of declared fields stand for, such as those of a grid, by name."""
        return {}

    def dims(self, declared: tuple[str, ...]) -> tuple[str, ...]:
        """Return dimensions as the file names them."""
        own = self.dimensions()
        return tuple(dim for name in declared for dim in own.get(name, (name,)))

    def derived(self) -> dict[str, Any]:
        """Return what JSON has besides the fields, or in place of one."""
        return {}

    def variables(self) -> dict[str, store.Variable]:
        """Return the variables of the file."""
        found, optional = {}, _optional(type(self))
        for name, (kind, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if isinstance(layout, Array) and not layout.attribute and not _missing(value, name in optional):
                stored = np.asarray(value, np.int8 if layout.dtype is bool else layout.dtype)
                for part, values in _parts(stored).items():
                    found[(layout.name or name) + part] = store.Variable(values, self.dims(layout.dims), layout.unit)
            elif isinstance(layout, Columns):
                for each, values in value.items():
                    one = layout.known()[each]
                    dims = self.dims((*layout.dims, *one.dims))
                    found[layout.prefix + each] = store.Variable(values, dims, one.unit)
            elif isinstance(layout, Rows):
                found |= row_variables(value, get_args(kind)[0], layout.dim)
        return found | {
            dim: store.Variable(np.array(list(names), object), (dim,)) for dim, names in self.labels().items()
        }

    def plain(self, names: Container[str] | None = None) -> dict[str, Any]:
        """Return the fields that are neither arrays nor rows, as plain data. names: of those wanted; None: all."""
        return {
            name: layout.encode(getattr(self, name))
            if isinstance(layout, Coded)
            else _adapter(kind).dump_python(getattr(self, name), mode="json")
            for name, (kind, layout) in declared(type(self)).items()
            if not isinstance(layout, Array | Columns | Rows | Own) and (names is None or name in names)
        }

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the file: numbers and texts as they are, other data as JSON.

        None and optional tables without an entry are left out, but for the provenance.
        """
        optional = _optional(type(self))
        found = {
            name: json.dumps(value) if isinstance(value, list) else value
            for name, value in self.plain().items()
            if value is not None and (value != {} or name not in optional or name == "provenance")
        }
        for name, (kind, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if isinstance(layout, Array) and layout.attribute and not _missing(value, name in optional):
                found[layout.name or name] = list(value) if _is_tuple(kind) else value
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain data, arrays as nested lists."""
        wanted = self.IN_JSON
        if wanted is None:
            wanted = tuple(name for name in declared(type(self)) if name != "provenance")
        found = self.plain(wanted)
        for name, (_, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if name not in wanted:
                continue
            if isinstance(layout, Array) and value is not None:
                for part, values in _parts(np.asarray(value)).items():
                    found[(layout.json or layout.name or name) + part] = values.tolist()
            elif isinstance(layout, Columns):
                found |= {layout.prefix + each: values.tolist() for each, values in value.items()}
            elif isinstance(layout, Rows):
                found[name] = [dataclasses.asdict(row) for row in value]
        return found | self.derived()

    def to_xarray(self) -> xarray.Dataset:
        """Return the data set of xarray, which must be installed, that the file opens as."""
        return store.dataset(self.variables(), self.attributes())

    def save(
        self,
        path: str | os.PathLike[str],
        variables: Mapping[str, store.Variable] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> None:
        """Write HDF5 that xarray opens; further variables and attributes ride along. Raises files.store.StoreError."""
        further, named = dict(variables or {}), dict(attributes or {})
        store.save(path, self.KIND, self.variables() | further, self.attributes() | named)

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        return cls.of(*store.load(path, cls.KIND), os.fspath(path))

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Self:
        """Return the record in the variables and attributes of a file."""
        return cls(**cls.given(values, attributes, path))

    @classmethod
    def given(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> dict[str, Any]:
        """Return the fields in a file by name, but those of its Own."""
        given: dict[str, Any] = {}
        optional = _optional(cls)
        for field, (kind, layout) in declared(cls).items():
            if isinstance(layout, Array):
                name, held = layout.name or field, attributes if layout.attribute else values
                if field in optional and name not in held and f"{name}_real" not in held:
                    continue
                if layout.dtype is complex:
                    given[field] = held[f"{name}_real"] + 1j * held[f"{name}_imaginary"]
                else:
                    given[field] = tuple(np.asarray(held[name]).tolist()) if _is_tuple(kind) else held[name]
            elif isinstance(layout, Columns):
                given[field] = {
                    name: store.frozen(values[layout.prefix + name], one.dtype)
                    for name, one in layout.known().items()
                    if layout.prefix + name in values
                }
            elif isinstance(layout, Rows):
                given[field] = rows_of(values, get_args(kind)[0], layout.dim)
            elif not isinstance(layout, Own) and (field in attributes or field not in optional):
                value = attributes.get(field) if type(None) in get_args(kind) else attributes[field]
                value = json.loads(value) if isinstance(value, str) and not _is_text(kind) else value
                coded = layout if isinstance(layout, Coded) else None
                given[field] = coded.decode(value, path) if coded else _adapter(kind).validate_python(value)
        return given


def declared(cls: Any) -> Mapping[str, tuple[Any, Layout]]:
    """Return type and layout of every field of a record; None: plain data."""
    return _declared(cls)


@cache
def _declared(cls: type) -> dict[str, tuple[Any, Layout]]:
    found: dict[str, tuple[Any, Layout]] = {}
    hints = get_type_hints(cls, include_extras=True)
    for item in dataclasses.fields(cls):
        kind, *notes = get_args(hints[item.name]) if get_origin(hints[item.name]) is Annotated else (hints[item.name],)
        layout = next((note for note in notes if isinstance(note, Array | Columns | Rows | Own | Coded)), None)
        found[item.name] = (kind, layout)
    return found


def _parts(values: np.ndarray) -> dict[str, np.ndarray]:
    """Return an array by the endings of its names: a complex one as a pair."""
    return {"_real": values.real, "_imaginary": values.imag} if np.iscomplexobj(values) else {"": values}


def _is_frozen(value: Any, dtype: Any) -> bool:
    """Whether a value is what `store.frozen` returns, so that records that are made of others need no copies."""
    own = isinstance(value, np.ndarray) and value.base is None and not value.flags.writeable
    return own and value.dtype == dtype and value.flags.c_contiguous


def _missing(value: Any, optional: bool) -> bool:
    return value is None or (optional and np.shape(value) == (0,))


def _optional(cls: Any) -> set[str]:
    """Return the fields that have a default."""
    none = dataclasses.MISSING
    return {item.name for item in dataclasses.fields(cls) if not (item.default is item.default_factory is none)}


def row_variables(rows: Iterable[Any], kind: type, dim: str) -> dict[str, store.Variable]:
    """Return the variables of rows of a class (Rows)."""
    rows = list(rows)
    return {
        f"{dim}_{name}": store.Variable(np.array([getattr(row, name) for row in rows], dtype), (dim,), unit)
        for name, (dtype, unit) in _columns(kind).items()
    }


def rows_of(values: Mapping[str, Any], kind: Callable[..., Row], dim: str) -> tuple[Row, ...]:
    """Return the rows of a class in the variables of a file."""
    return tuple(map(kind, *(values[f"{dim}_{name}"].tolist() for name in _columns(kind))))


@cache
def _columns(kind: Any) -> dict[str, tuple[Any, str]]:
    """Return type and unit of every field of the dataclass of rows."""
    found = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        dtype, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        unit = next((note.unit for note in notes if isinstance(note, Unit)), "1")
        found[name] = (object if dtype is str else np.int64 if dtype is int else dtype, unit)
    return found


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def _is_tuple(kind: Any) -> bool:
    return get_origin(kind) is tuple


def _is_text(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, str)
