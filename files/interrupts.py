"""Interrupts (Ctrl-C) that wait: for files that are put in place, for processes that are being started."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Keep interrupts from the work done meanwhile, and from processes that are started: this one sees them at the end.

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
