"""Ctrl-C is not lost in callbacks; a request to terminate ends a command like Ctrl-C."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# s, after which the callback that swallowed an interrupt has ended
_SOON = 0.02


@contextmanager
def swallowed_interrupts_again() -> Iterator[None]:
    """Repeat an interrupt that is swallowed: by a callback, such as LLVM's while compiled functions are loaded, which
    cannot pass it on; or by a library that makes another error of it, such as numpy while it loads.
    """
    before, again, came = sys.unraisablehook, list[threading.Timer](), list[int]()
    handler = signal.getsignal(signal.SIGINT)
    heeded = callable(handler) and threading.current_thread() is threading.main_thread()

    def hook(unraisable: Any) -> None:
        if unraisable.exc_type is not None and issubclass(unraisable.exc_type, KeyboardInterrupt):
            again.append(threading.Timer(_SOON, _thread.interrupt_main))
            again[-1].start()
        else:
            before(unraisable)

    def note(number: int, frame: Any) -> None:
        came.append(number)
        handler(number, frame)  # type: ignore[operator, misc]

    sys.unraisablehook = hook
    if heeded:
        signal.signal(signal.SIGINT, note)
    try:
        yield
        for timer in again:
            timer.join()
    except Exception as error:
        if came:
            raise KeyboardInterrupt from error
        raise
    finally:
        sys.unraisablehook = before
        if heeded:
            signal.signal(signal.SIGINT, handler)


def terminate_as_interrupt() -> list[int]:
    """Let SIGTERM end this process as an interrupt, so that checkpoints are written and workers end as well.

    Returns a list, which holds the signals that came.
    """
    came = list[int]()

    def handler(number: int, _frame: object) -> None:
        came.append(number)
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # of a command that a shell runs in the background
            signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.raise_signal(signal.SIGINT)  # waits where interrupts do

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, handler)
    return came
