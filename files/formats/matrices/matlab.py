"""Matrices in the files of MATLAB (.mat)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy import io, sparse

from vanedamp.files.foreign import apart, self_contained
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.sparse_indices import within_shape


def read_mat(path: str | Path) -> dict[str, Any]:
    """Return the numeric matrices of a MATLAB file by name, dense (n, m) or scipy's sparse.

    Versions 4 to 7 are read by scipy, 7.3 (HDF5) here. Structures, cells and texts are left out. Raises what the
    libraries raise for a damaged file.
    """
    content = apart(path, MatrixFileError, lambda: _matlab(path))
    return {
        name: within_shape(matrix)
        for name, matrix in content.items()
        if not name.startswith("__") and (sparse.issparse(matrix) or _numeric(matrix))
    }


def _matlab(path: str | Path) -> dict[str, Any]:
    """Return the variables of a MATLAB file."""
    try:
        return dict(io.loadmat(path, appendmat=False))
    except NotImplementedError:  # scipy's word for version 7.3
        with h5py.File(path) as file:
            self_contained(file)
            return {name: _variable(item) for name, item in file.items() if not name.startswith("#")}


def _variable(item: h5py.Dataset | h5py.Group) -> Any:
    """Return a variable of version 7.3: dense ones lie transposed, sparse ones by columns."""
    if isinstance(item, h5py.Group):
        if "MATLAB_sparse" not in item.attrs:
            return None
        columns, rows = item["jc"][()].astype(int), int(item.attrs["MATLAB_sparse"])
        empty = "data" not in item  # MATLAB omits empty arrays
        data, indices = (
            (np.empty(0), np.empty(0, int)) if empty else (_complex(item["data"]), item["ir"][()].astype(int))
        )
        return sparse.csc_array((data, indices, columns), shape=(rows, len(columns) - 1))
    if item.attrs.get("MATLAB_class", b"double") in (b"char", b"cell", b"struct") or "MATLAB_empty" in item.attrs:
        return None
    return _complex(item).T


def _complex(item: h5py.Dataset) -> np.ndarray:
    values = np.asarray(item[()])
    return values["real"] + 1j * values["imag"] if values.dtype.names == ("real", "imag") else values


def _numeric(matrix: Any) -> bool:
    return isinstance(matrix, np.ndarray) and matrix.dtype.kind in "biufc" and matrix.ndim == 2
