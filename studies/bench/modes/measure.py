"""Time and memory of ten modes: SLEPc beside scipy's eigsh, on the factorisations each can have, on the same matrices.

Every measurement runs in a process of its own, on one thread; processor time counts, since what else the machine does
counts less in it than in time by the clock.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import write_csv, write_json
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build
from vanedamp.studies.bench.modes.solvers import COUNT, NAMES, OURS
from vanedamp.studies.bench.timing import machine
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import run_module

# frequencies that differ by more than this between two solvers are another answer
_AGREE = 1e-7


@dataclass(frozen=True)
class Effort:
    """Element sizes of the cluster, m, rounds of every measurement (the median counts), and the limit of one, s."""

    sizes: tuple[float, ...]
    rounds: int
    limit: float


#: about 30 000, 100 000 and 350 000 degrees of freedom
FULL = Effort((0.0042, 0.00225, 0.00134), 3, 900.0)
QUICK = Effort((0.006, 0.0042), 1, 120.0)


def run_bench(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure, write bench_modal.json, .csv and .png into a folder, and return what the JSON holds."""
    started = time.perf_counter()
    solvers, absent = _solvers()
    result: dict[str, Any] = {
        "machine": machine() | {"clock": "CPU time of the process, one thread"}, "effort": asdict(effort),
        "modes": COUNT, "absent": absent, "sizes": [],
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as home, progress("bench") as report:
        for number, size in enumerate(effort.sizes):
            mesh, matrices = Path(home) / "cluster.msh", Path(home) / "matrices.npz"
            build(VaneCluster(element_size=size), mesh)
            assembled = _process(effort.limit, "assemble", str(mesh), str(matrices))
            entry: dict[str, Any] = {"element_size": size, "assembly": assembled, "solvers": {}}
            result["sizes"].append(entry)
            for place, name in enumerate(solvers):
                report(number * len(solvers) + place, len(effort.sizes) * len(solvers))
                if assembled["status"] == "ok":
                    entry["solvers"][name] = _rounds(name, matrices, effort)
            entry["agree"] = _agree(entry["solvers"])
            entry["ratio"] = _ratios(entry["solvers"])
            result["ahead"] = _ahead(result["sizes"])
            result["wall_time_s"] = time.perf_counter() - started
            _write(result, folder)  # a large size may end in a kill: what is measured stays
    return result


def _write(result: Mapping[str, Any], folder: Path) -> None:
    from vanedamp.studies.bench.modes.figures import modal_figure

    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "bench_modal.json", result)
    _write_csv(result, folder / "bench_modal.csv")
    modal_figure(result, folder / "bench_modal.png")


def print_summary(result: Mapping[str, Any]) -> None:
    """Print times, memory and ratios."""
    for entry in result["sizes"]:
        assembly = entry["assembly"]
        if assembly["status"] != "ok":
            print(f"element size {entry['element_size']} m: assembly {assembly['status']}")
            continue
        print(f"{assembly['dofs']} degrees of freedom: assembly {assembly['assembly']['cpu_s']:.2f} s, "
              f"{assembly['peak_bytes'] / 1e9:.2f} GB")  # fmt: skip
        for name, run in entry["solvers"].items():
            if run["status"] != "ok":
                print(f"  {NAMES[name]:34} {run['status']}")
                continue
            ratio = "" if name == OURS else f", ours / this {entry['ratio'][name]['modes']:.2f}"
            print(
                f"  {NAMES[name]:34} factorisation {run['factorisation']['cpu_s']:8.2f} s, with {COUNT} modes "
                f"{run['modes']['cpu_s']:8.2f} s, peak {run['peak_bytes'] / 1e9:.2f} GB{ratio}"
            )
    for name, reason in result["absent"].items():
        print(f"not measured: {NAMES[name]} ({reason})")
    behind = [f"{name} at {dofs}" for name, dofs in result["ahead"]["behind"]]
    print("at or ahead of each at every size" if not behind else "behind " + ", ".join(behind))


