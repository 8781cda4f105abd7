"""Export of results: the file's ending sets the format, the kind of the result the writer."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from vanedamp.files.extensions import ExtensionPoint
from vanedamp.files.store import decoding
from vanedamp.files.toml_input import InputError
from vanedamp.studies.export.record import ExportRecord, Saved, read_record

FORMATS = ExtensionPoint(
    "format of exports", "vanedamp.studies.export.formats", "vanedamp.export_formats",
    ("SUMMARY", "ENDINGS", "WRITERS", "OPTIONS"),
)  # fmt: skip
#: the kind of a writer for results of every kind
ANY = "*"
#: roles of options that name a file
INPUT, OUTPUT = "input", "output"


class Format(Protocol):
    """The contract of a format, described in the folder `formats`."""

    SUMMARY: str
    ENDINGS: tuple[str, ...]
    WRITERS: dict[str, Any]
    OPTIONS: tuple[Option, ...]


def export(result: str | os.PathLike[str] | Saved, path: str | os.PathLike[str], **options: Any) -> tuple[str, ...]:
    """Write a result, or a file's result, to a file of another program, whose ending names the format.

    options: of the format, such as `table="events"` of a .csv (docs/exchange.md). Returns warnings of data that the
    file cannot hold. Raises InputError for an unknown ending, a format that cannot hold this kind of result, or
    an unsuitable option, StoreError for a file that cannot be read or written.
    """
    chosen = format_of(path)
    return write(read_record(result), chosen, path, options)


def format_of(path: str | os.PathLike[str]) -> Format:
    """Return the format of a file's ending. Raises InputError."""
    formats = FORMATS.all()
    for candidate in formats.values():
        if Path(path).suffix.lower() in candidate.ENDINGS:
            chosen: Format = candidate
            return chosen
    endings = ", ".join(ending for candidate in formats.values() for ending in candidate.ENDINGS)
    raise InputError(f"{path}: expected a file name ending in one of {endings}")


def write(
    record: ExportRecord, chosen: Format, path: str | os.PathLike[str], options: dict[str, Any]
) -> tuple[str, ...]:
    """Write a record in a format. Returns warnings; raises InputError and StoreError."""
    writer = chosen.WRITERS.get(record.kind) or chosen.WRITERS.get(ANY)
    if writer is None:
        able = [
            ending
            for candidate in FORMATS.all().values()
            if candidate.WRITERS.keys() & {record.kind, ANY}
            for ending in candidate.ENDINGS
        ]
        raise InputError(
            f"{record.file}: {_named(record.kind)} cannot go to {Path(path).suffix}; it can to {', '.join(able)}"
        )
    accepted = list(inspect.signature(writer).parameters)[2:]
    for name in options:
        if name not in accepted:
            listed = ", ".join(f"--{_flag(option)}" for option in accepted) or "none"
            raise InputError(
                f"--{_flag(name)}: is no option of {_named(record.kind)} in {Path(path).suffix}, which has {listed}"
            )
    with decoding(record.source) if isinstance(record.source, str | os.PathLike) else nullcontext():
        return tuple(writer(record, Path(path), **options) or ())


def _named(kind: str) -> str:
    return f"a result of the kind {kind}"


def _flag(name: str) -> str:
    return name.replace("_", "-")


@dataclass(frozen=True)
class Option:
    """A keyword argument of writers, and `--name` of the command.

    metavar: words for its value in --help, of a list of values one for each; type: of each value; role: INPUT or OUTPUT
    of one that names a file; endings: that an OUTPUT may have.
    """

    name: str
    help: str
    metavar: str | tuple[str, ...]
    type: Callable[[str], Any] = str
    role: str | None = None
    endings: tuple[str, ...] = ()

    @property
    def count(self) -> int | None:
        """Number of values on the command line; None: a single value."""
        return len(self.metavar) if isinstance(self.metavar, tuple) else None
