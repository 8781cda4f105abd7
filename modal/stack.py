"""Import this before dolfinx, PETSc, SLEPc and mpi4py: the order in which their PyPI wheel and h5py's can be loaded.

The wheel loads its MPI library before the rest. It has an HDF5 library of its own, and so has h5py's, which has to be
the first.
"""

import contextlib

import h5py  # noqa: F401

with contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
