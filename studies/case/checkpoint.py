"""Solutions of a long command on a case, stored on disk so that the same command can resume after a kill."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.checkpoint_file import CheckpointFile, digests
from vanedamp.files.errors import VanedampError
from vanedamp.files.provenance import versions
from vanedamp.files.store import StoreError, Variable
from vanedamp.files.toml_input import tables
from vanedamp.modal.kept_solutions import Arrays
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.studies.case.tables import Case


class CaseCheckpoint(CheckpointFile):
    """Solutions in the order in which a command requests them (path None: nothing is stored)."""

    def __init__(self, path: str | Path | None, command: str, case: Case, matrices: SystemMatrices) -> None:
        """Load the file's solutions. Raises InputError for a file of another case, or one that cannot be read."""
        belongs: dict[str, tuple[str, Mapping[str, Any]]] = {
            "case": ("case", json.loads(json.dumps(tables(case)))),
            "matrices": ("mesh", matrices.provenance),
            "model": ("file of measurements", digests(case.files)),
            "versions": ("version of the software", versions()),
        }
        super().__init__(path, f"{command}-checkpoint", belongs, self._content)
        self._solutions: list[dict[str, np.ndarray]] = []
        self._requested, self._stores = 0, path is not None
        if (content := self.read()) is not None:
            self._solutions = [{} for _ in content[0]["solution"]]
            for key, values in content[0].items():
                name, of, number = key.partition(" ")
                if of:  # no dimension
                    self._solutions[int(number)] |= {name: values}

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        of_the_case = kind is not None and issubclass(kind, VanedampError) and not issubclass(kind, StoreError)
        if of_the_case:
            self.discard()
        super().__exit__(kind, *rest)

    def next(self, solve: Callable[[], Arrays]) -> Arrays:
        """Return the next solution, from the file or computed by the function (modal.kept_solutions.Keep)."""
        self._requested += 1
        if self._requested <= len(self._solutions):
            return self._solutions[self._requested - 1]
        solution = solve()
        if self._stores:
            self._solutions.append(dict(solution))
            self.changed()
        return solution

    def _content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        variables = {"solution": Variable(np.arange(len(self._solutions)), ("solution",))}
        for number, arrays in enumerate(self._solutions):
            for name, values in arrays.items():
                dims = [f"{name}_{number}_{axis}" for axis in range(values.ndim)]
                variables[f"{name} {number}"] = Variable(values, dims)
        return variables, {}, f"{len(self._solutions)} solutions are finished"
