"""Tidy tables: one row per point of a sweep, sample, period, event, mode ...; units are in the header."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import Variable, write_csv
from vanedamp.files.toml_input import InputError
from vanedamp.studies.export.export import ANY, Option
from vanedamp.studies.export.record import ExportRecord

SUMMARY = "tables with one row a point, units in the header: pandas, R, spreadsheets"
ENDINGS = (".csv",)
OPTIONS = (
    Option("table", "of a .csv: which rows, such as time or event of a response, section of a sweep", "NAME"),
)  # fmt: skip
#: tables by kind: dimensions of their rows, the first that a result has is written
_TABLES = {
    "modes": ("mode",), "calibration": ("target", "mode"), "campbell": ("mode",), "ring-modes": ("mode",),
    "reduced-model": ("mode",), "ring-model": ("coordinate",), "ring-sectors": ("interface",), "mistuning": ("order",),
    "response": ("time", "full_period"), "ensemble": ("sample",), "orbits": ("point",), "ramp": ("period",),
    "ring_down": ("cycle", "half_cycle"), "optimisation": ("frequency",), "life": ("time",),
    "identification": ("number",), "deviations": ("sector",), "system-matrices": ("node",),
}  # fmt: skip
#: dimension of the Poincare sections of a sweep
_SECTION = "section"
#: rows per write, and largest number of columns per variable
_CHUNK, _MOST_COLUMNS = 4096, 1000

Column = tuple[str, np.ndarray]


def sweep(record: ExportRecord, path: Path, table: str | None = None) -> None:
    """Write the grid of a sweep: one row per point, with columns of axes, statuses and measures.

    table: "section" has a row for each Poincare section of every point instead. Raises InputError for other rows, and
    for sections that the sweep has not kept.
    """
    axes: Sequence[str] = record.attributes["axes"]
    dims = tuple(axis.replace(".", "_") for axis in axes)
    kinds = ("point", *(name for name in (_SECTION,) if any(name in item.dims for item in record.variables.values())))
    if table is not None and table not in kinds:
        raise InputError(f"--table: no rows {table!r} in {record.file}; there are {', '.join(kinds)}")
    rows = (*dims, _SECTION) if table == _SECTION else dims
    on_grid = {
        name: variable
        for name, variable in record.variables.items()
        if variable.dims[: len(rows)] == rows and name not in dims and (rows != dims or _SECTION not in variable.dims)
    }
    texts = [name for name in ("status", "classification") if name in on_grid]
    names = [*texts, *(name for name in on_grid if name not in texts)]
    columns = [column for name in names for column in _columns(record, name, len(rows))]
    coordinates = [(axis, record.variables[name]) for axis, name in zip(axes, dims, strict=True)]
    if rows != dims:
        count = np.shape(record.variables[names[0]].values)[len(dims)]
        coordinates.append((_SECTION, Variable(np.arange(1, count + 1))))
    points = np.meshgrid(*(np.asarray(item.values) for _, item in coordinates), indexing="ij")
    names = [_headed(axis, item.units) for axis, item in coordinates]
    _write(path, [*zip(names, (values.ravel() for values in points), strict=True), *columns])


def table(record: ExportRecord, path: Path, table: str | None = None) -> tuple[str, ...]:
    """Write the variables of one dimension: one row per entry; further dimensions become columns.

    Fields, which would be too many columns, are left out. Raises InputError for rows that a result does not have.
    """
    lengths = _lengths(record.variables)
    if table is not None and table not in lengths:
        raise InputError(f"--table: no rows {table!r} in {record.file}; there are {', '.join(lengths)}")
    dimension = table or next(name for name in (*_TABLES.get(record.kind, ()), *lengths) if name in lengths)
    names = [name for name, item in record.variables.items() if item.dims[:1] == (dimension,)]
    names.sort(key=lambda name: (name != dimension, not name.endswith("time")))  # coordinate and times come first
    fields = [name for name in names if math.prod(np.shape(record.variables[name].values)[1:]) > _MOST_COLUMNS]
    columns = [column for name in names if name not in fields for column in _columns(record, name, 1)]
    _write(path, columns)
    return tuple(f"left out: {name}, a field; .mat or .vtkhdf hold it" for name in fields)


WRITERS = {"sweep": sweep, ANY: table}


def _lengths(variables: Mapping[str, Variable]) -> dict[str, int]:
    """Return the dimensions that variables begin with, and their lengths."""
    return {item.dims[0]: len(item.values) for item in variables.values() if item.dims}


def _columns(record: ExportRecord, name: str, leading: int) -> list[Column]:
    """Return a variable's columns: rows are its leading dimensions, with a column per index of the others."""
    variable = record.variables[name]
    values = np.asarray(variable.values)
    rows, further = math.prod(values.shape[:leading]), values.shape[leading:]
    if not further:
        return [(_headed(name, variable.units), values.reshape(rows))]
    indices = list(np.ndindex(*further))
    units = variable.units.split(", ")
    units = units if len(units) == len(indices) else [variable.units] * len(indices)
    labels = [
        ".".join(_label(record, dimension, index) for dimension, index in zip(variable.dims[leading:], at, strict=True))
        for at in indices
    ]
    flat = values.reshape(rows, len(indices))
    return [
        (_headed(f"{name}.{label}", unit), flat[:, column])
        for column, (label, unit) in enumerate(zip(labels, units, strict=True))
    ]


def _label(record: ExportRecord, dimension: str, index: int) -> str:
    """Return the name of an index of a dimension, or its number from 1."""
    named = record.variables.get(dimension)
    if named is not None and np.asarray(named.values).dtype.kind in "UO":
        return str(named.values[index])
    return str(index + 1)


def _headed(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} [{unit}]"


def _write(path: Path, columns: Sequence[Column]) -> None:
    """Write columns as rows of plain values; nan is an empty field."""

    def rows() -> Iterator[list[Any]]:
        for start in range(0, max((len(values) for _, values in columns), default=0), _CHUNK):
            for row in zip(*(values[start : start + _CHUNK].tolist() for _, values in columns), strict=True):
                yield ["" if isinstance(value, float) and math.isnan(value) else value for value in row]

    write_csv(path, [name for name, _ in columns], rows())
