"""Import this before dolfinx, PETSc, SLEPc and mpi4py: the order in which their PyPI wheel and h5py's can be loaded.

The wheel loads its MPI library before the rest. It has an HDF5 library of its own, and so has h5py's, which has to be
the first. The system's h5py shares that of PETSc, and is left until a file needs it.
"""

import contextlib
from importlib.util import find_spec
from pathlib import Path

_h5py = find_spec("h5py")
# the folder of a wheel's own libraries
if _h5py is not None and Path(str(_h5py.origin)).parent.with_name("h5py.libs").is_dir():
    import h5py  # noqa: F401

with contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
