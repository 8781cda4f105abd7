"""What this machine can do at most: the units in which docs/performance.md counts the least work of every stage.

Arithmetic and memory are measured in processes of their own on one thread, by processor time; files and starts by the
clock. The least of several counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.apart import run_module
from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.limits.worker import LIMITS
from benchmarks.tables import seconds_text, table
from vanedamp.files.store import replacing

#: what is started, and what it brings
STARTS = {
    "the interpreter": "pass",
    "numpy": "import numpy",
    "numpy and numba": "import numpy, numba",
}
_FILE, _START = "a byte of a file that is forced to the disk", "start of {}"
_WORDS = {
    "exponential": "a complex exponential",
    "product": "a complex product",
    "division": "a complex division",
    "multiply_add": "a multiplication with addition in a product of matrices",
    "byte": "a byte from memory",
}


@dataclass(frozen=True)
class Limits(Benchmark):
    """Operations of each kind (matrix: its rows; byte: doubles of a vector), bytes of a file, repeated starts."""

    sizes: Mapping[str, int]
    file: int
    starts: int

    NAME = "limits"
    CLOCK = "CPU time of the process, one thread; files and starts by the clock"
    COLUMNS = ("operation", "seconds")

    def rows(self, folder: Path) -> dict[str, Row]:
        tasks: dict[str, Callable[[], float]] = {
            _WORDS[name]: partial(_process, name, self.sizes[name]) for name in LIMITS
        }
        tasks[_FILE] = partial(_byte_of_file, folder, self.file)
        tasks |= {_START.format(name): partial(_start, code, self.starts) for name, code in STARTS.items()}
        return {name: Row(4.0, task, seconds_text) for name, task in tasks.items()}

    def result(self, values: Mapping[str, Any]) -> Result:
        return {"seconds": dict(values)}

    def lines(self, result: Mapping[str, Any]) -> Iterable[Sequence[Any]]:
        return result["seconds"].items()

    def summary(self, result: Mapping[str, Any]) -> list[str]:
        """Return the limits as rates, too."""
        seconds = result["seconds"]
        rates = {
            _WORDS["multiply_add"]: f"{2e-9 / seconds[_WORDS['multiply_add']]:.3g} Gflop/s",
            _WORDS["byte"]: f"{1e-9 / seconds[_WORDS['byte']]:.3g} GB/s",
            _FILE: f"{1e-9 / seconds[_FILE]:.3g} GB/s",
        }
        rows = ((name, seconds_text(value), rates.get(name, "")) for name, value in seconds.items())
        return [table(("operation", "time", "rate"), rows)]


FULL = Limits(
    {"exponential": 3_000_000, "product": 30_000_000, "division": 10_000_000, "multiply_add": 1500,
     "byte": 25_000_000}, 100_000_000, 11,
)  # fmt: skip
QUICK = Limits(
    {"exponential": 100_000, "product": 1_000_000, "division": 1_000_000, "multiply_add": 300, "byte": 1_000_000},
    1_000_000, 2,
)  # fmt: skip


def _process(name: str, size: int) -> float:
    """Return the seconds of an operation, from a process of its own."""
    done = run_module("benchmarks.limits.worker", name, str(size), threads=1)
    done.check_returncode()
    return float(done.stdout)


def _byte_of_file(folder: Path, size: int) -> float:
    """Return the seconds of a byte that is written as results are: to a file beside, forced to the disk, renamed."""
    content, file, times = os.urandom(size), folder / "bench_limits.bytes", []
    for _ in range(3):
        started = time.perf_counter()
        with replacing(file) as temporary:
            temporary.write_bytes(content)
        times.append(time.perf_counter() - started)
    file.unlink()
    return min(times) / size


def _start(code: str, count: int) -> float:
    """Return the least seconds by the clock of an interpreter that runs some code."""
    times = []
    for _ in range(count):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - started)
    return min(times)
