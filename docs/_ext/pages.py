"""The pages of docs/ as they stand in the repository: languages of their examples, names of files that become links."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

#: first words of the examples of commands
SHELL = ("vanedamp", "mpirun", "cd", "make", "pip", ".venv/bin/python", ".venv/bin/pip")
#: a page of the site as the text names it
PAGE = re.compile(r"\bdocs/([\w/]+)\.md\b|\b(CONTRIBUTING|CHANGELOG)\.md\b")


def language(text: str) -> str:
    """Return the language of an example that stands indented: toml, python, shell or text."""
    first = text.split()[0]
    if re.match(r"\[+[\w.]+\]", text):
        return "toml"
    if first in ("from", "import"):
        return "python"
    return "shell" if first in SHELL else "text"


class ExampleLanguages(SphinxTransform):
    """Gives indented examples their language, which Markdown cannot say."""

    default_priority = 200

    def apply(self, **_: Any) -> None:
        for block in self.document.findall(nodes.literal_block):
            if block.get("language") in (None, "none") and block.astext().strip():
                block["language"] = language(block.astext())


class PageLinks(SphinxTransform):
    """Makes links of the names of pages in the text: "docs/engine.md" becomes the page's title."""

    default_priority = 210

    def apply(self, **_: Any) -> None:
        for text in list(self.document.findall(nodes.Text)):
            inside = isinstance(text.parent, nodes.literal | nodes.literal_block | nodes.reference | pending_xref)
            if not inside and PAGE.search(text) and text.parent is not None:
                text.parent.replace(text, list(self._linked(text)))

    def _linked(self, text: str) -> Iterator[nodes.Node]:
        end = 0
        for match in PAGE.finditer(text):
            name = match[1] or match[2].lower()
            yield nodes.Text(text[end : match.start()])
            if name in self.env.found_docs:
                link = pending_xref(
                    refdomain="std", reftype="doc", reftarget=f"/{name}", refexplicit=False, refwarn=True,
                    refdoc=self.env.docname,
                )  # fmt: skip
                link += nodes.inline("", match[0])
                yield link
            else:
                yield nodes.Text(match[0])
            end = match.end()
        yield nodes.Text(text[end:])


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_transform(ExampleLanguages)
    app.add_transform(PageLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
