"""Fair timing: CPU time of the thread, in turns, in a new random order every round, medians and quartiles."""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.provenance import versions

#: measures once and returns seconds
Clock = Callable[[], float]


def in_turns(clocks: Mapping[str, Clock], rounds: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return the seconds (rounds,) of every clock; a first round, which loads compiled code, does not count."""
    names = list(clocks)
    times = {name: np.zeros(rounds) for name in names}
    for clock in clocks.values():
        clock()
    for turn in range(rounds):
        for index in rng.permutation(len(names)):
            times[names[index]][turn] = clocks[names[index]]()
    return times


def seconds(task: Callable[..., Any], *arguments: Any) -> float:
    """Return the thread's CPU time for a call: other work of the machine counts less than in time by the clock."""
    started = time.thread_time()
    task(*arguments)
    return time.thread_time() - started


def spread(values: np.ndarray) -> dict[str, float]:
    """Return median and quartiles of (rounds,) values. Ratios are taken round by round before."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75))
    return {"median": float(median), "low": float(low), "high": float(high)}


def format_spread(values: Mapping[str, float]) -> str:
    """Return median and quartiles as text."""
    return f"{values['median']:8.3g}  ({values['low']:.3g} to {values['high']:.3g})"


def machine() -> dict[str, Any]:
    """Return the machine that the times were taken on."""
    information = Path("/proc/cpuinfo")
    text = information.read_text(encoding="utf-8") if information.is_file() else ""
    models = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return {
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "clock": "CPU time of the thread",
        "versions": versions(),
    }


@contextmanager
def clocked(result: dict[str, Any], name: str) -> Iterator[None]:
    """Enter the seconds that a block takes, by the clock and of the process, under a name into a result."""
    wall, processor = time.perf_counter(), time.process_time()
    yield
    result[name] = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - processor}


def peak_memory() -> int:
    """Return the peak resident memory of this process, bytes."""
    import resource

    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used if sys.platform == "darwin" else 1024 * used
