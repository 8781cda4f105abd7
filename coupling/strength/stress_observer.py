"""Stress at the hot spots of a run, in the evaluated periods as it advances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.quantities.stress import LINEAR, MEASURES
from vanedamp.coupling.response.evaluation import Fields, Needs, Observer, Outcome, Run
from vanedamp.coupling.response.spot_stress import SpotStress, named, scalars
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.coupling.strength.assessment import with_strength
from vanedamp.coupling.strength.course import course_stress, sampled_course
from vanedamp.coupling.strength.linear_stress import linear_stresses, stresses_of
from vanedamp.coupling.strength.spot_history import SpotHistories
from vanedamp.coupling.strength.spots import Spots, samples_of
from vanedamp.coupling.strength.stress import PeriodStress, every_other, period_stress
from vanedamp.coupling.strength.stress_spectrum import linear_moments
from vanedamp.coupling.system.system import System

#: periods of those evaluated together by which the error of sampling is measured
_CHECKED = 8
#: periods of a course that are evaluated together
_TOGETHER = 100


class StressObserver(Observer):
    """Keeps the stress of every period; asked: samples of each that others keep.

    Runs of the exact engine are taken as their course, others as samples.
    """

    def __init__(self, spots: Spots, asked: int) -> None:
        super().__init__(self._stress)
        self.spots, self.asked, self.each = spots, asked, 0
        self._begin_again()

    def _begin_again(self) -> None:
        self._taken = 0
        self._parts: list[tuple[int, PeriodStress]] = []
        self._checked = np.zeros((2, len(self.spots.rows)))
        self._histories = SpotHistories(self.spots.materials)

    def begin(self, scene: Scene, system: System) -> Needs:
        """Return the samples from which stresses are taken, or the coordinates whose course is."""
        if getattr(METHODS.part(scene.solver.method), "COURSES", False):
            return Needs(course=self.spots.outputs[0])
        self.each = samples_of(scene, system, self.spots, self.asked)
        return Needs(samples=self.each)

    def linear(self, order: np.ndarray, motions: np.ndarray) -> list[dict[str, np.ndarray]]:
        """Return the amplitudes of stress of both curves of every scene."""
        return [dict(zip(LINEAR, both, strict=True)) for both in stresses_of(order, motions, self.spots)]

    def look(self, run: Run, dropped: int | None) -> None:
        """Take the periods done since the last call, or the course as it fills."""
        if isinstance(run, EventDrivenRun):
            run.reader = self._take_course
        else:
            self._take_samples(run.outcome())

    def _take_course(self, course: np.ndarray, last: int | None = None) -> int:
        """Take a course's groups of periods that are whole, or all up to the last. Return its rows."""
        periods = course[:, 0]
        if not len(periods):
            return 0
        first, last = int(periods[0]), int(periods[-1]) // _TOGETHER * _TOGETHER if last is None else last
        while first < last:
            next_one = min((first // _TOGETHER + 1) * _TOGETHER, last)
            rows = course[slice(*np.searchsorted(periods, (first, next_one)))]
            stress = course_stress(rows, self.spots.outputs[1])
            self._parts.append((first, stress))
            if self._histories.wanted:
                self._histories.add(*sampled_course(rows, self.spots.outputs[1]), stress.mean.mean(axis=0))
            first = next_one
        return int(np.searchsorted(periods, last))

    def _take_samples(self, run: Outcome) -> None:
        """Take the periods of samples done since the last call."""
        begin, done, q, each = self._taken, run.periods, run.records.coordinates, self.each
        self._taken = done
        if done <= begin or np.isnan(q[begin * each]).any():
            return
        # a sample more at both ends
        before, rows = q[max(begin * each - 1, 0)], q[begin * each : done * each]
        stress = self.spots.stress(np.concatenate([before[None], rows, rows[-1:]]))
        of_periods = period_stress(stress, each)
        self._parts.append((begin, of_periods))
        periods = np.repeat(np.arange(begin, done), each)
        self._histories.add(periods, stress[..., 1:-1], stress[..., 1:-1].mean(axis=-1))
        few = min(_CHECKED, len(of_periods.mean))
        if each % 2 == 0:
            halved = period_stress(every_other(stress[..., : few * each + 2]), each // 2)
            for total, each_stress in zip(self._checked, (of_periods, halved), strict=True):
                total += each_stress.amplitude[:few, :, MEASURES.index("von_mises")].sum(axis=0)

    def _stress(self, scene: Scene, run: Outcome, known: Fields) -> Fields:
        """Return the stress over the periods evaluated."""
        if self.each:
            self._take_samples(run)
        else:
            self._take_course(run.records.course[: run.records.noted[0]], run.periods)
        first, pieces, (all_of, half), histories = known["transient"], self._parts, self._checked, self._histories
        self._begin_again()
        parts = [PeriodStress(*(array[max(first - begin, 0) :] for array in piece)) for begin, piece in pieces]
        whole = PeriodStress(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True))) if parts else None
        if whole is None or not len(whole.mean):
            return {}
        error = np.abs(half - all_of) / np.where(all_of > 0.0, all_of, 1.0)
        linear = known.get("linear") or linear_stresses(scene, self.spots, run.system)
        spots = _spot_stresses(self.spots, whole, linear, self.each, error)
        repeats, duration = known["classification"] != "non-periodic", len(whole.mean) / scene.frequency
        counted = [histories.cycles(spot, first, repeats) for spot in range(len(spots))]
        noise = linear_moments(scene, self.spots) if isinstance(scene.excitation.waveform, Multisine) else {}
        spectra = [{curve: of[spot] for curve, of in noise.items()} for spot in range(len(spots))]
        parts_of = zip(spots, self.spots.materials, counted, spectra, strict=True)
        return {"stress": tuple(with_strength(*each, duration) for each in parts_of)}


def _spot_stresses(
    spots: Spots, stress: PeriodStress, linear: Mapping[str, np.ndarray] | None, each: int, error: np.ndarray
) -> tuple[SpotStress, ...]:
    """Return the stresses of the spots over the periods, of `each` samples, with an error (s,) of these.

    linear: amplitudes (s, 8) by the names of LINEAR.
    """
    made = []
    for spot, (name, facts) in enumerate(spots.facts.items()):
        mean, static, coordinates = stress.mean[:, spot].mean(axis=0), spots.static(name), facts.get("coordinates")
        of: dict[str, Any] = {}
        for suffix, values in (
            ("", stress.amplitude[:, spot].mean(axis=0)),
            ("_max", stress.amplitude[:, spot].max(axis=0)),
        ):
            of |= {f"amplitude{suffix}": named(values)}
            of |= {f"{name}{suffix}": value for name, value in scalars(values).items()}
        of |= {curve: None if linear is None else scalars(linear[curve][spot]) for curve in LINEAR}
        made.append(
            SpotStress(
                name=name, coordinates=None if coordinates is None else tuple(coordinates),
                group=facts.get("group", ""), mean=mean, static=None if static is None else mean + static,
                fatigue=facts.get("fatigue", {}), samples_per_period=each,
                sampling_error=float(error[spot]), mesh_error=facts.get("error"), **of,
            )
        )  # fmt: skip
    return tuple(made)
