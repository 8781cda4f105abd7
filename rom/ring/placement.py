"""The interface of every sector of a ring in its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any

import numpy as np

from vanedamp.files.record import Array, Record, declared
from vanedamp.modal.algebra import sector_rotations, symmetric_part
from vanedamp.rom.checks import shaped, symmetric, unit
from vanedamp.rom.reduced import NORMAL, ROTATION, ReducedModel
from vanedamp.rom.ring.deviations import RingError

#: dimensions of a symmetric matrix of a ring
SQUARE = ("coordinate", "column")
_Load = Annotated[np.ndarray, Array(("coordinate", "direction"), "kg")]
_Vectors = Annotated[np.ndarray, Array(("interface", "direction"))]


@dataclass(frozen=True, eq=False, repr=False)
class ReducedRing(Record):
    """Base of reduced rings: N sectors about an axis; sector j is sector 0 rotated by 2 pi j / N."""

    sectors: int
    """N"""
    axis: Annotated[np.ndarray, Array(("direction",))]
    """unit vector"""
    point: Annotated[np.ndarray, Array(("direction",), "m")]
    """a point of the axis"""
    modes: int
    """number of natural modes of the ring that `model` keeps"""
    interface: Annotated[tuple[str, ...], Array(("interface",), dtype=object)]
    """labels in a sector"""
    selection: Annotated[np.ndarray, Array(("interface", "coordinate"))]
    """displacements of the interface of sector 0"""
    directions: _Vectors
    """this and the next three: as in ReducedModel, of sector 0"""
    normals: _Vectors
    """transverse to them, towards the bodies"""
    positions: Annotated[np.ndarray, Array(("interface", "direction"), "m")]
    """coordinates"""
    arms: Annotated[np.ndarray, Array(("interface",), "m")]
    """distances of bodies from the interface"""
    base_load: _Load
    """load of sector 0 by an acceleration of the base along x, y, z of its frame"""
    part_load: _Load
    """load of the deviating part"""
    damping_ratio: float
    """damping ratio of every mode"""
    provenance: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    """where the numbers come from (JSON-able); "estimate": of the error"""

    def __post_init__(self) -> None:
        """Bring all fields into final form. Raises RingError for an empty interface, and ReducedModelError."""
        object.__setattr__(self, "interface", tuple(str(label) for label in self.interface))
        object.__setattr__(self, "provenance", dict(self.provenance))
        lengths = {"interface": len(self.interface), "direction": 3, **self._lengths()}
        lengths["column"] = lengths["coordinate"]
        for item in fields(self):
            name, layout, value = item.name, declared(type(self))[item.name][1], getattr(self, item.name)
            if isinstance(layout, Array) and name != "interface" and (value is not None or item.default is not None):
                shape = tuple(lengths[dimension] for dimension in layout.dims)
                final = symmetric(name, value, shape[0]) if layout.dims == SQUARE else shaped(name, value, shape)
                object.__setattr__(self, name, final)
        object.__setattr__(self, "directions", unit(self.directions))
        super().__post_init__()
        if not self.interface:
            raise RingError("interface: empty; a reduced ring needs a coordinate that loads can act on")

    def _lengths(self) -> dict[str, int]:
        """Return the length of the dimension "coordinate", and of others that are not shared."""
        raise NotImplementedError

    def labels(self) -> dict[str, Any]:
        """Return the names of the axes."""
        return {"direction": "xyz"}

    @property
    def sector_labels(self) -> tuple[str, ...]:
        """The N k labels, sector by sector."""
        return tuple(sector_label(label, sector) for sector in range(self.sectors) for label in self.interface)

    def natural_model(
        self, squares: np.ndarray, shapes: np.ndarray, rows: np.ndarray, static: np.ndarray, load: np.ndarray,
        added: np.ndarray | None,
    ) -> ReducedModel:  # fmt: skip
        """Return the whole ring in natural modes, with residual flexibility.

        squares (m,), shapes (n, m) of the modes in coordinates of the ring; rows (N k, n) of the interface and static
        (n, N k), the response to its forces; load (n, 3) of the base; added (m, m) damping, besides the damping ratio.
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
        rotations = sector_rotations(self.axis, self.sectors)

        def turned(vectors: np.ndarray) -> np.ndarray:
            return np.einsum("sij,kj->ski", rotations, vectors).reshape(-1, 3)

        ring = {
            "sectors": self.sectors, "axis": self.axis.tolist(), "point": self.point.tolist(),
            "labels": list(self.interface),
        }  # fmt: skip
        return {
            "interface": self.sector_labels,
            "directions": turned(self.directions),
            "normals": turned(self.normals),
            "positions": self.point + turned(self.positions - self.point),
            "arms": np.tile(self.arms, self.sectors),
            "provenance": dict(self.provenance) | {"ring": ring},
        }


def sector_label(label: str, sector: int) -> str:
    """Return the label of a sector's interface coordinate in the whole ring, such as "c1@3" or "c1@3.normal"."""
    for suffix in (NORMAL, ROTATION):
        if label.endswith(suffix):
            return f"{label.removesuffix(suffix)}@{sector}{suffix}"
    return f"{label}@{sector}"
