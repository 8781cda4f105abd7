"""Reference of the Python modules: a page for each group of public names and each public module of the parts.

Docstrings of the project are plain text: paragraphs, indented examples, and lists of "name  meaning" or of
"name: meaning; name: meaning". They are turned into reStructuredText here.
"""

from __future__ import annotations

import inspect
import pkgutil
import re
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from docutils import nodes
from sphinx.addnodes import desc_signature, pending_xref
from sphinx.application import Sphinx
from sphinx.util.inspect import stringify_signature

import vanedamp
from vanedamp.files.key_tables import KeyedDocstring
from vanedamp.files.record import Record

FOLDER = Path(__file__).parent.parent / "reference" / "api"


class Part(NamedTuple):
    """Modules that have a page: those of a package, all of them or the ones named."""

    package: str
    modules: tuple[str, ...] = ()


PARTS = (
    Part("vanedamp.files"),
    Part("vanedamp.files.formats"),
    Part("vanedamp.files.formats.meshes"),
    Part("vanedamp.files.formats.matrices"),
    Part("vanedamp.meshes"),
    Part("vanedamp.modal"),
    Part("vanedamp.rom"),
    Part("vanedamp.rom.bases"),
    Part("vanedamp.rom.ring"),
    Part("vanedamp.coupling"),
    Part("vanedamp.coupling.contacts"),
    Part("vanedamp.coupling.scene"),
    Part("vanedamp.coupling.scene.contact_laws"),
    Part("vanedamp.coupling.scene.elements"),
    Part("vanedamp.coupling.scene.shapes"),
    Part("vanedamp.coupling.scene.waveforms"),
    Part("vanedamp.coupling.response", ("response", "restart_state", "sector_response", "spot_stress", "steady_state")),
    Part("vanedamp.coupling.sweep", ("sweep", "record", "steady_states")),
    Part("vanedamp.coupling.ensembles", ("design", "record")),
    Part("vanedamp.coupling.orbits", ("orbits", "branch", "border", "multipliers", "bifurcations", "history")),
    Part("vanedamp.coupling.derivatives", ("matrix_direction", "passage")),
    Part("vanedamp.coupling.sensitivity", ("sensitivity", "sensitivity_record")),
    Part("vanedamp.coupling.exponents"),
    Part("vanedamp.coupling.strength"),
    Part("vanedamp.coupling.transients", ("ramp", "ramp_record", "ring_down", "ring_down_record", "lewis")),
    Part("vanedamp.studies", ("parallel_sweep",)),
    Part("vanedamp.studies.case"),
    Part("vanedamp.studies.optimisation"),
    Part("vanedamp.studies.life", ("study", "life", "record", "slow")),
    Part("vanedamp.studies.report", ("page", "results")),
    Part("vanedamp.studies.export", ("export", "record")),
    Part("vanedamp.studies.identification", ("study", "tables", "data", "search", "record", "density", "deviations")),
)


def modules(part: Part) -> list[str]:
    """Return the names of the modules of a part."""
    path = import_module(part.package).__path__
    found = [name for _, name, is_package in pkgutil.iter_modules(path) if not is_package and name[0] != "_"]
    return [f"{part.package}.{name}" for name in found if name in (part.modules or found)]


def members(module: ModuleType) -> list[str]:
    """Return the public classes and functions that a module defines and `vanedamp` does not name, in their order."""
    public = {id(getattr(vanedamp, name)) for name in vanedamp.__all__}
    return [
        name
        for name, value in vars(module).items()
        if name[0] != "_" and (inspect.isclass(value) or inspect.isroutine(value))
        and getattr(value, "__module__", None) == module.__name__ and id(value) not in public
    ]  # fmt: skip


