"""Tables of measurements as text, in the spellings of laboratory programs; ambiguous tables are rejected.

Semicolons, tabs, commas or blanks separate columns. Numbers have decimal points or, unless commas separate
columns, decimal commas; complex ones have an i or j. Text is UTF-8, UTF-16 or Latin-1. Data begin at the first line of
two or more cells whose first is a number; the last earlier line with as many cells names the columns, or gives their
units below the names; the others are remarks. Lines that begin with #, %, ! or // are remarks as well, unless the last
one before the data names its columns.
"""

from __future__ import annotations

import contextlib
import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vanedamp.files.errors import LARGEST, VanedampError
from vanedamp.files.foreign import existing, reading
from vanedamp.files.formats.lab_units import LabUnit, unit

_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "blanks"}
_REMARK = ("#", "%", "!", "//")
#: names of columns in headers, without units
_NAMES = {
    "frequency": r"f|freq\w*|frequen[zc]\w*|omega|ω", "time": r"t|time|zeit", "direction": "direction",
    "amplitude": r"ampl?(itude)?|(half )?swing", "displacement": r"x|displ?(acement)?|weg", "speed": "speed",
    "velocity": r"v|vel(ocity)?", "acceleration": r"a|acc(el(eration)?)?", "force": r"force|kraft",
    "base_acceleration": r"base([ _]?acc(el(eration)?)?)?", "phase": r"phase|angle|arg\w*", "sector": "sector",
    "real": r"re(al)?( ?part|teil)?", "imaginary": r"im(ag(inary)?)?( ?part|teil)?",
}  # fmt: skip
#: units of roles, as messages write them
_EXAMPLES = {
    "frequency": "Hz", "time": "s", "phase": "rad", "amplitude": "m", "displacement": "m", "velocity": "m/s",
    "acceleration": "m/s^2", "force": "N", "base_acceleration": "m/s^2", "speed": "m/s",
}  # fmt: skip
#: kind of an amplitude, by its header
_KINDS = {
    "pk-pk": r"(?:pk|p|peak)(?:[-_ ]?to[-_ ]?|[-_ ]?)(?:pk|p|peak)", "rms": "rms",
    "pk": r"(?:(?:0|zero)[-_ ]?(?:to[-_ ]?)?)?(?:pk|peak)",
}  # fmt: skip


class Column(NamedTuple):
    """A column: header, name and unit in it, kind of amplitude ("rms", "pk", "pk-pk" or ""), position from 0.

    unknown: text in brackets in the header that is not a unit."""

    header: str
    name: str
    unit: LabUnit | None
    kind: str
    unknown: str
    position: int

    @property
    def role(self) -> str:
        """Role of the column: by its name, or else by its unit; "" if unknown."""
        word = self.name.lower().replace("_", " ")
        if self.kind and not word:
            return "amplitude"
        named = (role for role, pattern in _NAMES.items() if re.fullmatch(pattern, word))
        return next(named, self.unit.quantity if self.unit else "")


