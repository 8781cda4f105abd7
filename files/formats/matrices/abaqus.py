"""Matrices of Abaqus: substructures (*USER ELEMENT with *MATRIX) in and out, global ones (*MATRIX OUTPUT) in.

A substructure's file, as *SUBSTRUCTURE MATRIX OUTPUT and CalculiX write it, is the definition of a linear user element:
the columns of a symmetric matrix from the first row to the diagonal, four entries per line, one column after another.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from scipy import sparse

from vanedamp.files.formats.matrices import MatrixFileError

#: entries of a line, and columns of a number, that Abaqus reads
_ENTRIES = 4
_NAMES = {"stiffness": "stiffness", "mass": "mass", "viscousdamping": "damping", "damping": "damping"}


class GlobalMatrix(sparse.csr_array):
    """A symmetric matrix of *MATRIX OUTPUT.

    freedoms  (n, 2) node and freedom of its rows, ascending; None where the file only counts rows
    """

    freedoms: np.ndarray | None = None


def is_matrix_market(path: Path) -> bool:
    """Whether an .mtx file is one of Matrix Market, which says so in its first line."""
    with path.open(encoding="latin-1") as stream:
        return stream.readline().lower().startswith("%%matrixmarket")


def write_substructure(stream: TextIO, title: str, matrices: Mapping[str, np.ndarray]) -> None:
    """Write stiffness and mass, symmetric (n, n), as a linear user element of n nodes with one freedom each.

    A number has up to 15 digits, as many as the 20 columns hold that Abaqus reads.
    """
    size = len(next(iter(matrices.values())))
    stream.write(f"** {title}\n*USER ELEMENT, NODES={size}, LINEAR\n** ELEMENT NODES\n")
    for start in range(1, size + 1, 10):
        stream.write("** " + ", ".join(str(node) for node in range(start, min(start + 10, size + 1))) + "\n")
    stream.write("1\n")
    for name, matrix in matrices.items():
        stream.write(f"*MATRIX, TYPE={name.upper()}\n")
        for column in range(size):
            entries = [_text(float(value)) for value in matrix[: column + 1, column]]
            for start in range(0, len(entries), _ENTRIES):
                stream.write(", ".join(entries[start : start + _ENTRIES]) + "\n")


def _text(value: float) -> str:
    return f"{value:.14E}" if value >= 0.0 else f"{value:.13E}"


def read_matrices(path: Path) -> dict[str, Any]:
    """Read stiffness, mass and damping of a substructure by name; one global matrix, a GlobalMatrix, has the name "".

    Global matrices come from *MATRIX OUTPUT: FORMAT=MATRIX INPUT (node, freedom, node, freedom, entry), of nodes
    that all have the same freedoms, and FORMAT=COORDINATE (row, column, entry), as CalculiX writes .sti and .mas.
    Raises MatrixFileError.
    """
    lines = list(_lines(path))
    if any(line.startswith("*USER ELEMENT") for _, line in lines):
        return _substructure(lines)
    rows = [_numbers(number, line) for number, line in lines if not line.startswith("*")]
    widths = {len(row) for row in rows}
    if widths not in ({3}, {5}):
        raise MatrixFileError(
            "expected Matrix Market, a *USER ELEMENT with *MATRIX, or lines of node, freedom, node, freedom, entry or "
            "of row, column, entry"
        )
    table = np.array(rows)
    indices = table[:, :-1]
    if np.any(indices != np.round(indices)):
        raise MatrixFileError("nodes, freedoms, rows and columns are whole numbers")
    return {"": _global(indices.astype(int), table[:, -1])}


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines that are no comments, keywords in capitals without spaces around commas."""
    with path.open(encoding="latin-1") as stream:
        for number, line in enumerate(stream, start=1):
            text = line.strip()
            if text and not text.startswith(("**", "%")):
                yield number, re.sub(r"\s*([,=])\s*", r"\1", text.upper()) if text.startswith("*") else text


def _numbers(number: int, line: str) -> list[float]:
    try:
        return [float(word.replace("D", "E").replace("d", "e")) for word in re.split(r"[,\s]+", line) if word]
    except ValueError as error:
        raise MatrixFileError(f"line {number}: expected numbers ({error})") from error


def _substructure(lines: list[tuple[int, str]]) -> dict[str, np.ndarray]:
    entries: dict[str, list[float]] = {}
    elements, whole, name = 0, False, None
    for number, line in lines:
        if line.startswith("*USER ELEMENT"):
            elements += 1
            whole, name = "UNSYM" in line.split(","), None
        elif line.startswith("*MATRIX"):
            kind = re.search(r"TYPE=([A-Z ]+)", line)
            name = _NAMES.get(kind[1].replace(" ", "").lower()) if kind else None
            if name in entries:
                raise MatrixFileError(
                    f"line {number}: a second matrix of {name}; a file holds one substructure, not several elements"
                )
            if name is not None:
                entries[name] = []
        elif line.startswith("*"):
            name = None
        elif name is not None:
            entries[name] += _numbers(number, line)
    if not entries:
        raise MatrixFileError("holds no *MATRIX of stiffness or mass")
    return {name: _unpacked(name, np.array(values), whole) for name, values in entries.items()}


def _unpacked(name: str, entries: np.ndarray, whole: bool) -> np.ndarray:
    """Return a matrix from its entries by columns, of a symmetric one down to the diagonal."""
    count = len(entries)
    size = round(count**0.5) if whole else round(((1 + 8 * count) ** 0.5 - 1) / 2)
    if size == 0 or count != (size**2 if whole else size * (size + 1) // 2):
        raise MatrixFileError(f"{name}: {count} entries fill no {'square' if whole else 'triangle'}")
    if whole:
        return entries.reshape(size, size).T
    matrix = np.zeros((size, size))
    matrix[np.tril_indices(size)] = entries
    return np.asarray(matrix + np.tril(matrix, -1).T)


def _global(indices: np.ndarray, values: np.ndarray) -> GlobalMatrix:
    freedoms = None
    if indices.shape[1] == 4:
        freedoms, index = np.unique(indices.reshape(-1, 2), axis=0, return_inverse=True)
        nodes, kinds = (len(np.unique(freedoms[:, column])) for column in (0, 1))
        if len(freedoms) != nodes * kinds:
            raise MatrixFileError(
                "nodes have different freedoms, so that the places of two matrices need not agree; write them by "
                "FORMAT=COORDINATE"
            )
        rows, columns = index.reshape(-1, 2).T
    else:
        if indices.min() < 1:
            raise MatrixFileError("rows and columns count from 1")
        rows, columns = indices.T - 1
    size = int(max(rows.max(), columns.max())) + 1
    # lists of entries may hold one twice, of which the last counts
    last = len(rows) - 1 - np.unique((rows * size + columns)[::-1], return_index=True)[1]
    matrix = sparse.csr_array((values[last], (rows[last], columns[last])), shape=(size, size))
    triangle = not sparse.triu(matrix, 1).count_nonzero() or not sparse.tril(matrix, -1).count_nonzero()
    whole = GlobalMatrix(matrix + matrix.T - sparse.diags(matrix.diagonal()) if triangle else matrix)
    whole.freedoms = freedoms
    return whole
