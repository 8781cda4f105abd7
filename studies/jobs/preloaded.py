"""Loads the compiled engine in the server from which the workers of a pool are forked (studies.jobs.workers).

Workers share its memory until one writes to it. It loads compiled code but compiles nothing: that
would take a minute in which it could not be interrupted, and the first worker does it just as well.
"""

from __future__ import annotations

import gc

from vanedamp.coupling.numerics.compiler.jit import loading_only
from vanedamp.coupling.sweep.sweep import warm_up


def _load() -> None:
    try:
        with loading_only():
            warm_up()
    except Exception:  # a worker has the same error and can report it
        return
    gc.collect()
    gc.freeze()  # a collection in a worker would write to every object


_load()
