"""Records over the axes of a [sweep] table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import dimension, dimensions, resonance_axis
from vanedamp.files.display import Plotted
from vanedamp.files.record import Record
from vanedamp.files.store import Variable, frozen


class OverAxes(Record, Plotted):
    """Base of such records, whose axes are coordinates of the file; axes: dotted path -> values."""

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

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file."""
        own = ((dimension(path), self.axes[path], unit) for path, unit in self.units().items())
        return {dim: Variable(values, (dim,), unit) for dim, values, unit in own} | super().variables()

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        return super().attributes() | {"axes": list(self.axes)}

    @classmethod
    def given(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> dict[str, Any]:
        """Return the fields in a file by name, its axes among them."""
        axes = {axis: values[dimension(axis)] for axis in attributes["axes"]}
        return {"axes": of_axes(axes), **super().given(values, attributes, path)}


def of_axes(axes: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the values of axes as a record has them."""
    return {path: frozen(values, np.asarray(values).dtype) for path, values in axes.items()}
