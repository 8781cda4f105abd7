"""Files that a user hands over: no devices, and whatever a reader or its library meets in them is one line."""

from __future__ import annotations

import contextlib
import os
import signal
import stat
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

from vanedamp.files.errors import VanedampError

#: signals by which a library dies of a damaged file; PETSc catches them, and ends the process with a page of text
_DEADLY = (signal.SIGSEGV, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
#: s for a trial read, and bytes a second beyond them: a slow disk's
_PATIENCE, _SPEED = 60, 1e6


def existing(path: str | os.PathLike[str], error: type[VanedampError], kind: str = "file") -> Path:
    """Return the path of a regular file. Raises `error` for one that is missing, a folder, a device or a pipe.

    kind: what the message calls it.
    """
    file = Path(path)
    try:
        mode = os.stat(file).st_mode
    except FileNotFoundError:
        raise error(f"{path}: no such {kind}") from None
    except (OSError, ValueError) as reason:  # ValueError: a zero character in the name
        raise error(f"{path}: cannot be read ({getattr(reason, 'strerror', None) or reason})") from None
    if stat.S_ISDIR(mode):
        raise error(f"{path}: is a folder; expected a file")
    if not stat.S_ISREG(mode):
        raise error(f"{path}: is a device or a pipe; expected a file")
    return file


@contextlib.contextmanager
def reading(path: str | os.PathLike[str], error: type[VanedampError], expected: str) -> Iterator[None]:
    """Turn what a reader stumbles over into `error` with the file; expected: what the file should be.

    Errors about input pass, and so do those of the system, a lack of memory and missing packages: no fault of the file.
    """
    try:
        yield
    except (VanedampError, MemoryError, ImportError):
        raise
    except Exception as reason:
        if isinstance(reason, OSError) and reason.errno:
            raise
        told = " ".join(str(reason).split()) or type(reason).__name__
        raise error(f"{path}: {expected}: damaged, or of another format ({told})") from reason


def survive(path: str | os.PathLike[str], error: type[VanedampError], read: Callable[[], object]) -> None:
    """Read a file in a fork of this process first, where a damaged one may crash or hang the library that reads it.

    Exceptions of `read` say nothing here: they come again when the file is read in earnest. Raises `error` for a fork
    that ends by a signal. Where the system has no forks, nothing is tried.
    """
    if not hasattr(os, "fork"):
        return
    seconds = int(_PATIENCE + os.stat(path).st_size / _SPEED)
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which reads files
        child = os.fork()
    if child == 0:
        _try(read, seconds)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        what = f"takes more than {seconds} s" if number == signal.SIGALRM else signal.Signals(number).name
        raise error(f"{path}: damaged: its library ends in the middle of it ({what}); write it again")


def _try(read: Callable[[], object], seconds: int) -> None:
    """Read, silently, and end this process."""
    try:
        for number in (*_DEADLY, signal.SIGALRM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        if hasattr(signal, "SIGBUS"):
            signal.signal(signal.SIGBUS, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        signal.alarm(seconds)
        read()
    finally:
        os._exit(0)
