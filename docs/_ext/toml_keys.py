"""Reference of the keys of an input file, made from the JSON Schema of its record: the directive `keys`.

A table of the file is a section, a key a line with an anchor: `damper.normal_load`. The role `toml:key` leads there,
and the search finds it under the kind of file: `scene.damper.normal_load`, `case.interface.NAME.direction`.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator
from typing import Any, ClassVar, NamedTuple

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains import Domain, ObjType
from sphinx.environment import BuildEnvironment
from sphinx.roles import XRefRole
from sphinx.util.nodes import make_refnode

from vanedamp.files.reference import constants, options
from vanedamp.studies.file_kinds import KINDS

Schema = dict[str, Any]
HEADER = ("Key", "Value", "Unit", "Default", "Meaning")
#: the part of a key's path that the file chooses: [interface.<name>]
NAME = "<name>"
#: how the search shows it, which takes < for markup
FOUND = "NAME"
#: a default that a description tells in words
DEFAULT = re.compile(r" \(default: ([^()]+)\)")
#: types of JSON in words
WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}


class Key(NamedTuple):
    """A key of a table: its name, what it may be, its unit, default and meaning; required ones have no default."""

    name: str
    value: str
    unit: str
    default: str
    meaning: str


class Table(NamedTuple):
    """A table of a file.

    path: dotted, `excitation.harmonic`; heading: as it stands in the file, `[[excitation.harmonic]]`; variant: the
    value of the key that tells tables of one name apart, such as a method's, "" without one; text: its meaning.
    """

    path: str
    heading: str
    variant: str
    text: str
    keys: tuple[Key, ...]

    def anchor(self, key: str = "") -> str:
        """Return the anchor of the table, or of a key in it."""
        return ".".join(part for part in (self.path, self.variant, key) if part).replace(NAME, "name")

    def dotted(self, key: str) -> str:
        """Return the dotted name of a key, without the variant."""
        return f"{self.path}.{key}" if self.path else key


def tables(schema: Schema) -> Iterator[Table]:
    """Yield the tables of a file in their order, each before those inside it."""
    top = _keys(schema, schema)
    if top:
        yield Table("", "Before the first table", "", "", top)
    yield from _inner(schema, schema, "")


def _inner(schema: Schema, table: Schema, path: str, text: str = "") -> Iterator[Table]:
    for name, node in table.get("properties", {}).items():
        yield from _tables_at(schema, node, f"{path}.{name}" if path else name, node.get("description", ""))
    others = table.get("additionalProperties")
    if isinstance(others, dict):
        yield from _tables_at(schema, others, f"{path}.{NAME}", text)


def _tables_at(schema: Schema, node: Schema, path: str, text: str) -> Iterator[Table]:
    """Yield the tables that a key stands for: one, the variants of one, or those of a list."""
    found = _own_tables(schema, node)
    brackets = "[[{}]]" if any("items" in option for option in options(schema, node)) else "[{}]"
    for one in found:
        told = _distinguishing(one, found)
        heading = brackets.format(path) + "".join(f' {key} = "{value}"' for key, value in told.items())
        others = one.get("additionalProperties")
        own = isinstance(others, dict) and not _own_tables(schema, others)
        if "properties" in one or own:
            free = (_key(schema, NAME, {"description": text} | others, False),) if own else ()
            said = "" if own else one.get("description", text)
            yield Table(path, heading, "".join(told.values()), said, _keys(schema, one, told) + free)
        yield from _inner(schema, one, path, text)


def _own_tables(schema: Schema, node: Schema) -> list[Schema]:
    """Return the tables of a file that a node stands for, those in a list as well.

    Inline tables are values, and so are names with values where a list or a text would do as well.
    """
    found, some = [], options(schema, node)
    for option in some:
        if isinstance(option.get("items"), dict):
            found += _own_tables(schema, option["items"])
        elif option.get("type") == "object" and "x-inline" not in option and ("properties" in option or len(some) == 1):
            found.append(option)
    return found


def _distinguishing(table: Schema, among: list[Schema]) -> dict[str, str]:
    """Return the key that tells a table from others of its name, with its value."""
    if len(among) < 2:
        return {}
    here = constants(table)
    return {key: here[key] for key in list(here)[:1]}


def _keys(schema: Schema, table: Schema, first: Container[str] = ()) -> tuple[Key, ...]:
    """Return the keys of a table that are no tables themselves, some of them first."""
    required = table.get("required", ())
    nodes = sorted(table.get("properties", {}).items(), key=lambda item: item[0] not in first)
    return tuple(_key(schema, name, node, name in required) for name, node in nodes if not _own_tables(schema, node))


def _key(schema: Schema, name: str, node: Schema, required: bool) -> Key:
    values = dict.fromkeys(_value(schema, option) for option in options(schema, node))
    meaning = node.get("description", "").removesuffix(f"[{node.get('x-unit')}]").rstrip()
    default = "required" if required else _toml(node["default"]) if "default" in node else ""
    if not default and (said := DEFAULT.search(meaning)):
        default, meaning = said[1], meaning[: said.start()] + meaning[said.end() :]
    return Key(name, " or ".join(values), node.get("x-unit", ""), default, meaning)


def _value(schema: Schema, node: Schema) -> str:
    """Return what a key may be in words: its type and its range, or the values it has."""
    if "const" in node:
        return _toml(node["const"])
    if "enum" in node:
        return ", ".join(map(_toml, node["enum"]))
    if node.get("type") == "array":
        return _list(schema, node)
    if node.get("type") == "object":
        others = node.get("additionalProperties")
        inner = f"{NAME} = {_value(schema, others)}" if isinstance(others, dict) else ", ".join(node["properties"])
        return "{" + inner + "}"
    return " ".join(part for part in (WORDS.get(node.get("type", ""), "any"), _range(node)) if part)


def _list(schema: Schema, node: Schema) -> str:
    if "prefixItems" in node:
        items = [" or ".join(_value(schema, one) for one in options(schema, item)) for item in node["prefixItems"]]
        return f"[{', '.join(items)}]"
    items = dict.fromkeys(_value(schema, one) for one in options(schema, node.get("items", {})))
    least, most = node.get("minItems", 0), node.get("maxItems")
    count = f" ({least}{'' if most == least else f' to {most}' if most else ' or more'})" if least > 1 or most else ""
    return f"list{count} of {' or '.join(items)}"


def _range(node: Schema) -> str:
    """Return the range of a number: "> 0", "0 to 1"."""
    low, high = node.get("minimum"), node.get("maximum")
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    signs = (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"))
    return ", ".join(f"{sign} {node[name]:g}" for name, sign in signs if name in node)


def _toml(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, list | tuple) else str(value)


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

    def _section(self, kind: str, table: Table) -> nodes.section:
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

    def _ids(self, table: Table, key: str = "") -> list[str]:
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
