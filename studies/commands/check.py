"""`vanedamp check`: what an input file means, without running it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from typing import Any

from vanedamp.files.toml_input import read_toml
from vanedamp.studies.commands.support import facts
from vanedamp.studies.commands.support.facts import Fact
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.file_kinds import a, kind_of


def run(arguments: Namespace) -> None:
    """Print the facts."""
    tables = read_toml(arguments.input)
    kind = kind_of(tables, arguments.input)
    found = import_module(f"{facts.__name__}.{kind.name}").facts(arguments.input)
    left = facts.defaults(kind, tables)
    result = {"kind": kind.name} | {fact.key: fact.value for fact in found} | {"defaults": left}
    commands = ", ".join(found[0].value) or "nothing as it is"
    write_result(arguments, result, _lines(f"{arguments.input}: {a(kind)}, for vanedamp {commands}", found[1:], left))


def _lines(head: str, found: Iterable[Fact], left: Mapping[str, Any]) -> Iterator[str]:
    yield head
    for key, value, unit, text in found:
        if key == "warnings":
            for warning in value:
                yield f"warning: {warning}"
        elif _known(value):
            yield f"  {key:21} {f'{_word(value)} {unit}':26} {text}".rstrip()
    if left:
        yield "left at their defaults: " + ", ".join(f"{key} = {_word(value)}" for key, value in left.items())


def _known(value: Any) -> bool:
    """Whether there is something to print of a value."""
    return any(map(_known, value)) if isinstance(value, list) else value not in ({}, None)


def _word(value: Any) -> str:
    """Return a value as it stands in a line."""
    if isinstance(value, dict):
        return "; ".join(f"{key}: {_word(entry)}" for key, entry in value.items())
    if isinstance(value, list):
        return ", ".join(map(_word, value))
    if value is None:
        return "unknown"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
