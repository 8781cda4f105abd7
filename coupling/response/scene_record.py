"""The bases of results of a scene on disk, sweeps, branches of orbits, run-ups, ring-downs, and of checkpoints."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.checkpoint_file import CheckpointFile, digests
from vanedamp.files.store import Variable, dataset, load, reader, save
from vanedamp.files.toml_input import validate

if TYPE_CHECKING:
    import xarray


class SceneRecord:
    """A record of a scene: its class says its kind, the variables and attributes of its file, and how to read them."""

    KIND: ClassVar[str]
    scene: Scene
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file."""
        raise NotImplementedError

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        return {
            "scene": self.scene.to_dict(), "warnings": json.dumps(list(self.warnings)),
            "provenance": dict(self.provenance),
        }  # fmt: skip

    @classmethod
    def of(cls, values: dict[str, Any], attributes: Mapping[str, Any], path: str) -> Self:
        """Return the record in the variables and attributes of a file."""
        raise NotImplementedError

    @staticmethod
    def common(attributes: Mapping[str, Any], path: str) -> dict[str, Any]:
        """Return scene, warnings and provenance from the attributes of a file; those that it has."""
        found: dict[str, Any] = {name: json.loads(attributes[name]) for name in ("scene", "provenance")}
        if "warnings" in attributes:
            found["warnings"] = tuple(json.loads(attributes["warnings"]))
        return found | {"scene": validate(Scene, found["scene"], path)}

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens."""
        save(path, self.KIND, self.variables(), self.attributes())

    @classmethod
    @reader
    def load(cls, path: str | Path) -> Self:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        return cls.of(*load(path, cls.KIND), str(path))

    def to_xarray(self) -> xarray.Dataset:
        """Return the data set of xarray, which must be installed, that the file opens as."""
        return dataset(self.variables(), self.attributes())


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