def pages() -> Iterator[tuple[str, str]]:
    """Yield name and text of the pages: indices of the public names and of parts, and what they lead to."""
    groups = [group for group in vanedamp._GROUPS if all(group.homes.values())]  # not that of the parts
    lists = "".join(
        f":doc:`{group.title} <{_page_of(group)}>`: {group.about}\n\n"
        + "".join(_line(f":py:obj:`~vanedamp.{name}`", getattr(vanedamp, name)) for name in group.homes)
        + "\n"
        for group in groups
    )
    yield "vanedamp", _titled("vanedamp") + ".. py:module:: vanedamp\n\n" + lists + _toctree(map(_page_of, groups))
    for group in groups:
        entries = "".join(_entry(name, getattr(vanedamp, name)) for name in group.homes)
        yield _page_of(group), _titled(group.title) + f"{group.about[0].upper()}{group.about[1:]}.\n\n" + entries
    for part in PARTS:
        inner = [each.package for each in PARTS if each.package.rpartition(".")[0] == part.package]
        lines = "".join(_line(f":doc:`{name}`", import_module(name)) for name in (*inner, *modules(part)))
        about = f".. automodule:: {part.package}\n   :no-members:\n\n"
        yield part.package, _titled(part.package) + about + lines + "\n" + _toctree([*inner, *modules(part)])
        for name in modules(part):
            text = f".. automodule:: {name}\n   :member-order: bysource\n"
            listed = members(import_module(name))
            yield (
                name,
                _titled(name) + text + (f"   :members: {', '.join(listed)}\n" if listed else "   :no-members:\n"),
            )


def _page_of(group: Any) -> str:
    return f"names-{group.title.lower().replace(' ', '-')}"


def _line(link: str, value: Any) -> str:
    """Return an item of a list: a link and the first paragraph of a docstring."""
    text = " ".join((inspect.getdoc(value) or "").split("\n\n")[0].split())
    return f"- {link}: {_inline(text)}\n"


def _toctree(names: Iterable[str]) -> str:
    return ".. toctree::\n   :hidden:\n\n" + "".join(f"   {name}\n" for name in names)


def _entry(name: str, value: Any) -> str:
    """Return the directive of a public name; records share how they are saved, loaded and converted."""
    if not inspect.isclass(value):
        return f".. autofunction:: vanedamp.{name}\n\n"
    inherited = "   :inherited-members:\n" if issubclass(value, Record) else ""
    return f".. autoclass:: vanedamp.{name}\n   :members:\n{inherited}\n"


def _titled(name: str) -> str:
    return f"{name}\n{'=' * len(name)}\n\n"


def write_pages(_app: Sphinx, _config: Any) -> None:
    """Write the pages, those that changed; remove what is no page any more."""
    FOLDER.mkdir(exist_ok=True)
    texts = {FOLDER / f"{name}.rst": text for name, text in pages()}
    for path in set(FOLDER.glob("*.rst")) - texts.keys():
        path.unlink()
    for path, text in texts.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# docstrings

_ALIGNED = re.compile(r"(\S(?:.*?\S)?)  +(\S.*)")
_NAMES = r"[A-Za-z_]\w*\*?(?:, [A-Za-z_]\w*\*?)*"


def restructured(text: str, names: Iterable[str] = ()) -> str:
    """Return a docstring as reStructuredText; names: of fields or parameters, whose meanings become a list."""
    known = set(names)
    return "\n\n".join(_block(block, known) for block in re.split(r"\n\s*\n", text.strip("\n")) if block.strip())


def _block(block: str, known: set[str]) -> str:
    lines = block.splitlines()
    if all(line.startswith("    ") for line in lines):
        return "::\n\n" + "\n".join(lines)
    if _ALIGNED.fullmatch(lines[0]) and all(line[0] == " " or _ALIGNED.fullmatch(line) for line in lines):
        return "\n".join(_definition(*item) for item in _aligned(lines))
    if lines[0].startswith("- "):
        return "\n".join(
            f"- {_inline(line[2:])}" if line.startswith("- ") else f"  {_inline(line.strip())}" for line in lines
        )
    joined = " ".join(line.strip() for line in lines)
    before, items = _told(joined, known)
    if len(items) > 1:
        return "\n\n".join([_inline(before)] * bool(before) + ["\n".join(_definition(*item) for item in items)])
    return _inline(joined)


def _aligned(lines: list[str]) -> list[tuple[str, str]]:
    items: list[tuple[str, str]] = []
    for line in lines:
        if line[0] == " ":
            items[-1] = (items[-1][0], f"{items[-1][1]} {line.strip()}")
        elif match := _ALIGNED.fullmatch(line):
            items.append((match[1], match[2]))
    return items


