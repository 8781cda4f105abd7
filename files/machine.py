"""Missing packages and memory of a machine, recognised by errors."""

from __future__ import annotations

import errno
import re

#: packages of the finite elements, and how to get them
_SYSTEM = ("dolfinx", "petsc4py", "slepc4py", "ufl", "basix", "ffcx", "mpi4py", "cffi")
_FINITE_ELEMENTS = (
    "pip install 'vanedamp[fem]' (Linux on x86-64, Python 3.12 or newer), apt install python3-dolfinx, or "
    "conda's environment.yml (CONTRIBUTING.md)"
)
#: names of packages that differ from their modules'
_ON_PYPI = {"vtkmodules": "vtk", "yaml": "pyyaml"}
#: words of glibc's loader, and of Python about threads
_NO_MEMORY = re.compile(r"failed to map|cannot map|cannot (re)?allocate memory(?! in static)|can't start new thread")


class PackageError(ImportError):
    """A package that is missing, or does not load; the message says which, why, and what to do."""


def not_loaded(error: ImportError | OSError) -> str | None:
    """Return that message for an error of an import; None if it is a fault of this project."""
    package = (getattr(error, "name", None) or "").split(".")[0]
    if isinstance(error, PackageError):
        return str(error)
    if package == "vanedamp":
        return None
    if isinstance(error, ModuleNotFoundError):
        remedy = _FINITE_ELEMENTS if package in _SYSTEM else f"pip install {_ON_PYPI.get(package, package)}"
        return f"needs {package}, which cannot be loaded ({error}): {remedy}"
    return f"a library is installed, but cannot be loaded ({error})"


def out_of_memory(error: BaseException | None) -> str | None:
    """Return the message of an error about memory, or of such a cause of it; None for another error."""
    reason = None
    while error is not None:
        no_memory = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
        if no_memory or _NO_MEMORY.search(str(error)):
            reason = str(error) or "none left"  # in the end the first cause
        error = error.__cause__ or error.__context__
    return reason
