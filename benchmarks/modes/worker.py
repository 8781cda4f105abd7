"""One measurement of the modal benchmark, in a process of its own, so that its peak memory is its own.

    python -m benchmarks.modes.worker assemble MESH OUTPUT.npz
    python -m benchmarks.modes.worker SOLVER MATRICES.npz COUNT

prints one line of JSON: seconds by the clock and of the processor, apart for factorisation and iteration, right-hand
sides solved, residual, peak resident memory, eigenvalues. NGSolve reads the mesh beside the matrices, and assembles.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from benchmarks.modes.solvers import DENSITY, POISSON, YOUNG
from benchmarks.timing import clocked, peak_memory

TOLERANCE = 1e-11
Result = dict[str, Any]


def assemble(mesh: str, output: str) -> Result:
    """Return the matrices of the held cluster of quadratic elements; forms are compiled before the clock starts."""
    from vanedamp.modal.elasticity import Material, Solid

    solid = Solid(mesh, {"default": Material(YOUNG, POISSON, DENSITY)})
    solid.assemble({"clamp": "xyz"}, 0.0)
    before = peak_memory()
    result: Result = {}
    with clocked(result, "assembly"):
        matrices = solid.assemble({"clamp": "xyz"}, 0.0)
    free = matrices.free
    stiffness, mass = (matrix[free][:, free] for matrix in (matrices.stiffness, matrices.mass))
    # scipy's matrix type: what every solver below takes
    entries = {f"{name}_{n}": getattr(matrix, n) for name, matrix in (("k", stiffness), ("m", mass)) for n in _PARTS}
    # of the mesh, for the solver that needs no factors: whole nodes are held here
    nodes = free[::3] // 3
    np.savez(output, **entries, coordinates=matrices.coordinates[nodes])
    sparse.save_npz(Path(output).with_name(_VERTICES), sparse.csr_matrix(_moving(matrices.vertices, nodes)))
    return result | {"dofs": int(free.size), "nonzeros": int(stiffness.nnz), "peak_bytes": max(before, peak_memory())}


def lanczos(matrices: Path, count: int) -> Result:
    """Solve by block Lanczos on CHOLMOD, as `vanedamp modal` does on one rank."""
    return _block_lanczos(matrices, count, "cholmod")


def mumps(matrices: Path, count: int) -> Result:
    """Solve by block Lanczos on MUMPS, as `vanedamp modal` does where there is no CHOLMOD."""
    return _block_lanczos(matrices, count, "mumps")


def _block_lanczos(matrices: Path, count: int, direct: str) -> Result:
    from vanedamp.modal import petsc
    from vanedamp.modal.eigen import SPARE
    from vanedamp.modal.lanczos import eigenpairs

    stiffness, mass, result = _load(matrices)

    def solve(rows: np.ndarray) -> np.ndarray:
        result["solves"] += len(rows)
        return factors.solve_rows(rows)

    with clocked(result, "modes"):
        with clocked(result, "factorisation"):
            factors = petsc.Factorization(stiffness, direct)
        with clocked(result, "iteration"):
            values, vectors = eigenpairs(solve, mass, count, spare=SPARE)
    _finish(result, stiffness, mass, values[:count], vectors[:count])
    factors.destroy()
    # that no mode is missed, which the others do not prove: the inertia between the spare modes
    with clocked(result, "proof"):
        below = petsc.negative_eigenvalues(sparse.csr_array(stiffness - 0.5 * values[-2:].sum() * mass))
    if below != len(values) - 1:
        raise ArithmeticError(f"{len(values) - 1} of {below} modes found")
    return result | {"proof_peak_bytes": peak_memory()}


def iterative(matrices: Path, count: int) -> Result:
    """Solve by Davidson's method with multigrid, as `vanedamp modal --solver iterative` does."""
    from vanedamp.modal.iterative import Iteration

    stiffness, mass, result = _load(matrices)
    with np.load(matrices) as file:
        coordinates = file["coordinates"]
    vertices = sparse.csr_array(sparse.load_npz(matrices.with_name(_VERTICES)))

    def cycle(rows: np.ndarray) -> np.ndarray:
        result["solves"] += len(rows)
        return multigrid(rows)

    with clocked(result, "modes"):
        iteration = Iteration(stiffness, mass, 0.0, coordinates, np.empty(0, int), vertices)
        with clocked(result, "factorisation"):
            multigrid = iteration.preconditioner
        iteration.preconditioner = cycle
        with clocked(result, "iteration"):
            values, vectors = iteration.lowest(count)
    _finish(result, stiffness, mass, values, vectors)
    return result


