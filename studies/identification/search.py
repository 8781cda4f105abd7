"""Identification: many short runs find where to begin, exact derivatives find the best numbers and their intervals."""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import suppress
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.worker import SweepError
from vanedamp.files.store import frozen
from vanedamp.studies.forecast import Forecast
from vanedamp.studies.identification.checkpoint import FinishedPart, SearchCheckpoint
from vanedamp.studies.identification.data import forced
from vanedamp.studies.identification.fit import Fit, Minimum, OutOfTime
from vanedamp.studies.identification.forced import Forced
from vanedamp.studies.identification.record import Identification, Proposal
from vanedamp.studies.identification.statistics import (
    Profile,
    covariance,
    information,
    misfit,
    profile,
    shrunk,
    threshold,
    unfinished,
)
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.summary import outcome, sentence_of
from vanedamp.studies.terminal import stage

#: smallest distance of two starts, and of two minima, in coordinates
_APART, _OTHER = 0.1, 0.02
#: how close the minima of the starts are found: relative change of the sum of squares
_ROUGH = 1e-3
#: rounds in which deviations are estimated, and in which a profile may find a better minimum
_ROUNDS = 4
#: rise of the misfit below which another minimum is as good
_AS_GOOD = 4.0
#: relative deviation of a proposed measurement's amplitude where no forced response tells it
_NOISE = 0.02
#: common factors of wrong readings, and what they are
FACTORS = {
    1e3: "mm and m", 1e6: "um and m", 2.0: "peak to peak and peak", math.sqrt(2.0): "peak and rms",
    180.0 / math.pi: "degrees and rad",
}  # fmt: skip
#: part of the misfit that is left where a common factor explains it
_EXPLAINS = 0.1
#: half width of a 95 % interval over the standard deviation
_NORMAL = 1.96


def identify(
    study: IdentificationStudy | str | Path,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    provenance: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
    budget: float | None = None,
) -> Identification:
    """Find the numbers of a scene that measurements tell, in a study or its TOML file.

    executor: of concurrent.futures, for candidates, starts and profiles; the answer does not depend on it; progress:
    called with the work done and what is expected in all, in candidates; checkpoint: a file to which finished parts are
    written and from which an interrupted search, or one whose budget ended, resumes; the caller removes it once the
    result is safe (files.checkpoint_file.clear); budget: s, in place of the study's. Raises InputError for a bad file,
    SweepError where workers are lost.
    """
    began = time.perf_counter()
    study = study if isinstance(study, IdentificationStudy) else IdentificationStudy.load(study)
    with SearchCheckpoint(checkpoint, study, provenance or {}) as kept:
        work = _Work(study, executor, progress, kept, study.search.budget if budget is None else budget)
        with stage("candidates"):
            starts = work.starts()
        with stage("minima"):
            minima = work.minima(starts)
            best = work.estimated(minima[0])
        with stage("profiles"):
            best, profiles = work.profiles(best)
        with stage("next measurement"):
            proposal = work.proposal(best)
    return _identification(study, work, best, minima, profiles, proposal, dict(provenance or {}), began)


