"""Natural frequencies and mode shapes of a structure at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.record import Array, Record


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Record):
    """Undamped modes K phi = (2 pi f)^2 M phi, lowest first."""

    KIND: ClassVar[str] = "modes"
    frequencies_hz: Annotated[np.ndarray, Array(("mode",), "Hz", name="frequency", json="frequency_hz")]
    """natural frequencies, ascending"""
    shapes: Annotated[np.ndarray, Array(("mode", "dof"), "kg^-0.5", name="shape")]
    """x, y and z of every node in turn: phi^T M phi = 1, zero at the fixed DOFs; the largest of the three participation
    factors (or else the largest component) is positive"""
    residuals: Annotated[np.ndarray, Array(("mode",), name="residual")]
    """|K phi - lambda M phi| / ((lambda - shift) |M phi|) over the free DOFs, with the small negative shift of the
    solver, so that rigid modes have a measure too"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """of the matrices (JSON-able), and as "solver" how the modes were found: "name", whether they were "counted", so
    that none is missed; for "auto" its estimate, "factor_bytes" and "memory_bytes" of the machine"""

    def __post_init__(self) -> None:
        super().__post_init__()
        count = self.frequencies_hz.shape
        if self.shapes.ndim != 2 or not count == self.residuals.shape == self.shapes.shape[:1]:
            shapes = f"{self.shapes.shape} shapes and {self.residuals.shape} residuals"
            raise ValueError(f"modes: {count} frequencies, {shapes} do not fit together")

    def __len__(self) -> int:
        return len(self.frequencies_hz)

    def first(self, count: int) -> Modes:
        """Return the first `count` modes."""
        return Modes(self.frequencies_hz[:count], self.shapes[:count], self.residuals[:count], self.provenance)

    @property
    def counted(self) -> bool:
        """Whether the number of modes is proven by Sylvester's law of inertia."""
        return bool(self.provenance.get("solver", {}).get("counted", True))

    @property
    def angular_frequencies(self) -> np.ndarray:
        """Angular frequencies (m,), rad/s."""
        return 2.0 * np.pi * self.frequencies_hz
