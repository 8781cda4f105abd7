"""`pytest --slow-clock [FACTOR]`: as on a machine that takes FACTOR times as long, by the clocks that vanedamp reads.

Clocks run faster, and sleeps, timers and waits end sooner, by this factor, for callers in vanedamp, its benchmarks and
the paper's studies: stages take long, progress is told, what is due after a time is due. All others, such as tests that
wait for a process, keep the clock. A factor far below 1 is a machine on which nothing is ever due.

Not reached: limits by signals, options that name a limit to a library or a process (subprocess's timeout), JavaScript.
"""

import functools
import os
import sys
import threading
import time

VARIABLE = "VANEDAMP_SLOW_CLOCK"
_SLOW = {"vanedamp", "benchmarks", "paper"}


def install() -> None:
    """Change the clocks of this process from now on, if the environment names a factor."""
    factor = float(os.environ.get(VARIABLE) or 0.0)
    if factor == 0.0 or hasattr(time.monotonic, "__wrapped__"):
        return
    for name in ("monotonic", "perf_counter", "process_time", "thread_time", "time"):
        setattr(time, name, _clock(getattr(time, name), factor))
    time.sleep = _sooner(time.sleep, 0, factor)
    threading.Timer.__init__ = _sooner(threading.Timer.__init__, 1, factor)
    threading.Condition.wait_for = _sooner(threading.Condition.wait_for, 2, factor)


def _ours() -> bool:
    """Whether the function that calls the function that asks is one of vanedamp's."""
    return sys._getframe(2).f_globals.get("__name__", "").partition(".")[0] in _SLOW


def _clock(read, factor):
    begun = read()

    @functools.wraps(read)
    def faster():
        return begun + factor * (read() - begun) if _ours() else read()

    return faster


def _sooner(function, place, factor):
    """Return a function whose argument at a place is a time, s."""

    @functools.wraps(function)
    def sooner(*arguments, **options):
        if _ours() and len(arguments) > place:
            arguments = (*arguments[:place], arguments[place] / factor, *arguments[place + 1 :])
        return function(*arguments, **options)

    return sooner
