"""One measurement of the modal benchmark, in a process of its own, so that its peak memory is its own.

    python -m vanedamp.studies.bench.modes.worker assemble MESH OUTPUT.npz
    python -m vanedamp.studies.bench.modes.worker SOLVER MATRICES.npz COUNT

prints one line of JSON: seconds by the clock and of the processor, peak resident memory, frequencies.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

TOLERANCE = 1e-11
YOUNG, POISSON, DENSITY = 2.0e11, 0.3, 8190.0
Result = dict[str, Any]


def assemble(mesh: str, output: str) -> Result:
    """Return the matrices of the held cluster of quadratic elements; forms are compiled before the clock starts."""
    from vanedamp.modal.elasticity import Material, Solid

    solid = Solid(mesh, {"default": Material(YOUNG, POISSON, DENSITY)})
    solid.assemble({"clamp": "xyz"}, 0.0)
    before = _peak()
    result: Result = {}
    with _clock(result, "assembly"):
        matrices = solid.assemble({"clamp": "xyz"}, 0.0)
    free = matrices.free
    stiffness, mass = (matrix[free][:, free] for matrix in (matrices.stiffness, matrices.mass))
    # scipy's matrix type: what every solver below takes
    np.savez(
        output, **{f"k_{n}": getattr(stiffness, n) for n in _PARTS}, **{f"m_{n}": getattr(mass, n) for n in _PARTS}
    )
    return result | {"dofs": int(free.size), "nonzeros": int(stiffness.nnz), "peak_bytes": max(before, _peak())}


def slepc(stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    """Solve by SLEPc's Krylov-Schur on CHOLMOD, as `vanedamp modal` does on one rank."""
    return _krylov_schur("cholmod", stiffness, mass, count)


def mumps(stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    """Solve by SLEPc's Krylov-Schur on MUMPS, as `vanedamp modal` does on several ranks."""
    return _krylov_schur("mumps", stiffness, mass, count)


def _krylov_schur(direct: str, stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    from vanedamp.modal import petsc

    result: Result = {}
    with _clock(result, "factorisation"), petsc.Factorization(stiffness, direct):
        pass
    with _clock(result, "modes"):
        values, _ = petsc.nearest_eigenpairs(stiffness, mass, count, 0.0, direct)
    return result | {"eigenvalues": values.tolist()}


def superlu(stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    """Solve by scipy's eigsh on SuperLU, with the ordering and pivoting for symmetric matrices."""
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return _arpack(lambda: splu(sparse.csc_matrix(stiffness), **options).solve, mass, count)


def superlu_default(stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    """Solve by scipy's eigsh with sigma only: SuperLU with its default ordering."""
    return _arpack(lambda: splu(sparse.csc_matrix(stiffness)).solve, mass, count)


def cholmod(stiffness: sparse.csr_array, mass: sparse.csr_array, count: int) -> Result:
    """Solve by scipy's eigsh on CHOLMOD by scikit-sparse, supernodal, the best of its orderings."""
    from sksparse.cholmod import cholesky

    return _arpack(lambda: cholesky(sparse.csc_matrix(stiffness), mode="supernodal"), mass, count)


SOLVERS: dict[str, Callable[[sparse.csr_array, sparse.csr_array, int], Result]] = {
    "slepc": slepc, "mumps": mumps, "superlu": superlu, "superlu_default": superlu_default, "cholmod": cholmod,
}  # fmt: skip
_PARTS = ("data", "indices", "indptr")


def _arpack(factorise: Callable[[], Any], mass: sparse.csr_array, count: int) -> Result:
    """Solve by implicitly restarted Lanczos on a factorisation; both are timed."""
    result: Result = {}
    with _clock(result, "modes"):
        with _clock(result, "factorisation"):
            solve = factorise()
        size = mass.shape[0]
        inverse = LinearOperator((size, size), solve, dtype=float)
        values = eigsh(inverse, count, mass, sigma=0.0, OPinv=inverse, tol=TOLERANCE)[0]
    return result | {"eigenvalues": np.sort(values).tolist()}


def _load(path: str) -> tuple[sparse.csr_array, sparse.csr_array]:
    with np.load(path) as file:
        shape = (file["k_indptr"].size - 1,) * 2
        first, second = (sparse.csr_array(tuple(file[f"{n}_{p}"] for p in _PARTS), shape=shape) for n in "km")
    return first, second


@contextmanager
def _clock(result: Result, name: str) -> Any:
    wall, processor = time.perf_counter(), time.process_time()
    yield
    result[name] = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - processor}


def _peak() -> int:
    """Return the peak resident memory of this process, bytes."""
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used if sys.platform == "darwin" else 1024 * used


def main(arguments: list[str]) -> None:
    """Measure and print one line of JSON."""
    task, *rest = arguments
    if task == "assemble":
        print(json.dumps(assemble(*rest)))
        return
    stiffness, mass = _load(rest[0])
    loaded = _peak()
    result = SOLVERS[task](stiffness, mass, int(rest[1]))
    print(json.dumps(result | {"loaded_bytes": loaded, "peak_bytes": _peak()}))


if __name__ == "__main__":
    main(sys.argv[1:])
