"""One sweep of the benchmark, in a process of its own, so that its peak memory is its own.

    python -m vanedamp.studies.bench.sweep.worker POINTS WORKERS FOLDER

prints one line of JSON: seconds by the clock and of the processors, peak resident memory, size of the result.
"""

from __future__ import annotations

import json
import math
import os
import resource
import sys
import time
from collections.abc import Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.sweep import sweep, warm_up
from vanedamp.files.toml_input import validate
from vanedamp.studies.workers import workers

#: the calibrated cluster of the demonstration
_MASS, _STIFFNESS, _AMPLITUDE = 0.148, 3.4e7, 3.0e-5
PERIODS, TRANSIENT = 200, 0


class _Use(NamedTuple):
    """Seconds of the processor that a process has used, and its peak of bytes."""

    process: int
    cpu_s: float
    peak_bytes: int


def scene(points: int) -> Scene:
    """Return a rigid model with one body: gaps times frequencies around the resonance, `points` in all."""
    frequencies = max(count for count in range(1, math.isqrt(points) + 1) if points % count == 0)
    first = math.sqrt(_STIFFNESS / _MASS) / (2 * math.pi)
    data: dict[str, Any] = {
        "structure": {"model": "rigid", "mass": _MASS, "stiffness": _STIFFNESS, "damping_ratio": 0.002},
        "excitation": {"frequency": first, "resonance_amplitude": _AMPLITUDE},
        "cavity": [{"name": "c1", "gap": 0.5 * _AMPLITUDE}],
        "damper": [{"cavity": "c1", "mass": 0.02 * _MASS, "friction": 0.4, "restitution": 0.7}],
        "time": {"periods": PERIODS, "transient": TRANSIENT},
        "sweep": {
            "cavity.c1.gap": {"start": 0.2 * _AMPLITUDE, "stop": 2.0 * _AMPLITUDE, "num": points // frequencies},
            "excitation.frequency": {"start": 0.95 * first, "stop": 1.03 * first, "num": frequencies},
        },
    }
    return validate(Scene, data, "benchmark")


def measure(points: int, count: int, folder: Path) -> dict[str, Any]:
    """Run a sweep with its checkpoint and its result, as the command does; workers have started before the clock."""
    grid = scene(points)
    with workers(count) as pool:
        warm_up()
        before = _uses(pool, count)
        started = time.perf_counter()
        result = sweep(grid, pool, checkpoint=folder / "sweep.h5.partial")
        result.save(folder / "sweep.h5")
        wall = time.perf_counter() - started
        after = _uses(pool, count)
    spent = {use.process: use.cpu_s - before[use.process].cpu_s for use in after.values()}
    own = spent.pop(os.getpid())
    return {
        "points": points, "workers": count, "wall_s": wall, "main_cpu_s": own, "worker_cpu_s": sorted(spent.values()),
        "main_peak_bytes": after[os.getpid()].peak_bytes,
        "worker_peak_bytes": max((use.peak_bytes for use in after.values() if use.process != os.getpid()), default=0),
        "file_bytes": (folder / "sweep.h5").stat().st_size,
        "ok": int((result.status == "ok").sum()), "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }  # fmt: skip


def _uses(pool: Executor | None, count: int) -> dict[int, _Use]:
    """Return what this process and each worker have used, by process."""
    uses = {use.process: use for use in [_use(0.0)]}
    while pool is not None and len(uses) < count + 1:
        tried: Iterable[_Use] = pool.map(_use, [0.2] * count)
        uses |= {use.process: use for use in tried}
    return uses


def _use(pause: float) -> _Use:
    time.sleep(pause)  # so that every worker is asked
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return _Use(os.getpid(), time.process_time(), used if sys.platform == "darwin" else 1024 * used)


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))))
