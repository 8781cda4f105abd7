"""Options of formats, in the command line and in Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

#: roles of options that name a file
INPUT, OUTPUT = "input", "output"


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
        """Number of values in the command line; None: one that is no list."""
        return len(self.metavar) if isinstance(self.metavar, tuple) else None
