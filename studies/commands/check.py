"""`vanedamp check`: explain an input file without running it."""

from __future__ import annotations

from argparse import Namespace
from importlib import import_module

from vanedamp.files.toml_input import read_toml
from vanedamp.studies.commands.support import facts
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.facts import fact_lines, word
from vanedamp.studies.file_kinds import a, kind_of


def run(arguments: Namespace) -> None:
    """Print the facts."""
    tables = read_toml(arguments.input)
    kind = kind_of(tables, arguments.input)
    file_facts = import_module(f"{facts.__name__}.{kind.name}").facts(arguments.input)
    defaults = facts.defaults(kind, tables)
    positions = next((fact.value for fact in file_facts if fact.key == "positions"), ())
    bodies = zip(tables.get("damper", ()), positions, strict=False)
    defaults |= {f"damper.{number}.position": at for number, (body, at) in enumerate(bodies) if "position" not in body}
    result = {"kind": kind.name} | {fact.key: fact.value for fact in file_facts} | {"defaults": defaults}
    commands = ", ".join(file_facts[0].value) or "nothing as it is"
    lines = list(fact_lines(f"{arguments.input}: {a(kind)}, for vanedamp {commands}", file_facts[1:]))
    if defaults:
        named = ", ".join(f"{key} = {word(value)}" for key, value in defaults.items())
        lines.append(f"left at their defaults: {named}")
    write_result(arguments, result, lines)
