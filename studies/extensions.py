"""Parts that are found, not listed: the files of a folder of ours, and what other packages add by entry points.

An installed package adds a part in its pyproject.toml, without a change here:

    [project.entry-points."vanedamp.commands"]
    fatigue = "acme.fatigue_command"
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from importlib import import_module
from typing import Any, NamedTuple

from vanedamp.files.entry_points import ExtensionError, added_parts

#: place of a part that has no ORDER: after those that have one
_LAST = 1000


class ExtensionPoint(NamedTuple):
    """Where parts of one kind come from. A part is a module, or any object with the attributes.

    kind        in words, for messages
    package     each module of which is a part; folders: each package of which is one
    group       of entry points, whose names are those of the parts
    attributes  that a part must have; it may have a NAME other than its file's, and an ORDER among the others
    """

    kind: str
    package: str
    group: str
    attributes: tuple[str, ...]
    folders: bool = False

    def own(self) -> dict[str, Any]:
        """Return the parts of our own folder by name, in their order."""
        parts = {}
        for _, name, is_folder in pkgutil.iter_modules(import_module(self.package).__path__):
            if is_folder is self.folders:
                part = import_module(f"{self.package}.{name}")
                parts[getattr(part, "NAME", name)] = part
        return _in_order(parts)

    def all(self) -> dict[str, Any]:
        """Return our own parts and those of other packages. Raises ExtensionError for one that cannot be used."""
        parts = self.own()
        for name, source, part in self._added():
            if name in parts:
                raise ExtensionError(f"{source}: there is a {self.kind} named {name} already; name it otherwise")
            parts[name] = part
        return _in_order(parts)

    def _added(self) -> Iterator[tuple[str, str, Any]]:
        """Name, where it comes from, and the part, of every entry point."""
        for name, source, part in added_parts(self.group):
            missing = [attribute for attribute in self.attributes if not hasattr(part, attribute)]
            if missing:
                raise ExtensionError(f"{source}: is no {self.kind}: lacks {', '.join(missing)}")
            yield name, source, part


def _in_order(parts: dict[str, Any]) -> dict[str, Any]:
    return dict(sorted(parts.items(), key=lambda item: (getattr(item[1], "ORDER", _LAST), item[0])))
