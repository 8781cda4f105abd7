"""Readers of matrix files, by their endings."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.files.foreign import existing
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.abaqus import is_matrix_market
from vanedamp.files.formats.matrices.abaqus import read_matrices as read_abaqus
from vanedamp.files.formats.matrices.matlab import read_mat
from vanedamp.files.formats.matrices.nastran import read_dmig, read_op2, read_op4
from vanedamp.files.formats.matrices.table import read_table
from vanedamp.files.sparse_indices import within_shape


def read_matrices(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read the dense matrices of a file by lower-case name; where these clash, by their own names.

    That in .mtx, .npy, .csv, CalculiX's .sti and .mas or scipy's save_npz is "". Several hold .npz, MATLAB's .mat,
    Nastran's OP4, OP2 and DMIG entries (.pch, .dmig), of which all have the same rows, by grid point and component, and
    .mtx of Abaqus, of whose substructures the names are stiffness, mass and damping. Entries of a file that are no
    numbers are left out. Raises MatrixFileError for a missing, damaged or unknown file, and for Nastran files without
    the package pyyeti.
    """
    file = Path(path)
    if file.suffix.lower() not in _READERS:
        raise MatrixFileError(f"{path}: expected a file ending in {', '.join(_READERS)}")
    existing(path, MatrixFileError)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Premature end-of-file")  # so pyyeti calls a file that is cut short
            matrices = _READERS[file.suffix.lower()](str(file))
    except MemoryError:
        raise
    except VanedampError as error:
        raise MatrixFileError(str(error) if str(error).startswith(f"{path}:") else f"{path}: {error}") from error
    except Exception as error:  # every format has exceptions of its own
        raise MatrixFileError(f"{path}: cannot be read ({' '.join(str(error).split())})") from error
    dense = {name: np.asarray(_dense(matrix)) for name, matrix in matrices.items()}
    dense = {name: matrix for name, matrix in dense.items() if matrix.dtype.kind in "biufc"}
    counts = Counter(name.lower() for name in dense)
    return {name if counts[name.lower()] > 1 else name.lower(): matrix for name, matrix in dense.items()}


def row_freedoms(path: str | os.PathLike[str]) -> np.ndarray | None:
    """Return node and freedom (n, 2) of the rows of a matrix file; None of one that does not give them."""
    matrix = read_mtx(str(path)).get("") if Path(path).suffix.lower() == ".mtx" else None
    return getattr(matrix, "freedoms", None)


def read_npz(path: str | os.PathLike[str]) -> Any:
    """Return the matrix of scipy.sparse.save_npz. Raises the libraries' errors for a damaged file."""
    return within_shape(sparse.load_npz(path))


def _archive(path: str) -> dict[str, Any]:
    """Return the arrays of a .npz by name; the matrix of scipy.sparse.save_npz is ""."""
    with np.load(path, allow_pickle=False) as data:
        if {"format", "shape", "data"} <= set(data.files):
            return {"": read_npz(path)}
        return {name: data[name] for name in data.files}


def _dense(matrix: Any) -> Any:
    return matrix.toarray() if sparse.issparse(matrix) else matrix


def read_mtx(path: str) -> dict[str, Any]:
    """Return the matrices of Matrix Market or Abaqus by name, "" for the only one."""
    return {"": io.mmread(path)} if is_matrix_market(Path(path)) else read_abaqus(Path(path))


#: the first six hold several matrices by name; the others one, but for substructures of Abaqus
_READERS = {
    ".npz": _archive,
    ".mat": read_mat,
    ".op4": read_op4,
    ".op2": read_op2,
    ".pch": read_dmig,
    ".dmig": read_dmig,
    ".mtx": read_mtx,
    ".sti": read_mtx,
    ".mas": read_mtx,
    ".npy": lambda path: {"": np.load(path, allow_pickle=False)},
    ".csv": lambda path: {"": read_table(path)},
}
