"""Stress at hot spots of a motion that does not repeat, period by period: passes of ramps, ring-downs."""

from __future__ import annotations

from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.stress import MEASURES, SCALARS
from vanedamp.coupling.response.spot_stress import scalars
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.assessment import assessed, mean_stress, used
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots, known_spots
from vanedamp.coupling.strength.stress import period_stress
from vanedamp.rom.recovery import COMPONENTS


class StressSeries:
    """Takes the stress at the hot spots of a scene period by period; each: samples of a period."""

    #: periods that are evaluated together
    _TOGETHER = 100

    def __init__(self, spots: Spots, each: int) -> None:
        self.spots, self.each, self._last = spots, each, spots
        self._waiting, self._amplitudes = list[np.ndarray](), list[np.ndarray]()
        self._histories = SpotHistories(spots.materials)

    def add(self, scene: Scene, coordinates: np.ndarray) -> None:
        """Take modal coordinates (each, n) of the next period, and the scene then, whose speed may have changed."""
        if scene.speed != self._last.speed:
            self._last = known_spots(scene)
        self._waiting.append(self._last.stress(coordinates))
        if len(self._waiting) > self._TOGETHER:
            self._evaluate()

    def amplitudes(self) -> np.ndarray:
        """Return the amplitudes (p, s, 8) of MEASURES of all periods, of which there is at least one."""
        self._evaluate()
        return np.concatenate(self._amplitudes)

    @cached_property
    def strengths(self) -> dict[str, dict[str, Any]]:
        """Utilisation by the largest amplitude and damage of the motion, by hot spot (assessment.assessed).

        The mean stress is that of the first or the last speed, where it is larger.
        """
        largest, strengths = self.amplitudes().max(axis=0), dict[str, dict[str, Any]]()
        for spot, (name, material) in enumerate(zip(self.spots.facts, self.spots.materials, strict=True)):
            if material is None:
                continue
            known = [spots.static(name) for spots in (self.spots, self._last)]
            rest = self._histories.mean[spot] if self._histories.mean.size else np.zeros(6)
            static = max((rest if one is None else rest + one for one in known), key=lambda s: mean_stress(material, s))
            cycles, every = self._histories.cycles(spot), all(one is not None for one in known)
            strengths[name] = {"mean_known": every} | assessed(material, scalars(largest[spot]), static, cycles)
        return strengths

    def of_spots(self, whole: bool = False) -> list[Any]:
        """Return inputs of quantities of hot spots: of each period, (p,), or of the whole motion as of a run."""
        amplitudes, results = self.amplitudes(), list[Any]()
        for spot, (name, material) in enumerate(zip(self.spots.facts, self.spots.materials, strict=True)):
            peaks = dict(zip(MEASURES, amplitudes[:, spot].T, strict=True))
            level = {measure: values.mean() if whole else values for measure, values in peaks.items()}
            strength = dict.fromkeys(("utilisation", "yield_utilisation"), np.nan * level[SCALARS[0]])
            if material is not None:
                most = self.strengths[name]
                strength |= used(level[material.criterion], most["mean"], material)
                if whole:
                    by_largest = {"utilisation_max": "utilisation", "yield_utilisation": "yield_utilisation"}
                    strength |= {name: most[of] for name, of in by_largest.items() if of in most}
            results.append(SimpleNamespace(
                **level, **{f"{scalar}_max": peaks[scalar].max() for scalar in SCALARS}, strength=strength, mean=[],
                static=None, undamped=None, fixed=None, amplitude={name: level[name] for name in COMPONENTS},
            ))  # fmt: skip
        return results

    def _evaluate(self) -> None:
        if not self._waiting:
            return
        stress = np.concatenate(self._waiting, axis=-1)
        padded = np.concatenate([stress[..., :1], stress, stress[..., -1:]], axis=-1)
        self._amplitudes.append(period_stress(padded, self.each).amplitude)
        self._histories.add(np.zeros(stress.shape[-1]), stress, stress.mean(axis=-1))
        self._waiting.clear()
