"""Time of reduced models over that of ten modes, proof included: 12 interface coordinates and 30 modes.

Tasks take turns in a process of their own for each size, on one thread; processor time counts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.apart import apart
from benchmarks.benchmark import Benchmark, Result, Row
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build

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
class Reduction(Benchmark):
    """Element sizes of the cluster, m, rounds, and the limit of one size, s."""

    sizes: tuple[float, ...]
    rounds: int
    limit: float

    NAME = "reduction"
    CLOCK = "CPU time of the process, one thread"
    COLUMNS = ("dofs", "task", "cpu_s", "wall_s", "ratio", "factorisations", "solves")

    def inputs(self) -> dict[str, Any]:
        return {"rounds": self.rounds, "limit": self.limit}

    def rows(self, folder: Path) -> dict[str, Row]:
        return {
            f"{size:g} m": Row(
                (self.rounds + 0.5) * _SECONDS * (_COARSE / size) ** _GROWTH, partial(_size, size, self), _text
            )
            for size in self.sizes
        }

    def result(self, values: Mapping[str, Any]) -> Result:
        pairs = zip(self.sizes, values.values(), strict=True)
        sizes = [{"element_size": size} | row | {"ratio": _ratios(row)} for size, row in pairs]
        return {"target": TARGET, "sizes": sizes}

    def lines(self, result: Mapping[str, Any]) -> Iterable[Sequence[Any]]:
        """Return a line a size and task."""
        return (
            (entry["dofs"], name, task["cpu_s"], task["wall_s"], entry["ratio"].get(name), task["factorisations"],
             task["solves"])
            for entry in result["sizes"] if entry["status"] == "ok" for name, task in entry["tasks"].items()
        )  # fmt: skip

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield seconds, ratios, factorisations and solves."""
        for entry in result["sizes"]:
            if entry["status"] != "ok":
                yield f"element size {entry['element_size']} m: {entry['status']}"
                continue
            yield f"{entry['dofs']:,} degrees of freedom, {entry['peak_bytes'] / 1e9:.2f} GB"
            for name, task in entry["tasks"].items():
                ratio = "" if name == "modes" else f", {entry['ratio'][name]:.2f} of the modes"
                yield (
                    f"  {NAMES[name]:46} {task['cpu_s']:8.2f} s{ratio}; "
                    f"{task['factorisations']} factorisations, {task['solves']} solves"
                )


#: about 30 000 and 100 000 degrees of freedom
FULL = Reduction((0.0042, 0.00225), 3, 3600.0)
QUICK = Reduction((0.006,), 1, 600.0)


def _size(size: float, effort: Reduction) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as home:
        mesh = Path(home) / "cluster.msh"
        build(VaneCluster(element_size=size), mesh)
        found = apart("benchmarks.reduction.worker", str(mesh), str(effort.rounds), limit=effort.limit)
    if found["status"] != "ok":
        return found
    return found | {"tasks": {name: _middle(of) for name, of in found["tasks"].items()}, "rounds": found["tasks"]}


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


def _text(row: Mapping[str, Any]) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    ratio = _ratios(row)["reduction"]
    return f"{row['dofs']:,} degrees of freedom, reduction over modes {ratio:.2f} (target {TARGET})"
