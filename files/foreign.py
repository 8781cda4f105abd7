"""Files from a user: no devices, nothing from elsewhere, and any error of a reader or its library becomes one line."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import stat
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

from vanedamp.files.errors import VanedampError

if TYPE_CHECKING:
    import h5py

#: signals that end a fork at once; PETSc catches some, and ends the process with a page of text
_DEADLY = [
    getattr(signal, name)
    for name in ("SIGSEGV", "SIGABRT", "SIGFPE", "SIGILL", "SIGBUS", "SIGALRM", "SIGPROF", "SIGINT", "SIGTERM")
    if hasattr(signal, name)
]
_Read = TypeVar("_Read")
#: s of processor time for a fork, and bytes a second beyond them; and how many times as long it may wait
_PATIENCE, _SPEED, _WAITS = 60, 1e6, 20
#: most bytes that deflate expands one byte to
_INFLATED = 1100
#: bytes that a fork may take, and further ones per byte of its file
_MEMORY, _PER_BYTE = 2 << 30, 100


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
        message = " ".join(str(reason).split()) or type(reason).__name__
        raise error(f"{path}: {expected}: damaged, or of another format ({message})") from reason


def self_contained(file: h5py.File) -> None:
    """Check that an HDF5 file holds all its data: links would expose other files, and shapes without data would fill
    the memory.

    Raises VanedampError for links other than hard ones, data in other files (external or virtual), and shapes that
    the bytes of the file cannot fill.
    """
    import h5py

    def reject(reason: str) -> NoReturn:
        raise VanedampError(f"{file.filename}: {reason}; expected a file that holds its data itself")

    groups, addresses, room = [h5py.Group(file.id)], set(), _INFLATED * os.path.getsize(file.filename)
    while groups:
        group = groups.pop()
        for name in group:
            path = f"{group.name.rstrip('/')}/{name}".lstrip("/")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                reject(f"{path} is a link to data elsewhere")
            item = group[name]
            if h5py.h5o.get_info(item.id).addr in addresses:  # another name of it
                continue
            addresses.add(h5py.h5o.get_info(item.id).addr)
            if isinstance(item, h5py.Group):
                groups.append(item)
            elif isinstance(item, h5py.Dataset):
                if item.is_virtual or item.external:
                    reject(f"the data of {path} are in other files")
                room -= item.size * item.dtype.itemsize if item.shape else 0
                if room < 0:
                    reject(f"{path} has the shape {item.shape}, more than its bytes can fill")


def apart(path: str | os.PathLike[str], error: type[VanedampError], read: Callable[[], _Read]) -> _Read:
    """Return the result of `read` for a file, called in a fork of this process: damage may crash or hang its library.

    The result is pickled. Raises `error` for a fork that ends by a signal, and for an error about input of
    `read`; ValueError with the words of another exception. Where the system has no forks, `read` is called here.
    """
    if not hasattr(os, "fork"):
        return read()
    size = os.stat(path).st_size
    seconds = int(_PATIENCE + size / _SPEED)
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which reads files
        child = os.fork()
    if child == 0:
        _answer(read, writing, seconds, _MEMORY + _PER_BYTE * size)
    os.close(writing)
    try:
        with os.fdopen(reading, "rb") as stream:
            answer = stream.read()
    finally:
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = signal.Signals(os.WTERMSIG(status))
        limits = {signal.SIGPROF: seconds, signal.SIGALRM: _WAITS * seconds}
        cause = f"takes more than {limits[number]} s" if number in limits else number.name
        raise error(f"{path}: damaged: its library ends in the middle of it ({cause}); write it again")
    result, failure, of_input = pickle.loads(answer)
    if failure is not None:
        raise (error if of_input else ValueError)(failure)
    return result


def _answer(read: Callable[[], object], writing: int, seconds: int, memory: int) -> None:
    """Read silently, write the result, and end this process."""
    try:
        for number in _DEADLY:
            signal.signal(number, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        signal.setitimer(signal.ITIMER_PROF, seconds)  # on a busy machine the clock says nothing of the file
        signal.alarm(_WAITS * seconds)
        try:
            _limit_memory(memory)
            answer = pickle.dumps((read(), None, False), protocol=5)
        except BaseException as reason:  # the library may end the program
            answer = pickle.dumps((None, str(reason) or type(reason).__name__, isinstance(reason, VanedampError)))
        with os.fdopen(writing, "wb") as stream:
            stream.write(answer)
    finally:
        os._exit(0)


def _limit_memory(more: int) -> None:
    """Limit further memory of this process to this many bytes, by a MemoryError."""
    with contextlib.suppress(OSError, ImportError):  # systems without /proc, or without limits
        import resource

        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        unlimited = resource.RLIM_INFINITY
        resource.setrlimit(resource.RLIMIT_AS, (used + more if soft == unlimited else min(soft, used + more), hard))
