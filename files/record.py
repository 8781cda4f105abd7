"""Records by declaration: fields declare dimensions and units once; file, JSON and data set follow.

    @dataclass(frozen=True, eq=False, repr=False)
    class Decay(Record):
        KIND: ClassVar[str] = "decay"
        time: Annotated[np.ndarray, Array(("time",), "s")]
        amplitude: Annotated[np.ndarray, Array(("time", "body"), "m")]
        status: str

A field is an array (Array), arrays by name (NamedArrays), a tuple of small records of one class, whose fields are
columns (RecordRows), a tuple of parts that have arrays of different lengths (Ragged), arrays by dotted path (Paths), a
sparse matrix (SparseMatrix), another record in the same file (Within), or plain data that pydantic accepts: an
attribute of the file.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Container, Mapping, Sequence
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
    variables, _real and `imaginary`; name: in the file ("": that of the field); json: in JSON ("": that in the file);
    attribute: whether the file has it as an attribute. A field with a default may miss in files; what is None or
    `empty` is not written.
    """

    dims: tuple[str, ...]
    unit: str = "1"
    dtype: Any = float
    name: str = ""
    json: str = ""
    attribute: bool = False
    imaginary: str = "_imaginary"


class RecordRows(NamedTuple):
    """A tuple of dataclasses, a variable "<dim>_<field>" for each of their fields, whose units are `NumberUnit`s.

    Fields with defaults are omitted if all rows have these.
    """

    dim: str


class NamedArrays(NamedTuple):
    """A mapping of arrays by name, a variable each: of a table that knows unit, further dims and dtype of every name.

    table: returns it; dims: first dimensions of all of them; prefix: of names in the file; in_json: returns the
    part of the table that JSON has (None: all).
    """

    table: Callable[[], Mapping[str, Any]]
    dims: tuple[str, ...] = ()
    prefix: str = ""
    in_json: Callable[[], Mapping[str, Any]] | None = None


class Ragged(NamedTuple):
    """A tuple of dataclasses with declared fields, each with rows of its own number along `dim`.

    The rows of all follow one another, and "<thing>_of_<dim>" has the owner of each. Fields without rows are variables
    along `thing`; RecordRows have "<dim of the rows>_<thing>" in the same way. prefix: of names and `dim` in the file.
    """

    thing: str
    dim: str
    prefix: str = ""


