"""The lowest modes without factors of the stiffness, and which structures are so large that they need that.

Factors of a structure in space grow with the 4/3rd power of its freedoms, everything here with the first.
"""

from __future__ import annotations

import contextlib
import os
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.davidson import directions, lowest_eigenpairs
from vanedamp.modal.lanczos import NotConvergedError
from vanedamp.modal.multigrid import Aggregation, VertexMultigrid
from vanedamp.modal.petsc import Product, SolverError
from vanedamp.modal.subspace import Rows

#: ways to find modes: by factors of the stiffness, iteratively, or as the memory allows
SOLVERS = ("factor", "iterative", "auto")
# relative residuals: as block Lanczos has them on factors; of spare modes; of further ones
_TOLERANCE, _SPARE, _GUARD = 1e-11, 3, 4
_LIMITS = (_TOLERANCE, _TOLERANCE**0.5, 0.1)
# the shift of free bodies over the one with factors: the round-off of a rigid mode is measured against it
_SHIFT = 10.0
# bytes of the factor of a compact block of n DOFs, over n^(4/3): 20 numbers, by METIS (19,494 and 56,862 DOFs)
_FACTOR = 160.0
# fraction of the memory that a factor may take: matrices, workspace and the count of modes need as much again
_PART = 0.5
# files with the memory limit of a container
_LIMIT_FILES = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
# mean squared motion at the fixed DOFs that is round-off
_ALLOWED = 1e-20
# number of modes first tried for a range of frequencies
_FIRST = 10


def chosen(solver: str, size: int, memory: float | None = None) -> dict[str, Any]:
    """Return how the modes of a structure with `size` free DOFs are found: "name", and for "auto" why.

    memory: bytes of this machine; None: found out. Raises SolverError for a solver that does not exist.
    """
    if solver not in SOLVERS:
        raise SolverError(f"solver: expected one of {', '.join(SOLVERS)}, not {solver!r}")
    if solver != "auto":
        return {"name": solver}
    factor, memory = _FACTOR * size ** (4.0 / 3.0), machine_memory() if memory is None else memory
    name = "iterative" if factor > _PART * memory else "factor"
    return {"name": name, "factor_bytes": round(factor), "memory_bytes": round(memory)}


def machine_memory() -> int:
    """Return the memory of this machine, or of its container, bytes."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for file in _LIMIT_FILES:
        with contextlib.suppress(OSError, ValueError):  # no container, or "max"
            memory = min(memory, int(file.read_text()))
    return memory


class Iteration:
    """Davidson's method for a structure, its preconditioner made once.

    stiffness, mass  (n, n) of the free DOFs
    floor            a small part of the lowest straining eigenvalue, negative: free bodies are shifted by it
    coordinates      (n_nodes, 3) m
    fixed            DOFs of these nodes that are held
    vertices         as in SystemMatrices

    All vectors begin at random, but for rigid motions. Spare ones, and further ones to a digit, guard against missed
    modes: a mode is missed only if all of them miss it. That is no proof.
    """

    def __init__(
        self, stiffness: sparse.csr_array, mass: sparse.csr_array, floor: float,
        coordinates: np.ndarray, fixed: np.ndarray, vertices: sparse.csr_array | None,
    ) -> None:  # fmt: skip
        self._stiffness, self._mass, self._floor = stiffness, mass, _SHIFT * floor
        self._coordinates, self._vertices = coordinates, vertices
        self._free = np.delete(np.arange(coordinates.size), fixed)
        self._random = np.random.default_rng(0)

    def lowest(self, count: int, known: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest eigenvalues (count,), ascending, and vectors (count, n).

        known: vectors (k, n) to start from. Raises SolverError.
        """
        size = self._mass.shape[0]
        limits = np.repeat(_LIMITS, (count, _SPARE, _GUARD))
        if size <= 2 * directions(limits.size):
            values, vectors = linalg.eigh(
                self._stiffness.toarray(), self._mass.toarray(), subset_by_index=(0, count - 1)
            )
            return values, vectors.T
        mass, precondition = Product(self._mass), self.preconditioner
        begun = list(self._rigid_modes() if known is None else known)[: limits.size]
        begun += [precondition(mass(self._random.standard_normal((1, size))))[0] for _ in limits[len(begun) :]]
        start = np.array(begun)
        try:
            values, vectors = lowest_eigenpairs(
                Product(self._stiffness), mass, self._stiffness.diagonal(), precondition, start, limits, self._floor
            )
        except NotConvergedError as error:
            raise SolverError(f"iterative solver: {error}; take the solver 'factor'") from error
        return values[:count], vectors[:count]

    def within(self, lower: float, upper: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the eigenpairs of an interval: the lowest, more and more of them until it is passed."""
        count, vectors = min(_FIRST, self._mass.shape[0]), None
        while True:
            values, vectors = self.lowest(count, vectors)
            if values[-1] > upper or count == self._mass.shape[0]:
                inside = (values > lower) & (values < upper)
                return values[inside], vectors[inside]
            count = min(2 * count, self._mass.shape[0])

    @cached_property
    def preconditioner(self) -> Rows:
        """A V-cycle applied to rows."""
        return self._aggregation() if self._vertices is None else self._vertex_multigrid(self._vertices)

    def _vertex_multigrid(self, vertices: sparse.csr_array) -> VertexMultigrid:
        up = sparse.csr_array(sparse.kron(vertices, sparse.identity(3), format="csr"))
        # a fixed vertex has no motion of its own
        is_fixed = np.ones(up.shape[0])
        is_fixed[self._free] = 0.0
        to_vertices = sparse.csr_array(up[self._free][:, is_fixed @ up < 1.0])
        coarse = [sparse.csr_array(to_vertices.T @ (matrix @ to_vertices)) for matrix in (self._stiffness, self._mass)]
        return VertexMultigrid(self._stiffness, to_vertices, sparse.csr_array(coarse[0] - self._floor * coarse[1]))

    def _aggregation(self) -> Aggregation:
        # the three DOFs of each node that can move
        dofs = (3 * np.unique(self._free // 3)[:, None] + np.arange(3)).ravel()
        columns = np.searchsorted(dofs, self._free)
        motions = np.zeros((6, dofs.size))
        motions[:, columns] = self._rigid_motions()[:, self._free]
        return Aggregation(sparse.csr_array(self._stiffness - self._floor * self._mass), columns, motions)

    def _rigid_modes(self) -> np.ndarray:
        """Return the rigid motions (0 to 6, n) that fixed DOFs allow: a start that round-off cannot spoil."""
        motions = self._rigid_motions()
        at_supports = np.delete(motions, self._free, axis=1)
        _, sizes, combinations = np.linalg.svd(at_supports @ at_supports.T)
        return combinations[sizes <= _ALLOWED * motions.shape[1]] @ motions[:, self._free]

    def _rigid_motions(self) -> np.ndarray:
        """Return translations and rotations (6, N), each about 1 in size."""
        offsets = self._coordinates - self._coordinates.mean(axis=0)
        offsets = offsets / (np.abs(offsets).max() or 1.0)
        rotations = [np.cross(axis, offsets).ravel() for axis in np.eye(3)]
        return np.vstack([np.tile(np.eye(3), (1, len(offsets))), rotations])
