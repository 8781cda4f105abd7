"""Reference of the keys of an input file, made from the JSON Schema of its record: the directive `keys`.

A table of the file is a section, a key a line with an anchor: `damper.normal_load`. The role `toml:key` leads there,
and the search finds it under the kind of file: `scene.damper.normal_load`, `case.interface.NAME.direction`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains import Domain, ObjType
from sphinx.environment import BuildEnvironment
from sphinx.roles import XRefRole
from sphinx.util.nodes import make_refnode

from vanedamp.files.key_tables import NAME, KeyTable, tables
from vanedamp.studies.file_kinds import KINDS

HEADER = ("Key", "Value", "Unit", "Default", "Meaning")
#: how the search shows it, which takes < for markup
FOUND = "NAME"


# nodes


def with_literals(text: str) -> list[nodes.Node]:
    """Return the nodes of a text whose code stands between backticks."""
    parts = re.split(r"`([^`]+)`", text)
    return [nodes.literal(part, part) if index % 2 else nodes.Text(part) for index, part in enumerate(parts) if part]


def table_node(header: Iterable[str], rows: Iterable[Iterable[list[nodes.Node]]], widths: Iterable[int]) -> nodes.table:
    """Return a table of docutils; a cell is a list of inline nodes."""
    widths = list(widths)
    group = nodes.tgroup(cols=len(widths))
    group += [nodes.colspec(colwidth=width) for width in widths]
    head, body = nodes.thead(), nodes.tbody()
    head += _row([nodes.Text(title)] for title in header)
    body += [_row(row) for row in rows]
    group += [head, body]
    table = nodes.table(classes=["keys"])
    table += group
    return table


def _row(cells: Iterable[list[nodes.Node]]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", "", *cell))
    return row


class Keys(Directive):
    """`{keys} KIND`: the tables and keys of a kind of file, less those of the kind after it: `{keys} study scene`."""

    required_arguments = 1
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        kind, *less = self.arguments
        known = {table for name in less for table in tables(KINDS[name].schema)}
        return [self._section(kind, table) for table in tables(KINDS[kind].schema) if table not in known]

    def _section(self, kind: str, table: KeyTable) -> nodes.section:
        env: BuildEnvironment = self.state.document.settings.env
        domain = env.domains["toml"]
        assert isinstance(domain, TomlDomain)
        section = nodes.section(ids=self._ids(table), names=[f"{kind} {table.heading}"])
        for path in dict.fromkeys((table.path, table.path.removesuffix(f".{NAME}"))):
            if path:
                domain.note(f"{kind}.{path}", env.docname, section["ids"][0], "table")
        section += nodes.title("", table.heading)
        paragraphs = [" ".join(text.split()) for text in table.text.split("\n\n") if text]
        section += [nodes.paragraph("", "", *with_literals(text)) for text in paragraphs]
        rows = []
        for key in table.keys:
            name = nodes.literal(key.name, key.name, ids=self._ids(table, key.name))
            link = nodes.reference("", "", name, refuri=f"#{name['ids'][0]}", internal=True, classes=["key"])
            domain.note(f"{kind}.{table.dotted(key.name)}", env.docname, name["ids"][0])
            value, default = (with_literals(re.sub(r'("[^"]*")', r"`\1`", text)) for text in (key.value, key.default))
            rows.append([[link], value, [nodes.Text(key.unit)], default, with_literals(key.meaning)])
        if rows:
            section += table_node(HEADER, rows, (16, 20, 8, 12, 44))
        return section

    def _ids(self, table: KeyTable, key: str = "") -> list[str]:
        """Return the anchors of a table or a key: that with the variant; of the first variant also that without."""
        taken = self.state.document.settings.env.temp_data.setdefault("toml_keys", set())
        plain = table._replace(variant="").anchor(key) or "top-level"
        ids = list(dict.fromkeys([table.anchor(key) or plain, *([] if plain in taken else [plain])]))
        taken.update(ids)
        return ids


class TomlDomain(Domain):
    """Keys of the input files, for links and the search."""

    name = "toml"
    label = "TOML"
    object_types: ClassVar = {"key": ObjType("key", "key"), "table": ObjType("table", "key")}
    roles: ClassVar = {"key": XRefRole()}
    initial_data: ClassVar = {"keys": []}
    data_version = 1

    def note(self, name: str, docname: str, anchor: str, kind: str = "key") -> None:
        """Remember a key, or a table."""
        self.data["keys"].append((name, docname, anchor, kind))

    def clear_doc(self, docname: str) -> None:
        self.data["keys"] = [key for key in self.data["keys"] if key[1] != docname]

    def merge_domaindata(self, docnames: set[str], otherdata: dict[str, Any]) -> None:
        self.data["keys"] += [key for key in otherdata["keys"] if key[1] in docnames]

    def get_objects(self) -> Iterator[tuple[str, str, str, str, str, int]]:
        for name, docname, anchor, kind in self.data["keys"]:
            found = name.replace(NAME, FOUND)
            yield found, found, kind, docname, anchor, 0  # important: before names of the same word in Python

    def resolve_xref(
        self, env: BuildEnvironment, fromdocname: str, builder: Any, typ: str, target: str, node: pending_xref,
        contnode: nodes.Element,
    ) -> nodes.reference | None:  # fmt: skip
        """Lead `damper.normal_load` and `case.mesh.file` to their keys; a key without its kind is first a scene's."""
        for wanted in (target, *(f"{kind}.{target}" for kind in KINDS)):
            for name, docname, anchor, _ in self.data["keys"]:
                if name == wanted:
                    return make_refnode(builder, fromdocname, docname, anchor, contnode, name)
        return None

    def resolve_any_xref(self, *_: Any) -> list[tuple[str, nodes.reference]]:
        return []


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_domain(TomlDomain)
    app.add_directive("keys", Keys)
    return {"parallel_read_safe": True, "parallel_write_safe": True, "version": "1"}
