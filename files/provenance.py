"""Software versions of a result."""

from __future__ import annotations

import importlib
import importlib.metadata
import platform


def versions() -> dict[str, str]:
    """Return the versions of this project and of the libraries its numbers depend on."""
    try:
        version = importlib.metadata.version("vanedamp")
    except importlib.metadata.PackageNotFoundError:  # run from a source tree
        version = "not installed"
    # the system's h5py has no package metadata
    others = {name: str(importlib.import_module(name).__version__) for name in ("numpy", "scipy", "numba", "h5py")}
    return {"vanedamp": version, "python": platform.python_version()} | others
