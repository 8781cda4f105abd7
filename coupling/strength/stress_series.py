"""Stress at hot spots of a motion that does not repeat, period by period: passes of ramps, ring-downs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.stress import MEASURES, SCALARS
from vanedamp.coupling.strength.assessment import assessed, mean_stress
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots
from vanedamp.coupling.strength.stress import period_stress


class StressSeries:
    """Takes the samples of stress (s, 6, each), Pa, at the hot spots period by period."""

    #: periods that are evaluated together
    _TOGETHER = 100

    def __init__(self, spots: Spots, each: int) -> None:
        self.spots, self.each = spots, each
        self._waiting, self._amplitudes = list[np.ndarray](), list[np.ndarray]()
        self._histories, self._taken = SpotHistories(spots.materials), 0

    def add(self, stress: np.ndarray) -> None:
        """Take the next period."""
        self._waiting.append(stress)
        if len(self._waiting) > self._TOGETHER:
            self._evaluate()

    def amplitudes(self) -> np.ndarray:
        """Return the amplitudes (p, s, 8) of MEASURES of all periods, of which there is at least one."""
        self._evaluate()
        return np.concatenate(self._amplitudes)

    def strengths(self, at: Sequence[Spots] = ()) -> dict[str, dict[str, Any]]:
        """Return utilisation by the largest amplitude and damage of the motion, by hot spot (assessment.assessed).

        at: the spots at other speeds of the motion; the largest mean stress counts.
        """
        largest, found = self.amplitudes().max(axis=0), {}
        for place, (name, material) in enumerate(zip(self.spots.facts, self.spots.materials, strict=True)):
            if material is None:
                continue
            known = [spots.static(name) for spots in (self.spots, *at)]
            rest = self._histories.mean[place] if self._histories.mean.size else np.zeros(6)
            static = max((rest if one is None else rest + one for one in known), key=lambda s: mean_stress(material, s))
            amplitudes = {scalar: float(largest[place, MEASURES.index(scalar)]) for scalar in SCALARS}
            cycles, every = self._histories.cycles(place), all(one is not None for one in known)
            found[name] = {"mean_known": every} | assessed(material, amplitudes, static, cycles)
        return found

    def _evaluate(self) -> None:
        if not self._waiting:
            return
        stress = np.concatenate(self._waiting, axis=-1)
        padded = np.concatenate([stress[..., :1], stress, stress[..., -1:]], axis=-1)
        self._amplitudes.append(period_stress(padded, self.each).amplitude)
        self._histories.add(self._taken, stress)
        self._taken += stress.shape[-1]
        self._waiting.clear()