class LabTable:
    """A table: its columns, its rows of words and their lines in the file."""

    def __init__(
        self, path: str | os.PathLike[str], error: type[VanedampError], columns: Sequence[Column],
        rows: Sequence[Sequence[str]], lines: Sequence[int], spelling: str,
    ) -> None:  # fmt: skip
        self.path, self.error, self.columns, self.rows = path, error, columns, rows
        self._lines, self._spelling = lines, spelling

    def place(self, row: int) -> str:
        """Return file and line of a row, for messages."""
        return f"{self.path}: line {self._lines[row]}"

    def words(self, column: Column) -> list[str]:
        """Return the words (n,) of a column."""
        return [row[column.position] for row in self.rows]

    def numbers(self, column: Column) -> np.ndarray:
        """Return the numbers (n,) of a column as they stand, complex if one is. Raises the table's error."""
        words = self.words(column)
        with contextlib.suppress(ValueError):  # most are plain, and many
            plain = np.array([float(word) for word in words])
            if np.all(np.abs(plain) <= LARGEST) and "_" not in "".join(words):
                return plain
        values = [number(word) for word in words]
        for row, value in enumerate(values):
            if value is None or abs(value) > LARGEST:
                expected = "a finite number" if value is None else f"a number up to {LARGEST:g}"
                name = f"{column.header}: " if column.header else ""
                raise self.error(
                    f"{self.place(row)}: {name}expected {expected} (got {self.rows[row][column.position]!r})"
                )
        array = np.array(values, complex)
        return array if self.is_complex(column) else array.real.copy()

    def is_complex(self, column: Column) -> bool:
        """Whether a column holds complex numbers."""
        return any("i" in word or "j" in word for word in self.words(column))

    def si(self, column: Column, quantity: str, default: str = "") -> np.ndarray:
        """Return the values (n,) of a column in SI (rad, Hz).

        quantity: one of lab_units.QUANTITIES; default: its unit if the header gives none. Raises the table's error.
        """
        return np.asarray(self.unit_of(column, quantity, default).factor * self.numbers(column))

    def unit_of(self, column: Column, quantity: str, default: str = "") -> LabUnit:
        """Return the unit of a column; arguments as of `si`."""
        found = column.unit or (unit(default) if not column.unknown else None)
        if found is not None and found.quantity == quantity and not found.decibels:
            return found
        fault = (
            f"no unit of {quantity}" if found else f"unknown unit {column.unknown!r}" if column.unknown else "no unit"
        )
        raise self.error(
            f"{self.path}: {column.header!r}: {fault}; write one such as '{column.name or quantity} "
            f"[{_EXAMPLES[quantity]}]'"
        )

    def taken(self, needed: Sequence[Sequence[str]], further: Sequence[str] = ()) -> dict[str, Column]:
        """Return the columns by their roles, of which of each of `needed` one must be there; a role may be a header.

        Raises the table's error for a missing, unknown or doubled column.
        """
        expected = ", ".join(
            [" or ".join(map(_title, roles)) for roles in needed]
            + [f"{_title(role)} (if measured)" for role in further]
        )
        if not any(column.header for column in self.columns):
            raise self.error(f"{self.path}: names no columns; expected the header {expected}")
        roles_known = {*further, *(role for roles in needed for role in roles)}
        by_role: dict[str, Column] = {}
        for column in self.columns:
            role = column.header if column.header in roles_known else column.role
            if role not in roles_known:
                raise self.error(f"{self.path}: unknown column {column.header!r}; expected {expected}")
            if role in by_role:
                raise self.error(
                    f"{self.path}: {by_role[role].header!r} and {column.header!r} are both {role}; leave one out"
                )
            by_role[role] = column
        for roles in needed:
            if not by_role.keys() & set(roles):
                raise self.error(f"{self.path}: no column {_title(roles[0])}; expected {expected}")
        return by_role

    def reading(self, taken: Mapping[str, str]) -> str:
        """Return how the file was read, in words; taken: meaning by header."""
        roles = ", ".join(f"{key!r} as {value}" for key, value in taken.items())
        return f"{Path(self.path).name}: {self._spelling}; {roles}"


def _title(role: str) -> str:
    """Return a header that names a role and its SI unit."""
    if role not in _EXAMPLES:
        return role
    ending = _EXAMPLES[role].lower() if role == "frequency" else _EXAMPLES[role]
    return f"{role}_{ending}".replace("/", "_").replace("^", "")


def lab_table(path: str | os.PathLike[str], error: type[VanedampError]) -> LabTable:
    """Read a table of measurements. Raises `error` with the file and, where one is wrong, the line."""
    file = existing(path, error)
    with reading(file, error, "not a table of measurements"):
        return _table(path, error, *_text(file.read_bytes()))


def _table(path: str | os.PathLike[str], error: type[VanedampError], text: str, encoding: str) -> LabTable:
    lines = [(n, line.strip(" \r\n")) for n, line in enumerate(re.split(r"\r\n|\r|\n", text), 1) if line.strip()]
    plain = [(n, line) for n, line in lines if not line.lstrip().startswith(_REMARK)]
    for separator in _SEPARATORS:
        having = (k for k, (_, line) in enumerate(plain) if separator in line.strip())
        begin = next((k for k in having if _is_data(split(plain[k][1], separator))), None)
        if begin is not None:
            break
    else:
        raise error(f"{path}: holds no rows of numbers; expected columns between semicolons, tabs, commas or blanks")
    body, first = [(n, split(line, separator)) for n, line in plain[begin:]], plain[begin][0]
    width = len(body[0][1])
    for n, row in body:
        if len(row) != width:
            raise error(f"{path}: line {n}: {len(row)} columns; line {first} has {width}")
    headers = [(n, _titles(line, separator)) for n, line in plain[:begin]]
    named = [titles for _, titles in headers if len(titles) == width]
    if headers and len(headers[-1][1]) not in (1, width):
        raise error(f"{path}: line {headers[-1][0]}: {len(headers[-1][1])} names for {width} columns of numbers below")
    if not named:
        remarks = [line.lstrip("".join(_REMARK)) for n, line in lines if n < first and line.startswith(_REMARK)]
        titles = _titles(remarks[-1], separator) if remarks else []
        named = [titles] if len(titles) == width and _column(titles[0], 0).role in ("frequency", "time") else []
    titles = named[-1] if named else [""] * width
    if len(named) > 1 and all(not _column(title, 0).name for title in titles):  # units below names
        titles = [" ".join(filter(None, pair)) for pair in zip(*named[-2:], strict=True)]
    if not titles[-1] and not any(row[-1] for _, row in body):  # a separator at the end of every line
        titles.pop()
    rows = [row for _, row in body]
    commas = _decimal_commas(path, error, body)
    spelling = f"{_SEPARATORS[separator]}, decimal {'commas' if commas else 'points'}, {encoding}"
    columns = [_column(title, index) for index, title in enumerate(titles)]
    return LabTable(path, error, columns, rows, [n for n, _ in body], spelling)


