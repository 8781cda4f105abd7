"""Records over the axes of a [sweep] table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import dimensions, resonance_axis
from vanedamp.files.display import Plotted
from vanedamp.files.record import Record
from vanedamp.files.store import frozen


class OverAxes(Record, Plotted):
    """Base of such records; axes: dotted path -> values."""

    scene: Scene
    axes: Mapping[str, np.ndarray]
    provenance: Mapping[str, Any]

    @property
    def swept(self) -> str | None:
        """Axis along which curves meet resonances: the frequency, or the speed along an engine order; None without."""
        return resonance_axis(self.scene, self.axes)[0]

    @property
    def warnings(self) -> tuple[str, ...]:
        """To be read before results are used."""
        return tuple(self.provenance.get("warnings", ()))

    def units(self) -> dict[str, str]:
        """Return the unit of every axis by its path."""
        return {path: unit_of(path) for path in self.axes}

    def dimensions(self) -> dict[str, tuple[str, ...]]:
        """Return the dimensions of the grid, and of its curves."""
        return dimensions(self.scene, self.axes)


def of_axes(axes: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the values of axes as a record has them."""
    return {path: frozen(values, np.asarray(values).dtype) for path, values in axes.items()}
