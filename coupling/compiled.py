"""The one decorator of compiled functions.

Cached on disk between processes; divisions by zero give inf as in C; no reference counting, which would cost more than
the arithmetic: a compiled function allocates nothing and works in the arrays that it is given (coupling.state.Scratch).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba import config, njit


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine."""
    return _compile(function, forceinline=False)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine into its callers: for what every segment runs.

    A call hands over every array of its records, some 5 kB: it costs as much as a handful of exponentials.
    """
    return _compile(function, forceinline=True)


def _compile(function: Callable[..., Any], forceinline: bool) -> Any:
    compiled = njit(cache=True, error_model="numpy", _nrt=False, forceinline=forceinline)(function)  # type: ignore[call-overload]
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
        if b"@kernel" in text or b"@inlined" in text or file.name in ("compiled.py", "state.py"):
            digest.update(text)
    return digest.hexdigest()
