"""Sparse symmetric algebra on PETSc and SLEPc: a factorisation and an eigenvalue solver for scipy matrices.

Both lean on MUMPS' LDL^T; the lowest modes of a held structure on CHOLMOD, whose solves are quicker, and on block
Lanczos. All PETSc objects are destroyed before a function returns or when its context ends. Under MPI all ranks divide
eigenvalue problems (SLEPc) and inertia counts (see `parallel`), on MUMPS; a Factorization stays on its own rank.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.files.errors import VanedampError
from vanedamp.modal import parallel
from vanedamp.modal.lanczos import NotConvergedError, directions, eigenpairs
from vanedamp.modal.stack import loading

with loading():
    from petsc4py import PETSc

# a round trip through a well-posed finite element matrix loses 5 to 8 digits, through a singular one all of them
_ROUND_TRIP = 1e-2
# MUMPS' controls: detect zero pivots; factorise the root on one rank, as its inertia is not known otherwise
_FOR_INERTIA = {24: 1, 13: 1}
_PREFIX = "vanedamp_"


class SolverError(VanedampError):
    """A matrix that cannot be factorised, or an eigenvalue problem that does not converge."""


class Factorization:
    """A regular symmetric matrix, factorised once and solved for many right-hand sides; a context manager.

    direct: PETSc's name of the solver, such as "cholmod" for a positive definite matrix. Raises SolverError for a
    matrix that is singular to working precision.
    """

    def __init__(self, matrix: sparse.csr_array, direct: str = "mumps") -> None:
        self.size = int(matrix.shape[0])
        # only the factor is kept: its inputs take as much memory in the largest structures
        with contextlib.ExitStack() as stack:
            view = stack.enter_context(owned(_view(matrix)))
            try:
                self._factor = _factor(stack, view, direct, inertia=direct == "mumps")
            except PETSc.Error as error:
                _forget(direct)
                raise SolverError(f"{direct}: {' '.join(str(error).split())}") from error
        try:
            self._check(matrix, self._factor.getMumpsInfog(1) if direct == "mumps" else 0)
        except BaseException:
            self.destroy()
            raise

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution, of the shape (n,) or (n, k) of the right-hand side."""
        values = np.asarray(rhs, dtype=float)
        if values.ndim not in (1, 2) or values.shape[0] != self.size:
            raise SolverError(f"rhs: expected shape ({self.size},) or ({self.size}, k), not {values.shape}")
        return np.ascontiguousarray(self.solve_rows(values.reshape(self.size, -1).T).T).reshape(values.shape)

    def solve_rows(self, rows: np.ndarray) -> np.ndarray:
        """Return the solutions (k, n) for right-hand sides (k, n)."""
        columns = np.asfortranarray(rows.T)
        solution = np.zeros_like(columns, order="F")
        with (
            owned(PETSc.Mat().createDense(columns.shape, array=columns, comm=PETSc.COMM_SELF)) as right,
            owned(PETSc.Mat().createDense(columns.shape, array=solution, comm=PETSc.COMM_SELF)) as unknowns,
        ):
            right.assemble()
            unknowns.assemble()
            self._factor.matSolve(right, unknowns)
            return np.array(unknowns.getDenseArray().T, order="C")

    def destroy(self) -> None:
        """Free the memory of the factors."""
        self._factor.destroy()

    def __del__(self) -> None:
        # PETSc keeps an object that Python drops, for ranks that have not dropped it yet: here there are no others
        if hasattr(self, "_factor") and not PETSc.Sys.isFinalized():
            self.destroy()

    def __enter__(self) -> Factorization:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()

    def _check(self, matrix: sparse.csr_array, status: int) -> None:
        error = np.inf
        if status >= 0:
            probe = np.random.default_rng(0).standard_normal(self.size)
            error = np.abs(self.solve(matrix @ probe) - probe).max()
        if not error < _ROUND_TRIP:
            raise SolverError(
                f"the matrix of size {self.size} is singular to working precision (status {status}); "
                "hold the structure against every rigid motion"
            )


