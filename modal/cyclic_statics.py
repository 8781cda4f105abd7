"""Static solutions and stability of a ring, from one of its sectors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from scipy import sparse

from vanedamp.modal.cyclic import CyclicSector
from vanedamp.modal.eigen import stable, stable_share, static_solver
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.petsc import one_analysis
from vanedamp.modal.statics import Statics


class RingStatics(Statics):
    """Static solutions of a ring with the same load on all sectors.

    sector_of  returns the sector of the ring from its matrices
    """

    def __init__(self, sector_of: Callable[[SystemMatrices], CyclicSector]) -> None:
        self._sector_of = sector_of

    @contextmanager
    def solver(self, matrices: SystemMatrices) -> Iterator[Callable[[np.ndarray], np.ndarray]]:
        """Yield the displacements (N,), m, of a sector by a load (N,), N, on each."""
        problem = self._sector_of(matrices).at(0)
        with static_solver(problem.matrices) as solve:
            yield lambda load: problem.fields(solve(problem.forces(load))[None])[0].real

    def stable(self, matrices: SystemMatrices) -> bool:
        """Return whether the stiffness of the ring is positive definite."""
        sector = self._sector_of(matrices)
        with one_analysis():
            return all(stable(sector.at(diameter).matrices) for diameter in sector.diameters)

    def stable_share(self, matrices: SystemMatrices, added: sparse.csr_array) -> float:
        """Return the largest fraction that leaves the ring stable in every nodal diameter."""
        sector = self._sector_of(matrices)
        problems = (sector.at(diameter) for diameter in sector.diameters)
        with one_analysis():
            return min(stable_share(problem.matrices, problem.real_form(added)) for problem in problems)
