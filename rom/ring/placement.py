"""The interface of every sector of a ring in its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.modal.cyclic_faces import rotation
from vanedamp.rom.checks import unit
from vanedamp.rom.reduced import NORMAL, ROTATION
from vanedamp.rom.ring.deviations import RingError


class Ring:
    """What reduced rings share: sectors about an axis, and the interface of sector 0 (see RingModel)."""

    sectors: int
    axis: np.ndarray
    point: np.ndarray
    interface: tuple[str, ...]
    directions: np.ndarray
    normals: np.ndarray
    positions: np.ndarray
    arms: np.ndarray
    provenance: Mapping[str, Any]

    def _settle(self) -> None:
        """Bring interface and provenance into final form. Raises RingError for an empty interface."""
        object.__setattr__(self, "directions", unit(self.directions))
        object.__setattr__(self, "interface", tuple(str(label) for label in self.interface))
        object.__setattr__(self, "provenance", dict(self.provenance))
        if not self.interface:
            raise RingError("interface: empty; a reduced ring needs a coordinate that loads can act on")

    @property
    def labels(self) -> tuple[str, ...]:
        """The N k labels, sector by sector."""
        return tuple(sector_label(label, sector) for sector in range(self.sectors) for label in self.interface)

    def placed(self) -> dict[str, Any]:
        """Return labels, places and provenance of the whole ring, as fields of a ReducedModel."""
        rotations = turns(self.axis, self.sectors)

        def turned(vectors: np.ndarray) -> np.ndarray:
            return np.einsum("sij,kj->ski", rotations, vectors).reshape(-1, 3)

        ring = {
            "sectors": self.sectors, "axis": self.axis.tolist(), "point": self.point.tolist(),
            "labels": list(self.interface),
        }  # fmt: skip
        return {
            "interface": self.labels,
            "directions": turned(self.directions),
            "normals": turned(self.normals),
            "positions": self.point + turned(self.positions - self.point),
            "arms": np.tile(self.arms, self.sectors),
            "provenance": dict(self.provenance) | {"ring": ring},
        }


def turns(axis: np.ndarray, sectors: int) -> np.ndarray:
    """Return the rotations (N, 3, 3) of the sectors' frames about an axis (3,)."""
    return np.array([rotation(axis, 2.0 * np.pi * sector / sectors) for sector in range(sectors)])


def sector_label(label: str, sector: int) -> str:
    """Return the label of a sector's interface coordinate in the whole ring, such as "c1@3" or "c1@3.normal"."""
    for suffix in (NORMAL, ROTATION):
        if label.endswith(suffix):
            return f"{label.removesuffix(suffix)}@{sector}{suffix}"
    return f"{label}@{sector}"
