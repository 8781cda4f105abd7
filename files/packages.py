"""Packages that cannot be loaded: a line that says which, why, and what to do."""

from __future__ import annotations

import re

#: packages of the finite elements, and how to get them
_SYSTEM = ("dolfinx", "petsc4py", "slepc4py", "ufl", "basix", "ffcx", "mpi4py", "cffi")
_FINITE_ELEMENTS = (
    "pip install 'vanedamp[fem]' (Linux on x86-64, Python 3.12 or newer), apt install python3-dolfinx, or "
    "conda's environment.yml (CONTRIBUTING.md)"
)
#: names of packages that differ from their modules'
_ON_PYPI = {"vtkmodules": "vtk", "yaml": "pyyaml"}
#: how the loader of glibc says that a library does not fit into the memory
_NO_MEMORY = re.compile(r"failed to map|cannot map|cannot (re)?allocate memory(?! in static)|cannot create")


class PackageError(ImportError):
    """A package that cannot be loaded; the message is that line."""


def not_loaded(error: ImportError | OSError) -> str | None:
    """Return the line; None where a module of this project is missing, which is a fault of the program."""
    package = (getattr(error, "name", None) or "").split(".")[0]
    if isinstance(error, PackageError):
        return str(error)
    if package == "vanedamp":
        return None
    if isinstance(error, ModuleNotFoundError):
        remedy = _FINITE_ELEMENTS if package in _SYSTEM else f"pip install {_ON_PYPI.get(package, package)}"
        return f"needs {package}, which cannot be loaded ({error}): {remedy}"
    return f"{package or 'a library'} is installed, but cannot be loaded ({error}){memory_hint(error)}"


def memory_hint(error: BaseException) -> str:
    """Return what to do about a library that the memory has no room for; "" for another error."""
    short = isinstance(error, MemoryError) or _NO_MEMORY.search(str(error))
    return ": too little memory, or a limit on it (ulimit -v)" if short else ""
