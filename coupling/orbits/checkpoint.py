"""Branches of orbits on disk while they are followed, from which an interrupted command resumes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import Variable


class BranchCheckpoint(SceneCheckpoint):
    """Results so far, in a file (path None: nowhere).

    found: branches, whose last one is unfinished if its end is ""; head, step: where it continues (Diagram.place);
    current: returns all three as they are now.
    """

    def __init__(
        self, path: str | Path | None, scene: Scene, provenance: Mapping[str, Any],
        current: Callable[[], tuple[Branches, np.ndarray, float]],
    ) -> None:  # fmt: skip
        """Resume from the file. Raises InputError for a file of other branches or an unreadable one."""
        super().__init__(path, "orbits-checkpoint", scene, provenance)
        self._current = current
        self.found: Branches | None = None
        self.head, self.step = np.zeros(0), 0.0
        if (read := self.read()) is not None:
            variables, attributes = read
            self.found = Branches.of(variables, attributes, str(path))
            self.head, self.step = variables["head"], float(attributes["step"])

    def content(self) -> tuple[Mapping[str, Variable], dict[str, Any], str]:
        """Return variables and attributes of the file, and how many points are found, in words."""
        branches, head, step = self._current()
        points = sum(len(branch.parameter) for branch in branches.branches)
        variables = branches.variables() | {"head": Variable(head, ("head_row", "head_entry"))}
        attributes = branches.attributes() | {"step": step}
        return variables, attributes, f"{points} points are found"
