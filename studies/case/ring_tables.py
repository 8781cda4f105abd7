"""The table [ring] of a case: the structure is one sector of a ring of equal ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Direction, Positive, Real, Whole
from vanedamp.modal.algebra import rotation as turned
from vanedamp.modal.cyclic import CyclicSector, SectorSpring, cyclic_sector
from vanedamp.modal.matrices import unit_direction
from vanedamp.studies.case.operation_tables import RotationTable

if TYPE_CHECKING:
    from vanedamp.modal.matrices import SystemMatrices


@dataclass(frozen=True, config=STRICT)
class RingTable:
    """The structure is one sector of a ring, the others are equal and turned about an axis."""

    sectors: Annotated[Whole, Field(ge=2)]
    """number of sectors around the ring"""
    low: str | None = None
    """facet group of the face that a positive turn about the axis by a sector's angle brings to `high`, whose nodes it
    meets; without faces the sectors are separate structures that springs couple"""
    high: str | None = None
    """facet group of the other face"""
    axis: Direction | None = None
    """direction of the axis, of any length (default: that of [rotation], or else z) [-]"""
    point: tuple[Real, Real, Real] | None = None
    """a point of the axis (default: that of [rotation], or else the origin) [m]"""
    tolerance: Annotated[Positive, Field(le=1e-2)] = 1e-6
    """largest distance of two nodes that are one, over the size of the sector [-]"""
    spring: tuple[SectorSpring, ...] = ()
    """springs between neighbours"""
    deviating: tuple[str, ...] = ()
    """volume groups that the deviations of mistuning change, such as ["blade"] (default: the whole sector)"""

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise ValueError("give both faces, low and high, or none of separate structures")
        if self.low is None and not self.spring:
            raise ValueError("low: missing; give the faces low and high, or [[ring.spring]] of separate structures")
        for key, group in (groups := self.groups).items():
            if key.endswith("high") and group == groups[key.replace("high", "low")]:
                raise ValueError(f"{key}: expected another group than low, {group!r}")

    @property
    def groups(self) -> dict[str, str]:
        """Facet groups by their keys."""
        faces = {} if self.low is None or self.high is None else {"low": self.low, "high": self.high}
        for number, spring in enumerate(self.spring):
            faces |= {f"spring[{number}].low": spring.low, f"spring[{number}].high": spring.high}
        return faces

    def check_faces(self, centres: Mapping[str, np.ndarray], size: float, rotation: RotationTable | None) -> None:
        """Raise CyclicError where the centres (3,), m, of facet groups contradict the number of sectors.

        size: of the sector, m; rotation: has the axis unless the table does.
        """
        from vanedamp.modal.cyclic_faces import check_angle

        axis, point = self._axis(rotation)
        first, second = (centres.get(face or "") for face in (self.low, self.high))
        if first is not None and second is not None:
            check_angle(first - point, second - point, self.sectors, np.array(axis) / np.linalg.norm(axis), size)

    def _axis(self, rotation: RotationTable | None) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        table: RingTable | RotationTable = self if rotation is None else rotation
        return table.axis or (0.0, 0.0, 1.0), table.point or (0.0, 0.0, 0.0)

    def turn(self, rotation: RotationTable | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrix (3, 3) that turns by one sector, and a point (3,) of the axis, m; rotation: of the case."""
        axis, point = self._axis(rotation)
        return turned(unit_direction(axis), 2.0 * np.pi / self.sectors), np.array(point)

    def sector(self, matrices: SystemMatrices, rotation: RotationTable | None) -> CyclicSector:
        """Return the sector with these matrices; rotation: has the axis unless the table does. Raises CyclicError."""
        return cyclic_sector(
            matrices, self.low, self.high, self.sectors, *self._axis(rotation), self.spring, self.tolerance
        )
