"""gmsh, loaded when it is first used: its library needs display libraries, which servers lack.

`from vanedamp.modal import gmsh_on_demand as gmsh`, and then as gmsh itself.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from vanedamp.files.errors import VanedampError
from vanedamp.files.machine import out_of_memory


class GmshError(VanedampError):
    """A gmsh that cannot be loaded; the message names the missing library."""


def __getattr__(name: str) -> Any:
    """Return gmsh's own. Raises GmshError where libraries of the system are missing."""
    try:
        return getattr(import_module("gmsh"), name)
    except OSError as error:
        if out_of_memory(error):
            raise
        raise GmshError(
            f"gmsh, which reads and makes meshes, cannot be loaded ({error}): apt install libglu1-mesa libgl1 "
            "libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1"
        ) from None
