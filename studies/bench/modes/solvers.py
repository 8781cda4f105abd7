"""The eigensolvers compared."""

from __future__ import annotations

COUNT = 10
#: what `vanedamp modal` runs on one rank
OURS = "slepc"
NAMES = {
    "slepc": "SLEPc, CHOLMOD",
    "mumps": "SLEPc, MUMPS",
    "superlu": "eigsh, SuperLU (symmetric mode)",
    "superlu_default": "eigsh, SuperLU (default)",
    "cholmod": "eigsh, CHOLMOD",
}
