"""Stress at the hot spots of a run, period by period as it advances.

It is taken from samples of the modal coordinates, some 100 per period of every mode: in the evaluated periods only,
where these are known before. Samples are dropped as soon as their stress is taken, and their memory is given back.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.quantities.stress import LINEAR, MEASURES
from vanedamp.coupling.response.evaluation import Fields, Needs, Observer, Outcome, Run
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.spot_stress import SpotStress, named, scalars
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.coupling.strength.assessment import with_strength
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots, samples_of
from vanedamp.coupling.strength.stress import PeriodStress, every_other, period_stress
from vanedamp.coupling.strength.stress_spectrum import linear_moments
from vanedamp.coupling.system.system import System

#: periods of those evaluated together by which the error of sampling is measured
_CHECKED = 8
#: fields of the records with a row for every sample
_SAMPLED = ("samples", "coordinates", "sampled", "shut")
#: samples that are evaluated together, in whole periods
_TOGETHER = 20_000


class StressObserver(Observer):
    """Keeps the stress of every period; asked: samples of each that others keep."""

    def __init__(self, spots: Spots, asked: int) -> None:
        super().__init__(self._stress)
        self.spots, self.asked, self.each = spots, asked, 0
        self._rooms: list[tuple[np.ndarray, mmap.mmap]] = []
        self._whole: Records
        self._taken, self._sampling, self._first = 0, True, -1
        self._parts: list[tuple[int, PeriodStress]] = []
        self._checked = np.zeros((2, len(spots.rows)))
        self._histories = SpotHistories(spots.materials)

    def begin(self, scene: Scene, system: System) -> Needs:
        """Return the samples from which stresses are taken."""
        self.each = samples_of(scene, system, self.spots, self.asked)
        return Needs(samples=self.each)

    def records(self, empty: Records) -> Records:
        """Return the records with samples whose memory can be given back."""
        self._whole = empty._replace(**{name: self._room(getattr(empty, name)) for name in _SAMPLED})
        return self._whole

    def look(self, run: Run, dropped: int | None) -> None:
        """Take the periods done since the last call, and sample what follows if it may be evaluated."""
        self._take_up_to(run.outcome().periods)
        if isinstance(run, EventDrivenRun) and not self.asked:
            self._sampling = dropped is None or self._taken >= dropped
            none = {name: getattr(self._whole, name)[:0] for name in _SAMPLED}
            run.records = self._whole if self._sampling else self._whole._replace(**none)
        self._whole.coordinates[self._taken * self.each :][:1] = np.nan  # remains if a method keeps none

    def _take_up_to(self, done: int) -> None:
        """Take the periods up to `done`, and give their samples back."""
        begin, self._taken = self._taken, done
        if not self._sampling or done <= begin:
            return
        q, together = self._whole.coordinates, max(_TOGETHER // self.each, 1)
        if np.isnan(q[begin * self.each]).any():
            return
        for first in range(begin, done, together):
            self._take(q, first, min(first + together, done))

    def _take(self, q: np.ndarray, begin: int, done: int) -> None:
        """Take some periods of the samples (n, modes) of the run, and give these back."""
        each, rows = self.each, slice(begin * self.each, done * self.each)
        self._first = rows.start if self._first < 0 else self._first
        # a sample more at both ends; the first one has none before it where the periods before were not sampled
        before = q[max(rows.start - 1, self._first)]
        stress = self.spots.stress(np.concatenate([before[None], q[rows], q[rows][-1:]]))
        found = period_stress(stress, each)
        self._parts.append((begin, found))
        self._histories.add(begin * each, stress[..., 1:-1])
        few = min(_CHECKED, len(found.mean))
        if each % 2 == 0:
            halved = period_stress(every_other(stress[..., : few * each + 2]), each // 2)
            for total, part in zip(self._checked, (found, halved), strict=True):
                total += part.amplitude[:few, :, MEASURES.index("von_mises")].sum(axis=0)
        if not self.asked:
            for array, room in self._rooms:
                _give_back(room, array.strides[0], rows.start - 1, rows.stop - 1)

    def _room(self, like: np.ndarray) -> np.ndarray:
        """Return an array of zeros like another, in memory of its own."""
        if not like.nbytes:
            return like
        room = mmap.mmap(-1, like.nbytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        array = np.frombuffer(room, like.dtype).reshape(like.shape)
        self._rooms.append((array, room))
        return array

    def _stress(self, scene: Scene, run: Outcome, known: Fields) -> Fields:
        """Return the stress over the periods evaluated."""
        self._take_up_to(run.periods)
        first = known["transient"]
        parts = [PeriodStress(*(array[max(first - begin, 0) :] for array in part)) for begin, part in self._parts]
        whole = PeriodStress(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True))) if parts else None
        if whole is None or not len(whole.mean):
            return {}
        all_of, half = self._checked
        error = np.abs(half - all_of) / np.where(all_of > 0.0, all_of, 1.0)
        spots = _spot_stresses(self.spots, whole, linear_stresses(scene, self.spots), self.each, error)
        repeats, duration = known["classification"] != "non-periodic", len(whole.mean) / scene.frequency
        counted = [self._histories.cycles(place, first * self.each, repeats) for place in range(len(spots))]
        noise = linear_moments(scene, self.spots) if isinstance(scene.excitation.waveform, Multisine) else {}
        spectra = [{curve: of[place] for curve, of in noise.items()} for place in range(len(spots))]
        parts_of = zip(spots, self.spots.materials, counted, spectra, strict=True)
        return {"stress": tuple(with_strength(*each, duration) for each in parts_of)}


def _spot_stresses(
    spots: Spots, found: PeriodStress, linear: Mapping[str, np.ndarray] | None, each: int, error: np.ndarray
) -> tuple[SpotStress, ...]:
    """Return the stresses of the spots over the periods found, of `each` samples, with an error (s,) of these.

    linear: amplitudes (s, 8) by the names of LINEAR.
    """
    made = []
    for place, (name, facts) in enumerate(spots.facts.items()):
        mean, static, coordinates = found.mean[:, place].mean(axis=0), spots.static(name), facts.get("coordinates")
        of: dict[str, Any] = {}
        for suffix, values in (
            ("", found.amplitude[:, place].mean(axis=0)),
            ("_max", found.amplitude[:, place].max(axis=0)),
        ):
            of |= {f"amplitude{suffix}": named(values)}
            of |= {f"{name}{suffix}": value for name, value in scalars(values).items()}
        of |= {curve: None if linear is None else scalars(linear[curve][place]) for curve in LINEAR}
        made.append(
            SpotStress(
                name=name, coordinates=None if coordinates is None else tuple(coordinates),
                group=facts.get("group", ""), mean=mean, static=None if static is None else mean + static,
                fatigue=facts.get("fatigue", {}), samples_per_period=each,
                sampling_error=float(error[place]), mesh_error=facts.get("error"), **of,
            )
        )  # fmt: skip
    return tuple(made)


def _give_back(room: mmap.mmap, row: int, first: int, last: int) -> None:
    """Give rows of so many bytes back to the system, from the first one up to the last, without pages of others."""
    begin = -(-max(first, 0) * row // mmap.PAGESIZE) * mmap.PAGESIZE
    end = last * row // mmap.PAGESIZE * mmap.PAGESIZE
    if end > begin and hasattr(mmap, "MADV_DONTNEED"):
        room.madvise(mmap.MADV_DONTNEED, begin, end - begin)
