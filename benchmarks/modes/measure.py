"""Time and memory of ten modes: block Lanczos beside scipy's eigsh and NGSolve, on the same matrices or mesh.

Every measurement runs in a process of its own, on one thread; processor time counts, since what else the machine does
counts less in it than in time by the clock.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import json
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.modes.solvers import COUNT, NAMES, OURS
from benchmarks.rows import Contest, Rows
from benchmarks.tables import table
from benchmarks.timing import machine
from vanedamp.files.store import write_csv, write_json
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build
from vanedamp.studies.workers import run_module

# frequencies that differ by more than this between two solvers are another answer
_AGREE = 1e-7
#: a solver that takes this many times the best's time has lost
_LOST = 5.0
#: solvers of other packages: module, package, how to get it
_PEERS = {
    "cholmod": (
        "sksparse", "scikit-sparse",
        "apt-get install libsuitesparse-dev gcc libc6-dev python3-dev, then pip install 'scikit-sparse<0.5'",
    ),
    "ngsolve": ("ngsolve", "ngsolve", "pip install ngsolve"),
}  # fmt: skip
#: processor time of ten modes at the coarsest element size (m), s, and its growth with 1 / size, for the announcement
_COARSE, _GROWTH, _DEAR = 0.0042, 3.5, {"superlu": 1.7, "superlu_default": 4.0}


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
    """Measure, write bench_modal.json, .csv and .png into a folder, and return what the JSON holds.

    Solvers take turns in every round; one that has lost by far at a size is left out from there on.
    """
    solvers, absent = _solvers()
    rows = Rows(folder, "modal", {}, _expected(solvers, effort))
    contest = Contest(OURS, _LOST, effort.limit)
    result: dict[str, Any] = {
        "machine": machine() | {"clock": "CPU time of the process, one thread"}, "effort": asdict(effort),
        "modes": COUNT, "absent": absent, "dropped": contest.dropped, "sizes": [],
    }  # fmt: skip
    for size, growth in zip(effort.sizes, _growths(effort.sizes), strict=True):
        with tempfile.TemporaryDirectory() as home:
            result["sizes"].append(_size(rows, contest, solvers, _Matrices(Path(home), size, effort), growth))
        result["ahead"] = _ahead(result["sizes"])
        result["wall_time_s"] = rows.seconds
        _write(result, folder)  # a large size may end in a kill: what is measured stays
    rows.finish()
    return result


@dataclass(frozen=True)
class _Matrices:
    """Mesh and matrices of one element size in a folder, made when they are first needed."""

    home: Path
    size: float
    effort: Effort

    @property
    def inputs(self) -> dict[str, Any]:
        """What a measurement depends on."""
        return {"element_size": self.size, "limit": self.effort.limit, "modes": COUNT}

    def assemble(self) -> dict[str, Any]:
        """Make the mesh, and the matrices in a process of their own."""
        mesh = self.home / "cluster.msh"
        if not mesh.is_file():
            build(VaneCluster(element_size=self.size), mesh)
        return _process(self.effort.limit, "assemble", str(mesh), str(self.home / "matrices.npz"))

    def solve(self, name: str) -> dict[str, Any]:
        """Solve in a process of its own."""
        file = self.home / "matrices.npz"
        if not file.is_file():
            self.assemble()  # that of a run that was stopped is lost
        return _process(self.effort.limit, name, str(file), str(COUNT))


def _size(rows: Rows, contest: Contest, solvers: list[str], matrices: _Matrices, growth: float) -> dict[str, Any]:
    """Measure all solvers at one size. growth: of their time towards the next."""
    size, inputs = matrices.size, matrices.inputs
    assembled = rows.take(_row(size), matrices.assemble, inputs=inputs, tell=_assembly_text)
    where = f"{assembled['dofs']:,} degrees of freedom" if assembled["status"] == "ok" else f"{size} m"
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in solvers}
    for turn in range(matrices.effort.rounds):
        for name in solvers:
            row = _row(size, turn, name)
            reason = contest.dropped.get(name) if assembled["status"] == "ok" else f"assembly {assembled['status']}"
            if reason is not None:
                rows.leave_out(row, reason)
                continue
            versions = {"package": _version(name)}
            runs[name].append(
                rows.take(row, partial(matrices.solve, name), inputs=inputs | versions, tell=_solver_text)
            )
            if runs[name][-1]["status"] != "ok" and name != OURS:
                contest.dropped[name] = f"{runs[name][-1]['status']} at {where}"
        contest.judge(where, {name: _time(of) for name, of in runs.items() if of and of[-1]["status"] == "ok"}, growth)
    done = {
        name: _middle(of) if of else {"status": f"dropped: {contest.dropped.get(name)}"} for name, of in runs.items()
    }
    solved = done if assembled["status"] == "ok" else {}
    return {
        "element_size": size, "assembly": assembled, "solvers": solved, "agree": _agree(solved),
        "ratio": _ratios(solved),
    }  # fmt: skip


def _row(size: float, turn: int = 0, name: str | None = None) -> str:
    return f"{size:g} m, " + ("assembly" if name is None else f"{NAMES[name]}, round {turn + 1}")


def _expected(solvers: list[str], effort: Effort) -> dict[str, float]:
    """Return the rows in their order, and about what each takes, s."""
    expected = {}
    for size in effort.sizes:
        expected[_row(size)] = 8.0 + 4.0 * (_COARSE / size) ** 2.4
        for turn, name in itertools.product(range(effort.rounds), solvers):
            expected[_row(size, turn, name)] = 3.0 + _DEAR.get(name, 1.2) * (_COARSE / size) ** _GROWTH
    return expected


def _growths(sizes: tuple[float, ...]) -> list[float]:
    """Return by how much a solver's time grows from each size to the next, about."""
    return [(one / other) ** _GROWTH for one, other in itertools.pairwise(sizes)] + [1.0]


