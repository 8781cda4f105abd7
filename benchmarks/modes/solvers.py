"""The eigensolvers compared."""

from __future__ import annotations

COUNT = 10
#: what `vanedamp modal` runs where factors need too much memory, without factors
ITERATIVE = "iterative"
NAMES = {
    "lanczos": "block Lanczos, CHOLMOD",
    "iterative": "Davidson, multigrid",
    "mumps": "block Lanczos, MUMPS",
    "superlu": "eigsh, SuperLU (symmetric mode)",
    "superlu_default": "eigsh, SuperLU (default)",
    "cholmod": "eigsh, CHOLMOD",
    "ngsolve": "NGSolve, LOBPCG",
}
#: of the material, SI units
YOUNG, POISSON, DENSITY = 2.0e11, 0.3, 8190.0