class Paths(NamedTuple):
    """A mapping of arrays by dotted path, a variable each, along itself.

    called, unit: return name and unit of a path; dim: along it instead, and before the names; listed: variable with the
    paths ("": the attribute of the field's name).
    """

    called: Callable[[str], str]
    unit: Callable[[str], str]
    dim: str = ""
    listed: str = ""

    def name(self, path: str) -> str:
        """Return the name of the variable of a path."""
        return f"{self.dim}_{self.called(path)}" if self.dim else self.called(path)

    def written(self, _: str, arrays: Mapping[str, Any]) -> dict[str, store.Variable]:
        """Return the variables of the file."""
        return {
            self.name(path): store.Variable(values, (self.dim or self.called(path),), self.unit(path))
            for path, values in arrays.items()
        }

    def read(self, field: str, values: Mapping[str, Any], attributes: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the arrays in a file."""
        paths = values[self.listed] if self.listed else attributes[field]
        arrays = {path: values[self.name(path)] for path in paths}
        return {path: store.frozen(array, array.dtype) for path, array in arrays.items()}


class SparseMatrix(NamedTuple):
    """A square sparse matrix, compressed by rows: its entries, "<name>_column" and "<name>_row_start"."""

    unit: str

    def written(self, name: str, matrix: Any) -> dict[str, store.Variable]:
        """Return the variables of the file."""
        entry = (f"{name}_entry",)
        return {
            name: store.Variable(matrix.data, entry, self.unit),
            f"{name}_column": store.Variable(matrix.indices, entry),
            f"{name}_row_start": store.Variable(matrix.indptr, ("row_edge",)),
        }

    def read(self, name: str, values: Mapping[str, Any], _: Mapping[str, Any]) -> Any:
        """Return the matrix in a file."""
        from scipy.sparse import csr_array

        starts = values[f"{name}_row_start"]
        return csr_array((values[name], values[f"{name}_column"], starts), (len(starts) - 1,) * 2)


class Own(NamedTuple):
    """A field with functions that return its variables, and read it from the variables of a file.

    Without: one that its class writes and reads by itself, in `variables`, `attributes`, `derived` and `of`.
    """

    variables: Callable[[Any], dict[str, store.Variable]] | None = None
    read: Callable[[Mapping[str, Any]], Any] | None = None


class Within(NamedTuple):
    """A record in the same file, or None where that lacks its first field; JSON has some of its fields."""

    json: tuple[str, ...] = ()


class NumberUnit(NamedTuple):
    """The unit of a number."""

    unit: str


class Named(NamedTuple):
    """Plain data whose attribute and key have another name than the field."""

    name: str


class Coded(NamedTuple):
    """Plain data of a class that is no plain data: to it, and from it with the path of the file."""

    encode: Callable[[Any], Any]
    decode: Callable[[Any, str], Any]


Layout = (
    Array | NamedArrays | RecordRows | Ragged | Paths | SparseMatrix | Within | Own | Named | Coded | NumberUnit | None
)
#: layouts of fields that are not attributes
_VARIABLES = (NamedArrays, RecordRows, Ragged, Paths, SparseMatrix, Within, Own)


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
        """Return the names, or numbers, along dimensions that have some, by dimension."""
        return {}

    def dimensions(self) -> dict[str, tuple[str, ...]]:
        """Return the actual dimensions by declared dimension, such as the axes of a grid."""
        return {}

    def dims(self, declared: tuple[str, ...]) -> tuple[str, ...]:
        """Return dimensions as the file names them."""
        lengths = self.dimensions()
        return tuple(dim for name in declared for dim in lengths.get(name, (name,)))

    def unit_in_file(self, declared: str) -> str:
        """Return the unit of declared fields, some of which stand for that of a number, such as a parameter's."""
        return declared

    def derived(self) -> dict[str, Any]:
        """Return the entries of JSON besides the fields, or instead of one."""
        return {}

    def variables(self) -> dict[str, store.Variable]:
        """Return the variables of the file."""
        variables, optional = {}, _optional(type(self))
        for name, (kind, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if isinstance(layout, Array) and not layout.attribute and not _missing(value, name in optional):
                stored = np.asarray(value, np.int8 if layout.dtype is bool else layout.dtype)
                for suffix, values in _parts(stored, layout.imaginary).items():
                    dims, unit = self.dims(layout.dims), self.unit_in_file(layout.unit)
                    variables[(layout.name or name) + suffix] = store.Variable(values, dims, unit)
            elif isinstance(layout, NamedArrays):
                for key, values in value.items():
                    entry = layout.table()[key]
                    dims = self.dims((*layout.dims, *entry.dims))
                    variables[layout.prefix + key] = store.Variable(values, dims, entry.unit)
            elif isinstance(layout, RecordRows) and (value or name not in optional):
                variables |= _row_variables(value, get_args(kind)[0], layout.dim, self.unit_in_file)
            elif isinstance(layout, Ragged) and (value or name not in optional):
                variables |= self._ragged_variables(value, get_args(kind)[0], layout)
            elif isinstance(layout, Within):
                variables |= value.variables() if value is not None else {}
            elif isinstance(layout, Paths | SparseMatrix):
                variables |= layout.written(name, value)
            elif isinstance(layout, Own) and layout.variables and value is not None:
                variables |= layout.variables(value)
        return variables | {
            dim: store.Variable(names if isinstance(names, np.ndarray) else np.array(list(names), object), (dim,))
            for dim, names in self.labels().items()
        }

    def _ragged_variables(self, parts: Sequence[Any], kind: type, ragged: Ragged) -> dict[str, store.Variable]:
        """Return the variables of parts (Ragged)."""
        variables, (thing, dim, prefix) = dict[str, store.Variable](), ragged
        counts = [0] * len(parts)
        for field, (of, layout) in declared(kind).items():
            column = [getattr(part, field) for part in parts]
            if isinstance(layout, RecordRows):
                whose = np.repeat(np.arange(len(parts)), [len(rows) for rows in column])
                rows = [row for entries in column for row in entries]
                variables |= _row_variables(rows, get_args(of)[0], prefix + layout.dim, self.unit_in_file)
                variables[f"{prefix}{layout.dim}_{thing}"] = store.Variable(whose, (prefix + layout.dim,))
            elif isinstance(layout, NamedArrays):
                for name, values in joined(column, counts).items():
                    entry = layout.table()[name]
                    variables[prefix + layout.prefix + name] = store.Variable(
                        values, (prefix + dim, *entry.dims), entry.unit
                    )
            elif isinstance(layout, Array) and layout.dims[0] == dim:
                values, counts = np.concatenate(column), [len(own) for own in column]
                stored = values.astype(np.int8) if layout.dtype is bool else values
                for suffix, array in _parts(stored, layout.imaginary).items():
                    name, dims = prefix + (layout.name or field) + suffix, (prefix + dim, *layout.dims[1:])
                    variables[name] = store.Variable(array, dims, self.unit_in_file(layout.unit))
            else:
                dtype, unit, dims = _column(of, layout)
                name = prefix + _name(field, layout)
                variables[name] = store.Variable(np.array(column, dtype), (thing, *dims), self.unit_in_file(unit))
        sizes = {
            dim: size
            for entry in variables.values()
            for dim, size in zip(entry.dims, np.shape(entry.values), strict=False)
        }
        for name, entry in variables.items():  # arrays without rows have lost their further dimensions
            if np.ndim(entry.values) < len(entry.dims):
                shape = [sizes.get(dim, 0) for dim in entry.dims]
                variables[name] = entry._replace(values=np.reshape(entry.values, shape))
        variables[f"{thing}_of_{dim}"] = store.Variable(np.repeat(np.arange(len(parts)), counts), (prefix + dim,))
        return variables

    def plain(self, names: Container[str] | None = None) -> dict[str, Any]:
        """Return the fields that are neither arrays nor rows, as plain data. names: of those wanted; None: all."""
        return {
            _name(name, layout): layout.encode(getattr(self, name))
            if isinstance(layout, Coded)
            else _adapter(kind).dump_python(getattr(self, name), mode="json")
            for name, (kind, layout) in declared(type(self)).items()
            if not isinstance(layout, (Array, *_VARIABLES)) and (names is None or name in names)
        }

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the file: numbers and texts as they are, other data as JSON.

        None and optional tables without an entry are left out, but for the provenance.
        """
        optional = _optional(type(self))
        attributes = {
            name: json.dumps(value) if isinstance(value, list) else value
            for name, value in self.plain().items()
            if value is not None and (value != {} or name not in optional or name == "provenance")
        }
        for name, (kind, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if isinstance(layout, Array) and layout.attribute and not _missing(value, name in optional):
                attributes[layout.name or name] = list(value) if _is_tuple(kind) else value
            elif isinstance(layout, Paths) and not layout.listed:
                attributes[name] = list(value)
            elif isinstance(layout, Within) and value is not None:
                attributes |= value.attributes()
        return attributes

    def to_json(self) -> dict[str, Any]:
        """Return the record as plain data, arrays as nested lists."""
        wanted = self.IN_JSON
        if wanted is None:
            wanted = tuple(name for name in declared(type(self)) if name != "provenance")
        return self._in_json(wanted) | self.derived()

    def _in_json(self, wanted: tuple[str, ...]) -> dict[str, Any]:
        """Return some fields as plain data."""
        data = self.plain(wanted)
        for name, (_, layout) in declared(type(self)).items():
            value = getattr(self, name)
            if name not in wanted:
                continue
            if isinstance(layout, Array) and value is not None:
                for suffix, values in _parts(np.asarray(value), layout.imaginary).items():
                    data[(layout.json or layout.name or name) + suffix] = values.tolist()
            elif isinstance(layout, NamedArrays):
                entries = (layout.in_json or layout.table)()
                data |= {layout.prefix + key: values.tolist() for key, values in value.items() if key in entries}
            elif isinstance(layout, RecordRows):
                data[name] = [dataclasses.asdict(row) for row in value]
            elif isinstance(layout, Paths):
                data[name] = {path: values.tolist() for path, values in value.items()}
            elif isinstance(layout, Within):
                data |= value._in_json(layout.json)
        return data

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
        """Return the fields in a file by name, except those written by the class itself."""
        fields: dict[str, Any] = {}
        optional = _optional(cls)
        for field, (kind, layout) in declared(cls).items():
            if isinstance(layout, Array):
                name, source = layout.name or field, attributes if layout.attribute else values
                if field in optional and name not in source and f"{name}_real" not in source:
                    continue
                if layout.dtype is complex:
                    fields[field] = source[f"{name}_real"] + 1j * source[name + layout.imaginary]
                else:
                    fields[field] = tuple(np.asarray(source[name]).tolist()) if _is_tuple(kind) else source[name]
            elif isinstance(layout, NamedArrays):
                fields[field] = {
                    name: store.frozen(array, entry.dtype)
                    for name, (array, entry) in _arrays_of(values, layout).items()
                }
            elif isinstance(layout, RecordRows):
                of = get_args(kind)[0]
                if field not in optional or f"{layout.dim}_{next(iter(_columns(of)))}" in values:
                    fields[field] = _rows_of(values, of, layout.dim)
            elif isinstance(layout, Ragged):
                fields[field] = _parts_of(values, get_args(kind)[0], layout)
            elif isinstance(layout, Within):
                of = (get_args(kind) or (kind,))[0]
                if field not in optional or next(iter(declared(of))) in values:
                    fields[field] = of.of(values, attributes, path)
            elif isinstance(layout, Paths | SparseMatrix):
                fields[field] = layout.read(field, values, attributes)
            elif isinstance(layout, Own):
                fields |= {field: layout.read(values)} if layout.read else {}
            elif (name := _name(field, layout)) in attributes or field not in optional:
                value = attributes.get(name) if type(None) in get_args(kind) else attributes[name]
                value = json.loads(value) if isinstance(value, str) and not _is_text(kind) else value
                coded = layout if isinstance(layout, Coded) else None
                fields[field] = coded.decode(value, path) if coded else _adapter(kind).validate_python(value)
        return fields


def declared(cls: Any) -> Mapping[str, tuple[Any, Layout]]:
    """Return type and layout of every field of a record; None: plain data."""
    return _declared(cls)


@cache
def _declared(cls: type) -> dict[str, tuple[Any, Layout]]:
    layouts: dict[str, tuple[Any, Layout]] = {}
    hints = get_type_hints(cls, include_extras=True)
    for item in dataclasses.fields(cls):
        kind, *notes = get_args(hints[item.name]) if get_origin(hints[item.name]) is Annotated else (hints[item.name],)
        layout = next(
            (note for note in notes if isinstance(note, (Array, *_VARIABLES, Named, Coded, NumberUnit))), None
        )
        layouts[item.name] = (kind, layout)
    return layouts


def joined(columns: Sequence[Mapping[str, np.ndarray]], counts: Sequence[int]) -> dict[str, np.ndarray]:
    """Return arrays by name one after the other; nan, or no text, where one of some counts of rows has none."""
    arrays = dict[str, np.ndarray]()
    for name, array in {name: values for table in columns for name, values in table.items()}.items():
        nothing = "" if array.dtype == object else np.nan
        rows = (
            table[name] if name in table else np.full((count, *array.shape[1:]), nothing, array.dtype)
            for table, count in zip(columns, counts, strict=True)
        )
        arrays[name] = np.concatenate(list(rows))
    return arrays


def _arrays_of(values: Mapping[str, Any], layout: NamedArrays, prefix: str = "") -> dict[str, tuple[Any, Any]]:
    """Return the arrays of a file that a table lists, with their entries in it, by name."""
    entries = {name: (prefix + layout.prefix + name, entry) for name, entry in layout.table().items()}
    return {name: (values[at], entry) for name, (at, entry) in entries.items() if at in values}


def _parts_of(values: Mapping[str, Any], kind: Any, ragged: Ragged) -> tuple[Any, ...]:
    """Return the parts in the variables of a file (Ragged)."""
    thing, dim, prefix = ragged
    whose = values.get(f"{thing}_of_{dim}", np.zeros(0, int))
    columns: dict[str, Sequence[Any]] = {}
    for field, (of, layout) in declared(kind).items():
        name = prefix + _name(field, layout)
        if isinstance(layout, Array) and layout.dtype is complex and f"{name}_real" in values:
            columns[field] = values[f"{name}_real"] + 1j * values[name + layout.imaginary]
        elif isinstance(layout, RecordRows) and f"{prefix}{layout.dim}_{thing}" in values:
            columns[field] = _rows_of(values, get_args(of)[0], prefix + layout.dim)
        elif name in values:
            columns[field] = values[name]
    of_things = [len(columns[field]) for field in columns if not _has_rows(kind, field, dim)]
    return tuple(
        kind(**_part(values, kind, ragged, columns, number, whose == number))
        for number in range(of_things[0] if of_things else int(whose.max(initial=-1)) + 1)
    )


def _has_rows(kind: Any, field: str, dim: str) -> bool:
    layout = declared(kind)[field][1]
    return isinstance(layout, RecordRows | NamedArrays) or (isinstance(layout, Array) and layout.dims[0] == dim)


def _part(
    values: Mapping[str, Any], kind: Any, ragged: Ragged, columns: Mapping[str, Sequence[Any]], number: int,
    rows: np.ndarray,
) -> dict[str, Any]:  # fmt: skip
    """Return the fields of one of the parts in a file; rows: the indices of its own."""
    fields = dict[str, Any]()
    for field, (of, layout) in declared(kind).items():
        if isinstance(layout, NamedArrays):
            named = _arrays_of(values, layout, ragged.prefix)
            fields[field] = {name: store.frozen(array[rows], entry.dtype) for name, (array, entry) in named.items()}
        elif field not in columns:
            continue
        elif isinstance(layout, RecordRows):
            whose = values[f"{ragged.prefix}{layout.dim}_{ragged.thing}"]
            fields[field] = tuple(columns[field][index] for index in np.flatnonzero(whose == number))
        elif isinstance(layout, Array) and layout.dims[0] == ragged.dim:
            fields[field] = store.frozen(np.asarray(columns[field])[rows], layout.dtype)
        else:
            value = np.asarray(columns[field][number], _column(of, layout)[0])
            fields[field] = tuple(value.tolist()) if _is_tuple(of) else value.item() if value.ndim == 0 else value
    return fields


def _name(field: str, layout: Layout) -> str:
    return (layout.name if isinstance(layout, Array | Named) else "") or field


def _column(kind: Any, layout: Layout) -> tuple[Any, str, tuple[str, ...]]:
    """Return type, unit and further dimensions of a column of fields."""
    if isinstance(layout, Array):
        return layout.dtype, layout.unit, layout.dims
    dtype = object if kind is str else np.int64 if kind is int else kind
    return dtype, layout.unit if isinstance(layout, NumberUnit) else "1", ()


def _parts(values: np.ndarray, imaginary: str) -> dict[str, np.ndarray]:
    """Return an array by the endings of its names: a complex one as a pair."""
    return {"_real": values.real, imaginary: values.imag} if np.iscomplexobj(values) else {"": values}


def _is_frozen(value: Any, dtype: Any) -> bool:
    """Whether a value is a result of `store.frozen`, so that records made from other records need no copies."""
    frozen = isinstance(value, np.ndarray) and value.base is None and not value.flags.writeable
    return frozen and value.dtype == dtype and value.flags.c_contiguous


def _missing(value: Any, optional: bool) -> bool:
    return value is None or (optional and np.size(value) == 0)


def _optional(cls: Any) -> set[str]:
    """Return the fields that have a default."""
    none = dataclasses.MISSING
    return {item.name for item in dataclasses.fields(cls) if not (item.default is item.default_factory is none)}


def _row_variables(
    rows: Sequence[Any], kind: type, dim: str, unit_of: Callable[[str], str]
) -> dict[str, store.Variable]:
    """Return the variables of rows of a class."""
    columns, optional = _columns(kind), _optional(kind)
    if all(getattr(row, name) == getattr(kind, name) for row in rows for name in optional):
        columns = {name: column for name, column in columns.items() if name not in optional}
    return {
        f"{dim}_{name}": store.Variable(
            np.array([getattr(row, name) for row in rows], dtype), (dim, *dims), unit_of(unit)
        )
        for name, (dtype, unit, dims) in columns.items()
    }


def _rows_of(values: Mapping[str, Any], kind: Callable[..., Row], dim: str) -> tuple[Row, ...]:
    """Return the rows of a class in the variables of a file."""
    optional = _optional(kind)
    columns = {
        name: map(store.frozen, values[f"{dim}_{name}"]) if dims else values[f"{dim}_{name}"].tolist()
        for name, (_, _, dims) in _columns(kind).items()
        if name not in optional or f"{dim}_{name}" in values
    }
    return tuple(kind(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))


@cache
def _columns(kind: Any) -> dict[str, tuple[Any, str, tuple[str, ...]]]:
    """Return type, unit and further dimensions of every field of the dataclass of rows."""
    return {name: _column(of, layout) for name, (of, layout) in declared(kind).items()}


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def _is_tuple(kind: Any) -> bool:
    """Whether a type is a tuple, or a tuple or None."""
    kinds = get_args(kind) if type(None) in get_args(kind) else (kind,)
    return any(get_origin(option) is tuple for option in kinds)


def _is_text(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, str)
