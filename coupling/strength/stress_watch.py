"""Stress at the hot spots of a run: evaluated as it advances, from samples that are dropped at once.

Samples are many: a period takes some 100 of every mode. They are taken in the evaluated periods only, where these are
known before, and their memory is given back as soon as their stresses are known.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.evaluation import Outcome, Run
from vanedamp.coupling.response.plane import plane_of
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.spot_stress import LINEAR, MEASURES, SCALARS, SpotStress, named
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.coupling.strength.assessment import with_strength
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots, samples_of, spots_of
from vanedamp.coupling.strength.stress import PeriodStress, every_other, period_stress
from vanedamp.coupling.strength.stress_spectrum import linear_moments
from vanedamp.coupling.system.system import System

#: fields of the records with a row for every sample
_SAMPLED = ("samples", "coordinates", "sampled", "shut")
#: samples that are evaluated together, in whole periods; periods of these by which the error of sampling is measured
_TOGETHER, _CHECKED = 20_000, 8


def stressed(
    scene: Scene,
    events: bool = False,
    samples_per_period: int = 0,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Return the response of a scene without open choices, with the stress at its hot spots if it has any.

    Arguments as in coupling.simulation.simulate.
    """
    spots = spots_of(scene)
    if spots is None:
        return respond(scene, events, samples_per_period, start, progress)
    watch = StressWatch(spots)
    response = respond(scene, events, samples_per_period, start, progress, watch)
    return replace(response, stress=watch.result(scene, response))


class StressWatch:
    """Takes the stress of every period as a run advances (response.evaluation.Watch)."""

    def __init__(self, spots: Spots) -> None:
        self.spots, self.each, self.asked = spots, 0, 0
        self._rooms: list[tuple[np.ndarray, mmap.mmap]] = []
        self._whole: Records | None = None
        self._taken, self._sampling, self._parts = 0, True, list[tuple[int, PeriodStress]]()
        self._checked = np.zeros((2, len(spots.rows)))
        self._histories, self._period = SpotHistories(spots.materials), 0.0

    def samples(self, scene: Scene, system: System, asked: int) -> int:
        """Return how many samples of each period the run keeps."""
        self.each, self.asked = samples_of(scene, system, self.spots, asked), asked
        self._period = system.period
        return self.each

    def records(self, empty: Records) -> Records:
        """Return the records with samples whose memory can be given back."""
        self._whole = empty._replace(**{name: self._room(getattr(empty, name)) for name in _SAMPLED})
        return self._whole

    def __call__(self, run: Run, dropped: int | None) -> None:
        """Take the stress of the periods done since the last call, and sample what follows if it may be evaluated."""
        self._take(run.outcome().periods)
        assert self._whole is not None
        if isinstance(run, EventDrivenRun) and not self.asked:
            self._sampling = dropped is None or self._taken >= dropped
            run.records = self._whole if self._sampling else _cut(self._whole, slice(0))
        self._whole.coordinates[self._taken * self.each :][:1] = np.nan  # remains if a method keeps none

    def close(self, outcome: Outcome) -> Outcome:
        """Take the rest of the stress. Return the outcome with the samples that were asked for."""
        self._take(outcome.periods)
        records = _cut(outcome.records, slice(None, None, self.each // self.asked) if self.asked else slice(0))
        if (plane := outcome.plane) is not None:
            plane = plane_of(outcome.system, records, plane.bound, plane.walls)
        return replace(outcome, records=records, plane=plane)

    def result(self, scene: Scene, response: Response) -> tuple[SpotStress, ...] | None:
        """Return the stress over the periods evaluated; None if there is none."""
        first = response.transient
        parts = [PeriodStress(*(array[max(first - begin, 0) :] for array in part)) for begin, part in self._parts]
        whole = PeriodStress(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True))) if parts else None
        if whole is None or not len(whole.mean):
            return None
        all_of, half = self._checked
        error = np.abs(half - all_of) / np.where(all_of > 0.0, all_of, 1.0)
        found = spot_stresses(self.spots, whole, linear_stresses(scene, self.spots), self.each, error)
        repeats, duration = response.classification != "non-periodic", len(whole.mean) * self._period
        counted = [self._histories.cycles(place, first * self.each, repeats) for place in range(len(found))]
        noise = linear_moments(scene, self.spots) if isinstance(scene.excitation.waveform, Multisine) else {}
        spectra = [{curve: of[place] for curve, of in noise.items()} for place in range(len(found))]
        materials = self.spots.materials
        return tuple(with_strength(*each, duration) for each in zip(found, materials, counted, spectra, strict=True))

    def _take(self, done: int) -> None:
        """Take the stress of the periods up to `done`, and give their samples back."""
        begin, self._taken = self._taken, done
        if not self._sampling or done <= begin or self._whole is None:
            return
        q, together = self._whole.coordinates, max(_TOGETHER // self.each, 1)
        if np.isnan(q[begin * self.each]).any():
            return
        for first in range(begin, done, together):
            self._evaluate(q, first, min(first + together, done))

    def _evaluate(self, q: np.ndarray, begin: int, done: int) -> None:
        """Take the stress of some periods from the samples (n, modes) of the run, and give these back."""
        rows = slice(begin * self.each, done * self.each)
        # the first sample has none before it where the periods before were not sampled
        before = q[max(rows.start - 1, self._parts[0][0] * self.each if self._parts else rows.start)]
        stress = self.spots.stress(np.concatenate([before[None], q[rows], q[rows][-1:]]))
        found = period_stress(stress, self.each)
        self._parts.append((begin, found))
        self._histories.add(rows.start, stress[..., 1:-1])
        few = min(_CHECKED, done - begin)
        if self.each % 2 == 0:
            halved = period_stress(every_other(stress[..., : few * self.each + 2]), self.each // 2)
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
                sampling_error=0.0 if error is None else float(error[place]), **of,
            )
        )  # fmt: skip
    return tuple(made)


def _cut(records: Records, kept: slice) -> Records:
    return records._replace(**{name: getattr(records, name)[kept] for name in _SAMPLED})


def _give_back(room: mmap.mmap, row: int, first: int, last: int) -> None:
    """Give rows of so many bytes back to the system, from the first one up to the last, without pages of others."""
    begin = -(-max(first, 0) * row // mmap.PAGESIZE) * mmap.PAGESIZE
    end = last * row // mmap.PAGESIZE * mmap.PAGESIZE
    if end > begin and hasattr(mmap, "MADV_DONTNEED"):
        room.madvise(mmap.MADV_DONTNEED, begin, end - begin)
