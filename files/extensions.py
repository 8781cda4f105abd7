"""Parts that are found or named, not imported: our own modules, and other packages' entry points.

An installed package adds a part in its pyproject.toml, without a change here:

    [project.entry-points."vanedamp.commands"]
    fatigue = "acme.fatigue_command"
"""

from __future__ import annotations

import pkgutil
import sys
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from vanedamp.files.errors import VanedampError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

#: order of a part without ORDER: after parts that have one
_LAST = 1000


class ExtensionError(VanedampError):
    """A part of another package that cannot be used."""


class ExtensionPoint(NamedTuple):
    """Source of parts of one kind that are all loaded at once.

    A part is a module, or any object with the attributes.

    kind        in words, for messages
    package     each module of which is a part; folders: each package of which is one, or its module `inside`; or a
                module with PARTS by name
    group       of entry points, named like the parts
    attributes  that a part must have; it may have a NAME other than its file's, and an ORDER among the others
    """

    kind: str
    package: str
    group: str
    attributes: tuple[str, ...]
    folders: bool = False
    inside: str = ""

    def own(self) -> dict[str, Any]:
        """Return the parts of our own folder by name, in their order."""
        listed = getattr(import_module(self.package), "PARTS", None)
        if listed is not None:
            return _in_order(listed)
        parts = {}
        for _, name, is_folder in pkgutil.iter_modules(import_module(self.package).__path__):
            if is_folder is self.folders:
                part = import_module(f"{self.package}.{name}{self.inside}")
                parts[getattr(part, "NAME", name)] = part
        return _in_order(parts)

    def all(self) -> dict[str, Any]:
        """Return our own parts and other packages'. Raises ExtensionError for one that cannot be used."""
        ours = self.own()
        added = _added(self.kind, self.group, ours)
        return _in_order(ours | {name: _load(entry, self.kind, self.attributes) for name, entry in added.items()})


def added_parts(kind: str, group: str) -> dict[str, Any]:
    """Return other packages' parts of a group by name. Raises ExtensionError for one that cannot be loaded."""
    return {name: _load(entry, kind, ()) for name, entry in _added(kind, group, {}).items()}


class Registry(NamedTuple):
    """Source of parts of one kind that are loaded one by one when needed.

    kind        in words, for messages
    parts       by name: ours, as "package.module" or "package.module:object" until they are loaded, and others
    group       of entry points, named like the parts
    attributes  that a part must have
    """

    kind: str
    parts: dict[str, Any]
    group: str
    attributes: tuple[str, ...]

    def names(self) -> list[str]:
        """Return the names of all parts, ours first; loads none. Raises ExtensionError for a name that is taken."""
        return [*self.parts, *_added(self.kind, self.group, self.parts)]

    def __contains__(self, name: object) -> bool:
        """Whether there is a part with that name; looks for entry points only where none of ours has it."""
        return name in self.parts or name in self.names()

    def part(self, name: str) -> Any:
        """Return a part. Raises KeyError for an unknown name, ExtensionError for a part that cannot be used."""
        if name not in self.parts:
            return _load(_added(self.kind, self.group, self.parts)[name], self.kind, self.attributes)
        part = self.parts[name]
        if isinstance(part, str):
            part = self.parts[name] = pkgutil.resolve_name(part)
        return part

    def all(self) -> dict[str, Any]:
        """Return all parts by name. Raises ExtensionError for one that cannot be used."""
        return {name: self.part(name) for name in self.names()}

    def register(self, name: str, part: Any) -> None:
        """Add a part, as an entry point does. Raises ExtensionError for one that cannot be used, or a taken name."""
        _check(part, f"{part!r}", self.kind, self.attributes)
        if self.parts.setdefault(name, part) is not part:
            raise ExtensionError(f"{part!r}: there is a {self.kind} named {name} already; name it otherwise")


def _added(kind: str, group: str, ours: Mapping[str, Any]) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name."""
    entries: dict[str, EntryPoint] = {}
    for entry in _entry_points(group, tuple(sys.path)):
        if entry.name in ours or entry.name in entries:
            raise ExtensionError(f"{_source(entry)}: there is a {kind} named {entry.name} already; name it otherwise")
        entries[entry.name] = entry
    return entries


@lru_cache(maxsize=32)
def _entry_points(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points on a path of imports, kept: to look through all installed packages takes long."""
    # this import takes half as long as all else of `vanedamp --help`
    from importlib.metadata import entry_points

    return tuple(entry_points(group=group))


def _load(entry: EntryPoint, kind: str, attributes: tuple[str, ...]) -> Any:
    try:
        part = entry.load()
    except Exception as error:  # whatever another package's module does
        raise ExtensionError(f"{_source(entry)}: cannot be loaded ({type(error).__name__}: {error})") from error
    _check(part, _source(entry), kind, attributes)
    return part


def _check(part: Any, source: str, kind: str, attributes: tuple[str, ...]) -> None:
    missing = [attribute for attribute in attributes if not hasattr(part, attribute)]
    if missing:
        raise ExtensionError(f"{source}: is no {kind}: lacks {', '.join(missing)}")


def _source(entry: EntryPoint) -> str:
    return f"entry point {entry.name} = {entry.value} ({entry.group})"


def _in_order(parts: dict[str, Any]) -> dict[str, Any]:
    return dict(sorted(parts.items(), key=lambda item: (getattr(item[1], "ORDER", _LAST), item[0])))
