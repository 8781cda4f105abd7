"""Deviations of a ring's sectors from the nominal sector: mistuning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.files import store
from vanedamp.files.errors import VanedampError


class RingError(VanedampError):
    """A reduced ring, deviations or an excitation of it that do not fit together; the message names the argument."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """Relative deviations (N,) by sector, of the part of a sector that deviates; None: none.

    stiffness  of its stiffness: above -1
    mass       of its mass: above -1
    damping    of its part in the damping: not below -1

    Raises RingError.
    """

    stiffness: np.ndarray | None = None
    mass: np.ndarray | None = None
    damping: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name in ("stiffness", "mass", "damping"):
            deviation = getattr(self, name)
            if deviation is None:
                continue
            values = store.frozen(deviation)
            if values.ndim != 1 or not np.all(np.isfinite(values)):
                raise RingError(f"{name}: expected a finite deviation for each sector")
            worst = int(np.argmin(values))
            if values[worst] < -1.0 or (name != "damping" and values[worst] == -1.0):
                raise RingError(f"{name}: the deviation {values[worst]:g} of sector {worst} leaves none; above -1")
            object.__setattr__(self, name, values)

    def any(self) -> bool:
        """Whether a sector deviates."""
        return any(values is not None and values.any() for values in (self.stiffness, self.mass, self.damping))

    def of(self, name: str, sectors: int) -> np.ndarray:
        """Return a kind of deviation (N,), zeros where there is none. Raises RingError for another number."""
        values = getattr(self, name)
        if values is None:
            return np.zeros(sectors)
        if len(values) != sectors:
            raise RingError(f"{name}: {len(values)} deviations for {sectors} sectors; give one for each sector")
        return np.asarray(values)