def _told(text: str, known: set[str]) -> tuple[str, list[tuple[str, str]]]:
    """Split "..., name: meaning; name: meaning." at the names that are known: what stands before, and the items."""
    starts = [
        match
        for match in re.finditer(rf"(?:^|(?<=[;.] ))({_NAMES}): ", text)
        if all(name in known or name.endswith("*") for name in match[1].split(", "))
    ]
    if not starts:
        return text, []
    ends = [match.start() for match in starts[1:]] + [len(text)]
    items = [(m[1], text[m.end() : end].strip().rstrip(";.")) for m, end in zip(starts, ends, strict=True)]
    return text[: starts[0].start()].strip(), items


def _definition(term: str, meaning: str) -> str:
    return f"{_inline(f'`{term}`')}\n   {_inline(meaning)}"


def _inline(text: str) -> str:
    """Return a line of text with its code as literals and without other markup."""
    parts = re.split(r"`([^`]+)`", text)
    plain = (re.sub(r"([\\*|_`])", r"\\\1", part) for part in parts[::2])
    literals = (f"\\ ``{part.strip()}``\\ " for part in parts[1::2])
    woven = [piece for pair in zip(plain, [*literals, ""], strict=True) for piece in pair]
    return "".join(woven).removeprefix("\\ ")


def _names_of(value: Any) -> Iterable[str]:
    if inspect.isclass(value):
        return [name for base in value.__mro__ for name in vars(base).get("__annotations__", ())]
    try:
        return list(inspect.signature(value).parameters)
    except (TypeError, ValueError):
        return []


def process(_app: Sphinx, _what: str, _name: str, value: Any, _options: Any, lines: list[str]) -> None:
    """Turn a docstring into reStructuredText, in place; keys of files have pages of their own."""
    own = vars(value).get("__doc__") if inspect.isclass(value) else None
    if isinstance(own, KeyedDocstring):
        lines[:] = own.plain.splitlines()
    lines[:] = [*restructured("\n".join(lines), _names_of(value)).splitlines(), ""]


def written_signature(
    _app: Sphinx, _what: str, _name: str, value: Any, _options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Return a signature with its types as they are written: short names, not what they stand for."""
    try:
        found = inspect.signature(value)
    except (TypeError, ValueError):
        return signature, returned
    kept = [parameter for name, parameter in found.parameters.items() if name not in ("self", "cls")]
    types = found.return_annotation
    returns = None if types is inspect.Signature.empty or inspect.isclass(value) else str(types)
    return stringify_signature(found.replace(parameters=kept), show_return_annotation=False), returns


def link_types(_app: Sphinx, doctree: nodes.document) -> None:
    """Lead the types of signatures, which are written short, to the classes that they name in their module."""
    for node in doctree.findall(pending_xref):
        if node.get("refdomain") != "py" or not _in_signature(node):
            continue
        name = node["reftarget"]
        public = getattr(vanedamp, name) if name in vanedamp.__all__ else None
        value = getattr(sys.modules.get(node.get("py:module") or ""), name, public)
        node.attributes.pop("refspecific", None)  # no search for the name in other modules
        if value is public is not None:
            node["reftarget"] = f"vanedamp.{name}"
        elif inspect.isclass(value):
            node["reftarget"] = f"{value.__module__}.{value.__qualname__}"


def leave_type(_app: Sphinx, _env: Any, node: pending_xref, content: nodes.TextElement) -> nodes.Node | None:
    """Leave types of signatures that have no page without a link."""
    return content if node.get("refdomain") == "py" and _in_signature(node) else None


def _in_signature(node: nodes.Node | None) -> bool:
    while node is not None and not isinstance(node, desc_signature):
        node = node.parent
    return node is not None


def skip(_app: Sphinx, _what: str, _name: str, value: Any, _skip: bool, _options: Any) -> bool | None:
    """Leave out the fields of named tuples, which have no docstring of their own."""
    return True if (inspect.getdoc(value) or "").startswith("Alias for field number") else None


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("config-inited", write_pages)
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", written_signature)
    app.connect("autodoc-skip-member", skip)
    app.connect("doctree-read", link_types)
    app.connect("missing-reference", leave_type)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
