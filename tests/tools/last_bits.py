"""`pytest --last-bits SEED`: the tests with the arithmetic of a library that is on no machine.

A result that turns on its last bits differs between processors, and a test that turns on it fails on some. This takes
sums in another order, and gives LAPACK, SuperLU, CHOLMOD, MUMPS and ARPACK another order of unknowns, other signs and
bases of eigenvectors, or other round-off (`startup_path/last_bits_arithmetic.py`). All of it is drawn from the seed,
and the same for the same seed and call: repeated and parallel runs agree as they do with a real library, and a test
fails alone as it failed among others.

Reached, in this process, in pytest's workers and in child processes (by PYTHONPATH and sitecustomize):
`@`, einsum, exp, log, sine in vanedamp and in the tests, whose modules are compiled with calls in their place;
numpy.linalg, scipy.linalg and scipy.sparse.linalg wherever they are called by those names; factors and eigenpairs of
PETSc and SLEPc in modal/petsc.py. Even seeds compile the engine for a generic processor, without fused multiplication
and addition, into a cache of its own (a minute when it is empty).

Not reached: products with sparse matrices, sums (numpy.sum), powers, the math module,
integrators and optimisers inside scipy, dolfinx's assembly. For these there is `make test-arithmetic`.
"""

import os
import sys
from pathlib import Path

from _pytest.assertion import rewrite

from tests.tools.processes import STARTUP, startup

_NUMBA = Path(__file__).resolve().parents[2] / ".cache" / "numba-generic"


def variables(seed: int) -> dict[str, str]:
    """Return the environment of a process that is perturbed from its start."""
    found = startup() | {"VANEDAMP_LAST_BITS": str(seed)}
    if seed % 2 == 0:
        found |= {"NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(_NUMBA)}
    return found


def begin(seed: int) -> None:
    """Perturb this process and those that it starts."""
    os.environ |= variables(seed)
    sys.path.append(str(STARTUP))
    import last_bits_imports

    last_bits_imports.install()
    _perturb_tests(last_bits_imports)


def _perturb_tests(imports) -> None:
    """Have pytest, which compiles test files itself, compile them with other arithmetic, and keep them apart."""
    compiled = rewrite.rewrite_asserts

    def with_calls(tree, *arguments):
        imports.change(tree)
        compiled(tree, *arguments)

    rewrite.rewrite_asserts = with_calls
    rewrite.get_cache_dir = lambda path: imports.CACHE.joinpath("pytest", *path.parts[1:-1])