class _Work:
    """The steps of an identification.

    fit: of the best numbers, with the deviations of the channels as far as they are known; over: what the budget of
    time, s, has cut, in words, or "".
    """

    def __init__(
        self, study: IdentificationStudy, executor: Executor | None, progress: Callable[[int, int], None] | None,
        kept: SearchCheckpoint, budget: float | None,
    ) -> None:  # fmt: skip
        self.study, self.count, self.over = study, Counter[str](), ""
        self.fit = Fit(study)
        self._executor, self._kept, self._asked = executor, kept, 0
        self._until = math.inf if budget is None else time.monotonic() + budget
        numbers, asked = len(study.numbers), study.proposals()
        parts = {
            "candidates": (study.search.candidates, "candidates", 1.0),
            "minima": (study.search.starts, "candidates", 8.0 + 4.0 * numbers),
            "profiles": (numbers, "minima", 2.5),
            "proposals": (
                math.prod(map(len, asked.values())) if asked else 0, "candidates",
                (numbers + 10.0) / sum(len(one.at) for one in study.measured),
            ),
        }  # fmt: skip
        self._forecast = Forecast(progress, parts)

    def _each(self, kind: str, function: Callable[..., FinishedPart], calls: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Return the results of calls in order, None of those that the budget has cut, and count their engine runs.

        Those kept are not called.
        """
        first, self._asked = self._asked, self._asked + len(calls)
        self._forecast.expect(kind, len(calls))
        results: list[Any] = [None] * len(calls)

        def take(place: int, part: FinishedPart, kept: bool = False) -> None:
            results[place] = part.result
            self.count += part.counts
            self._forecast.ended(kind, part.seconds, kept)

        missing = list[int]()
        for place in range(len(calls)):
            if (part := self._kept.parts.get(first + place)) is None:
                missing.append(place)
            else:
                take(place, part, True)
        for place, part in _called(self._executor, function, {place: calls[place] for place in missing}, self._until):
            if time.monotonic() <= self._until:
                self._kept.add(first + place, part)
                missing.remove(place)
            take(place, part)
        if missing and not self.over:
            self.over = f"{len(missing)} of {len(calls)} {kind} and what follows are not finished"
        return results

    def starts(self) -> list[tuple[np.ndarray, float]]:
        """Return the best candidates that are apart, the best first: of the first guess and a Sobol sequence.

        Each with its misfit, inf where it was not tried.
        """
        table, tried = self.study.search, candidates(self.study)
        found = self._each("candidates", _quick, [(self.study, z) for z in tried])
        misfits = [math.inf if misfit is None else misfit for misfit in found]
        chosen: list[tuple[np.ndarray, float]] = []
        for place in np.argsort(misfits, kind="stable"):
            z = tried[place]
            if all(np.abs(z - other).max() > _APART for other, _ in chosen):
                chosen.append((z, misfits[place]))
        return chosen[: table.starts]

    def minima(self, starts: Sequence[tuple[np.ndarray, float]]) -> list[Minimum]:
        """Return the minima near some starts, the best first."""
        found = self._each("minima", _minimum, [(self.study, z, self._until) for z, _ in starts])
        each = (Minimum(z, m, False) if one is None else _read(one) for one, (z, m) in zip(found, starts, strict=True))
        return sorted(each, key=lambda one: one.misfit)

    def estimated(self, best: Minimum) -> Minimum:
        """Return the minimum, close, with the deviations that are not given from its residuals."""
        self.fit.until = self._until
        try:
            for _ in range(_ROUNDS):
                changed = self.fit.estimate(best.z)
                best = self.fit.minimum(best.z)
                if not changed:
                    break
        except OutOfTime:
            self.over = self.over or "the best minimum and what follows are not finished"
        self.fit.until = math.inf
        return best

    def profiles(self, best: Minimum) -> tuple[Minimum, list[Profile]]:
        """Return the profiles of all numbers, and the minimum, which is another if a profile has found a better one."""
        for _ in range(_ROUNDS):
            if self.over:
                self.fit.estimate(best.z)
            scatter = covariance(self.fit.jacobian(best.z))
            given = self.study, self.fit.deviations, best, scatter, self.rise, self._until
            found = self._each("profiles", _profile, [(*given, number) for number in range(len(best.z))])
            told = [
                unfinished(best, scatter, number, self.rise) if one is None else _read_profile(one)
                for number, one in enumerate(found)
            ]  # fmt: skip
            better = [each.better for each in told if each.better is not None]
            if not better:
                break
            best = self.estimated(min(better, key=lambda each: each.misfit))
        return best, told

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residuals."""
        return sum(len(channel.values) for channel in self.fit.channels) - len(self.study.numbers)

    @property
    def rise(self) -> float:
        """Rise of the misfit at the ends of an interval."""
        return threshold(any(self.fit.estimated), self.freedom)

    def proposal(self, best: Minimum) -> Proposal | None:
        """Return what each further measurement would tell; None where no level is known to measure at."""
        axes = self.study.proposals()
        if not axes:
            return None
        places = list(itertools.product(*axes.values()))
        noise = [
            deviation for channel, deviation in zip(self.fit.channels, self.fit.deviations, strict=True)
            if channel.unit == "m" and channel.compare == "ratio"
        ]  # fmt: skip
        deviation = min(noise, default=_NOISE)
        calls = [(self.study, best.z, dict(zip(axes, place, strict=True))) for place in places]
        found = self._each("proposals", _sensitivity, calls)
        if self.over:
            return None
        told = information(self.fit.jacobian(best.z))
        before = np.sqrt(np.diag(np.linalg.inv(told)))
        after = shrunk(told, [np.array(row) / deviation for row in found])
        return Proposal(tuple(axes), frozen(places), frozen(after / before), int(np.argmax(before)))


def candidates(study: IdentificationStudy) -> np.ndarray:
    """Return coordinates (c, P) that are tried first: the first guess and a Sobol sequence."""
    table = study.search
    spread = qmc.Sobol(len(study.numbers), seed=table.seed).random(1 << max(table.candidates - 1, 1).bit_length())
    own = np.clip(study.coordinates(study.start), 0.0, 1.0)
    return np.vstack([own, spread[: table.candidates - 1]])


def _called(
    executor: Executor | None, function: Callable[..., FinishedPart], calls: Mapping[int, tuple[Any, ...]], until: float
) -> Iterator[tuple[int, FinishedPart]]:
    """Yield the parts of calls as they end, with their places, but for those that the time has cut."""
    if executor is None:
        for place, call in calls.items():
            if time.monotonic() > until:
                return
            with suppress(OutOfTime):
                yield place, function(*call)
        return
    futures = dict[Future[FinishedPart], int]()
    try:
        if time.monotonic() <= until:
            futures = {executor.submit(function, *call): place for place, call in calls.items()}
        for future in as_completed(futures):
            with suppress(OutOfTime, CancelledError):
                yield futures[future], future.result()
            if time.monotonic() > until:
                for waiting in futures:
                    waiting.cancel()
    except BrokenExecutor as error:
        raise SweepError(f"the workers are gone ({error}); run the same again to go on from the checkpoint") from error
    finally:
        for future in futures:
            future.cancel()


def _part(work: Callable[..., tuple[Any, Counter[str]]]) -> Callable[..., FinishedPart]:
    """Return a function of a worker that returns its part, of the result as plain data and the counts of another."""

    @wraps(work)
    def timed(*arguments: Any) -> FinishedPart:
        began = time.perf_counter()
        result, count = work(*arguments)
        return FinishedPart(result, count, time.perf_counter() - began)

    return timed


def _told(minimum: Minimum) -> list[Any]:
    return [minimum.z.tolist(), minimum.misfit, minimum.converged]


def _read(told: list[Any]) -> Minimum:
    return Minimum(np.array(told[0]), told[1], told[2])


def _read_profile(told: list[Any]) -> Profile:
    z, rise, ends, opened, better = told
    return Profile(np.array(z), np.array(rise), tuple(ends), tuple(opened), None if better is None else _read(better))


@_part
def _quick(study: IdentificationStudy, z: np.ndarray) -> tuple[float, Counter[str]]:
    fit = Fit(study)
    return fit.quick(z), fit.count


@_part
def _minimum(study: IdentificationStudy, z: np.ndarray, until: float) -> tuple[list[Any], Counter[str]]:
    fit = Fit(study, until=until)
    return _told(fit.minimum(z, close=_ROUGH)), fit.count


@_part
def _profile(
    study: IdentificationStudy, deviations: Sequence[float], best: Minimum, scatter: np.ndarray, most: float,
    until: float, number: int,
) -> tuple[list[Any], Counter[str]]:  # fmt: skip
    fit = Fit(study, deviations, until)
    z, rise, ends, opened, better = profile(fit, best, scatter, number, most)
    return [z.tolist(), rise.tolist(), list(ends), list(opened), None if better is None else _told(better)], fit.count


@_part
def _sensitivity(
    study: IdentificationStudy, z: np.ndarray, changes: Mapping[str, float]
) -> tuple[list[list[float]], Counter[str]]:
    """Return the derivatives (1, P) of the logarithm of the amplitude in a measurement; 0 where it does not repeat."""
    values, count = study.values(z), Counter[str]()
    others = {path: value for path, value in changes.items() if path not in (FREQUENCY, *study.paths)}
    asked = forced("proposal", [changes.get(FREQUENCY, study.scene.frequency)], [1.0], others)
    model = Forced(study, asked, count)
    predicted = model.predict(values)
    amplitude = predicted.values["amplitude"]
    if not (predicted.repeats[0] and np.isfinite(amplitude[0])):
        return [[0.0] * len(z)], count
    slope = model.rough_derivative(values)["amplitude"] * study.slope(values) / amplitude[:, None]
    return np.nan_to_num(slope).tolist(), count


def _identification(
    study: IdentificationStudy, work: _Work, best: Minimum, minima: Sequence[Minimum], profiles: Sequence[Profile],
    proposal: Proposal | None, provenance: dict[str, Any], began: float,
) -> Identification:  # fmt: skip
    """Return the record of what was found."""
    fit, values, test = work.fit, study.values(best.z), misfit(work.fit, best.z)
    slope, scatter = study.slope(values), covariance(fit.jacobian(best.z))
    interval = np.array([study.along(place, np.array(own.ends)) for place, own in enumerate(profiles)])
    opened = np.array([own.open for own in profiles])
    ended = np.array([study.values(each.z) for each in minima])
    squares = np.array([_squares(fit, each.z) for each in minima])
    apart = np.array([np.abs(each.z - best.z).max() > _OTHER for each in minima])
    least = _squares(fit, best.z) if work.over else best.misfit
    found = np.array([each.converged or not work.over for each in minima])
    others = ended[apart & found & (squares < least + _AS_GOOD)]
    data = _data(fit, best.z, scatter)
    cold = fit.quick(best.z)
    factor = common_factor(fit, best.z) if test.larger and not work.over else ""
    status, notes = outcome(study, opened, interval, test, best.converged, others, cold, least, work.over, factor)
    return Identification(
        study=study.to_json(), status=status, notes=notes, paths=study.paths,
        sentence=sentence_of(study.paths, values, interval, opened), best=values,
        covariance=scatter * np.multiply.outer(slope, slope), interval=interval, open=opened,
        profile_number=np.repeat(np.arange(len(profiles)), [len(own.z) for own in profiles]),
        profile_value=np.concatenate([study.along(place, own.z) for place, own in enumerate(profiles)]),
        profile_rise=np.concatenate([own.rise for own in profiles]), threshold=work.rise, misfit=least, test=test,
        minima=ended, minima_misfit=squares, deviation=np.array(fit.deviations),
        estimated=np.array(fit.estimated), proposal=proposal, counts=dict(work.count + fit.count),
        wall_time_s=time.perf_counter() - began, scene=study.scene_at(values), provenance=provenance, **data,
    )  # fmt: skip


def common_factor(fit: Fit, z: np.ndarray) -> str:
    """Say by which factor, such as one between units, all measured amplitudes are off; "" if by none of FACTORS.

    The two are tried that are closest to the median of the ratios to the model at its best, which they have moved.
    """
    pairs = zip(fit.channels, fit.by_channel(z), strict=True)
    ratios = [off[np.isfinite(off)] for channel, off in pairs if channel.compare == "ratio"]
    if not ratios or not len(together := np.concatenate(ratios)):
        return ""
    middle = -float(np.median(together))
    both = {factor: name for value, name in FACTORS.items() for factor in (value, 1.0 / value)}
    for factor in sorted(both, key=lambda each: abs(math.log(each) - middle))[:2]:
        measured = [
            replace(one, channels=tuple(
                replace(each, values=each.values / factor) if each.compare == "ratio" else each for each in one.channels
            ))
            for one in fit.study.measured
        ]  # fmt: skip
        other = Fit(replace(fit.study, measured=measured), fit.deviations)
        start = min((z, fit.study.coordinates(fit.study.start)), key=other.quick)
        if other.minimum(start, close=_ROUGH).misfit < _EXPLAINS * _squares(fit, z):
            return f"divided by {factor:.4g} all amplitudes fit ({both[factor]}?)"
    return ""


def _squares(fit: Fit, z: np.ndarray) -> float:
    """Return the misfit at some coordinates, with the deviations that were found last."""
    residual = fit.residual(z)
    return float(residual @ residual)


def _data(fit: Fit, z: np.ndarray, scatter: np.ndarray) -> dict[str, Any]:
    """Return the measured values beside those of the model, as the record has them."""
    told = np.where(np.isfinite(scatter), scatter, 0.0)
    rows, channels = list[np.ndarray](), list[dict[str, str]]()
    each = zip(fit.compared(z), fit.sensitivity(z), fit.deviations, strict=True)
    for number, ((measured, channel, model, repeats), slope, deviation) in enumerate(each):
        band = _NORMAL * np.sqrt(np.maximum(np.einsum("np,pq,nq->n", slope, told, slope), 0.0))
        place = np.full(len(model), float(number))
        rows.append(np.array([place, measured.at, channel.values, channel.deviations(deviation), model, band, repeats]))
        channels.append(
            {"measurement": measured.name, "kind": measured.kind, "quantity": channel.name, "unit": channel.unit,
             "compare": channel.compare, "at_unit": measured.unit}
        )  # fmt: skip
    names = ("data_channel", "data_at", "data_value", "data_deviation", "data_model", "data_band", "data_repeats")
    return dict(zip(names, np.concatenate(rows, axis=1), strict=True)) | {"channels": tuple(channels)}
