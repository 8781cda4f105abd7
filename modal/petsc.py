"""Sparse symmetric algebra on PETSc and SLEPc: a factorisation and an eigenvalue solver for scipy matrices.

Both lean on MUMPS' LDL^T. All PETSc objects are destroyed before a function returns or when its context ends.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from types import TracebackType
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from slepc4py import SLEPc

# a round trip through a well-posed finite element matrix loses 5 to 8 digits, through a singular one all of them
_ROUND_TRIP = 1e-2


class SolverError(ValueError):
    """A matrix that cannot be factorised, or an eigenvalue problem that does not converge."""


class Factorization:
    """A regular symmetric matrix, factorised once and solved for many right-hand sides; a context manager.

    Raises SolverError for a matrix that is singular to working precision.
    """

    def __init__(self, matrix: sparse.csr_array) -> None:
        self.size = int(matrix.shape[0])
        self._matrix = _petsc_matrix(matrix)
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        try:
            self._ksp.setOperators(self._matrix)
            _configure_direct(self._ksp)
            self._ksp.setUp()
            self._factor = self._ksp.getPC().getFactorMatrix()
            self._check(matrix)
        except BaseException:
            self.destroy()
            raise

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution, of the shape (n,) or (n, k) of the right-hand side."""
        values = np.asarray(rhs, dtype=float)
        if values.ndim not in (1, 2) or values.shape[0] != self.size:
            raise SolverError(f"rhs: expected shape ({self.size},) or ({self.size}, k), not {values.shape}")
        columns = np.array(values.reshape(self.size, -1), order="F")
        solution = np.zeros_like(columns, order="F")
        given = PETSc.Mat().createDense(columns.shape, array=columns, comm=PETSc.COMM_SELF)
        found = PETSc.Mat().createDense(columns.shape, array=solution, comm=PETSc.COMM_SELF)
        try:
            given.assemble()
            found.assemble()
            self._factor.matSolve(given, found)
            return np.array(found.getDenseArray(), order="C").reshape(values.shape)
        finally:
            given.destroy()
            found.destroy()

    def destroy(self) -> None:
        """Free the memory of the factors."""
        self._ksp.destroy()
        self._matrix.destroy()

    def __enter__(self) -> Factorization:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.destroy()

    def _check(self, matrix: sparse.csr_array) -> None:
        status = self._factor.getMumpsInfog(1)
        error = np.inf
        if status >= 0:
            known = np.random.default_rng(0).standard_normal(self.size)
            error = np.abs(self.solve(matrix @ known) - known).max()
        if not error < _ROUND_TRIP:
            raise SolverError(
                f"the matrix of size {self.size} is singular to working precision (MUMPS status {status}); "
                "hold the structure against every rigid motion"
            )


def negative_eigenvalues(matrix: sparse.csr_array) -> int:
    """Number of negative eigenvalues of a symmetric matrix, from its factors (Sylvester's law of inertia)."""
    with _petsc(_petsc_matrix(matrix)) as operator, _petsc(PETSc.KSP().create(PETSc.COMM_SELF)) as ksp:
        ksp.setOperators(operator)
        _configure_direct(ksp)
        ksp.setUp()
        return int(ksp.getPC().getFactorMatrix().getInertia()[0])


def lowest_eigenpairs(
    stiffness: sparse.csr_array, mass: sparse.csr_array, count: int, shift: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (count,) ascending and vectors (count, n) of K x = lambda M x nearest to a shift below them all.

    Krylov-Schur with shift and invert (Stewart 2001, SIAM J. Matrix Anal. Appl. 23). Raises SolverError when fewer
    converge than were asked for.
    """
    with contextlib.ExitStack() as stack:
        matrices = [stack.enter_context(_petsc(_petsc_matrix(matrix))) for matrix in (stiffness, mass)]
        eps = stack.enter_context(_petsc(SLEPc.EPS().create(PETSc.COMM_SELF)))
        eps.setOperators(*matrices)
        eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        eps.setTarget(shift)
        eps.setDimensions(count)
        eps.setTolerances(1e-11, 500)
        transform = eps.getST()
        transform.setType(SLEPc.ST.Type.SINVERT)
        transform.setShift(shift)
        _set_direct(transform.getKSP())
        eps.solve()
        if eps.getConverged() < count:
            raise SolverError(
                f"{eps.getConverged()} of {count} modes converged in {eps.getIterationNumber()} iterations"
            )
        vector = stack.enter_context(_petsc(matrices[0].createVecRight()))
        values, vectors = np.empty(count), np.empty((count, stiffness.shape[0]))
        for index in range(count):
            values[index] = eps.getEigenpair(index, vector).real
            vectors[index] = vector.getArray()
    order = np.argsort(values)
    return values[order], vectors[order]


@contextlib.contextmanager
def _petsc(created: Any) -> Iterator[Any]:
    try:
        yield created
    finally:
        created.destroy()


def _petsc_matrix(matrix: sparse.csr_array) -> Any:
    """A PETSc matrix from a symmetric CSR one; the caller destroys it."""
    csr = (matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), np.array(matrix.data))
    created = PETSc.Mat().createAIJ(size=matrix.shape, csr=csr, comm=PETSc.COMM_SELF)
    created.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return created


def _set_direct(ksp: Any) -> None:
    """Make a Krylov solver a direct one on MUMPS."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType("mumps")


def _configure_direct(ksp: Any) -> None:
    """As `_set_direct`, with the detection of zero pivots that inertia counts need."""
    _set_direct(ksp)
    ksp.getPC().setFactorSetUpSolverType()
    ksp.getPC().getFactorMatrix().setMumpsIcntl(24, 1)
