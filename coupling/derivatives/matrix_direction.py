"""A number that a scene has no path to: how far the matrices of its reduced model move in a direction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel


@dataclass(frozen=True, eq=False)
class MatrixDirection:
    """Changes (n, n) of the matrices of a scene's reduced model per unit of a number that is zero in the scene.

    name: of the number, instead of a path; mass (kg), damping (N s/m), stiffness (N/m): symmetric; None: no change.
    """

    name: str
    mass: np.ndarray | None = None
    damping: np.ndarray | None = None
    stiffness: np.ndarray | None = None

    def at(self, scene: Scene, amount: float) -> Scene:
        """Return a scene with its model moved by an amount. Raises InputError for one without a reduced model."""
        model = self._model(scene)
        moved = {name: getattr(model, name) + amount * change for name, change in self._changes.items()}
        return scene.replace({"structure.file": replace(model, damping_ratio=None, **moved)})

    def size(self, scene: Scene) -> float:
        """Return the amount that changes a matrix by as much as there is. Raises InputError for shapes that differ."""
        model, sizes = self._model(scene), []
        for name, change in self._changes.items():
            matrix = getattr(model, name)
            if np.shape(change) != matrix.shape:
                raise InputError(f"{self.name}.{name}: expected the shape {matrix.shape}, not {np.shape(change)}")
            if np.any(change):
                sizes.append(float(np.linalg.norm(matrix) / np.linalg.norm(change)) or 1.0)
        if not sizes:
            raise InputError(f"{self.name}: changes nothing; give mass, damping or stiffness")
        return min(sizes)

    @property
    def _changes(self) -> dict[str, np.ndarray]:
        given = {"mass": self.mass, "damping": self.damping, "stiffness": self.stiffness}
        return {name: np.asarray(change) for name, change in given.items() if change is not None}

    def _model(self, scene: Scene) -> ReducedModel:
        if not isinstance(scene.structure, Rom):
            raise InputError(f'{self.name}: matrices are those of a reduced model; take structure.model = "rom"')
        return ReducedModel.load(scene.structure.file)
