"""Loaded once by the server from which the workers of a pool are forked (studies.workers): the engine, compiled.

Workers share its memory as long as none of them writes there. It loads what is compiled and compiles nothing: that
would take a minute in which nobody could interrupt it, and the first worker does it just as well.
"""

from __future__ import annotations

import gc
from typing import Any

from numba.core import event

from vanedamp.coupling.sweep.sweep import warm_up


class _NotCompiled(Exception):
    """The disk cache lacks a function."""


class _Refusal(event.Listener):
    """Stops a compilation before it begins."""

    def on_start(self, event: Any) -> None:
        """Refuse."""
        raise _NotCompiled

    def on_end(self, event: Any) -> None:
        """Do nothing."""


def _load() -> None:
    try:
        with event.install_listener("numba:compile", _Refusal()):
            warm_up()
    except Exception:  # whatever it is, a worker meets it as well and can tell it
        return
    gc.collect()
    gc.freeze()  # a collection in a worker would write to every object


_load()
