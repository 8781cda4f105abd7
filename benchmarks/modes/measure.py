"""Time and memory of ten modes: block Lanczos, scipy's eigsh and NGSolve on the same matrices or mesh, with factors
as far as the memory holds them, and Davidson's method without.

Every measurement runs in a process of its own, on one thread; processor time counts, since what else the machine does
counts less in it than in time by the clock.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.apart import apart
from benchmarks.benchmark import Benchmark, Result
from benchmarks.modes.solvers import COUNT, ITERATIVE, NAMES
from benchmarks.rows import Contest, Rows
from benchmarks.tables import table
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build
from vanedamp.modal.iterative import chosen
from vanedamp.modal.petsc import has_cholmod

#: what `vanedamp modal` runs on one rank
OURS = "lanczos" if has_cholmod() else "mumps"
_WORKER = "benchmarks.modes.worker"
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
_ITERATIVE_COARSE, _ITERATIVE_GROWTH = 6.0, 2.2


@dataclass(frozen=True)
class Modal(Benchmark):
    """Element sizes of the cluster, m, rounds of every measurement (the median counts), and the limit of one, s.

    Solvers take turns in every round; one that has lost by far at a size is left out from there on.
    """

    sizes: tuple[float, ...]
    rounds: int
    limit: float

    NAME = "modal"
    CLOCK = "CPU time of the process, one thread"
    COLUMNS = ("dofs", "solver", "status", "factorisation_cpu_s", "modes_cpu_s", "modes_wall_s", "peak_bytes")

    def inputs(self) -> dict[str, Any]:
        return {}

    def expected(self, folder: Path) -> dict[str, float]:
        expected = {}
        for size in self.sizes:
            expected[_row(size)] = 8.0 + 4.0 * (_COARSE / size) ** 2.4
            for turn, name in itertools.product(range(self.rounds), _solvers()[0]):
                known = _DEAR.get(name, 1.2), _GROWTH
                coarse, growth = (_ITERATIVE_COARSE, _ITERATIVE_GROWTH) if name == ITERATIVE else known
                expected[_row(size, turn, name)] = 3.0 + coarse * (_COARSE / size) ** growth
        return expected

    def measure(self, rows: Rows) -> Result:
        solvers, absent = _solvers()
        contest = Contest(OURS, _LOST, self.limit)
        result: Result = {"modes": COUNT, "absent": absent, "dropped": contest.dropped, "sizes": []}
        for size, growth in zip(self.sizes, _growths(self.sizes), strict=True):
            with tempfile.TemporaryDirectory() as home:
                result["sizes"].append(_size(rows, contest, solvers, _Matrices(Path(home), size, self), growth))
            result["ahead"] = _ahead(result["sizes"])
            self.write(
                self.begun() | result | {"wall_time_s": rows.seconds}, rows.folder
            )  # a larger size may be killed
        return result

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        """Yield a line a size and solver."""
        for entry in result["sizes"]:
            assembly = entry["assembly"]
            dofs, times = assembly.get("dofs"), assembly.get("assembly", {})
            clocks = (times.get("cpu_s"), times.get("wall_s"), assembly.get("peak_bytes"))
            yield dofs, "assembly", assembly["status"], "", *clocks
            for name, run in entry["solvers"].items():
                factor, modes = run.get("factorisation", {}), run.get("modes", {})
                clocks = (modes.get("cpu_s"), modes.get("wall_s"), run.get("peak_bytes"))
                yield dofs, NAMES[name], run["status"], factor.get("cpu_s"), *clocks

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.modes.figures import modal_figure

        modal_figure(result, folder / "bench_modal.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield times, memory and ratios."""
        lines = []
        for entry in result["sizes"]:
            dofs, ratios = f"{entry['assembly'].get('dofs', 0):,}", entry["ratio"]
            lines.append((dofs, "assembly", _assembly_text(entry["assembly"]), ""))
            lines += [
                (dofs, NAMES[name], _solver_text(run), f"{ratios[name]['modes']:.2f}" if name in ratios else "")
                for name, run in entry["solvers"].items()
            ]
        yield table(("degrees of freedom", "solver", "processor time and peak memory", "ours / this"), lines)
        yield from (f"not measured: {NAMES[name]} ({reason})" for name, reason in result["absent"].items())
        behind = [f"{name} at {dofs}" for name, dofs in result["ahead"]["behind"]]
        yield "at or ahead of each at every size" if not behind else "behind " + ", ".join(behind)


#: about 30 000, 100 000, 350 000 and 1 500 000 degrees of freedom
FULL = Modal((0.0042, 0.00225, 0.00134, 0.00074), 3, 900.0)
QUICK = Modal((0.006, 0.0042), 1, 120.0)


@dataclass(frozen=True)
class _Matrices:
    """Mesh and matrices of one element size in a folder, made when they are first needed."""

    home: Path
    size: float
    effort: Modal

    @property
    def inputs(self) -> dict[str, Any]:
        """What a measurement depends on."""
        return {"element_size": self.size, "limit": self.effort.limit, "modes": COUNT}

    def assemble(self) -> dict[str, Any]:
        """Make the mesh, and the matrices in a process of their own."""
        mesh = self.home / "cluster.msh"
        if not mesh.is_file():
            build(VaneCluster(element_size=self.size), mesh)
        return apart(_WORKER, "assemble", str(mesh), str(self.home / "matrices.npz"), limit=self.effort.limit)

    def solve(self, name: str) -> dict[str, Any]:
        """Solve in a process of its own."""
        file = self.home / "matrices.npz"
        if not file.is_file():
            self.assemble()  # that of a run that was stopped is lost
        return apart(_WORKER, name, str(file), str(COUNT), limit=self.effort.limit)


def _size(rows: Rows, contest: Contest, solvers: list[str], matrices: _Matrices, growth: float) -> dict[str, Any]:
    """Measure all solvers at one size. growth: of their time towards the next."""
    size, inputs = matrices.size, matrices.inputs
    assembled = rows.take(_row(size), matrices.assemble, inputs=inputs, tell=_assembly_text)
    where = f"{assembled['dofs']:,} degrees of freedom" if assembled["status"] == "ok" else f"{size} m"
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in solvers}
    if assembled["status"] == "ok":
        memory = chosen("auto", assembled["dofs"])
        if memory["name"] != "factor":
            needs = f"factors of {memory['factor_bytes'] / 1e9:.0f} GB estimated at {where}"
            contest.dropped |= {name: needs for name in solvers if name != ITERATIVE and name not in contest.dropped}
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
        times = {name: _time(of) for name, of in runs.items() if of and of[-1]["status"] == "ok" and name != ITERATIVE}
        contest.judge(where, times, growth)
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


def _solvers() -> tuple[list[str], dict[str, str]]:
    """Return the solvers that are installed, and why the others are not."""
    absent = {
        name: f"{package} is not installed: {remedy}"
        for name, (module, package, remedy) in _PEERS.items()
        if name in NAMES and importlib.util.find_spec(module) is None
    }
    if not has_cholmod():
        absent["lanczos"] = "this PETSc is built without SuiteSparse; Debian's and conda's have it"
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
        if ratio["modes"] > 1.05 and name != ITERATIVE
    ]
    return {"everywhere": not behind, "behind": behind}
