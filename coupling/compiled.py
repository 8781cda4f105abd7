"""The decorators of compiled functions.

Cached on disk between processes; divisions by zero give inf as in C; a product and a sum may be one instruction; no
reference counting, which would cost more than the arithmetic: a compiled function allocates nothing and works in the
arrays that it is given (coupling.state.Scratch).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import config, njit

#: start of a counter: a literal 0 has a type of its own, for which numba would compile all that it is handed to again
ZERO = np.int64(0)


_MARKS = (b"@entry", b"@kernel", b"@inlined")


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine that Python calls."""
    return _compile(function, no_cfunc_wrapper=True)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine that compiled functions alone may call.

    Unpacking the records' arrays for Python would take longer to compile than most functions themselves.
    """
    return _compile(function, no_cfunc_wrapper=True, no_cpython_wrapper=True)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine into its callers, compiled ones: for what every segment runs.

    A call hands over every array of its records, some 5 kB: it costs as much as a handful of exponentials.
    """
    return _compile(function, no_cfunc_wrapper=True, no_cpython_wrapper=True, forceinline=True)


def _compile(function: Callable[..., Any], **options: bool) -> Any:
    compiled = njit(cache=True, error_model="numpy", _nrt=False, fastmath={"contract"}, **options)(function)  # type: ignore[call-overload]
    if config.DISABLE_JIT:  # type: ignore[attr-defined]  # plain Python, for a debugger
        return compiled
    # numba dates a cached function by its own file alone, but it holds the code of the functions that it calls
    compiled._cache._cache_file._source_stamp = _sources()
    return compiled


@cache
def _sources() -> str:
    """Digest of the files that hold compiled functions or the constants in them."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        text = file.read_bytes()
        if any(mark in text for mark in _MARKS) or file.name in (
            "compiled.py",
            "state.py",
        ):
            digest.update(text)
    return digest.hexdigest()
