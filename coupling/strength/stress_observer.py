"""Stress at the hot spots of a run, period by period as it advances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.spot_stress import LINEAR, MEASURES, SCALARS, SpotStress, named
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.coupling.strength.assessment import with_strength
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.modal_observer import ModalObserver
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots, samples_of
from vanedamp.coupling.strength.stress import PeriodStress, every_other, period_stress
from vanedamp.coupling.strength.stress_spectrum import linear_moments
from vanedamp.coupling.system.system import System

#: periods of those evaluated together by which the error of sampling is measured
_CHECKED = 8


class StressObserver(ModalObserver):
    """Keeps the stress of every period; asked: samples of each that others keep."""

    def __init__(self, spots: Spots, asked: int) -> None:
        super().__init__(asked)
        self.spots = spots
        self._parts: list[tuple[int, PeriodStress]] = []
        self._checked = np.zeros((2, len(spots.rows)))
        self._histories = SpotHistories(spots.materials)

    def samples(self, scene: Scene, system: System) -> int:
        """Return the samples of each period from which stresses are taken."""
        return samples_of(scene, system, self.spots, self.asked)

    def take(self, begin: int, coordinates: np.ndarray) -> None:
        """Take periods (modal_observer.ModalObserver)."""
        each, stress = self.each, self.spots.stress(coordinates)
        found = period_stress(stress, each)
        self._parts.append((begin, found))
        self._histories.add(begin * each, stress[..., 1:-1])
        few = min(_CHECKED, len(found.mean))
        if each % 2 == 0:
            halved = period_stress(every_other(stress[..., : few * each + 2]), each // 2)
            for total, part in zip(self._checked, (found, halved), strict=True):
                total += part.amplitude[:few, :, MEASURES.index("von_mises")].sum(axis=0)

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stress over the periods evaluated."""
        self.take_up_to(run.periods)
        first = found["transient"]
        parts = [PeriodStress(*(array[max(first - begin, 0) :] for array in part)) for begin, part in self._parts]
        whole = PeriodStress(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True))) if parts else None
        if whole is None or not len(whole.mean):
            return {}
        all_of, half = self._checked
        error = np.abs(half - all_of) / np.where(all_of > 0.0, all_of, 1.0)
        spots = spot_stresses(self.spots, whole, linear_stresses(scene, self.spots), self.each, error)
        repeats, duration = found["classification"] != "non-periodic", len(whole.mean) / scene.frequency
        counted = [self._histories.cycles(place, first * self.each, repeats) for place in range(len(spots))]
        noise = linear_moments(scene, self.spots) if isinstance(scene.excitation.waveform, Multisine) else {}
        spectra = [{curve: of[place] for curve, of in noise.items()} for place in range(len(spots))]
        parts_of = zip(spots, self.spots.materials, counted, spectra, strict=True)
        return {"stress": tuple(with_strength(*each, duration) for each in parts_of)}


def spot_stresses(
    spots: Spots,
    found: PeriodStress,
    linear: Mapping[str, np.ndarray] | None,
    each: int = 0,
    error: np.ndarray | None = None,
) -> tuple[SpotStress, ...]:
    """Return the stresses of the spots over the periods found, of `each` samples, with an error (s,) of these.

    linear: amplitudes (s, 8) by the names of LINEAR.
    """
    at, made = {name: MEASURES.index(name) for name in SCALARS}, []
    for place, (name, facts) in enumerate(spots.facts.items()):
        mean, static, coordinates = found.mean[:, place].mean(axis=0), spots.static(name), facts.get("coordinates")
        of: dict[str, Any] = {}
        for suffix, values in (
            ("", found.amplitude[:, place].mean(axis=0)),
            ("_max", found.amplitude[:, place].max(axis=0)),
        ):
            of |= {f"amplitude{suffix}": named(values)} | {
                f"{name}{suffix}": float(values[at[name]]) for name in SCALARS
            }
        for curve in LINEAR:
            values = np.empty(0) if linear is None else linear[curve][place]
            of[curve] = None if linear is None else {name: float(values[at[name]]) for name in SCALARS}
        made.append(
            SpotStress(
                name=name, coordinates=None if coordinates is None else tuple(coordinates),
                group=facts.get("group", ""), mean=mean, static=None if static is None else mean + static,
                fatigue=facts.get("fatigue", {}), samples_per_period=each,
                sampling_error=0.0 if error is None else float(error[place]), mesh_error=facts.get("error"), **of,
            )
        )  # fmt: skip
    return tuple(made)
