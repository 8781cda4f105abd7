"""Natural frequencies and mode shapes of a structure at rest."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vanedamp.files import store
from vanedamp.files.display import Displayed

_KIND = "modes"


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Displayed):
    """Undamped modes K phi = (2 pi f)^2 M phi, lowest first.

    frequencies_hz  (m,)
    shapes          (m, N) kg^-1/2, phi^T M phi = 1, zero at the fixed DOFs; the largest of the three participation
                    factors (or else the largest component) is positive
    residuals       (m,) |K phi - lambda M phi| / ((lambda - shift) |M phi|) over the free DOFs, with the small negative
                    shift of the solver, so that rigid modes have a measure too
    provenance      of the matrices (JSON-able), and as "solver" how the modes were found: "name", whether they were
                    "counted", so that none is missed; for "auto" its estimate, "factor_bytes" and "memory_bytes"
    """

    frequencies_hz: np.ndarray
    shapes: np.ndarray
    residuals: np.ndarray
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("frequencies_hz", "shapes", "residuals"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))
        count = self.frequencies_hz.shape
        if self.shapes.ndim != 2 or not count == self.residuals.shape == self.shapes.shape[:1]:
            shapes = f"{self.shapes.shape} shapes and {self.residuals.shape} residuals"
            raise ValueError(f"modes: {count} frequencies, {shapes} do not fit together")
        object.__setattr__(self, "provenance", dict(self.provenance))

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

    def save(
        self,
        path: str | os.PathLike[str],
        variables: Mapping[str, store.Variable] | None = None,
        attributes: Mapping[str, Any] | None = None,
    ) -> None:
        """Write an HDF5 record; further variables (over the dimensions "mode", "dof") and attributes ride along."""
        own = {
            "frequency": store.Variable(self.frequencies_hz, ("mode",), "Hz"),
            "residual": store.Variable(self.residuals, ("mode",)),
            "shape": store.Variable(self.shapes, ("mode", "dof"), "kg^-0.5"),
        }
        store.save(
            path, _KIND, own | dict(variables or {}), {"provenance": dict(self.provenance), **(attributes or {})}
        )

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> Modes:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = store.load(path, _KIND)
        return cls(values["frequency"], values["shape"], values["residual"], json.loads(attributes["provenance"]))