def number(word: str) -> complex | None:
    """Return the finite number, real or complex, that a word is; None for anything else."""
    plain = word.strip("()").replace(",", ".").replace("*", "")
    if "i" in plain or "j" in plain:
        plain = re.sub(r"(^|[-+])j([\d.].*)", r"\1\2j", plain.replace(" ", "").replace("i", "j"))
    if not re.fullmatch(r"[-+\d.eEdDj]+", plain):
        return None
    try:
        value = complex(plain.replace("D", "e").replace("d", "e"))
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; cells between blanks may be complex numbers with blanks around their signs."""
    if separator == " ":
        return re.sub(r"(?<=\S)\s+([-+])\s+(?=\S)|\s+(?=[ij](\s|$))", r"\1", line).split()
    return [word.strip() for word in next(csv.reader([line], delimiter=separator))]


def _text(content: bytes) -> tuple[str, str]:
    """Return the text of a file, and its encoding."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace"), "UTF-16"
    if len(content) > 1 and content[1::2].count(0) > len(content) // 4:
        return content.decode("utf-16-le", "replace"), "UTF-16"
    try:
        return content.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        return content.decode("latin-1"), "Latin-1"


def _is_data(row: Sequence[str]) -> bool:
    """Whether a row begins the data: something like a number first, and no cell that holds several."""
    several = any(re.search(r"\d\s+[-+(\d.]", word) and number(word) is None for word in row)
    return len(row) > 1 and not several and bool(re.fullmatch(r"[-+(]*[\d.,][-+\d.,eEdD]*", row[0]))


def _titles(line: str, separator: str) -> list[str]:
    """Return the names in a header line; between blanks, brackets belong to the name before."""
    if separator != " ":
        return split(line, separator)
    return re.findall(r"[^\s(\[]\S*(?:\s+[(\[][^)\]]*[)\]]\S*)?", line)


def _column(header: str, index: int) -> Column:
    """Return the column of a header: its unit is the longest end of it that is one."""
    text, kind = header, ""
    for name, pattern in _KINDS.items():
        if match := re.search(rf"(?<![A-Za-z]){pattern}(?![A-Za-z])", text, re.I):
            text, kind = f"{text[: match.start()]} {text[match.end() :]}", name
            break
    text = re.sub(r"[\[(]\s*[\])]", "", text).strip(" _,")
    for cut in [0, *(match.start() for match in re.finditer(r"[\s_/,:(\[]", text))]:
        end = text[cut:].strip(" ,:")
        tried = [end, end[1:]] if end[:1] in "/" else [end[1:].replace("_", "/")] if end[:1] == "_" else [end]
        if end[:1] == "[" and end[-1:] == "]":
            tried = [end[1:-1].strip(" ,")]
        for candidate in tried:
            if candidate and (of := unit(candidate)):
                return Column(header, text[:cut].strip(" _/,:"), of, kind, "", index)
    bracket = re.fullmatch(r"(.*?)\s*([\[(])([^\])]*)[\])]", text)
    if bracket and (bracket[2] == "[" or "/" in bracket[3] or _role_alone(bracket[1])):
        return Column(header, bracket[1], None, kind, bracket[3].strip(), index)
    return Column(header, text, None, kind, "", index)


def _role_alone(name: str) -> bool:
    """Whether a name states the quantity of a column, not only which part of a response it is."""
    return Column("", name, None, "", "", 0).role not in ("", "real", "imaginary")


def _decimal_commas(path: object, error: type[VanedampError], body: Sequence[tuple[int, list[str]]]) -> bool:
    """Return whether numbers have decimal commas. Raises `error` where some have points as well."""
    marks: dict[str, int] = {}
    if all(any(mark in word for _, row in body for word in row) for mark in ",."):
        for n, row in body:
            for word in (word for word in row if number(re.sub("[.,]", "", word)) is not None):
                marks |= {mark: n for mark in ",." if mark in word and mark not in marks}
    if len(marks) > 1:
        raise error(
            f"{path}: lines {marks[',']} and {marks['.']}: commas and points in numbers; write one of them, as decimal "
            "mark, and none between thousands"
        )
    return any("," in word for _, row in body for word in row)
