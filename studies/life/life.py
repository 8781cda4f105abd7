"""Service life of a damper: wear opens its cavities, and the response is recomputed until the reduction is lost."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError, tables
from vanedamp.studies.life.fast import BandMeans, LifeRuns
from vanedamp.studies.life.record import LifeRecord, sentence_of
from vanedamp.studies.life.slow import STAGES, Moment, Steps, between, integrate, steps_left
from vanedamp.studies.life.study import LifeStudy, WearEffect
from vanedamp.studies.worst_start import worst_start

#: relative width of the interval with the crossing of the threshold at which halving stops
_CLOSE = 0.01
#: below this fraction of its mass a body counts as worn away
_LEFT = 0.05


def life(
    study: LifeStudy,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    provenance: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
) -> LifeRecord:
    """Integrate the wear of a damper over the hours of its study, or until the reduction is lost with certainty.

    progress: called with the numbers of finished and expected runs; checkpoint: a file to which finished runs are
    written and from which an interrupted life resumes; the caller removes it after the result is saved
    (files.checkpoint_file.clear).
    Raises InputError for a contact that opens a gap and has no known patch, SweepError if workers are lost.
    """
    expected = _Expected(study, progress)
    with LifeRuns(checkpoint, study, executor, provenance or {}, expected) as runs:
        try:
            first = runs.at(study.scene)
            wearing = study.wearing(runs.contacts)
        except InputError:
            runs.discard()
            raise
        moments = list(_moments(_Course(study, wearing, runs, first), expected))
    ends, starts = {"new": study.scene, "end": wearing.worn(moments[-1].state)}, dict[str, Any]()
    for name, scene in ends.items():
        expected.total, done = runs.asked + study.starts, runs.asked + study.starts // 2 * len(starts)
        starts[name] = worst_start(scene, study.frequencies, executor, expected.after(done))
    return _record(study, wearing, runs, moments, starts, dict(provenance or {}))


class _Expected:
    """Progress in runs. total: runs expected so far."""

    def __init__(self, study: LifeStudy, progress: Callable[[int, int], None] | None) -> None:
        self._study, self._progress, self.total = study, progress, study.runs

    def __call__(self, done: int) -> None:
        """Show how many runs are done."""
        if self._progress is not None:
            self._progress(done, max(self.total, done))

    def after(self, done: int) -> Callable[[int, int], None]:
        """Return the progress function of runs that follow finished ones."""
        return lambda more, _: self(done + more)

    def at(self, asked: int, before: Moment[BandMeans] | None, now: Moment[BandMeans], steps: Steps) -> None:
        """Estimate the total from the present moment, the one before and the runs requested so far.

        The reduction is extrapolated linearly; when it is lost, the interval of the crossing is halved a few times.
        """
        table, halved = self._study.table, 0
        end, step = table.hours, 0.0 if table.steps is None else table.hours / table.steps
        if before is not None:
            step = now.time - before.time
            margin = now.found.reduction + now.found.reduction_confidence - self._study.threshold
            falls = (before.found.reduction - now.found.reduction) / step
            if falls > 0.0 and margin > 0.0 and now.time + margin / falls < end:
                end = now.time + margin / falls
                halved = max(math.ceil(math.log2(step / (_CLOSE * table.hours))), 0)
        evaluations = len(STAGES) * steps_left(now, end, step, steps) + halved
        self.total = asked + evaluations * self._study.each + self._study.starts


class WornAway(Exception):
    """A body is worn away within a step, which can happen with a fixed number of steps."""


class _Course:
    """Rates as a function of volumes of wear, and scales of the volumes."""

    def __init__(self, study: LifeStudy, wearing: WearEffect, runs: LifeRuns, first: BandMeans) -> None:
        self.study, self.wearing, self._runs = study, wearing, runs
        self._new: BandMeans | None = first

    @property
    def asked(self) -> int:
        """Runs requested so far."""
        return self._runs.asked

    def rates(self, volume: np.ndarray) -> BandMeans:
        """Return the means at given volumes of wear."""
        if np.any(self.wearing.lost(volume) >= 1.0):
            raise WornAway
        if self._new is not None:  # of the first runs, which determined the contacts
            means, self._new = self._new, None
            return means
        return self._runs.at(self.wearing.worn(volume))

    def scale(self, volume: np.ndarray) -> np.ndarray:
        """Return the volumes (c,), m^3, for which contacts together double a gap or play, or remove a body.

        inf for contacts that change none of them.
        """
        scale, wearing = np.full(len(volume), np.inf), self.wearing
        lost = wearing.lost(volume)
        finite = np.isfinite(lost)
        for size, matrix in (
            (wearing.gaps(volume), wearing.gap), (wearing.plays(volume), wearing.play),
            (1.0 - lost[finite], wearing.losses[finite]),
        ):  # fmt: skip
            opens = matrix > 0.0
            scaled = np.nan_to_num(size, nan=1.0)[:, None] / opens.sum(axis=1, keepdims=True).clip(1)
            scale = np.minimum(
                scale,
                np.divide(scaled, matrix, out=np.full(matrix.shape, np.inf), where=opens).min(axis=0, initial=np.inf),
            )
        return scale


def _moments(course: _Course, expected: _Expected) -> Iterator[Moment[BandMeans]]:
    """Yield the moments, with additional ones between two steps where the threshold is crossed."""
    table, threshold, before, damped = course.study.table, course.study.threshold, None, False
    steps = Steps(table.tolerance, table.reach, course.scale, table.steps)
    start = np.zeros(course.wearing.gap.shape[1])
    with suppress(WornAway):
        for now in integrate(course.rates, start, table.hours, steps):
            if before is not None and _passes(before, now, threshold):
                yield from _halved(course, before, now)
            yield now
            expected.at(course.asked, before, now, steps)
            damped = damped or now.found.reduction >= threshold
            if damped and now.found.reduction + now.found.reduction_confidence < threshold:
                return
            if np.any(course.wearing.lost(now.state) >= 1.0 - _LEFT):
                return
            before = now


def _worn_away(wearing: WearEffect, last: Moment[BandMeans]) -> tuple[float, int] | None:
    """Return when a body is worn away at the latest rates, h, and its number; None: never, or size unknown."""
    rate, remaining = wearing.losses @ last.found.rate, 1.0 - wearing.lost(last.state)
    spans = np.divide(remaining, rate, out=np.full(len(remaining), np.inf), where=np.isfinite(remaining) & (rate > 0.0))
    first = int(np.argmin(spans))
    return (last.time + float(spans[first]), first) if np.isfinite(spans[first]) else None


def _passes(before: Moment[BandMeans], after: Moment[BandMeans], threshold: float) -> bool:
    return (before.found.reduction >= threshold) != (after.found.reduction >= threshold)


def _halved(course: _Course, before: Moment[BandMeans], after: Moment[BandMeans]) -> Iterator[Moment[BandMeans]]:
    """Yield moments between two, until the time of crossing the threshold is accurate enough.

    Halving also stops if reductions differ by less than their confidence.
    """
    table, first, last, moments = course.study.table, before, after, list[Moment[BandMeans]]()
    while last.time - first.time > _CLOSE * table.hours:
        change = abs(last.found.reduction - first.found.reduction)
        if change < max(last.found.reduction_confidence, first.found.reduction_confidence):
            break
        middle = (first.time + last.time) / 2
        volume, band = between(before, after, middle)
        moment = Moment(middle, volume, course.rates(volume), band, after.error)
        moments.append(moment)
        first, last = (first, moment) if _passes(first, moment, course.study.threshold) else (moment, last)
    yield from sorted(moments, key=lambda moment: moment.time)


def _record(
    study: LifeStudy, wearing: WearEffect, runs: LifeRuns, moments: list[Moment[BandMeans]], starts: dict[str, Any],
    provenance: dict[str, Any],
) -> LifeRecord:  # fmt: skip
    """Return the record of moments in ascending time."""
    volume = np.array([moment.state for moment in moments])
    band, error = (np.array([getattr(moment, name) for moment in moments]) for name in ("band", "error"))
    rate, confidence = (np.array([getattr(m.found, name) for m in moments]) for name in ("rate", "confidence"))
    area = np.array([contact.area for contact in runs.contacts])
    gap_rate = rate @ wearing.gap.T
    shift = np.sqrt(band**2 @ wearing.gap.T**2) + error @ wearing.gap.T
    travel = {
        name: np.array([of(state) for state in volume]) for name, of in (("gap", wearing.gaps), ("play", wearing.plays))
    }
    values = {
        "time": np.array([moment.time for moment in moments]),
        "depth": volume / area, "depth_band": band / area, "depth_error": error / area,
        "depth_rate": rate / area, "depth_rate_confidence": confidence / area,
        "gap": travel["gap"], "gap_band": shift, "play": travel["play"],
        "lost": np.array([wearing.lost(state) for state in volume]),
        "reduction": np.array([moment.found.reduction for moment in moments]),
        "reduction_band": np.array([moment.found.reduction_confidence for moment in moments]),
        "amplitude": np.array([moment.found.amplitude for moment in moments]),
    }  # fmt: skip
    late = np.divide(shift, gap_rate, out=np.zeros_like(shift), where=gap_rate > 0.0).max(axis=1)
    hours = _hours(values["time"], values["reduction"], values["reduction_band"], late, study.threshold)
    if study.spots:
        values["damage_rate"] = np.array([moment.found.damage for moment in moments])
        values["damage"] = cumulative_trapezoid(values["damage_rate"], values["time"], axis=0, initial=0.0)
    last = moments[-1]
    early_end = last.time < study.table.hours * (1.0 - 1e-12) and not hours[0]
    thin = bool(np.any(wearing.lost(last.state) >= 1.0 - _LEFT))
    worn = _worn_away(wearing, last) if early_end or thin else None
    return LifeRecord(
        study={"life": tables(study.table), "scene": study.scene.to_dict()},
        reference=study.reference, frequency=study.frequencies, contacts=tuple(runs.contacts),
        **{name: frozen(array) for name, array in values.items()},
        hours=hours, runs=runs.asked, trouble=runs.trouble,
        sentence=sentence_of(hours, study, values, starts, worn), starts=starts,
        worn_away=None if worn is None else worn[0], hot_spots=study.spots,
        vane_hours=_failed(values["time"], values["damage"]) if study.spots else None, provenance=provenance,
    )  # fmt: skip


def _hours(
    time: np.ndarray, reduction: np.ndarray, band: np.ndarray, late: np.ndarray, threshold: float
) -> tuple[float | None, float | None, float | None]:
    """Return the time when the reduction is lost: nominal, earliest and latest; None: not within the hours.

    0 if it is never reached. late (n,): uncertainty of the depths of wear as a time, h.
    """
    lost, early, last = (_lost(time, reduction - threshold + side * band) for side in (0.0, -1.0, 1.0))
    if early is not None:
        early = max(early - float(np.interp(early, time, late)), 0.0)
    return lost, early, None if last is None else last + float(np.interp(last, time, late))


def _failed(time: np.ndarray, damage: np.ndarray) -> float | None:
    """Return when the damage (n, s) of a hot spot reaches 1, h; None: not within the hours."""
    most = damage.max(axis=1)
    return float(np.interp(1.0, most, time)) if most[-1] >= 1.0 else None


def _lost(time: np.ndarray, above: np.ndarray) -> float | None:
    """Return the first time at which a curve falls below zero after being above it."""
    reached = np.flatnonzero(above >= 0.0)
    if len(reached) == 0:
        return 0.0
    below = np.flatnonzero(above[reached[0] :] < 0.0)
    if len(below) == 0:
        return None
    after = reached[0] + below[0]
    fraction = above[after - 1] / (above[after - 1] - above[after])
    return float(time[after - 1] + fraction * (time[after] - time[after - 1]))
