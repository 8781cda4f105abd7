"""CSV tables that input files name: a header of known columns, then rows; errors of one line with file and line."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from vanedamp.files.errors import LARGEST, VanedampError
from vanedamp.files.foreign import existing, reading
from vanedamp.files.toml_input import InputError


class CsvRow(NamedTuple):
    """A row of a table: its place for messages ("forces.csv: line 3"), and its words by column."""

    place: str
    words: dict[str, str]

    def number(self, column: str) -> float:
        """Return the finite number in a column, no larger than numbers of other input files. Raises InputError."""
        word = self.words[column]
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"{self.place}: {column}: expected a finite number (got {word!r})")
        if abs(value) > LARGEST:
            raise InputError(f"{self.place}: {column}: expected a number up to {LARGEST:g} in SI units (got {word!r})")
        return value


def csv_table(path: str | Path, error: type[VanedampError], kind: str = "file") -> list[tuple[int, list[str]]]:
    """Return number, from 1, and words of the lines that are neither blank nor comments, which begin with #.

    kind: what messages call the file. Raises `error`.
    """
    file = existing(path, error, kind)
    with reading(file, error, "not a CSV table"):
        lines = enumerate(file.read_text(encoding="utf-8-sig").splitlines(), 1)
        content = [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]
        if zero := [number for number, line in content if "\0" in line]:
            raise error(f"{path}: line {zero[0]}: holds a zero character; expected text")
        # line by line, so that no quotation mark joins two of them
        return [(number, [word.strip() for word in next(csv.reader([line]))]) for number, line in content]


def read_csv(path: str | Path, columns: Sequence[str], least: int = 1) -> list[CsvRow]:
    """Return the rows of a CSV table, at least `least`; empty lines and those that begin with # are left out.

    The first line names the columns, in any order. Raises InputError.
    """
    table = csv_table(path, InputError)
    if not table:
        raise InputError(f"{path}: is empty; expected the header {','.join(columns)}, then rows")
    (first, header), *body = table
    if sorted(header) != sorted(columns):
        raise InputError(f"{path}: line {first}: expected the header {','.join(columns)}, not {','.join(header)}")
    if len(body) < least:
        raise InputError(f"{path}: expected at least {least} row{'s' * (least > 1)} below the header, not {len(body)}")
    rows = []
    for number, words in body:
        if len(words) != len(header):
            raise InputError(f"{path}: line {number}: expected {len(header)} values, not {len(words)}")
        rows.append(CsvRow(f"{path}: line {number}", dict(zip(header, words, strict=True))))
    return rows
