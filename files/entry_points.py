"""Parts that installed packages add by entry points, in their pyproject.toml."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vanedamp.files.errors import VanedampError


class ExtensionError(VanedampError):
    """A part of another package that cannot be used."""


def added_parts(group: str) -> Iterator[tuple[str, str, Any]]:
    """Name, where it comes from, and the part, of every entry point of a group.

    Raises ExtensionError for one that cannot be loaded.
    """
    # this import takes half as long as all else of `vanedamp --help`
    from importlib.metadata import entry_points

    for entry in entry_points(group=group):
        source = f"entry point {entry.name} = {entry.value} ({group})"
        try:
            part = entry.load()
        except Exception as error:  # whatever another package's module does
            raise ExtensionError(f"{source}: cannot be loaded ({type(error).__name__}: {error})") from error
        yield entry.name, source, part
