"""Identification: many short runs find where to begin, exact derivatives find the best numbers and their intervals."""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.files.store import frozen
from vanedamp.studies.identification.data import forced
from vanedamp.studies.identification.fit import Fit, Minimum
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
#: half width of a 95 % interval over the standard deviation
_NORMAL = 1.96


def identify(
    study: IdentificationStudy | str | Path,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Identification:
    """Find the numbers of a scene that measurements tell, in a study or its TOML file.

    executor: of concurrent.futures, for candidates, starts and profiles; the answer does not depend on it; progress:
    called with the parts done and of those expected. Raises InputError for a bad file.
    """
    began = time.perf_counter()
    study = study if isinstance(study, IdentificationStudy) else IdentificationStudy.load(study)
    work = _Work(study, executor, progress)
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
    """The steps of an identification. deviations: of the channels, as far as they are known."""

    def __init__(
        self, study: IdentificationStudy, executor: Executor | None, progress: Callable[[int, int], None] | None
    ) -> None:
        self.study, self.count = study, Counter[str]()
        self.fit = Fit(study)
        self._map: Callable[..., Iterable[Any]] = map if executor is None else executor.map
        self._progress, self._done = progress, 0
        asked = math.prod(map(len, study.proposals().values())) if study.proposals() else 0
        self._expected = study.search.candidates + study.search.starts + len(study.numbers) + asked

    def _each(self, function: Callable[..., Any], *arguments: Iterable[Any]) -> list[Any]:
        """Return the results of calls, in order, and count their engine runs."""
        results = []
        for result, count in self._map(function, *arguments):
            self.count += count
            results.append(result)
            self._done += 1
            if self._progress is not None:
                self._progress(self._done, max(self._expected, self._done))
        return results

    def starts(self) -> list[np.ndarray]:
        """Return the best candidates that are apart, the best first: of the first guess and a Sobol sequence."""
        table, tried = self.study.search, candidates(self.study)
        misfits = self._each(_quick, itertools.repeat(self.study), tried)
        chosen: list[np.ndarray] = []
        for place in np.argsort(misfits, kind="stable"):
            z = tried[place]
            if all(np.abs(z - other).max() > _APART for other in chosen):
                chosen.append(z)
        return chosen[: table.starts]

    def minima(self, starts: Sequence[np.ndarray]) -> list[Minimum]:
        """Return the minima near some starts, the best first."""
        found = self._each(_minimum, itertools.repeat(self.study), starts)
        return sorted(found, key=lambda each: each.misfit)

    def estimated(self, best: Minimum) -> Minimum:
        """Return the minimum, close, with the deviations that are not given from its residuals."""
        for _ in range(_ROUNDS):
            changed = self.fit.estimate(best.z)
            best = self.fit.minimum(best.z)
            if not changed:
                break
        return best

    def profiles(self, best: Minimum) -> tuple[Minimum, list[Profile]]:
        """Return the profiles of all numbers, and the minimum, which is another if a profile has found a better one."""
        for _ in range(_ROUNDS):
            scatter = covariance(self.fit.jacobian(best.z))
            told = self._each(
                _profile, itertools.repeat(self.study), itertools.repeat(self.fit.deviations),
                itertools.repeat(best), itertools.repeat(scatter), range(len(best.z)), itertools.repeat(self.rise),
            )  # fmt: skip
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
        found = self._each(
            _sensitivity, itertools.repeat(self.study), itertools.repeat(best.z),
            [dict(zip(axes, place, strict=True)) for place in places],
        )  # fmt: skip
        told = information(self.fit.jacobian(best.z))
        before = np.sqrt(np.diag(np.linalg.inv(told)))
        after = shrunk(told, [row / deviation for row in found])
        return Proposal(tuple(axes), frozen(places), frozen(after / before), int(np.argmax(before)))


def candidates(study: IdentificationStudy) -> np.ndarray:
    """Return coordinates (c, P) that are tried first: the first guess and a Sobol sequence."""
    table = study.search
    spread = qmc.Sobol(len(study.numbers), seed=table.seed).random(1 << max(table.candidates - 1, 1).bit_length())
    own = np.clip(study.coordinates(study.start), 0.0, 1.0)
    return np.vstack([own, spread[: table.candidates - 1]])


def _quick(study: IdentificationStudy, z: np.ndarray) -> tuple[float, Counter[str]]:
    fit = Fit(study)
    return fit.quick(z), fit.count


def _minimum(study: IdentificationStudy, z: np.ndarray) -> tuple[Minimum, Counter[str]]:
    fit = Fit(study)
    return fit.minimum(z, close=_ROUGH), fit.count


def _profile(
    study: IdentificationStudy,
    deviations: Sequence[float],
    best: Minimum,
    scatter: np.ndarray,
    number: int,
    most: float,
) -> tuple[Profile, Counter[str]]:
    fit = Fit(study, deviations)
    fit.predict(best.z)
    return profile(fit, best, scatter, number, most), fit.count


def _sensitivity(
    study: IdentificationStudy, z: np.ndarray, changes: Mapping[str, float]
) -> tuple[np.ndarray, Counter[str]]:
    """Return the derivatives (1, P) of the logarithm of the amplitude in a measurement; 0 where it does not repeat."""
    values, count = study.values(z), Counter[str]()
    others = {path: value for path, value in changes.items() if path not in (FREQUENCY, *study.paths)}
    asked = forced("proposal", [changes.get(FREQUENCY, study.scene.frequency)], [1.0], others)
    model = Forced(study, asked, count)
    predicted = model.predict(values)
    amplitude = predicted.values["amplitude"]
    if not (predicted.repeats[0] and np.isfinite(amplitude[0])):
        return np.zeros((1, len(z))), count
    slope = model.derivative(values)["amplitude"] * study.slope(values) / amplitude[:, None]
    return np.nan_to_num(slope), count


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
    others = ended[apart & (squares < best.misfit + _AS_GOOD)]
    data = _data(fit, best.z, scatter)
    cold = fit.quick(best.z)
    status, notes = outcome(study, opened, interval, test, best.converged, others, cold, best.misfit)
    return Identification(
        study=study.to_json(), status=status, notes=notes, paths=study.paths,
        sentence=sentence_of(study.paths, values, interval, opened), best=frozen(values),
        covariance=frozen(scatter * np.multiply.outer(slope, slope)), interval=frozen(interval),
        open=frozen(opened, bool),
        profile_number=frozen(np.repeat(np.arange(len(profiles)), [len(own.z) for own in profiles]), int),
        profile_value=frozen(np.concatenate([study.along(place, own.z) for place, own in enumerate(profiles)])),
        profile_rise=frozen(np.concatenate([own.rise for own in profiles])), threshold=work.rise, misfit=best.misfit,
        test=test, minima=frozen(ended), minima_misfit=frozen(squares), deviation=frozen(fit.deviations),
        estimated=frozen(fit.estimated, bool), proposal=proposal, counts=dict(work.count + fit.count),
        wall_time_s=time.perf_counter() - began, scene=study.scene_at(values), provenance=provenance, **data,
    )  # fmt: skip


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
    types = {"data_channel": int, "data_repeats": bool}
    found = {
        name: frozen(row, types.get(name, float)) for name, row in zip(names, np.concatenate(rows, axis=1), strict=True)
    }
    return found | {"channels": tuple(channels)}
