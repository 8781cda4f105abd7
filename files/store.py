"""Records on disk: one HDF5 layout for every result, readable by xarray and netCDF tools; tables and plain data.

The lowest layer of the project: it imports h5py and no other folder, so that every stage may write its records the
same way. A record is a set of named variables with dimensions and units, and flat attributes. h5py takes 12 MB: it is
imported where a file is read or written.
Dimension scales take ten lines of h5py; h5netcdf 1.8.2 would replace these only, as another dependency, and writes a
record in 14.5 ms, this file in 13.5 ms.
"""

from __future__ import annotations

import contextlib
import csv
import glob
import hashlib
import io
import json
import math
import os
import re
import shutil
import stat
import tempfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from functools import lru_cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO, TypeVar

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import apart, existing, reading, self_contained
from vanedamp.files.interrupts import uninterrupted

if TYPE_CHECKING:
    import h5py

SCHEMA_VERSION = 1

#: given each time: the default is the process's, which other packages change
_TRACK_ORDER = False
#: name of a dimension without a coordinate in netCDF-4
_NO_COORDINATE = "This is a netCDF dimension but not a netCDF variable."
#: folder of links to the open files of processes
_OPEN_FILES = Path("/proc")
#: the last bytes of a record's file, after HDF5's, which passes over them and drops them at a change
_SEAL, _SEAL_LENGTH = "\nvanedamp {:08x}\n", 19
#: bytes that are read at once
_PART = 1 << 20
_Class = TypeVar("_Class")
_Path = TypeVar("_Path", bound="str | os.PathLike[str]")
_Record = TypeVar("_Record")
#: files that wait for others to be put in place with (`together`)
_WAITING: ContextVar[list[tuple[Path, Path]] | None] = ContextVar("waiting", default=None)


class StoreError(VanedampError):
    """A file that cannot be read (missing, damaged, of another kind, of a newer schema) or cannot be written."""


class Variable(NamedTuple):
    """One array of a record: its values, the name of each dimension, and its unit ("1" if it has none)."""

    values: Any
    dims: Sequence[str] = ()
    units: str = "1"


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; rename it to `path` on success, remove it on any failure.

    A killed or failing writer thus leaves the old file or none, never half a file; an interrupt waits for its end. The
    temporary file keeps the suffix.
    A link stays one, and the file that it leads to is replaced. A device or a pipe gets the content once it is
    complete. Raises StoreError when it cannot be written: a full disk, no permission, no folder.
    """
    try:
        target = destination(path)
        if target is None:
            with tempfile.TemporaryDirectory() as folder:
                yield (content := Path(folder, Path(path).name))
                with content.open("rb") as source, open(path, "wb") as stream:
                    shutil.copyfileobj(source, stream)
            return
        if not target.parent.is_dir():
            raise StoreError(f"{path}: the folder {target.parent} does not exist; create it first")
        with uninterrupted():
            handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
            os.close(handle)
            temporary = Path(name)
            try:
                yield temporary
                _sync(temporary)
                mask = os.umask(0)
                os.umask(mask)
                temporary.chmod(0o666 & ~mask)
                if (waiting := _WAITING.get()) is None:
                    os.replace(temporary, target)
                else:
                    waiting.append((temporary, target))
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror or error})") from error


@contextlib.contextmanager
def together() -> Iterator[None]:
    """Put the files that `replacing` makes meanwhile in place at the end: all of them, or none after an error.

    Raises StoreError where one cannot be put in place.
    """
    waiting: list[tuple[Path, Path]] = []
    outer = _WAITING.set(waiting)
    try:
        yield
        with uninterrupted():
            while waiting:
                _put_in_place(*waiting[0])
                waiting.pop(0)
    finally:
        _WAITING.reset(outer)
        with uninterrupted():
            for temporary, _ in waiting:
                temporary.unlink(missing_ok=True)


def _put_in_place(temporary: Path, target: Path) -> None:
    try:
        os.replace(temporary, target)
    except OSError as error:
        raise StoreError(f"{target}: cannot be written ({error.strerror or error})") from error


def destination(path: str | os.PathLike[str]) -> Path | None:
    """Return the regular file, there or not yet, that a path leads to; None for a device, a pipe or an open file.

    Raises OSError for links that lead round in a circle.
    """
    target = Path(path)
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISREG(os.stat(target).st_mode):
            return None
    while target.is_symlink():
        if _OPEN_FILES in target.parent.resolve().parents:
            return None  # such as /dev/stdout: to replace it would leave the writer of the open file without one
        target = target.parent / os.readlink(target)
    return target


def _sync(path: Path) -> None:
    """Force a file to the disk: its new name must not reach it before the content."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def file_stamp(path: str | os.PathLike[str]) -> int:
    """Return a number that distinguishes a file from a later one of that name, and of that time."""
    file = Path(path)
    if not file.is_file():
        return 0
    status = file.stat()
    # copies and archives keep the time of the content; the time of the change cannot be set
    return hash((status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns))


