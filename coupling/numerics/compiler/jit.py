"""The decorators of compiled functions, and the disk cache of those that Python calls.

Those that Python calls are kept on disk between processes, with the code of those that they call. Divisions by zero
give inf as in C; a product and a sum may be one instruction; no reference counting, which would cost more than the
arithmetic: a compiled function allocates nothing and works in the arrays that it is given (`Scratch` of the engines).
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial, update_wrapper
from pathlib import Path
from typing import Any

import numpy as np
from numba import config, njit, typeof, types
from numba.core import event
from numba.extending import typeof_impl

from vanedamp.coupling.numerics.compiler.record import is_record, lengths, sized_type
from vanedamp.files.errors import VanedampError

try:
    from vanedamp.coupling.numerics.compiler.code_library import COMPILERS
except ImportError:  # another numba than those tried
    COMPILERS = {kind: {} for kind in ("entry", "kernel", "inlined", "loops")}

#: start of a counter: numba would compile the callees of a literal 0 again
ZERO = np.int64(0)

_OPTIONS: dict[str, Any] = {
    "error_model": "numpy", "_nrt": False, "fastmath": {"contract"}, "no_cfunc_wrapper": True,
}  # fmt: skip
_NOT_FROM_PYTHON = {"no_cpython_wrapper": True}
# no sum and product become one: results do not depend on what a function is compiled into
_STRICT = _OPTIONS | {"fastmath": False}

# marks of files that enter compiled code: functions, and records, whose fields have their places there
_MARKS = (
    "@entry", "@kernel", "@counting", "@inlined", "@summing", "@comparing", "@strict", "@intrinsic", "(NamedTuple)",
)  # fmt: skip
_PACKAGE = Path(__file__).parents[3]


_Decorator = Callable[[Callable[..., Any]], Any]

#: compiles a function that only compiled functions call, as a part of them
kernel: _Decorator = njit(**_OPTIONS | _NOT_FROM_PYTHON, **COMPILERS["kernel"])
#: the same into its callers: for functions that every segment runs
inlined: _Decorator = njit(**_OPTIONS | _NOT_FROM_PYTHON, **COMPILERS["inlined"])
#: a kernel with the same results, bit for bit, in all its callers: for figures of single runs and of batches. It calls
#: no part of numba that is written in Python (complex division, abs of a complex number): that would have the freedoms
#: of its first caller
strict: _Decorator = njit(**_STRICT | _NOT_FROM_PYTHON, **COMPILERS["kernel"])
#: a kernel whose sums may be taken in any order, several terms at once
summing: _Decorator = njit(**_OPTIONS | _NOT_FROM_PYTHON | {"fastmath": {"contract", "reassoc"}}, **COMPILERS["loops"])
#: a kernel that compares many numbers, several at once; its result for NaN is arbitrary
comparing: _Decorator = njit(
    **_OPTIONS | _NOT_FROM_PYTHON | {"fastmath": {"contract", "nnan", "nsz"}}, **COMPILERS["loops"]
)
#: a kernel that returns parts of arrays, whose references are counted
counting: _Decorator = njit(**_OPTIONS | _NOT_FROM_PYTHON | {"_nrt": True}, **COMPILERS["kernel"])


class CacheError(VanedampError):
    """Compiled functions have no folder to be kept in: every process would compile them again, for a minute."""


class Entry:
    """A compiled function that Python calls, kept on disk; as a kernel, in `kernel`, compiled functions call it."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.kernel = njit(**options | _NOT_FROM_PYTHON, **COMPILERS["kernel"])(function)
        self._compiled = _kept(function, options)
        self._sized: dict[Any, Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Call it, compiled for the types of these arguments."""
        return self._compiled(*arguments)

    def sized(self, *arguments: Any) -> Callable[..., Any]:
        """Return it compiled for arguments like these, and for the lengths of the records among them."""
        key = tuple((type(value), lengths(value) if is_record(value) else None) for value in arguments)
        if key not in self._sized:
            kinds = tuple(sized_type(value) if is_record(value) else typeof(value) for value in arguments)
            self._compiled.compile(kinds)
            self._sized[key] = self._compiled.overloads[kinds].entry_point
        return self._sized[key]


@typeof_impl.register(Entry)
def _type_of_entry(function, context):
    return types.Dispatcher(function.kernel)


def entry(function: Callable[..., Any]) -> Any:
    """Compile a function of the engine that Python calls, and compiled functions may."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]  # plain Python, for a debugger
        return function
    return Entry(function, _OPTIONS)


def counting_entry(function: Callable[..., Any]) -> Any:
    """Compile a function as `counting` that Python calls, and compiled functions may."""
    return function if config.DISABLE_JIT else Entry(function, _OPTIONS | {"_nrt": True})  # type: ignore[attr-defined]


def strict_entry(function: Callable[..., Any]) -> Any:
    """Compile a function as `strict` that Python calls, and compiled functions may."""
    return function if config.DISABLE_JIT else Entry(function, _STRICT)  # type: ignore[attr-defined]


def _kept(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Compile a function that Python calls, and keep it on disk."""
    try:
        compiled = njit(**options, cache=True, **COMPILERS["entry"])(function)
    except RuntimeError as error:  # numba has found no folder that it can write to
        folders = f"NUMBA_CACHE_DIR ({config.CACHE_DIR or 'not set'}), {Path(__file__).with_name('__pycache__')}"  # type: ignore[attr-defined]
        raise CacheError(
            f"compiled functions have no folder that can be written to, of {folders} and the user's cache: "
            "set NUMBA_CACHE_DIR to one"
        ) from error
    try:
        from vanedamp.coupling.numerics.compiler.code_file import CodeFile

        stored = compiled._cache
        # numba dates a cached function by its own file only, but it holds the code of the functions that it calls
        stored._cache_file = CodeFile(
            stored.cache_path, stored._impl.filename_base, _sources(Path(function.__code__.co_filename))
        )  # fmt: skip
    except (AttributeError, ImportError, TypeError):  # another numba: nothing is kept, as its date would not do
        return njit(**options, **COMPILERS["entry"])(function)
    # references are counted by code that numba prepares as it loads all that it could compile
    if hasattr(stored, "_load_overload") and not options["_nrt"]:
        stored.load_overload = partial(_load, stored)
    return compiled


def _load(stored: Any, signature: Any, target: Any) -> Any:
    """Load machine code as numba does, without all that it could compile, which takes a quarter of a start."""
    with stored._guard_against_spurious_io_errors():
        return stored._load_overload(signature, target)


@cache
def _sources(file: Path) -> str:
    """Return the digest of a file of compiled functions and of its imports, through files of functions and records.

    The imports of other files are data: they do not enter the code.
    """
    sources: set[Path] = set()
    waiting = [file]
    while waiting:
        path = waiting.pop()
        if path not in sources:
            sources.add(path)
            waiting += _read(path)[1]
    digest = hashlib.sha256()
    for path in sorted(sources):
        digest.update(_read(path)[0])
    return digest.hexdigest()


@cache
def _read(path: Path) -> tuple[bytes, list[Path]]:
    """Return the text of a file, and the imports that it has as a file of functions or records."""
    text = path.read_text(encoding="utf-8")
    if not any(mark in text for mark in _MARKS):
        return text.encode(), []
    names = re.findall(r"^from vanedamp\.([\w.]+) import", text, re.MULTILINE)
    files = [_PACKAGE / f"{name.replace('.', '/')}.py" for name in names]
    return text.encode(), [name for name in files if name.is_file()]


class NotCompiled(Exception):
    """The disk cache lacks a function."""


class _Refusal(event.Listener):
    """Stops a compilation before it begins."""

    def on_start(self, event: Any) -> None:
        raise NotCompiled

    def on_end(self, event: Any) -> None:
        pass


@contextmanager
def loading_only() -> Iterator[None]:
    """Raise NotCompiled where a function would be compiled."""
    with event.install_listener("numba:compile", _Refusal()):
        yield
