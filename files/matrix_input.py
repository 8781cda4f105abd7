"""Matrices in the files of MATLAB (.mat) and as dense tables (.csv)."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import io, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import survive
from vanedamp.files.sparse_indices import within_shape


class MatrixFileError(VanedampError):
    """A file that holds no readable matrix; the message says where and why."""


def read_mat(path: str | Path) -> dict[str, Any]:
    """Return the numeric matrices of a MATLAB file by name, dense (n, m) or scipy's sparse.

    Versions 4 to 7 are read by scipy, 7.3 (HDF5) here. Structures, cells and texts are left out. Raises what the
    libraries raise for a damaged file.
    """
    survive(path, MatrixFileError, lambda: _matlab(path))
    return {
        name: within_shape(matrix)
        for name, matrix in _matlab(path).items()
        if not name.startswith("__") and (sparse.issparse(matrix) or _numeric(matrix))
    }


def _matlab(path: str | Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file."""
    try:
        return dict(io.loadmat(path, appendmat=False))
    except NotImplementedError:  # scipy's word for version 7.3
        with h5py.File(path) as file:
            return {name: _variable(item) for name, item in file.items() if not name.startswith("#")}


def read_npz(path: str | Path) -> Any:
    """Return the matrix of scipy.sparse.save_npz. Raises what the libraries raise for a damaged file."""
    return within_shape(sparse.load_npz(path))


def read_table(path: str | Path) -> np.ndarray:
    """Return the dense matrix (n, m) of a CSV file, one row a line.

    Columns stand between `;`, `,`, tabs or blanks; with `;`, a comma in a number is its decimal point. A first line of
    names and a first column of names are left out, and lines that begin with # or %. Raises MatrixFileError with the
    line.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise MatrixFileError(f"not a text in UTF-8 ({error.reason})") from error
    rows = [(n, _words(line)) for n, line in enumerate(lines, 1) if line.strip() and line.strip()[0] not in "#%"]
    head = rows[0][1] if rows else []
    if "" not in head[:1] and all(_number(word) is not None for word in head[1:] or head):
        head = []
    rows = rows[bool(head) :]
    if not rows:
        raise MatrixFileError("holds no numbers; expected one row of a matrix a line")
    start = int(head[:1] == [""] or all(_number(words[0]) is None for _, words in rows))
    values = []
    for line, words in rows:
        numbers = [_number(word) for word in words[start:]]
        if None in numbers:
            raise MatrixFileError(f"line {line}: expected numbers, not {words[start + numbers.index(None)]!r}")
        if len(words) != len(rows[0][1]):
            raise MatrixFileError(f"line {line}: {len(words)} columns; the first row has {len(rows[0][1])}")
        values.append(numbers)
    return np.array(values, dtype=float)


def _words(line: str) -> list[str]:
    """Return the cells of a line."""
    separator = next((mark for mark in ";,\t" if mark in line), None)
    if separator is None:
        return line.split()
    words = [word.strip() for word in next(csv.reader([line], delimiter=separator))]
    if separator == ";":
        words = [word.replace(",", ".") for word in words]
    return words[:-1] if len(words) > 1 and not words[-1] else words


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _variable(item: h5py.Dataset | h5py.Group) -> Any:
    """Return a variable of version 7.3: dense ones lie transposed, sparse ones by columns."""
    if isinstance(item, h5py.Group):
        if "MATLAB_sparse" not in item.attrs:
            return None
        columns, rows = item["jc"][()].astype(int), int(item.attrs["MATLAB_sparse"])
        empty = "data" not in item  # MATLAB leaves out what is empty
        data, places = (
            (np.empty(0), np.empty(0, int)) if empty else (_complex(item["data"]), item["ir"][()].astype(int))
        )
        return sparse.csc_array((data, places, columns), shape=(rows, len(columns) - 1))
    if item.attrs.get("MATLAB_class", b"double") in (b"char", b"cell", b"struct") or "MATLAB_empty" in item.attrs:
        return None
    return _complex(item).T


def _complex(item: h5py.Dataset) -> np.ndarray:
    values = np.asarray(item[()])
    return values["real"] + 1j * values["imag"] if values.dtype.names == ("real", "imag") else values


def _numeric(matrix: Any) -> bool:
    return isinstance(matrix, np.ndarray) and matrix.dtype.kind in "biufc" and matrix.ndim == 2
