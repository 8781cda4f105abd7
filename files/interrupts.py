"""Interrupts (Ctrl-C) that wait for files put in place and processes being started; signals that libraries take."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay interrupts of this process to the end of the context, and keep them from processes started in it.

    Processes inherit that interrupts are blocked. To have them ignore it is too late, and shows a traceback, for an
    interrupt while they load. Blocked here, it may still come by way of another thread, which waits as well.
    """
    handler = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()
    if not main or not callable(handler):
        with _blocked():
            yield
        return
    late = list[tuple[Any, ...]]()
    with _blocked():
        signal.signal(signal.SIGINT, lambda *arguments: late.append(arguments))
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, handler)
    if late:
        handler(*late[-1])


@contextmanager
def _blocked() -> Iterator[None]:
    """Block interrupts in this thread and the processes that it starts."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def signals_kept() -> Iterator[None]:
    """Let libraries begin or end, and put the handlers of signals back: MPI's and PETSc's, which gmsh has, too, print,
    abort, and let a closed pipe end the process.

    By the C library: Python has its own handlers only, and sets them in its main thread only.
    """
    if os.name != "posix":
        yield
        return
    libc = ctypes.CDLL(None)
    actions = {number: ctypes.create_string_buffer(1024) for number in signal.valid_signals()}  # of any sigaction
    for number, action in actions.items():
        libc.sigaction(number, None, action)
    try:
        yield
    finally:
        for number, action in actions.items():
            libc.sigaction(number, action, None)
