"""Modes of a ring of equal sectors: frequencies over nodal diameters, and shapes on one sector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.record import Array, Record
from vanedamp.modal.algebra import sector_rotations
from vanedamp.modal.cyclic_faces import CyclicError


@dataclass(frozen=True, eq=False, repr=False)
class RingModes(Record):
    """Undamped modes of a ring of N sectors, by nodal diameter, lowest first.

    In the axes of sector j, turned with it, a mode moves by u_j = Re(z exp(i (omega t + h j alpha))). For 0 < h < N / 2
    it is a pair of one frequency, of which z and its conjugate, with -h, are the two waves.
    """

    KIND: ClassVar[str] = "ring-modes"
    sectors: int
    """N"""
    axis: Annotated[np.ndarray, Array(("axis",), attribute=True)]
    """unit vector"""
    point: Annotated[np.ndarray, Array(("axis",), "m", attribute=True)]
    """a point of the axis"""
    diameters: Annotated[np.ndarray, Array(("mode",), dtype=np.int64, name="diameter")]
    """h. With gyroscopic coupling h > 0 is the wave against the turn about the axis, -h the one with it, each with its
    own frequency"""
    families: Annotated[np.ndarray, Array(("mode",), dtype=np.int64, name="family")]
    """order within the diameter, from 0"""
    frequencies_hz: Annotated[np.ndarray, Array(("mode",), "Hz", name="frequency", json="frequency_hz")]
    """natural frequencies"""
    residuals: Annotated[np.ndarray, Array(("mode",), name="residual")]
    """as in `modes.Modes`"""
    shapes: Annotated[np.ndarray, Array(("mode", "dof"), "kg^-0.5", dtype=complex, name="shape")]
    """z on sector 0, x, y and z of every node in turn. The modal mass over the ring is 1: N z^H M z = 1 for h = 0 and
    N / 2 (real z), and (N / 2) z^H M z = 1 else. Its largest component is real and positive"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """of the matrices (JSON-able)"""

    def __post_init__(self) -> None:
        super().__post_init__()
        lengths = {
            len(array) for array in (self.diameters, self.families, self.frequencies_hz, self.residuals, self.shapes)
        }
        if len(lengths) != 1 or self.shapes.ndim != 2:
            raise CyclicError(f"modes: shapes {self.shapes.shape} do not fit {len(self.diameters)} diameters")

    def __len__(self) -> int:
        return len(self.frequencies_hz)

    @property
    def angle(self) -> float:
        """Angle of a sector, rad."""
        return 2.0 * np.pi / self.sectors

    @property
    def table(self) -> np.ndarray:
        """Frequencies (diameters, families), Hz, of the diameters in ascending order; nan where there is none."""
        diameters = np.unique(self.diameters)
        frequencies = np.full((diameters.size, int(self.families.max()) + 1), np.nan)
        frequencies[np.searchsorted(diameters, self.diameters), self.families] = self.frequencies_hz
        return frequencies

    def whole(self, mode: int, phase: float = 0.0) -> np.ndarray:
        """Return the displacements (N, n_nodes, 3) of all sectors in the global axes, at a phase omega t (rad)."""
        steps = np.arange(self.sectors) * self.angle
        turned = np.exp(1j * (phase + self.diameters[mode] * steps))
        displacements = (turned[:, None] * self.shapes[mode]).real.reshape(self.sectors, -1, 3)
        return np.einsum("sij,snj->sni", sector_rotations(self.axis, self.sectors), displacements)
