"""The kinds of results: each folder here is one and holds everything about it.

A kind is a folder named like the attribute `kind` of its HDF5 files (with _ for -), whose `__init__` has

    NAME           the attribute
    ABOUT          its name in sentences
    COMMANDS       that write it
    RECORD         class of its content in Python, by its public name
    facts(found)   the output of `vanedamp info` on a file (studies.facts.Found)

and whose `page.py`, which draws, has

    load(path)                read a file; returns a studies.report.results.Result. Without: by `load` of RECORD
    shown(file, record, page) the data of a result for page.html, whose `section` is the list of these; page: a
                              studies.report.page.Page, which makes the charts
    section(results, page)    instead of `shown`, for all results of the kind by the path of their file
    ORDER                     place on the page
    figure(record)            the figure of `vanedamp.plot`, of the record that `load` read, or that a command returns

page.html, a Jinja template, is given `section`, and the name of the `study` that the results belong to, if any, and its
`title`. It has the macro `plot(chart)` and, for files, the filters `name` and `anchor`. What it writes inside
`{% call later() %}` goes to the section of energies, inside `{% call strength() %}` to that of strength and life.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from typing import Protocol

from vanedamp.studies.facts import Fact, Found


class ResultKind(Protocol):
    """The contract of a kind's folder."""

    NAME: str
    ABOUT: str
    COMMANDS: tuple[str, ...]
    RECORD: str

    def facts(self, found: Found) -> Iterator[Fact]:
        """Yield the main results of a file."""


def names() -> list[str]:
    """Return the names of all kinds; loads none."""
    folders = (name for _, name, is_folder in pkgutil.iter_modules(__path__) if is_folder)
    return sorted(name if name in _UNDERSCORED else name.replace("_", "-") for name in folders if name != _PAGE_ONLY)


def kind(name: str) -> ResultKind | None:
    """Return the kind of a name; None where there is none."""
    return _loaded(name) if name in names() else None


def of_command(command: str) -> ResultKind | None:
    """Return the kind that a command writes; None where there is none."""
    return kind(command) or next((entry for entry in map(_loaded, names()) if command in entry.COMMANDS), None)


def _loaded(name: str) -> ResultKind:
    module: ResultKind = import_module(f"{__name__}.{name.replace('-', '_')}")
    return module


#: a kind that has the underscore in its name; a folder that is no kind of HDF5
_UNDERSCORED, _PAGE_ONLY = {"ring_down"}, "claims"
