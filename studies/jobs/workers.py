"""Process pools: for sweeps, and for a single task.

Why not loky: each of its workers (3.7.0) imports and loads the compiled engine. Two of them have 67 MB of their
own memory each and finish eight runs of a small scene after 2.5 s; these are forked from a server that has loaded it
(`preloaded`): 11 MB and 2.1 s.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, InvalidStateError, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.context import BaseContext
from typing import Any

from vanedamp.files.interrupts import uninterrupted

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: modules that the server of workers loads before it forks the first one
_PRELOADED = "vanedamp.studies.jobs.preloaded"


class WorkerPool(Executor):
    """A process pool that restarts after the death of a worker, which breaks a pool of the standard library."""

    def __init__(self, count: int, niceness: int = 0) -> None:
        """Set the number of processes and their niceness (os.nice)."""
        self._max_workers, self._niceness = count, niceness
        self._pool = self._new()

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """Run a call in a worker. Calls lost by a broken pool are not run again."""
        with uninterrupted():  # submit starts them
            try:
                future = self._pool.submit(function, *arguments, **options)
            except BrokenExecutor:
                self._pool.shutdown(wait=False)
                self._pool = self._new()
                future = self._pool.submit(function, *arguments, **options)
        future.__class__ = _Call
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers once they have done their work."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the workers; after an error or an interrupt, without waiting for their work."""
        if kind is not None:
            # not public before Python 3.14; without it, workers first finish their tasks
            for process in list((getattr(self._pool, "_processes", None) or {}).values()):
                process.terminate()
        self.shutdown(cancel_futures=kind is not None)

    def _new(self) -> ProcessPoolExecutor:
        resource_tracker.ensure_running()  # its start ends with interrupts unblocked, for the server to come as well
        with uninterrupted():  # a semaphore that was made and not noted yet is warned of at the end
            return ProcessPoolExecutor(
                self._max_workers, mp_context=_context(), initializer=_begin, initargs=(self._niceness,)
            )


class _Call(Future[Any]):
    """Future of a call. Until CPython 3.12 the thread of a broken pool ends in an error at a cancelled future."""

    def set_exception(self, exception: BaseException | None) -> None:
        """Take the call's error, unless it is cancelled."""
        with suppress(InvalidStateError):
            super().set_exception(exception)


def _context() -> BaseContext:
    """Return how workers begin: not as a fork of this process, which may hold MPI or threads.

    On Linux they are forks of a server that holds neither and has the engine in shared memory.
    Elsewhere the system's libraries may have threads of their own, so each worker is a new process.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([_PRELOADED])
    before = {name: os.environ.pop(name) for name in _THREADS if name in os.environ}
    try:
        # every worker has a core of its own, and with this setting a library starts no thread in the server
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        forkserver.ensure_running()
    finally:
        for name in _THREADS:
            del os.environ[name]
        os.environ.update(before)
    return context


def _begin(niceness: int) -> None:
    """Lower the worker's priority, and end it with its parent: otherwise it would wait for work for ever."""
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def workers(count: int | None) -> Iterator[Executor | None]:
    """Yield worker processes with the engine compiled, one for every core by default; None for a single one.

    Raises SweepError if they end while starting, such as for lack of memory.
    """
    count = count or available_cores()
    if count == 1:
        yield None
        return
    with WorkerPool(count) as pool:
        from vanedamp.coupling.sweep.sweep import warm_up
        from vanedamp.coupling.sweep.worker import SweepError

        try:
            pool.submit(warm_up).result()
        except BrokenExecutor as error:
            raise SweepError(f"the workers end as they begin: {error}") from error
        yield pool


def available_cores() -> int:
    """Return the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
