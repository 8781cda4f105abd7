"""Histories of the stress that counts at hot spots, kept as turning points while a motion advances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.coupling.quantities.stress import SCALARS
from vanedamp.coupling.strength.counting import Cycles, rainflow_cycles, turning_points
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.coupling.strength.multiaxial import largest_principal
from vanedamp.coupling.strength.stress import scalar_stresses, signs


class SpotHistories:
    """Turning points of the criterion's stress at s spots, about the mean of the first periods.

    It counts as tensile where the stress goes with the largest one of these samples, if that is tensile. Spots without
    a curve of stress and life have no history.
    """

    #: (s, 6) Pa, that mean; empty before the first sample
    mean: np.ndarray

    def __init__(self, materials: Sequence[Fatigue | None]) -> None:
        self.wanted = any(material is not None and material.exponent is not None for material in materials)
        self._rows = {
            spot: SCALARS.index(material.criterion)
            for spot, material in enumerate(materials)
            if material is not None and material.exponent is not None
        }
        self.mean, self._reference = np.zeros(0), np.zeros(0)
        self._points: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {spot: [] for spot in self._rows}

    def add(self, periods: np.ndarray, stress: np.ndarray, mean: np.ndarray) -> None:
        """Add samples (s, 6, t) of stress, Pa, in periods (t,), and their mean (s, 6)."""
        if not stress.shape[-1]:
            return
        if not self.mean.size:
            self.mean = mean
        if not self._rows:
            return
        about = np.moveaxis(stress - self.mean[..., None], 1, 0)
        scalars = scalar_stresses(about)
        if not self._reference.any():
            worst = scalars[0].argmax(axis=-1)
            largest = np.take_along_axis(about, worst[None, :, None], axis=-1)
            self._reference = np.copysign(1.0, largest_principal(largest)) * largest
        signed = signs(about, self._reference) * scalars
        for spot, row in self._rows.items():
            turning = turning_points(signed[row, spot])
            self._points[spot].append((periods[turning], signed[row, spot, turning]))

    def cycles(self, spot: int, first: int = 0, repeats: bool = False) -> Cycles | None:
        """Return the cycles of a spot from a period on; None without any sample, or a curve.

        repeats: the counted motion repeats (counting.rainflow_cycles).
        """
        if not self._points.get(spot):
            return None
        periods, values = (np.concatenate(arrays) for arrays in zip(*self._points[spot], strict=True))
        values = values[periods >= first]
        return rainflow_cycles(values, repeats) if values.size else None
