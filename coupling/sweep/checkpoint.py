"""Finished points of a sweep on disk, from which a killed sweep resumes (files.checkpoint_file)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.worker import SweepTable, Task, TaskResult
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import InputError


class SweepCheckpoint(SceneCheckpoint):
    """Finished points, in memory and in a file (path None: in memory only)."""

    def __init__(self, path: str | Path | None, scene: Scene, size: int, provenance: Mapping[str, Any]) -> None:
        """Take up the file's points. Raises InputError for a file of another sweep, or one that cannot be read."""
        self.finished = SweepTable(size, Row(scene))
        super().__init__(path, "sweep-checkpoint", scene, provenance)
        if (saved := self.read()) is not None:
            self._take(str(path), saved[0])

    def add(self, task: Task, result: TaskResult, more: bool) -> None:
        """Take over a task's points; more: whether its chain continues. Raises StoreError, such as for a full disk."""
        self.finished.add(task, result, more)
        self.changed()

    def content(self) -> tuple[dict[str, Variable], dict[str, Any], str]:
        """Return variables of the file, and how many points are finished, in words."""
        finished, done = self.finished, np.flatnonzero(self.finished.done)
        # a copy of most of a million points would take as much memory as all
        rows = slice(None) if 2 * len(done) > len(finished.done) else done
        states = {str(number): state.to_list() for number, state in finished.states.items()}
        texts = np.array([json.dumps(finished.texts), json.dumps(states)], object)
        variables = {
            "point": Variable(done, ("point",)),
            "values": Variable(finished.values.T[:, rows], ("column", "kept")),
            "codes": Variable(finished.codes[rows], ("kept", "text")),
            "texts_and_states": Variable(texts, ("entry",)),
        }
        return variables, {}, f"{finished.count} of {len(finished.done)} points are finished"

    def _take(self, path: str, variables: Mapping[str, Any]) -> None:
        values, codes, done = (variables[name] for name in ("values", "codes", "point"))
        if (len(values), codes.shape[1]) != (self.finished.row.width, len(self.finished.row.texts)):
            raise InputError(
                f"{path}: the checkpoint of another version of the software, which kept other measures; nothing was "
                "done to it: move it away, or delete it to start again"
            )
        texts, states = (json.loads(entry) for entry in variables["texts_and_states"])
        rows = done if values.shape[1] > len(done) else slice(None)
        self.finished.put(done, values[:, rows].T, codes[rows], texts)
        self.finished.states = {int(number): RestartState.from_list(state) for number, state in states.items()}
