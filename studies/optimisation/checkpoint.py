"""Runs of a search on disk. The same search asks for the same runs in the same order, and begins with those kept."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.sweep import ListProgress, run_list
from vanedamp.coupling.sweep.worker import SweepTable
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import tables
from vanedamp.studies.optimisation.measures import counted
from vanedamp.studies.optimisation.study import Study

#: of a run: what counts, without bodies, excess over limits, whether it is ok
_COLUMNS = 4


class DesignCheckpoint(SceneCheckpoint):
    """Runs that were asked for so far, in memory and in a file (path None: in memory only).

    Each has what it counts by (measures.counted) and whether its status is ok, as a last column.
    """

    def __init__(self, path: str | Path | None, study: Study, provenance: Mapping[str, Any]):
        """Take up the file's runs. Raises InputError for a file of another study, or one that cannot be read."""
        of_table = {"optimise": ("study", json.loads(json.dumps(tables(study.table))))}
        super().__init__(path, "optimise-checkpoint", study.scene, provenance, of_table)
        self._table = study.table
        self._runs, self._asked = np.empty((0, _COLUMNS)), 0
        self._list: SweepTable | None = None
        self._base = study.scene
        if (found := self.read()) is not None:
            self._runs = found[0]["runs"]

    def run(
        self, base: Scene, points: Sequence[Mapping[str, Any]], executor: Executor | None, progress: ListProgress
    ) -> np.ndarray:
        """Return the columns (p, 4) of scenes that differ from `base` in some values (sweep.run_list)."""
        first, self._asked = self._asked, self._asked + len(points)
        if missing := points[len(self._runs[first : self._asked]) :]:
            known = len(points) - len(missing)
            finished = SweepTable(len(missing), Row(base))
            self._list, self._base = finished, base

            def told(done: int) -> None:
                self.changed()
                progress(known + done)

            run_list(base, missing, executor, told, finished)
            self._runs, self._list = np.vstack([self._runs, self._of(finished)]), None
        return self._runs[first : self._asked]

    def content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        """Return variables of the file, and how much is finished, in words: runs up to the first that is not done."""
        runs = self._runs
        if self._list is not None:
            whole = np.append(self._list.done, False).argmin()
            runs = np.vstack([runs, self._of(self._list)[:whole]])
        return {"runs": Variable(runs, ("run", "column"))}, {}, f"{len(runs)} runs are finished"

    def _of(self, table: SweepTable) -> np.ndarray:
        """Return the columns (p, 4) of a list of runs, finished or not."""
        ok = table.text("status") == "ok" if table.count else np.zeros(len(table.done))
        size = len(table.done)
        found = counted(self._table.measure, self._table.limits, table.arrays((size,)), size)
        return np.column_stack([found, ok.astype(float)])