def superlu(matrices: Path, count: int) -> Result:
    """Solve by scipy's eigsh on SuperLU, with the ordering and pivoting for symmetric matrices."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return _arpack(matrices, count, lambda matrix: splu(matrix, **options).solve)


def superlu_default(matrices: Path, count: int) -> Result:
    """Solve by scipy's eigsh with sigma only: SuperLU with its default ordering."""
    return _arpack(matrices, count, lambda matrix: splu(matrix).solve)


def cholmod(matrices: Path, count: int) -> Result:
    """Solve by scipy's eigsh on CHOLMOD by scikit-sparse, supernodal; METIS where AMD leaves much to do."""
    from sksparse.cholmod import cholesky

    return _arpack(matrices, count, lambda matrix: cholesky(matrix, mode="supernodal"))


def ngsolve(matrices: Path, count: int) -> Result:
    """Solve by NGSolve alone, on the mesh beside the matrices."""
    from benchmarks.modes.peer_ngsolve import modes

    return modes(matrices.with_name("cluster.msh"), count)


SOLVERS: dict[str, Callable[[Path, int], Result]] = {
    "lanczos": lanczos, "iterative": iterative, "mumps": mumps, "superlu": superlu, "superlu_default": superlu_default,
    "cholmod": cholmod, "ngsolve": ngsolve,
}  # fmt: skip
_PARTS = ("data", "indices", "indptr")
_VERTICES = "vertices.npz"


def _moving(vertices: Any, nodes: np.ndarray) -> Any:
    """Return the rows of nodes, and the vertices among them."""
    own = vertices[nodes]
    return own[:, np.asarray(own.max(axis=0).toarray()).ravel() > 0.999]


def _arpack(matrices: Path, count: int, factorise: Callable[[Any], Any]) -> Result:
    """Solve by implicitly restarted Lanczos on a factorisation."""
    stiffness, mass, result = _load(matrices)

    def solve(load: np.ndarray) -> np.ndarray:
        result["solves"] += 1
        return np.asarray(factor(load))

    with clocked(result, "modes"):
        with clocked(result, "factorisation"):
            factor = factorise(sparse.csc_matrix(stiffness))
        with clocked(result, "iteration"):
            inverse = LinearOperator(mass.shape, solve, dtype=float)
            values, vectors = eigsh(inverse, count, mass, sigma=0.0, OPinv=inverse, tol=TOLERANCE)
    _finish(result, stiffness, mass, values, vectors.T)
    return result


def _load(path: Path) -> tuple[sparse.csr_array, sparse.csr_array, Result]:
    """Return stiffness and mass, and the result so far: the memory that they and the interpreter take."""
    with np.load(path) as file:
        shape = (file["k_indptr"].size - 1,) * 2
        first, second = (sparse.csr_array(tuple(file[f"{n}_{p}"] for p in _PARTS), shape=shape) for n in "km")
    return first, second, {"solves": 0, "loaded_bytes": peak_memory()}


def _finish(result: Result, stiffness: Any, mass: Any, values: np.ndarray, vectors: np.ndarray) -> None:
    """Add the peak memory so far, eigenvalues and the largest residual |K x - lambda M x| / (lambda |M x|)."""
    result["peak_bytes"] = peak_memory()
    inertia = (mass @ vectors.T).T
    defects = np.linalg.norm((stiffness @ vectors.T).T - values[:, None] * inertia, axis=1)
    result["residual"] = float((defects / values / np.linalg.norm(inertia, axis=1)).max())
    result["eigenvalues"] = np.sort(values).tolist()


def main(arguments: list[str]) -> None:
    """Measure and print one line of JSON."""
    task, first, second = arguments
    print(json.dumps(assemble(first, second) if task == "assemble" else SOLVERS[task](Path(first), int(second))))


if __name__ == "__main__":
    main(sys.argv[1:])
