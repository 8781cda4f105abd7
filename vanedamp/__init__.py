"""Vibration damping of vane clusters by loose bodies in cavities.

`import vanedamp as vd` takes no time: a name is loaded when it is first used. The names, by groups:
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from textwrap import fill, indent
from typing import Any, NamedTuple


class _Group(NamedTuple):
    """Public names that belong together, with their modules, "" of a part."""

    title: str
    about: str
    homes: dict[str, str]

    def __str__(self) -> str:
        return f"\n{self.title}: {self.about}\n\n{indent(fill(', '.join(self.homes), 100), '    ')}\n"


def _read() -> list[_Group]:
    """Return the groups as the stub has them, which is their only place."""
    groups = []
    for line in Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8").splitlines():
        if found := re.fullmatch(r"# ([A-Z][\w ]*): (.+)", line):
            groups.append(_Group(found[1], found[2], {}))
        elif found := re.match(r"from vanedamp\.?(\S*) import (\w+)", line):
            groups[-1].homes[found[2]] = found[1]
    return groups


_GROUPS = _read()
_HOMES = {name: home for group in _GROUPS for name, home in group.homes.items()}
__all__ = [name for name, home in _HOMES.items() if home]
__doc__ = (__doc__ or "") + "".join(map(str, _GROUPS))


def __getattr__(name: str) -> Any:
    """Load a public name, or a part, where it is first used."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'vanedamp' has no attribute {name!r}")
    return getattr(import_module(f"vanedamp.{home}"), name) if home else import_module(f"vanedamp.{name}")


def __dir__() -> list[str]:
    return sorted(_HOMES)
