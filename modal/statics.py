"""Static solutions and stability of a structure, as prestress needs them; `cyclic_statics` has those of a ring."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vanedamp.modal.eigen import stable_share, static_shape
from vanedamp.modal.matrices import SystemMatrices


class Statics:
    """Those of a structure by itself."""

    def shape(self, matrices: SystemMatrices, load: np.ndarray) -> np.ndarray:
        """Return the displacements (N,), m, under a static load (N,), N. Raises SolverError where nothing holds it."""
        return static_shape(matrices, load)

    def stable_share(self, matrices: SystemMatrices, added: sparse.csr_array) -> float:
        """Return the largest fraction (0 to 1) of a stiffness (N, N) that leaves the structure stable."""
        return stable_share(matrices, added)
