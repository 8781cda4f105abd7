"""CSV tables that input files name: a header of known columns, then rows; errors of one line with file and line."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from vanedamp.files.foreign import existing
from vanedamp.files.toml_input import LARGEST, InputError


class CsvRow(NamedTuple):
    """A row of a table: its place for messages ("forces.csv: line 3"), and its words by column."""

    place: str
    words: dict[str, str]

    def number(self, column: str) -> float:
        """Return the finite number in a column, no larger than those of other input files. Raises InputError."""
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


def content_lines(text: str) -> list[tuple[int, str]]:
    """Return number, from 1, and text of the lines that are neither blank nor comments, which begin with #."""
    lines = enumerate(text.splitlines(), 1)
    return [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


def read_csv(path: str | Path, columns: Sequence[str], least: int = 1) -> list[CsvRow]:
    """Return the rows of a CSV table, at least `least`; empty lines and those that begin with # are left out.

    The first line names the columns, in any order. Raises InputError.
    """
    file = existing(path, InputError)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    lines = content_lines(text)
    try:  # line by line, so that no quotation mark joins two of them
        table = [[word.strip() for word in next(csv.reader([line]))] for _, line in lines]
    except csv.Error as error:
        raise InputError(f"{path}: is no CSV table ({error})") from None
    if not table:
        raise InputError(f"{path}: is empty; expected the header {','.join(columns)}, then rows")
    header, *body = table
    if sorted(header) != sorted(columns):
        raise InputError(f"{path}: line {lines[0][0]}: expected the header {','.join(columns)}, not {','.join(header)}")
    if len(body) < least:
        raise InputError(f"{path}: expected at least {least} row{'s' * (least > 1)} below the header, not {len(body)}")
    rows = []
    for (number, _), words in zip(lines[1:], body, strict=True):
        if len(words) != len(header):
            raise InputError(f"{path}: line {number}: expected {len(header)} values, not {len(words)}")
        rows.append(CsvRow(f"{path}: line {number}", dict(zip(header, words, strict=True))))
    return rows
