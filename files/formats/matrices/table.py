"""Matrices as dense tables (.csv)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from vanedamp.files.formats.matrices import MatrixFileError


def read_table(path: str | Path) -> np.ndarray:
    """Return the dense matrix (n, m) of a CSV file, one row per line.

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
