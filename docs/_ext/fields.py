"""Tables from the code: `fields` of a record or an enumeration, with the docstrings after them; `result-kinds`."""

from __future__ import annotations

from enum import Enum
from importlib import import_module
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

from docs._ext.toml_keys import table_node, with_literals
from vanedamp.files.reference import unit_in
from vanedamp.studies import kinds


class Fields(Directive):
    """`{fields} MODULE:CLASS`, then the names of the fields in their order: all of them without any."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        place, name = self.arguments[0].split(":")
        record = getattr(import_module(place), name)
        texts = {
            field: " ".join(" ".join(lines).split())
            for (owner, field), lines in ModuleAnalyzer.for_module(record.__module__).find_attr_docs().items()
            if owner == name
        }
        names = " ".join(self.content).split() or list(texts)
        if issubclass(record, Enum):
            rows = [[_code(record[one].value), with_literals(texts[one])] for one in names]
            return [table_node(("Value", "Meaning"), rows, (25, 75))]
        rows = []
        for one in names:
            unit = unit_in(texts[one]) or ""
            meaning = texts[one].removesuffix(f"[{unit}]").rstrip()
            rows.append([_code(one), [nodes.Text(unit)], with_literals(meaning)])
        return [table_node(("Name", "Unit", "Meaning"), rows, (25, 10, 65))]


class ResultKinds(Directive):
    """`{result-kinds}`: the kinds of result files, the commands that write them, the classes of their content."""

    def run(self) -> list[nodes.Node]:
        rows = []
        for kind in filter(None, map(kinds.kind, kinds.names())):
            # by address: labels of a page that Markdown nests are not known to other pages
            commands = [nodes.reference("", each, refuri=f"commands.html#command-{each}") for each in kind.COMMANDS]
            joined = [part for each in commands for part in (nodes.Text(", "), each)][1:]
            short = kind.RECORD.rpartition(".")[2]
            record = pending_xref(
                "", nodes.literal(short, short), refdomain="py", reftype="obj", reftarget=kind.RECORD,
                refexplicit=True, refwarn=True,
            )  # fmt: skip
            rows.append([_code(kind.NAME), [nodes.Text(kind.ABOUT)], joined, [record]])
        return [table_node(("Kind", "Content", "Written by", "In Python"), rows, (15, 40, 15, 30))]


def _code(text: str) -> list[nodes.Node]:
    return [nodes.literal(text, text)]


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("fields", Fields)
    app.add_directive("result-kinds", ResultKinds)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
