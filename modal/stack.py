"""Import this before dolfinx, PETSc, SLEPc and mpi4py: their PyPI wheel loads its MPI library before them."""

import contextlib

with contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
