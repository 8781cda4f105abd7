"""Scaling of sweeps: time, parallel efficiency and memory of a rigid model's sweep of up to 100 000 scenes.

Efficiency is time of one process over processes times their time. By the clock it suffers from whatever else the
machine does; so it is also taken from seconds of the processors: what one process needs, over processes times the
longer of the busiest worker's share and everybody's mean share. That is what the clock would show on a machine that
does nothing else.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import write_csv, write_json
from vanedamp.studies.bench.sweep.worker import PERIODS
from vanedamp.studies.bench.timing import format_spread, machine, spread
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import available_cores, run_module

TARGET = 0.85
_COLUMNS = (
    "points", "workers", "wall_s", "main_cpu_s", "worker_cpu_s", "main_peak_bytes", "worker_peak_bytes", "file_bytes",
    "load",
)  # fmt: skip


@dataclass(frozen=True)
class Effort:
    """Scenes of the sweeps on all cores; scenes of those that are timed in turns with one process, and how often."""

    sizes: tuple[int, ...]
    compared: int
    rounds: int


FULL = Effort((1_000, 10_000, 100_000), 4_000, 3)
QUICK = Effort((100, 400), 400, 1)


def run_bench(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure, write bench_sweep.json, .csv and .png into a folder, and return what the JSON holds."""
    from vanedamp.studies.bench.sweep.figures import sweep_figure

    started, cores = time.perf_counter(), max(2, available_cores())
    result: dict[str, Any] = {
        "machine": machine() | {"clock": "CPU time of the processes"}, "effort": asdict(effort), "periods": PERIODS,
        "workers": cores, "target": TARGET, "sizes": [], "pairs": [],
    }  # fmt: skip
    total = 2 * effort.rounds + len(effort.sizes)
    with progress("bench") as report:
        for turn in range(effort.rounds):
            report(2 * turn, total)
            counts = (1, cores) if turn % 2 == 0 else (cores, 1)
            runs = {count: _process(effort.compared, count) for count in counts}
            pair = {count: runs[count] for count in (1, cores)}
            result["pairs"].append(
                {"one": pair[1], "all": pair[cores], "efficiency": _efficiency(pair[1], pair[cores])}
            )
        for number, size in enumerate(effort.sizes):
            report(2 * effort.rounds + number, total)
            result["sizes"].append(_process(size, cores))
    result["efficiency"] = {
        name: spread(np.array([pair["efficiency"][name] for pair in result["pairs"]]))
        for name in ("clock", "processor")
    }
    result["overhead"] = spread(np.array([_overhead(entry) for entry in result["sizes"]]))
    result["wall_time_s"] = time.perf_counter() - started
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "bench_sweep.json", result)
    entries = [entry for pair in result["pairs"] for entry in (pair["one"], pair["all"])] + result["sizes"]
    write_csv(
        folder / "bench_sweep.csv",
        (*_COLUMNS, "scenes_per_second"),
        [(*(_flat(entry[name]) for name in _COLUMNS), entry["points"] / entry["wall_s"]) for entry in entries],
    )
    sweep_figure(result, folder / "bench_sweep.png")
    return result


def print_summary(result: Mapping[str, Any]) -> None:
    """Print times, memory and efficiency."""
    for entry in result["sizes"]:
        print(
            f"{entry['points']:7} scenes of {result['periods']} periods, {entry['workers']} workers: "
            f"{entry['wall_s']:8.1f} s, {entry['points'] / entry['wall_s']:6.1f} scenes/s; peak memory "
            f"{entry['main_peak_bytes'] / 1e6:.0f} MB + {entry['worker_peak_bytes'] / 1e6:.0f} MB a worker; "
            f"file {entry['file_bytes'] / 1e6:.2f} MB"
        )
    for name, values in result["efficiency"].items():
        print(f"parallel efficiency by the {name:9} {format_spread(values)}  target {result['target']}")
    print(f"share of the main process in the processors' time {format_spread(result['overhead'])}")
    print(f"load of the machine at the beginning: {result['machine']['load']:.1f}")


def _efficiency(one: Mapping[str, Any], many: Mapping[str, Any]) -> dict[str, float]:
    count = many["workers"]
    everybody = (sum(many["worker_cpu_s"]) + many["main_cpu_s"]) / count
    return {
        "clock": one["wall_s"] / (count * many["wall_s"]),
        "processor": one["main_cpu_s"] / (count * max(everybody, *many["worker_cpu_s"])),
    }


def _overhead(many: Mapping[str, Any]) -> float:
    """Return the share of all processor time that handing out, collecting and writing take."""
    own: float = many["main_cpu_s"]
    return own / (own + sum(many["worker_cpu_s"]))


def _process(points: int, workers: int) -> dict[str, Any]:
    """Run one sweep in a process of its own, one thread a process."""
    with tempfile.TemporaryDirectory() as folder:
        done = run_module("vanedamp.studies.bench.sweep.worker", str(points), str(workers), folder, threads=1)
    done.check_returncode()
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def _flat(value: Any) -> Any:
    return " ".join(f"{item:.3f}" for item in value) if isinstance(value, list) else value
