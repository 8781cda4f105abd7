"""The interface of every sector of a ring in its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.modal.algebra import symmetric_part
from vanedamp.modal.cyclic_faces import rotation
from vanedamp.rom.checks import unit
from vanedamp.rom.reduced import NORMAL, ROTATION, ReducedModel
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
    damping_ratio: float
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

    def natural_model(
        self, squares: np.ndarray, shapes: np.ndarray, rows: np.ndarray, static: np.ndarray, load: np.ndarray,
        added: np.ndarray | None,
    ) -> ReducedModel:  # fmt: skip
        """Return the whole ring in natural modes, with residual flexibility.

        squares (m,), shapes (n, m) of the modes in coordinates of the ring; rows (N k, n) of the interface and static
        (n, N k), the response to its forces; load (n, 3) of the base; added (m, m) damping beside that of the ratio.
        Raises RingError for a ring that can move freely, or is unstable.
        """
        if squares[0] <= 0.0:
            raise RingError("the ring can move freely, or is unstable at that speed: its modes do not hold it")
        selection = rows @ shapes
        damping = np.diag(2.0 * self.damping_ratio * np.sqrt(squares))
        if added is not None:
            damping = damping + added
        return ReducedModel(
            mass=np.eye(len(squares)), stiffness=np.diag(squares), damping=damping, selection=selection,
            damping_ratio=self.damping_ratio if added is None else None, free_modes=len(squares),
            residual_flexibility=symmetric_part(rows @ static - (selection / squares) @ selection.T),
            base_load=shapes.T @ load, **self.placed(), **self._turning(),
        )  # fmt: skip

    def _turning(self) -> dict[str, Any]:
        """Return the axis of rotation as fields of a ReducedModel; none of a ring that does not rotate."""
        return {}

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
