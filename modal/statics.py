"""Static solutions and stability of a structure, for prestress; of a ring, see `cyclic_statics`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

import numpy as np
from scipy import sparse

from vanedamp.modal.eigen import stable, stable_share, static_solver
from vanedamp.modal.matrices import SystemMatrices


class Statics:
    """Static solutions and stability of a single structure."""

    def solver(self, matrices: SystemMatrices) -> AbstractContextManager[Callable[[np.ndarray], np.ndarray]]:
        """Return a context with the displacements (N,), m, by a static load (N,), N.

        Raises SolverError where nothing holds the structure.
        """
        return static_solver(matrices)

    def stable(self, matrices: SystemMatrices) -> bool:
        """Return whether the stiffness is positive definite."""
        return stable(matrices)

    def stable_share(self, matrices: SystemMatrices, added: sparse.csr_array) -> float:
        """Return the largest fraction (0 to 1) of a stiffness (N, N) that leaves the structure stable."""
        return stable_share(matrices, added)
