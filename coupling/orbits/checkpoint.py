"""Branches of orbits on disk while they are followed, from which an interrupted command goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.checkpoint_file import CheckpointFile, digests
from vanedamp.files.store import StoreError, Variable


class Checkpoint:
    """What was found so far, in a file (path None: nowhere). A context manager.

    found: branches, whose last one is unfinished if its end is ""; tangent, step: where that one goes on; current:
    returns all three as they are now.
    """

    def __init__(
        self, path: str | Path | None, scene: Scene, provenance: Mapping[str, Any],
        current: Callable[[], tuple[Branches, np.ndarray, float]],
    ) -> None:  # fmt: skip
        """Take up what the file holds. Raises InputError for the file of other branches, or one that cannot be read."""
        belongs = {
            "scene": ("scene", scene.to_dict()),
            "model": ("reduced model or CSV file", digests(scene.files)),
            "provenance": ("version of the software", provenance),
        }
        self._current = current
        self._file = CheckpointFile(path, "orbits-checkpoint", belongs, self._content)
        self.found: Branches | None = None
        self.tangent, self.step = np.zeros(0), 0.0
        if (read := self._file.read()) is not None:
            variables, attributes = read
            self.found = Branches.of(variables, attributes, str(path))
            self.tangent, self.step = variables["tangent"], float(attributes["step"])

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # a file that could not be written will not be now
        if kind is None or not issubclass(kind, StoreError):
            self._file.write()

    def changed(self) -> None:
        """Say that there is more to keep. Raises StoreError, such as for a full disk."""
        self._file.changed()

    def _content(self) -> tuple[Mapping[str, Variable], dict[str, Any], str]:
        found, tangent, step = self._current()
        points = sum(len(branch.parameter) for branch in found.branches)
        variables = found.variables() | {"tangent": Variable(tangent, ("tangent_entry",))}
        attributes = found.attributes() | {"step": step}
        return variables, attributes, f"{points} points are found"
