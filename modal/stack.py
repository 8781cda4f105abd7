"""The way to load dolfinx, PETSc, SLEPc and mpi4py: `with loading():` around their imports, and nowhere else.

Their PyPI wheel and h5py's can be loaded in one order only. The wheel loads its MPI library before the rest. It has an
HDF5 library of its own, and so has h5py's, which has to be the first. The system's h5py shares that of PETSc, and is
left until a file needs it.
"""

import contextlib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from vanedamp.files.interrupts import signals_kept
from vanedamp.files.machine import PackageError, not_loaded

_h5py = find_spec("h5py")
# the folder of a wheel's own libraries
if _h5py is not None and Path(str(_h5py.origin)).parent.with_name("h5py.libs").is_dir():
    import h5py  # noqa: F401


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Within this context, import these packages, which leave the handlers of signals as they were.

    Raises PackageError where one is missing, or does not load.
    """
    try:
        with signals_kept():
            yield
    except (ImportError, OSError) as error:
        raise PackageError(not_loaded(error), name=getattr(error, "name", None)) from error


with loading(), contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
