"""Temperature of a structure: uniform, or given at points and linear between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import QhullError, cKDTree

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen

# fraction of the points' extent: up to this outside their hull, the temperature of the nearest point holds
_OUTSIDE = 0.01


class TemperatureError(VanedampError):
    """A temperature that does not fit the structure or its materials; the message says where and the remedy."""


@dataclass(frozen=True, eq=False)
class Temperature:
    """Temperature of a structure, in K or throughout in degrees Celsius.

    reference  at which the structure is free of thermal stress
    values     one number, or (n,) at the points
    points     (n, 3) m, not in one plane; None: uniform
    """

    reference: float
    values: np.ndarray
    points: np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        if self.points is None:
            return
        object.__setattr__(self, "points", frozen(self.points))
        if self.points.ndim != 2 or self.points.shape[1:] != (3,) or self.values.shape != self.points.shape[:1]:
            raise TemperatureError("expected the columns x, y, z (m) and temperature, a row for every point")
        if not (np.all(np.isfinite(self.points)) and np.all(np.isfinite(self.values))):
            raise TemperatureError("expected finite coordinates and temperatures")
        if len(np.unique(self.points, axis=0)) != len(self.points):
            raise TemperatureError("a point occurs twice; give every point once")

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the temperatures (k,) at places (k, 3), m.

        Raises TemperatureError for points in one plane, and places outside their hull by more than 1 % of its size.
        """
        if self.points is None:
            return np.full(len(places), float(self.values))
        try:
            temperatures = np.asarray(self._interpolator(places / self._size))
        except (QhullError, ValueError):
            raise TemperatureError(
                f"temperature: the {len(self.values)} points lie in one plane or are fewer than four; give points "
                "around the structure"
            ) from None
        outside = np.flatnonzero(np.isnan(temperatures))
        if outside.size:
            distances, nearest = cKDTree(self.points).query(places[outside])
            worst = int(np.argmax(distances))
            if distances[worst] > _OUTSIDE * self._size:
                x, y, z = places[outside[worst]]
                raise TemperatureError(
                    f"temperature: the structure reaches beyond the points: ({x:.4g}, {y:.4g}, {z:.4g}) m lies "
                    f"outside, {distances[worst]:.3g} m from the nearest; give points around the structure, in metres"
                )
            temperatures[outside] = self.values[nearest]
        return temperatures

    @property
    def _size(self) -> float:
        assert self.points is not None
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def _interpolator(self) -> LinearNDInterpolator:
        assert self.points is not None
        return LinearNDInterpolator(self.points / self._size, self.values)

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data for the provenance of matrices: the range only, where it is a field."""
        values = [float(self.values)] if self.points is None else [float(self.values.min()), float(self.values.max())]
        return {"reference": self.reference, "values": values}
