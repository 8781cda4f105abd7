"""The way to load dolfinx, PETSc, SLEPc and mpi4py: `with loading():` around their imports, and nowhere else.

Their PyPI wheel and h5py's can be loaded in one order only. The wheel loads its MPI library before the rest. It has an
HDF5 library of its own, and so has h5py's, which has to be the first. The system's h5py shares that of PETSc, and is
left until a file needs it.
"""

import contextlib
import ctypes
import os
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from vanedamp.files.machine import PackageError, not_loaded

_h5py = find_spec("h5py")
# the folder of a wheel's own libraries
if _h5py is not None and Path(str(_h5py.origin)).parent.with_name("h5py.libs").is_dir():
    import h5py  # noqa: F401


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Within this context, import these packages. Raises PackageError where one is missing, or does not load."""
    try:
        with _signals_kept():
            yield
    except (ImportError, OSError) as error:
        raise PackageError(not_loaded(error), name=getattr(error, "name", None)) from error


@contextlib.contextmanager
def _signals_kept() -> Iterator[None]:
    """Leave the process's reactions to signals as they are: MPI and PETSc print, abort and let a closed pipe kill it.

    By the C library, as Python knows its own handlers only, and sets them in its main thread only.
    """
    if os.name != "posix":
        yield
        return
    libc = ctypes.CDLL(None)
    kept = {number: ctypes.create_string_buffer(1024) for number in range(1, signal.SIGRTMIN)}  # of any sigaction
    for number, action in kept.items():
        libc.sigaction(number, None, action)
    try:
        yield
    finally:
        for number, action in kept.items():
            libc.sigaction(number, action, None)


with loading(), contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
