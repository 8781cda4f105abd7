"""A scene in results on disk, and the base of the checkpoints of commands on one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.checkpoint_file import CheckpointFile, digests
from vanedamp.files.record import Coded
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import validate

#: a scene as a field of a record
SceneField = Annotated[Scene, Coded(Scene.to_dict, lambda data, path: validate(Scene, data, path))]


class SceneCheckpoint(CheckpointFile):
    """The checkpoint of a command on a scene."""

    def __init__(
        self, path: str | Path | None, kind: str, scene: Scene, provenance: Mapping[str, Any],
        more: Mapping[str, tuple[str, Any]] | None = None,
    ) -> None:  # fmt: skip
        """more: further input that it belongs to."""
        belongs = {
            "scene": ("scene", scene.to_dict()),
            "model": ("reduced model or CSV file", digests(scene.files)),
            "provenance": ("version of the software", provenance),
            **(more or {}),
        }
        super().__init__(path, kind, belongs, self.content)

    def content(self) -> tuple[Mapping[str, Variable], Mapping[str, Any], str]:
        """Return variables and further attributes of the file, and how much is finished, in words."""
        raise NotImplementedError
