"""Ctrl-C: one line from the parent, none from its workers, and it is never lost."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# s, in which the callback that swallowed an interrupt has ended
_SOON = 0.02


@contextmanager
def swallowed_interrupts_again() -> Iterator[None]:
    """Repeat an interrupt that a callback cannot pass on: LLVM has some while compiled functions are loaded."""
    before, again = sys.unraisablehook, list[threading.Timer]()

    def hook(unraisable: Any) -> None:
        if unraisable.exc_type is not None and issubclass(unraisable.exc_type, KeyboardInterrupt):
            again.append(threading.Timer(_SOON, _thread.interrupt_main))
            again[-1].start()
        else:
            before(unraisable)

    sys.unraisablehook = hook
    try:
        yield
        for timer in again:
            timer.join()
    finally:
        sys.unraisablehook = before


@contextmanager
def uninterrupted_children() -> Iterator[None]:
    """Keep interrupts from processes that are started meanwhile, and from cutting their start in two.

    They inherit that it is blocked. To have them ignore it is too late, and shows a traceback, for an interrupt while
    they load. The parent sees it at the end: blocked here, it may still come by way of another thread, and a process
    whose parent stops in the middle of its start shows a traceback as well.
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
