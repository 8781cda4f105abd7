"""Time of reduced models over that of ten modes, proof included: 12 interface coordinates and 30 modes.

Tasks take turns in a process of their own for each size, on one thread; processor time counts.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rows import Rows
from benchmarks.timing import machine
from vanedamp.files.store import write_csv, write_json
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build
from vanedamp.studies.workers import run_module

#: of the reduction, over the ten modes
TARGET = 1.2
NAMES = {
    "modes": "ten modes and the proof that none is missed",
    "reduction": "12 interface coordinates, 30 modes",
    "quasi_static": "with a block of quasi-static modes",
    "rubin": "Rubin's basis",
    "estimate": "vanedamp reduce --modes 30, with its estimate",
    "hot_spots": "the same with 3 hot spots",
}
# s of all tasks in one round at the coarsest element size (m), and the growth with 1 / size
_COARSE, _SECONDS, _GROWTH = 0.0042, 15.0, 3.2


@dataclass(frozen=True)
class Effort:
    """Element sizes of the cluster, m, rounds, and the limit of one size, s."""

    sizes: tuple[float, ...]
    rounds: int
    limit: float


#: about 30 000 and 100 000 degrees of freedom
FULL = Effort((0.0042, 0.00225), 3, 3600.0)
QUICK = Effort((0.006,), 1, 600.0)


def run_bench(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure, write bench_reduction.json and .csv into a folder, and return what the JSON holds."""
    expected = {f"{size:g} m": (effort.rounds + 0.5) * _SECONDS * (_COARSE / size) ** _GROWTH for size in effort.sizes}
    rows = Rows(folder, "reduction", {"rounds": effort.rounds, "limit": effort.limit}, expected)
    sizes = []
    for size in effort.sizes:
        row = rows.take(f"{size:g} m", partial(_size, size, effort), tell=_row_text)
        sizes.append({"element_size": size} | row | {"ratio": _ratios(row)})
    result = {
        "machine": machine() | {"clock": "CPU time of the process, one thread"}, "effort": asdict(effort),
        "target": TARGET, "sizes": sizes, "wall_time_s": rows.seconds,
    }  # fmt: skip
    write_json(folder / "bench_reduction.json", result)
    _write_csv(sizes, folder / "bench_reduction.csv")
    rows.finish()
    return result


def print_summary(result: Mapping[str, Any]) -> None:
    """Print seconds, ratios, factorisations and solves."""
    for entry in result["sizes"]:
        if entry["status"] != "ok":
            print(f"element size {entry['element_size']} m: {entry['status']}")
            continue
        print(f"{entry['dofs']:,} degrees of freedom, {entry['peak_bytes'] / 1e9:.2f} GB")
        for name, task in entry["tasks"].items():
            ratio = "" if name == "modes" else f", {entry['ratio'][name]:.2f} of the modes"
            print(
                f"  {NAMES[name]:46} {task['cpu_s']:8.2f} s{ratio}; "
                f"{task['factorisations']} factorisations, {task['solves']} solves"
            )


def _size(size: float, effort: Effort) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as home:
        mesh = Path(home) / "cluster.msh"
        build(VaneCluster(element_size=size), mesh)
        try:
            done = run_module(
                "benchmarks.reduction.worker", str(mesh), str(effort.rounds), threads=1,
                timeout=effort.limit,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return {"status": f"more than {effort.limit:g} s"}
    if done.returncode != 0:
        return {"status": (done.stderr.strip().splitlines() or ["killed (out of memory?)"])[-1]}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    tasks = {name: _middle(rounds) for name, rounds in found["tasks"].items()}
    return found | {"status": "ok", "tasks": tasks, "rounds": found["tasks"]}


def _middle(rounds: list[dict[str, Any]]) -> dict[str, Any]:
    """Return medians; factorisations and solves are the same in all rounds."""
    times = {clock: float(np.median([entry["time"][clock] for entry in rounds])) for clock in ("cpu_s", "wall_s")}
    return times | {"factorisations": rounds[0]["factorisations"], "solves": rounds[0]["solves"]}


def _ratios(row: Mapping[str, Any]) -> dict[str, float]:
    """Return medians of the ratios to the modes, round by round."""
    if row["status"] != "ok":
        return {}
    modes = [entry["time"]["cpu_s"] for entry in row["rounds"]["modes"]]
    return {
        name: float(np.median([entry["time"]["cpu_s"] / one for entry, one in zip(rounds, modes, strict=True)]))
        for name, rounds in row["rounds"].items()
        if name != "modes"
    }


def _row_text(row: Mapping[str, Any]) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    ratio = _ratios(row)["reduction"]
    return f"{row['dofs']:,} degrees of freedom, reduction over modes {ratio:.2f} (target {TARGET})"


def _write_csv(sizes: list[dict[str, Any]], path: Path) -> None:
    """Write one line a size and task."""
    header = ("dofs", "task", "cpu_s", "wall_s", "ratio", "factorisations", "solves")
    lines = [
        (entry["dofs"], name, task["cpu_s"], task["wall_s"], entry["ratio"].get(name), task["factorisations"],
         task["solves"])
        for entry in sizes
        if entry["status"] == "ok"
        for name, task in entry["tasks"].items()
    ]  # fmt: skip
    write_csv(path, header, lines)
