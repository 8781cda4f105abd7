"""The folders of a part and the modules in each, from the first sentences of their docstrings: `{layout} coupling`."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from docs._ext.toml_keys import with_literals

ROOT = Path(__file__).parent.parent.parent
#: end of a sentence; of a list or an abbreviation it is none
_END = re.compile(r"(?<=[.:])\s+(?=[A-Z`])")


def sentence(file: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return _END.split(" ".join(text.split("\n\n")[0].split()))[0]


def folders(part: str) -> Iterator[tuple[Path, list[Path]]]:
    """Yield the packages of a part, from its folder down, each with its modules."""
    for package in sorted(path.parent for path in (ROOT / part).rglob("__init__.py")):
        yield package, sorted(file for file in package.glob("*.py") if file.name != "__init__.py")


class Layout(Directive):
    """`{layout} PART`: folders and modules of a part."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        listed = nodes.definition_list()
        for package, modules in folders(self.arguments[0]):
            name = f"{package.relative_to(ROOT).as_posix()}/"
            about = nodes.paragraph("", "", *with_literals(sentence(package / "__init__.py")))
            lines = nodes.bullet_list("", *(_line(file) for file in modules))
            term = nodes.term("", "", nodes.literal("", name))
            listed += nodes.definition_list_item("", term, nodes.definition("", about, *([lines] if modules else [])))
        return [listed]


def _line(file: Path) -> nodes.list_item:
    said = nodes.paragraph("", "", nodes.literal("", file.stem), nodes.Text(": "), *with_literals(sentence(file)))
    return nodes.list_item("", said)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("layout", Layout)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
