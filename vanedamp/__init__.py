"""Vibration damping of vane clusters by loose bodies in cavities.

The parts, in the order of the pipeline: `modal` (finite elements: mesh to matrices, modes, rigid model), `rom` (reduced
models), `coupling` (scenes of a structure and its bodies, run by the exact event engine and other methods), `studies`
(cases, sweeps' pictures, reports, the command line); `meshes` has meshes by parameters, `files` what all stand on.

The names below are loaded when they are first used, so that `import vanedamp` takes no time.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any


def _public() -> dict[str, str]:
    """Return the modules of the public names, "" of a part: as the stub has them, which is their only place."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    return {name.name: (node.module or "").partition(".")[2] for node in imports for name in node.names}


_HOMES = _public()
__all__ = sorted(name for name, home in _HOMES.items() if home)


def __getattr__(name: str) -> Any:
    """Load a public name, or a part, where it is first used."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'vanedamp' has no attribute {name!r}")
    return getattr(import_module(f"vanedamp.{home}"), name) if home else import_module(f"vanedamp.{name}")


def __dir__() -> list[str]:
    return sorted(_HOMES)
