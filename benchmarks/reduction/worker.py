"""Reductions of one structure, and its modes, in turns in a process of its own.

    python -m benchmarks.reduction.worker MESH ROUNDS

prints one line of JSON: for every task seconds, factorisations and right-hand sides solved of each round.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import clocked, peak_memory
from vanedamp.files.toml_input import validate
from vanedamp.modal import petsc
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.rom.reduction import reduce
from vanedamp.studies.case.stages import assemble, interface, reduction
from vanedamp.studies.case.structure import Structure
from vanedamp.studies.case.tables import Case

#: natural modes, modes of the reduced model, its patches with three displacements each, and hot spots
COUNT, MODES, PATCHES, SPOTS = 10, 30, ("shroud", "c1_left", "c1_right", "c1_floor"), 3


def case(mesh: Path) -> Case:
    """Return the held cluster with three displacements of every patch, quadratic elements."""
    axes = dict(zip("xyz", np.eye(3).tolist(), strict=True))
    return validate(
        Case,
        {
            "mesh": {"file": str(mesh), "degree": 2},
            "material": {"default": {"young": 2.0e11, "poisson": 0.3, "density": 8190.0, "damping_ratio": 0.002}},
            "support": {"clamped": ["clamp"]},
            "modes": {"count": COUNT, "direction": [0, 1, 0], "at": "shroud_y"},
            "interface": {
                f"{patch}_{axis}": {"facets": patch, "direction": direction}
                for patch in PATCHES
                for axis, direction in axes.items()
            },
        },
        "benchmark",
    )


def tasks(structure: Structure) -> dict[str, Callable[[], Any]]:
    """Return what is timed, by its name."""
    matrices, coordinates = structure.matrices, interface(structure.case, structure.matrices)
    reduced = partial(reduce, matrices, coordinates, modes=MODES, factorize=factorize)
    return {
        "modes": lambda: solve_modes(matrices, COUNT),
        "reduction": reduced,
        "quasi_static": partial(reduced, quasi_static=1),
        "rubin": partial(reduced, "rubin"),
        "estimate": partial(reduction, structure, MODES),
        "hot_spots": partial(reduction, structure, MODES, spots=SPOTS),
    }


@contextmanager
def counted(entry: dict[str, Any]) -> Iterator[None]:
    """Count factorisations, those for inertia included, and right-hand sides solved, into an entry."""
    entry |= {"factorisations": 0, "solves": 0}
    make, solve, inertia = petsc.Factorization.__init__, petsc.Factorization.solve_rows, petsc.negative_eigenvalues

    def made(self: petsc.Factorization, *arguments: Any) -> None:
        entry["factorisations"] += 1
        make(self, *arguments)

    def solved(self: petsc.Factorization, rows: np.ndarray) -> np.ndarray:
        entry["solves"] += len(rows)
        return solve(self, rows)

    def below(*arguments: Any) -> int:
        entry["factorisations"] += 1
        return inertia(*arguments)

    changed = {"Factorization.__init__": made, "Factorization.solve_rows": solved, "negative_eigenvalues": below}
    kept = {"Factorization.__init__": make, "Factorization.solve_rows": solve, "negative_eigenvalues": inertia}
    try:
        _set(changed)
        yield
    finally:
        _set(kept)


def _set(functions: dict[str, Any]) -> None:
    for name, function in functions.items():
        owner, _, attribute = name.rpartition(".")
        setattr(getattr(petsc, owner) if owner else petsc, attribute, function)


def measure(mesh: Path, rounds: int) -> dict[str, Any]:
    """Return degrees of freedom, peak memory and the rounds of every task; the first round compiles and is dropped."""
    structure = assemble(case(mesh))
    todo = tasks(structure)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in todo}
    for turn in range(-1, rounds):
        # forms are compiled by the last task only
        for name in list(todo)[:: 1 if turn % 2 == 0 else -1] if turn >= 0 else ["hot_spots"]:
            entry: dict[str, Any] = {}
            with clocked(entry, "time"), counted(entry):
                todo[name]()
            if turn >= 0:
                found[name].append(entry)
    return {"dofs": int(structure.matrices.free.size), "peak_bytes": peak_memory(), "tasks": found}


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]), int(sys.argv[2]))))