class Product:
    """A sparse matrix (m, n) that is applied to rows (k, n), several in one pass over its entries."""

    def __init__(self, matrix: sparse.csr_array) -> None:
        self.shape = matrix.shape
        self._matrix = _view(matrix)

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Return the products (k, m)."""
        columns = np.ascontiguousarray(rows).T
        with owned(PETSc.Mat().createDense(columns.shape, array=columns, comm=PETSc.COMM_SELF)) as operand:
            operand.assemble()
            with owned(self._matrix.matMult(operand)) as product:
                return np.array(product.getDenseArray().T, order="C")

    def __del__(self) -> None:
        if hasattr(self, "_matrix") and not PETSc.Sys.isFinalized():
            self._matrix.destroy()


def negative_eigenvalues(matrix: sparse.csr_array) -> int:
    """Return the number of negative eigenvalues of a symmetric matrix, by Sylvester's law of inertia."""
    count: int = _on_all_ranks("inertia", (matrix,))
    return count


def nearest_eigenpairs(
    stiffness: sparse.csr_array, mass: sparse.csr_array, count: int, shift: float, spare: int = 0, width: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (m,) ascending and vectors (m, n) of K x = lambda M x nearest to a shift.

    spare: more pairs than `count`, whose vectors have half the digits; width: `lanczos.eigenpairs`. Block Lanczos on
    one rank, Krylov-Schur (Stewart 2001, SIAM J. Matrix Anal. Appl. 23) on MUMPS on several. Raises SolverError when
    fewer converge than were asked for.
    """
    wanted = count + spare
    if mass.shape[0] <= directions(wanted, width):
        values, vectors = linalg.eigh(stiffness.toarray(), mass.toarray())
        vectors = vectors.T
    elif parallel.COMM.size > 1:
        values, vectors = _on_all_ranks("nearest", (stiffness, mass), wanted, shift)
    else:
        matrix = sparse.csr_array(stiffness - shift * mass) if shift else stiffness
        with factorize(matrix, definite=shift <= 0.0) as factors:
            try:
                values, vectors = eigenpairs(factors.solve_rows, Product(mass), count, shift, spare=spare, width=width)
            except NotConvergedError as error:
                raise SolverError(str(error)) from error
    nearest = np.argsort(np.abs(values - shift), kind="stable")[:wanted]
    return _ascending(values[nearest], vectors[nearest])


def has_cholmod() -> bool:
    """Whether this PETSc is built with SuiteSparse."""
    return bool(PETSc.Sys.hasExternalPackage("suitesparse"))


def factorize(matrix: sparse.csr_array, definite: bool = True) -> Factorization:
    """Factorise a regular symmetric matrix, such as the stiffness of the free DOFs, by CHOLMOD or by MUMPS' LDL^T.

    definite: whether it may be positive definite, for CHOLMOD. The result solves for right-hand sides (n,) or (n, k)
    with `.solve`; `.destroy()` or the end of a `with` block frees it. Raises SolverError for a singular matrix.
    """
    if definite and has_cholmod() and np.all(matrix.diagonal() > 0.0):
        with contextlib.suppress(SolverError):
            return Factorization(matrix, "cholmod")
    return Factorization(matrix)


def interval_eigenpairs(
    stiffness: sparse.csr_array, mass: sparse.csr_array, lower: float, upper: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return all eigenvalues (m,) ascending in an interval and their vectors (m, n), by spectrum slicing.

    Shifts walk through the interval, and inertia counts give the number of eigenvalues between two of them (Campos and
    Roman 2012, Numer. Algorithms 60). Raises SolverError.
    """
    return _ascending(*_on_all_ranks("interval", (stiffness, mass), lower, upper))


@contextlib.contextmanager
def one_analysis() -> Iterator[None]:
    """Within this context, factorise a matrix with the ordering and symbolic factors of one with the same pattern.

    The last factors of each solver are kept for it, which takes memory. The factors of the next matrix replace them, so
    that a Factorization is valid until then. Without effect on several ranks.
    """
    global _analysed
    before, _analysed = _analysed, {} if parallel.COMM.size == 1 else None
    try:
        yield
    finally:
        for analysis in (_analysed or {}).values():
            analysis.destroy()
        _analysed = before


def ranks() -> contextlib.AbstractContextManager[bool]:
    """Yield True on MPI's rank 0, which runs the program, and False on the others once they have helped it."""
    return parallel.ranks(_assist)


def _on_all_ranks(task: str, matrices: tuple[sparse.csr_array, ...], *arguments: Any) -> Any:
    """Run a task on all ranks with the matrices of rank 0."""
    parallel.invite(task, len(matrices), arguments)
    return _run_task(task, matrices, arguments)


def _assist(task: str, matrices: int, arguments: tuple[Any, ...]) -> None:
    # a failure occurs on rank 0 too, which reports it
    with contextlib.suppress(SolverError, PETSc.Error):
        _run_task(task, (None,) * matrices, arguments)


def _run_task(task: str, matrices: tuple[sparse.csr_array | None, ...], arguments: tuple[Any, ...]) -> Any:
    with contextlib.ExitStack() as stack:
        operators = [stack.enter_context(owned(_operator(task, matrix))) for matrix in matrices]
        return _TASKS[task](stack, operators, *arguments)


def _inertia(stack: contextlib.ExitStack, operators: list[Any]) -> int:
    factor = _factor(stack, operators[0])
    status, detail = factor.getMumpsInfog(1), factor.getMumpsInfog(2)
    if status < 0:
        raise SolverError(
            f"MUMPS cannot factorise a matrix of size {operators[0].getSize()[0]}: status {status} ({detail})"
            + (", not enough memory" if status in (-9, -13) else "")
        )
    return int(factor.getInertia()[0])


def _nearest(
    stack: contextlib.ExitStack, operators: list[Any], count: int, shift: float
) -> tuple[np.ndarray, np.ndarray]:
    eps = _eigenproblem(stack, operators, "TARGET_MAGNITUDE")
    eps.setTarget(shift)
    eps.setDimensions(count)
    eps.getST().setShift(shift)
    _solve(eps, eps.getST().getKSP())
    if eps.getConverged() < count:
        raise SolverError(f"{eps.getConverged()} of {count} modes converged in {eps.getIterationNumber()} iterations")
    return _eigenpairs(stack, eps, operators[0])


def _interval(
    stack: contextlib.ExitStack, operators: list[Any], lower: float, upper: float
) -> tuple[np.ndarray, np.ndarray]:
    eps = _eigenproblem(stack, operators, "ALL")
    eps.setInterval(lower, upper)
    _solve(eps, eps.getKrylovSchurKSP())
    return _eigenpairs(stack, eps, operators[0])


_TASKS: dict[str, Callable[..., Any]] = {"inertia": _inertia, "nearest": _nearest, "interval": _interval}


def _eigenproblem(stack: contextlib.ExitStack, operators: list[Any], which: str) -> Any:
    with loading():
        from slepc4py import SLEPc  # one rank and the lowest modes do without

    eps = stack.enter_context(owned(SLEPc.EPS().create(parallel.COMM)))
    eps.setOptionsPrefix(_PREFIX)
    # the solver makes its factors itself, so that MUMPS takes its controls from the options of that prefix only
    options = PETSc.Options(f"{_PREFIX}st_mat_mumps_icntl_")
    for number, value in _FOR_INERTIA.items():
        options[str(number)] = value
        stack.callback(options.delValue, str(number))
    eps.setOperators(*operators)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setTolerances(1e-11, 500)
    eps.setWhichEigenpairs(getattr(SLEPc.EPS.Which, which))
    eps.getST().setType(SLEPc.ST.Type.SINVERT)
    return eps


def _solve(eps: Any, ksp: Any) -> None:
    _set_direct(ksp)
    try:
        eps.solve()
    except PETSc.Error as error:
        raise SolverError(f"the eigenvalue solver failed ({' '.join(str(error).split())})") from error


def _eigenpairs(stack: contextlib.ExitStack, eps: Any, operator: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return all converged values and, on rank 0, vectors."""
    vector = stack.enter_context(owned(operator.createVecRight()))
    values, vectors = np.empty(eps.getConverged()), np.empty((eps.getConverged(), vector.getLocalSize()))
    for index in range(len(values)):
        values[index] = eps.getEigenpair(index, vector).real
        vectors[index] = vector.getArray()
    return values, parallel.gathered(vectors)


@contextlib.contextmanager
def owned(created: Any) -> Iterator[Any]:
    """Yield an object of PETSc, and destroy it."""
    try:
        yield created
    finally:
        created.destroy()


def _ascending(values: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(values, kind="stable")
    return values[order], vectors[order]


def _view(matrix: sparse.csr_array) -> Any:
    """Return a CSR matrix as one of PETSc, which reads and keeps its arrays where they are; the caller destroys it.

    Direct solvers read the upper triangle only.
    """
    matrix = matrix if matrix.has_sorted_indices else matrix.sorted_indices()
    indices = (matrix.indptr.astype(PETSc.IntType, copy=False), matrix.indices.astype(PETSc.IntType, copy=False))
    return PETSc.Mat().createAIJWithArrays(matrix.shape, (*indices, matrix.data), comm=PETSc.COMM_SELF)


def _operator(task: str, matrix: sparse.csr_array | None) -> Any:
    """Return a PETSc matrix for a task; the caller destroys it."""
    if task == "inertia" and matrix is not None and parallel.COMM.size == 1:
        return _view(matrix)
    return _distributed(matrix)


def _distributed(matrix: sparse.csr_array | None) -> Any:
    """Return a PETSc matrix over all ranks from rank 0's symmetric CSR one; the caller destroys it."""
    size, csr = parallel.rows(matrix)
    local = (len(csr[0]) - 1, size)
    created = PETSc.Mat().createAIJ(size=(local, local), csr=csr, comm=parallel.COMM)
    created.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return created


class _Analysed(NamedTuple):
    """A matrix of PETSc and the direct solver that has analysed its pattern."""

    ksp: Any
    matrix: Any

    def fits(self, matrix: Any) -> bool:
        """Whether a matrix has the same pattern."""
        return all(map(np.array_equal, self.matrix.getRowIJ(), matrix.getRowIJ()))

    def destroy(self) -> None:
        self.ksp.destroy()
        self.matrix.destroy()


#: the last of each solver within `one_analysis`; None outside of it
_analysed: dict[str, _Analysed] | None = None


def _factor(stack: contextlib.ExitStack, matrix: Any, direct: str = "mumps", inertia: bool = True) -> Any:
    """Return the factor of a matrix of PETSc, by itself or by the analysis of one with the same pattern."""
    earlier = None if _analysed is None else _analysed.pop(direct, None)
    if earlier is not None and earlier.fits(matrix):
        matrix.copy(earlier.matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        ksp, operator = earlier
    else:
        if earlier is not None:
            earlier.destroy()
        ksp = PETSc.KSP().create(matrix.getComm())
        operator = matrix if _analysed is None else matrix.duplicate(copy=True)
        ksp.setOperators(operator)
        _set_direct(ksp, direct, inertia)
    if _analysed is None:
        stack.callback(ksp.destroy)
    else:
        _analysed[direct] = _Analysed(ksp, operator)
    ksp.setOperators(operator)
    with _one_thread():
        ksp.setUp()
    return ksp.getPC().getFactorMatrix()


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Where OMP_NUM_THREADS is 1, let it be 1: CHOLMOD asks OpenMP for four, which wait by spinning."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # another OpenMP, or none
            openmp = ctypes.CDLL("libgomp.so.1")
            if openmp.omp_get_max_threads() == 1:
                stack.callback(openmp.omp_set_max_active_levels, openmp.omp_get_max_active_levels())
                openmp.omp_set_max_active_levels(0)
        yield


def _forget(direct: str) -> None:
    """Drop the analysis of a solver that has failed."""
    if _analysed is not None and direct in _analysed:
        _analysed.pop(direct).destroy()


def _set_direct(ksp: Any, direct: str = "mumps", inertia: bool = False) -> None:
    """Make a Krylov solver a direct one; inertia: one that can count negative eigenvalues."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(direct)
    if inertia:
        pc.setFactorSetUpSolverType()
        for number, value in _FOR_INERTIA.items():
            pc.getFactorMatrix().setMumpsIcntl(number, value)
