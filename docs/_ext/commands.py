"""Reference of the command line, made from the parsers of its commands: the directive `commands`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.nodes import nested_parse_with_titles

from vanedamp.studies.cli import _parsers
from vanedamp.studies.commands import COMMANDS


def parsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of our own commands by name, in the order of --help."""
    found = {}
    for name in COMMANDS.own():
        (places,) = (a for a in _parsers(name)[0]._actions if isinstance(a, argparse._SubParsersAction))
        found[name] = places.choices[name]
    return found


def description(name: str) -> str:
    """Return what a command does."""
    summary = COMMANDS.own()[name].SUMMARY
    return f"{summary[0].upper()}{summary[1:]}.\n"


def _lines(name: str, parser: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the section of a command as reStructuredText."""
    title = f"vanedamp {name}"
    yield from (f".. _command-{name}:", "", title, "=" * len(title), "")
    yield from description(name).replace("`", "``").splitlines()
    usage = " ".join(parser.format_usage().removeprefix("usage: ").replace("[-h] ", "").split())
    yield from ("", ".. code-block:: text", "   :class: usage", "", f"   {usage}", "", f".. program:: {title}", "")
    for action in parser._actions:
        if not isinstance(action, argparse._HelpAction):
            yield from (f".. option:: {_signature(action)}", "", f"   {_meaning(action)}", "")


def _signature(action: argparse.Action) -> str:
    """Return an argument as it is written: `-o FILE, --output FILE`."""
    value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
    value = "{" + ",".join(map(str, action.choices)) + "}" if action.choices and not action.metavar else str(value)
    if not action.option_strings:
        return value
    return ", ".join(f"{option} {value}".strip() for option in action.option_strings)


def _meaning(action: argparse.Action) -> str:
    text = (action.help or "").replace("%(default)s", str(action.default)).replace("%%", "%")
    parts = [text[:1].upper() + text[1:] + "." if text else ""]
    if action.required and action.option_strings:
        parts.append("Required.")
    elif action.default not in (None, False, argparse.SUPPRESS) and "%(default)s" not in (action.help or ""):
        parts.append(f"Default: ``{action.default}``.")
    return " ".join(part for part in parts if part).replace("*", r"\*")


class Commands(Directive):
    """`{commands}`: every command with its arguments."""

    def run(self) -> list[nodes.Node]:
        node = nodes.section()
        node.document = self.state.document
        lines = [line for name, parser in parsers().items() for line in _lines(name, parser)]
        nested_parse_with_titles(self.state, StringList(lines, "commands"), node)
        return node.children


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
