"""Worker processes for sweeps."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def workers(count: int | None) -> Iterator[ProcessPoolExecutor | None]:
    """Worker processes with the engine compiled, one for every core unless told; None for a single one."""
    count = count or available_cores()
    if count == 1:
        yield None
        return
    with new_pool(count) as pool:
        from coupling.sweep import warm_up

        pool.submit(warm_up).result()
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def new_pool(count: int) -> ProcessPoolExecutor:
    """Fresh processes: a fork of one that holds MPI or threads is not safe."""
    return ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"))