def _solvers() -> tuple[list[str], dict[str, str]]:
    """Return the solvers that are installed, and why the others are not."""
    if importlib.util.find_spec("sksparse") is None:
        return [name for name in NAMES if name != "cholmod"], {
            "cholmod": "scikit-sparse is not installed: apt-get install libsuitesparse-dev, pip install scikit-sparse"
        }
    return list(NAMES), {}


def _rounds(name: str, matrices: Path, effort: Effort) -> dict[str, Any]:
    """Measure medians over the rounds; the first trouble ends them."""
    runs = []
    for _ in range(effort.rounds):
        runs.append(_process(effort.limit, name, str(matrices), str(COUNT)))
        if runs[-1]["status"] != "ok":
            return runs[-1]
    middle = {
        part: {clock: float(np.median([run[part][clock] for run in runs])) for clock in ("cpu_s", "wall_s")}
        for part in ("factorisation", "modes")
    }
    peaks = {key: max(run[key] for run in runs) for key in ("loaded_bytes", "peak_bytes")}
    return middle | peaks | {"status": "ok", "eigenvalues": runs[0]["eigenvalues"]}


def _process(limit: float, *arguments: str) -> dict[str, Any]:
    """Measure once in a process of its own, on one thread; trouble is a status."""
    try:
        done = run_module("vanedamp.studies.bench.modes.worker", *arguments, threads=1, timeout=limit)
    except subprocess.TimeoutExpired:
        return {"status": f"more than {limit:g} s"}
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines()
        return {"status": lines[-1] if lines else f"ended by signal {-done.returncode} (out of memory?)"}
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result | {"status": "ok"}


def _agree(solvers: Mapping[str, Any]) -> bool:
    """Say whether all solvers give the same frequencies."""
    values = [np.array(s["eigenvalues"]) for s in solvers.values() if s["status"] == "ok"]
    return all(bool(np.all(np.abs(each / values[0] - 1.0) < 2.0 * _AGREE)) for each in values)


def _ratios(solvers: Mapping[str, Any]) -> dict[str, Any]:
    """Return our processor time and memory over the others'."""
    ours = solvers.get(OURS, {"status": "none"})
    return {
        name: {part: ours[part]["cpu_s"] / other[part]["cpu_s"] for part in ("factorisation", "modes")}
        | {"peak": ours["peak_bytes"] / other["peak_bytes"]}
        for name, other in solvers.items()
        if name != OURS and ours["status"] == other["status"] == "ok"
    }


def _ahead(sizes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return where another solver needs less processor time for the modes, by more than 5 %."""
    behind = [
        (name, entry["assembly"].get("dofs"))
        for entry in sizes
        for name, ratio in entry["ratio"].items()
        if ratio["modes"] > 1.05
    ]
    return {"everywhere": not behind, "behind": behind}


def _write_csv(result: Mapping[str, Any], path: Path) -> None:
    """Write one line a size and solver."""
    rows: list[tuple[Any, ...]] = []
    for entry in result["sizes"]:
        assembly = entry["assembly"]
        dofs, times = assembly.get("dofs"), assembly.get("assembly", {})
        rows.append(
            (dofs, "assembly", assembly["status"], "", times.get("cpu_s"), times.get("wall_s"),
             assembly.get("peak_bytes"))
        )  # fmt: skip
        for name, run in entry["solvers"].items():
            factor, modes = run.get("factorisation", {}), run.get("modes", {})
            rows.append(
                (dofs, NAMES[name], run["status"], factor.get("cpu_s"), modes.get("cpu_s"), modes.get("wall_s"),
                 run.get("peak_bytes"))
            )  # fmt: skip
    header = ("dofs", "solver", "status", "factorisation_cpu_s", "modes_cpu_s", "modes_wall_s", "peak_bytes")
    write_csv(path, header, rows)
