"""Modes of a ring of equal sectors: frequencies over nodal diameters, and shapes on one sector."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vanedamp.files import store
from vanedamp.files.display import Displayed
from vanedamp.modal.algebra import turns
from vanedamp.modal.cyclic_faces import CyclicError

_KIND = "ring-modes"


@dataclass(frozen=True, eq=False, repr=False)
class RingModes(Displayed):
    """Undamped modes of a ring of N sectors, by nodal diameter, lowest first.

    In the axes of sector j, turned with it, a mode moves by u_j = Re(z exp(i (omega t + h j alpha))). For 0 < h < N / 2
    it is a pair of one frequency, of which z and its conjugate, with -h, are the two waves.

    sectors         N
    axis, point     (3,) unit vector, and (3,) m, a point of the axis
    diameters       (m,) h. With gyroscopic coupling h > 0 is the wave against the turn about the axis, -h the one with
                    it, each with its own frequency
    families        (m,) order within the diameter, from 0
    frequencies_hz  (m,)
    residuals       (m,) as those of `modes.Modes`
    shapes          (m, n) kg^-1/2, complex z on sector 0: the modal mass over the ring is 1, that is N z^H M z = 1 for
                    h = 0 and N / 2 (real z), and (N / 2) z^H M z = 1 else. Its largest component is real and positive
    provenance      of the matrices (JSON-able)
    """

    sectors: int
    axis: np.ndarray
    point: np.ndarray
    diameters: np.ndarray
    families: np.ndarray
    frequencies_hz: np.ndarray
    residuals: np.ndarray
    shapes: np.ndarray
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("axis", "point", "frequencies_hz", "residuals"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))
        for name in ("diameters", "families"):
            object.__setattr__(self, name, store.frozen(getattr(self, name), np.int64))
        object.__setattr__(self, "shapes", store.frozen(self.shapes, complex))
        lengths = {len(getattr(self, name)) for name in (*_COLUMNS, "shapes")}
        if len(lengths) != 1 or self.shapes.ndim != 2:
            raise CyclicError(f"modes: shapes {self.shapes.shape} do not fit {len(self.diameters)} diameters")
        object.__setattr__(self, "provenance", dict(self.provenance))

    def __len__(self) -> int:
        return len(self.frequencies_hz)

    @property
    def angle(self) -> float:
        """Angle of a sector, rad."""
        return 2.0 * np.pi / self.sectors

    @property
    def table(self) -> np.ndarray:
        """Frequencies (diameters, families), Hz, of the diameters in ascending order; nan where there is none."""
        known = np.unique(self.diameters)
        found = np.full((known.size, int(self.families.max()) + 1), np.nan)
        found[np.searchsorted(known, self.diameters), self.families] = self.frequencies_hz
        return found

    def whole(self, mode: int, phase: float = 0.0) -> np.ndarray:
        """Return the displacements (N, n_nodes, 3) of all sectors in the global axes, at a phase omega t (rad)."""
        steps = np.arange(self.sectors) * self.angle
        turned = np.exp(1j * (phase + self.diameters[mode] * steps))
        own = (turned[:, None] * self.shapes[mode]).real.reshape(self.sectors, -1, 3)
        return np.einsum("sij,snj->sni", turns(self.axis, self.sectors), own)

    def save(
        self,
        path: str | os.PathLike[str],
        variables: Mapping[str, store.Variable] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> None:
        """Write an HDF5 record; further variables (over "mode", "dof") and attributes, as of the mesh, ride along."""
        own = {
            name: store.Variable(getattr(self, column), ("mode",), units) for column, (name, units) in _COLUMNS.items()
        }
        own |= {
            "shape_real": store.Variable(self.shapes.real, ("mode", "dof"), "kg^-0.5"),
            "shape_imaginary": store.Variable(self.shapes.imag, ("mode", "dof"), "kg^-0.5"),
        }
        named = {"sectors": self.sectors, "axis": self.axis, "point": self.point, "provenance": dict(self.provenance)}
        store.save(path, _KIND, own | dict(variables or {}), named | dict(attributes or {}))

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> RingModes:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = store.load(path, _KIND)
        return cls(
            sectors=int(attributes["sectors"]),
            axis=np.array(attributes["axis"]),
            point=np.array(attributes["point"]),
            **{column: values[name] for column, (name, _) in _COLUMNS.items()},
            shapes=values["shape_real"] + 1j * values["shape_imaginary"],
            provenance=json.loads(attributes["provenance"]),
        )


#: arrays by their fields: name and unit in the record
_COLUMNS = {
    "diameters": ("diameter", "1"), "families": ("family", "1"), "frequencies_hz": ("frequency", "Hz"),
    "residuals": ("residual", "1"),
}  # fmt: skip
