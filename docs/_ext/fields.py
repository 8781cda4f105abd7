"""Tables from the code: `fields` of a record or an enumeration, with the docstrings after them; `result-kinds`."""

from __future__ import annotations

import pkgutil
import re
from collections.abc import Sequence
from dataclasses import is_dataclass
from enum import Enum
from importlib import import_module
from typing import Any, NamedTuple, get_args

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

from docs._ext.toml_keys import table_node, with_literals
from vanedamp.files.record import (
    Array,
    Named,
    NamedArrays,
    NumberUnit,
    Paths,
    Ragged,
    Record,
    RecordRows,
    SparseMatrix,
    Within,
    declared,
)
from vanedamp.files.reference import unit_in
from vanedamp.studies import kinds


class Fields(Directive):
    """`{fields} MODULE:CLASS`, then the names of the fields in their order: all of them without any."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        place, name = self.arguments[0].split(":")
        record = getattr(import_module(place), name)
        names = " ".join(self.content).split()
        if issubclass(record, Enum):
            texts = _texts(record)
            rows = [[_code(record[one].value), with_literals(texts[one])] for one in names or texts]
            return [table_node(("Value", "Meaning"), rows, (25, 75))]
        return [fields_table(described(record, names))]


def fields_table(found: Sequence[Described]) -> nodes.table:
    """Return the table of fields of a record."""
    header, widths = ["Name", "Unit", "Meaning"], [25, 10, 65]
    if in_file := any(one.dims for one in found):
        header, widths = ["Variable", "Dimensions", *header[1:]], [20, 15, 10, 55]
    rows = [
        [_code(one.name), *([[nodes.Text(one.dims)]] if in_file else []), [nodes.Text(one.unit)],
         with_literals(one.meaning)]
        for one in found
    ]  # fmt: skip
    return table_node(header, rows, widths)


#: fields that many records have, where they have no docstring
_EVERYWHERE = {"provenance": "versions and further data of the caller (JSON-able)"}
#: shape at the start of a docstring, which the dimensions give
_SHAPE = re.compile(r"^\([^)]*\) ")


class Described(NamedTuple):
    """A field of a record; one that is a variable of the file (files.record.Array) by its name and dimensions there."""

    name: str
    dims: str
    unit: str
    meaning: str


def described(record: type, names: Sequence[str] = ()) -> list[Described]:
    """Return the fields of a record: the unit of its annotation, else that at the end of the docstring after it.

    With those of a record within it, of its rows, and of its parts, whose dimension is their first.
    """
    texts, found = _texts(record), []
    layouts = declared(record) if is_dataclass(record) else {}
    for one in names or layouts or texts:
        kind, layout = layouts.get(one, (None, None))
        text = _SHAPE.sub("", texts.get(one, _EVERYWHERE.get(one, "")))
        if isinstance(layout, Within):
            found += described((get_args(kind) or (kind,))[0])
        elif isinstance(layout, RecordRows):
            found += [
                row._replace(name=f"{layout.dim}_{row.name}", dims=", ".join(filter(None, (layout.dim, row.dims))))
                for row in described(get_args(kind)[0])
            ]
        elif isinstance(layout, Ragged):
            found += _of_parts(get_args(kind)[0], layout)
        elif isinstance(layout, NamedArrays):
            found.append(Described(f"{layout.prefix}QUANTITY", ", ".join((*layout.dims, "...")), "", text))
        elif isinstance(layout, Paths):
            name = f"{layout.dim}_AXIS" if layout.dim else "AXIS"
            found.append(Described(name, layout.dim or "AXIS", "", text))
        elif isinstance(layout, SparseMatrix):
            found += [
                Described(one, f"{one}_entry", layout.unit, f"entries of the matrix {text}"),
                Described(f"{one}_column", f"{one}_entry", "", "their columns, from 0"),
                Described(f"{one}_row_start", "row_edge", "", "places among them where rows begin, and the last ends"),
            ]
        elif isinstance(layout, Array) and not layout.attribute:
            parts = ("_real", layout.imaginary) if layout.dtype is complex else ("",)
            own = ", ".join((layout.name or one) + part for part in parts)
            found.append(Described(own, ", ".join(layout.dims), _unit(layout), text))
        else:
            unit = _unit(layout) if isinstance(layout, Array | NumberUnit) else unit_in(text) or ""
            name = layout.name if isinstance(layout, Named) else one
            found.append(Described(name, "", unit, text.removesuffix(f"[{unit}]").rstrip()))
    return found


def _of_parts(part: type, ragged: Ragged) -> list[Described]:
    """Return the variables of parts: of their rows one after the other, and one each where they have a number."""
    thing, dim, prefix = ragged
    whose = f"index of the {thing} to which it belongs, from 0"
    found = [Described(f"{thing}_of_{dim}", prefix + dim, "", whose)]
    for name, (_, layout) in declared(part).items():
        rows = layout.dim if isinstance(layout, RecordRows) else dim
        if isinstance(layout, RecordRows):
            found.append(Described(f"{prefix}{rows}_{thing}", prefix + rows, "", whose))
        for one in described(part, [name]):
            own = one.dims.split(", ") if one.dims else []
            dims = [prefix + rows, *own[1:]] if own[:1] in ([rows], ["..."]) else [thing, *own]
            names = ", ".join(prefix + each for each in one.name.split(", "))
            found.append(one._replace(name=names, dims=", ".join(dims)))
    return found


def _unit(layout: Array | NumberUnit) -> str:
    return "" if layout.unit == "1" else layout.unit


def _texts(record: type) -> dict[str, str]:
    """Return the docstrings after the fields of a class, and of its bases."""
    found: dict[str, str] = {}
    for base in reversed(record.__mro__[:-1]):
        if base.__module__.startswith("vanedamp"):
            for (owner, field), lines in ModuleAnalyzer.for_module(base.__module__).find_attr_docs().items():
                if owner == base.__name__:
                    found[field] = " ".join(" ".join(lines).split())
    return found


class ResultRecords(Directive):
    """`{result-records}`: the fields of the records of all kinds, but those that are given."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        found: list[nodes.Node] = []
        for kind in filter(None, map(kinds.kind, kinds.names())):
            record = pkgutil.resolve_name(kind.RECORD)
            if kind.NAME in " ".join(self.content).split() or not issubclass(record, Record):
                continue
            section = nodes.section(ids=[f"result-{kind.NAME}"], names=[f"result-{kind.NAME}"])
            section += nodes.title("", "", *_code(kind.NAME))
            section += nodes.paragraph("", f"{kind.ABOUT[:1].upper()}{kind.ABOUT[1:]}.")
            section += fields_table(described(record))
            found.append(section)
        return found


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
    app.add_directive("result-records", ResultRecords)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