def write_csv(path: str | os.PathLike[str], header: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table: one line of names, then the rows."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        _write_rows(stream, header, rows)


def csv_text(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return the text of the table that `write_csv` writes."""
    stream = io.StringIO(newline="")
    _write_rows(stream, header, rows)
    return stream.getvalue()


def _write_rows(stream: TextIO, header: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
    writer = csv.writer(stream)
    writer.writerow(header)
    writer.writerows(rows)


def write_json(path: str | os.PathLike[str], data: Any) -> None:
    """Write finite plain data as JSON."""
    with replacing(path) as temporary:
        temporary.write_text(json_text(data), encoding="utf-8")


def json_text(data: Any) -> str:
    """Return finite plain data as JSON. Raises ValueError for nan and infinity, which JSON lacks."""
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def digest(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file's bytes, which identifies the source of a result."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def finite(data: Any) -> Any:
    """Return plain data with None in place of nan and infinity."""
    if isinstance(data, Mapping):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def save(
    path: str | os.PathLike[str],
    kind: str,
    variables: Mapping[str, Variable],
    attributes: Mapping[str, Any] | None = None,
    compressed: bool = True,
) -> None:
    """Write a record of the given kind. A variable named like a dimension is that dimension's coordinate.

    compressed: large arrays, which takes ten times as long.

    Strings and lists of strings become UTF-8 text; dictionaries among the attributes become JSON text. Equal records
    become equal files, byte by byte. Raises StoreError when the file cannot be written: a full disk, no permission.
    """
    with uninterrupted():  # HDF5 calls Python, and would lose an interrupt there
        image = _image(kind, variables, attributes or {}, compressed)
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(image.getbuffer())
        stream.write(_SEAL.format(zlib.crc32(image.getbuffer())).encode())


def _image(
    kind: str, variables: Mapping[str, Variable], attributes: Mapping[str, Any], compressed: bool
) -> io.BytesIO:  # fmt: skip
    """Return the content of a record's file."""
    import h5py

    # in memory first: a write that fails within HDF5 ends the whole process, sooner or later
    image = io.BytesIO()
    with h5py.File(image, "w", track_order=_TRACK_ORDER) as file:
        file.attrs["kind"] = kind
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs.update(_texts(attributes))
        for name, variable in variables.items():
            _create(file, name, variable, compressed)
        lengths = _dimension_lengths(variables)
        for dimension, length in lengths.items():
            if dimension not in file:
                # a dimension without coordinate, marked as netCDF-4 marks it
                file.create_dataset(dimension, data=np.zeros(length, np.float32), track_order=_TRACK_ORDER)
                file[dimension].make_scale(f"{_NO_COORDINATE}{length:10d}")
            else:
                file[dimension].make_scale(dimension)
        for name, variable in variables.items():
            for axis, dimension in enumerate(variable.dims):
                if name != dimension:
                    file[name].dims[axis].attach_scale(file[dimension])
    return image


def dataset(variables: Mapping[str, Variable], attributes: Mapping[str, Any]) -> Any:
    """Return a record as an xarray.Dataset, as its file opens. Raises ModuleNotFoundError without xarray."""
    import xarray

    data_vars = {
        name: (tuple(item.dims), np.asarray(item.values), {"units": item.units}) for name, item in variables.items()
    }
    return xarray.Dataset(data_vars, attrs=_texts(attributes))


def _texts(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as a file holds them: dictionaries as JSON text."""
    return {
        name: json.dumps(value, sort_keys=True) if isinstance(value, dict) else value
        for name, value in attributes.items()
    }


def clear_leftovers(path: str | os.PathLike[str]) -> None:
    """Remove the temporary files that killed writers of `path` have left in its folder."""
    target = destination(path)
    if target is None:
        return
    for file in target.parent.glob(f".{glob.escape(target.stem)}-{'?' * 8}{glob.escape(target.suffix)}"):
        file.unlink(missing_ok=True)


def load(path: str | os.PathLike[str], kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a record: (variables by name as arrays, attributes). Raises StoreError with the file and the reason."""
    attributes, variables = _content(path)
    if attributes.get("kind") != kind:
        raise StoreError(f"{path}: holds {attributes.get('kind') or 'no record of ours'}, expected {kind}")
    values = {name: variable.values for name, variable in variables.items()}
    return _RecordFields(path, values), _attributes(path, attributes)


def load_any(path: str | os.PathLike[str]) -> tuple[str, dict[str, Variable], dict[str, Any]]:
    """Read a record of any kind: (kind, variables with dimensions and units, attributes). Raises StoreError."""
    attributes, variables = _content(path, dimensions=True)
    if attributes.get("kind") is None:
        raise StoreError(f"{path}: holds no record of ours")
    return str(attributes["kind"]), variables, _attributes(path, attributes)


def kind_of(path: str | os.PathLike[str]) -> str:
    """Return the kind of a record's file, "None" for HDF5 of others. Raises StoreError."""
    if not _sealed(path):
        return str(_content(path)[0].get("kind"))
    import h5py

    with h5py.File(path, "r") as file:
        return str(file.attrs.get("kind"))


@contextlib.contextmanager
def decoding(*paths: str | os.PathLike[str], expected: str = "not a readable record") -> Iterator[None]:
    """Raise StoreError for whatever is met in files, unless they are as we wrote them: then the fault is ours."""
    doubtful = [os.fspath(path) for path in paths if not _sealed(path)]
    if not doubtful:
        yield
        return
    with reading(", ".join(doubtful), StoreError, expected):
        yield


def reader(load: Callable[[_Class, _Path], _Record]) -> Callable[[_Class, _Path], _Record]:
    """Decorate a class's method that makes a record of its file: see `decoding`."""

    @wraps(load)
    def guarded(cls: _Class, path: _Path) -> _Record:
        with decoding(path):
            return load(cls, path)

    return guarded


def _content(path: str | os.PathLike[str], dimensions: bool = False) -> tuple[dict[str, Any], dict[str, Variable]]:
    """Return attributes and variables of a record's file. Raises StoreError for one that is missing or damaged.

    dimensions: names of dimensions and units as well, which takes longer, and no variables that stand for a dimension.
    """
    existing(path, StoreError)
    with decoding(path, expected="not a readable HDF5 file"):
        if _sealed(path):
            return _read_all(path, dimensions)
        return apart(path, StoreError, lambda: _read_all(path, dimensions))


def _read_all(path: str | os.PathLike[str], dimensions: bool) -> tuple[dict[str, Any], dict[str, Variable]]:
    import h5py

    with h5py.File(path, "r") as file:
        self_contained(file)
        attributes = {name: _plain(value) for name, value in file.attrs.items()}
        items = [(name, item) for name, item in file.items() if isinstance(item, h5py.Dataset)]
        if not dimensions:
            return attributes, {name: Variable(_read(item)) for name, item in items}
        return attributes, {
            name: Variable(_read(item), _dimensions(item, name), str(item.attrs.get("units", "1")))
            for name, item in items
            if not _without_coordinate(item)
        }


def _sealed(path: str | os.PathLike[str]) -> bool:
    """Whether a file ends with the checksum of its content; records before its introduction do not.

    Raises StoreError where the checksum is another's: the file has been damaged since.
    """
    stamp = file_stamp(path)
    return bool(stamp) and _checked(os.fspath(path), stamp)


@lru_cache(maxsize=64)
def _checked(path: str, stamp: int) -> bool:
    checksum, length = 0, os.path.getsize(path) - _SEAL_LENGTH
    with open(path, "rb") as stream:
        stream.seek(max(length, 0))
        seal = re.fullmatch(rb"\nvanedamp ([0-9a-f]{8})\n", stream.read())
        if seal is None:
            return False
        stream.seek(0)
        for start in range(0, length, _PART):
            checksum = zlib.crc32(stream.read(min(length - start, _PART)), checksum)
    if checksum != int(seal[1], 16):
        raise StoreError(f"{path}: damaged: its bytes are not those that were written; write it again")
    return True


def _attributes(path: str | os.PathLike[str], attributes: dict[str, Any]) -> dict[str, Any]:
    with decoding(path):
        version = int(attributes.get("schema_version", 0))
    if version > SCHEMA_VERSION:
        raise StoreError(f"{path}: schema version {version} is newer than {SCHEMA_VERSION}; update vanedamp")
    return _RecordFields(path, attributes)


def _dimensions(dataset: h5py.Dataset, name: str) -> tuple[str, ...]:
    """Return the names of a variable's dimensions; a coordinate's is its own."""
    return tuple(scales[0].name.lstrip("/") if len(scales) else name for scales in dataset.dims)


def _without_coordinate(dataset: h5py.Dataset) -> bool:
    """Whether a dataset only stands for a dimension, as netCDF-4 marks it."""
    return bytes(dataset.attrs.get("NAME", b"")).startswith(_NO_COORDINATE.encode())


class _RecordFields(dict[str, Any]):
    """The fields of a record by name; a missing one raises StoreError with the file."""

    def __init__(self, path: str | os.PathLike[str], values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self._path = path

    def __missing__(self, name: str) -> Any:
        raise StoreError(f"{self._path}: holds no {name!r}; the record is not whole, write it again")


def frozen(array: Any, dtype: Any = float) -> np.ndarray:
    """Return a contiguous read-only copy of an array, as frozen records hold it."""
    copy = np.array(array, dtype=dtype, order="C")
    copy.setflags(write=False)
    return copy


def read_only(array: np.ndarray) -> np.ndarray:
    """Return a read-only view of an array, as held by frozen records."""
    view = array.view()
    view.setflags(write=False)
    return view


def _dimension_lengths(variables: Mapping[str, Variable]) -> dict[str, int]:
    lengths: dict[str, int] = {}
    for name, variable in variables.items():
        shape = np.shape(variable.values)
        if len(shape) != len(variable.dims):
            raise ValueError(f"{name}: {len(variable.dims)} dimensions named for an array of shape {shape}")
        for dimension, length in zip(variable.dims, shape, strict=True):
            if lengths.setdefault(dimension, length) != length:
                earlier = lengths[dimension]
                raise ValueError(f"{name}: dimension {dimension} has length {length} here and {earlier} elsewhere")
    return lengths


def _create(file: h5py.File, name: str, variable: Variable, compressed: bool) -> None:
    if not name or "/" in name or "\0" in name or name == ".":
        raise StoreError(f"{name!r}: is no name of a variable in HDF5; expected one without a slash")
    values = np.asarray(variable.values)
    if values.dtype.kind in "UO":
        import h5py

        text = values.astype(object)
        dataset = file.create_dataset(name, data=text, dtype=h5py.string_dtype(), track_order=_TRACK_ORDER)
    else:
        zipped = compressed and values.size > 4096
        options = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if zipped else {}
        dataset = file.create_dataset(name, data=values, track_order=_TRACK_ORDER, **options)
    dataset.attrs["units"] = variable.units


def _read(dataset: h5py.Dataset) -> Any:
    import h5py

    if h5py.check_string_dtype(dataset.dtype):
        return dataset.asstr()[()]
    return dataset[()]


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value
