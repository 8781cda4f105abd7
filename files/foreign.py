"""Files from a user: no devices, and any error of a reader or its library becomes one line."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import stat
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from vanedamp.files.errors import VanedampError

#: signals that end a fork at once; PETSc catches some, and ends the process with a page of text
_DEADLY = [
    getattr(signal, name)
    for name in ("SIGSEGV", "SIGABRT", "SIGFPE", "SIGILL", "SIGBUS", "SIGALRM", "SIGPROF", "SIGINT", "SIGTERM")
    if hasattr(signal, name)
]
_Read = TypeVar("_Read")
#: s of processor time for a fork, and bytes a second beyond them; and how many times as long it may wait
_PATIENCE, _SPEED, _WAITS = 60, 1e6, 20


def existing(path: str | os.PathLike[str], error: type[VanedampError], kind: str = "file") -> Path:
    """Return the path of a regular file. Raises `error` for one that is missing, a folder, a device or a pipe.

    kind: its name in the message.
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
    """Turn a reader's exceptions into `error` with the file; expected: the kind of file expected.

    Errors about input pass, and so do system errors, a lack of memory and missing packages: no fault of the file.
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


def apart(path: str | os.PathLike[str], error: type[VanedampError], read: Callable[[], _Read]) -> _Read:
    """Return what `read` makes of a file, called in a fork of this process: damage may crash or hang its library.

    What it returns is pickled. Raises `error` for a fork that ends by a signal, and ValueError with the words of an
    exception of `read`. Where the system has no forks, `read` is called here.
    """
    if not hasattr(os, "fork"):
        return read()
    seconds = int(_PATIENCE + os.stat(path).st_size / _SPEED)
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which reads files
        child = os.fork()
    if child == 0:
        _tell(read, writing, seconds)
    os.close(writing)
    try:
        with os.fdopen(reading, "rb") as stream:
            told = stream.read()
    finally:
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = signal.Signals(os.WTERMSIG(status))
        limits = {signal.SIGPROF: seconds, signal.SIGALRM: _WAITS * seconds}
        what = f"takes more than {limits[number]} s" if number in limits else number.name
        raise error(f"{path}: damaged: its library ends in the middle of it ({what}); write it again")
    made, failure = pickle.loads(told)
    if failure is not None:
        raise ValueError(failure)
    return made


def _tell(read: Callable[[], object], writing: int, seconds: int) -> None:
    """Read, silently, write what comes of it, and end this process."""
    try:
        for number in _DEADLY:
            signal.signal(number, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        signal.setitimer(signal.ITIMER_PROF, seconds)  # on a busy machine the clock says nothing of the file
        signal.alarm(_WAITS * seconds)
        try:
            told = pickle.dumps((read(), None), protocol=5)
        except BaseException as reason:  # the library may end the program
            told = pickle.dumps((None, str(reason) or type(reason).__name__))
        with os.fdopen(writing, "wb") as stream:
            stream.write(told)
    finally:
        os._exit(0)