def _assembly_text(row: Mapping[str, Any]) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    return f"{row['dofs']:,} degrees of freedom in {row['assembly']['cpu_s']:.2f} s, {row['peak_bytes'] / 1e9:.2f} GB"


def _solver_text(row: Mapping[str, Any]) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    parts = ", ".join(f"{part} {value['cpu_s']:.2f} s" for part, value in _timed(row).items())
    solves = f", {row['solves']} solves" if "solves" in row else ""
    return f"{parts}{solves}, {row['peak_bytes'] / 1e9:.2f} GB"


def _timed(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a measurement that were timed."""
    return {part: value for part, value in row.items() if isinstance(value, dict) and "cpu_s" in value}


def _time(runs: list[dict[str, Any]]) -> float:
    return float(np.median([run["modes"]["cpu_s"] for run in runs]))


def _write(result: Mapping[str, Any], folder: Path) -> None:
    from benchmarks.modes.figures import modal_figure

    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "bench_modal.json", result)
    _write_csv(result, folder / "bench_modal.csv")
    modal_figure(result, folder / "bench_modal.png")


def print_summary(result: Mapping[str, Any]) -> None:
    """Print times, memory and ratios."""
    lines = []
    for entry in result["sizes"]:
        dofs, ratios = f"{entry['assembly'].get('dofs', 0):,}", entry["ratio"]
        lines.append((dofs, "assembly", _assembly_text(entry["assembly"]), ""))
        lines += [
            (dofs, NAMES[name], _solver_text(run), f"{ratios[name]['modes']:.2f}" if name in ratios else "")
            for name, run in entry["solvers"].items()
        ]
    print(table(("degrees of freedom", "solver", "processor time and peak memory", "ours / this"), lines))
    for name, reason in result["absent"].items():
        print(f"not measured: {NAMES[name]} ({reason})")
    behind = [f"{name} at {dofs}" for name, dofs in result["ahead"]["behind"]]
    print("at or ahead of each at every size" if not behind else "behind " + ", ".join(behind))


def _solvers() -> tuple[list[str], dict[str, str]]:
    """Return the solvers that are installed, and why the others are not."""
    absent = {
        name: f"{package} is not installed: {remedy}"
        for name, (module, package, remedy) in _PEERS.items()
        if name in NAMES and importlib.util.find_spec(module) is None
    }
    return [name for name in NAMES if name not in absent], absent


def _version(name: str) -> str | None:
    """Return the version of the package of a peer; ours and scipy's solvers have none of their own."""
    return importlib.metadata.version(_PEERS[name][1]) if name in _PEERS else None


def _middle(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return medians over the rounds; the first trouble is what they come to."""
    for run in runs:
        if run["status"] != "ok":
            return run
    middle = {
        part: {clock: float(np.median([run[part][clock] for run in runs])) for clock in ("cpu_s", "wall_s")}
        for part in _timed(runs[0])
    }
    peaks = {key: max(run[key] for run in runs) for key in ("loaded_bytes", "peak_bytes")}
    return runs[0] | middle | peaks | {"rounds": len(runs)}


def _process(limit: float, *arguments: str) -> dict[str, Any]:
    """Measure once in a process of its own, on one thread; trouble is a status."""
    try:
        done = run_module("benchmarks.modes.worker", *arguments, threads=1, timeout=limit)
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
