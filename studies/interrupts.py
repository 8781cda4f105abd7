"""Ctrl-C in callbacks: it is never lost."""

from __future__ import annotations

import _thread
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
