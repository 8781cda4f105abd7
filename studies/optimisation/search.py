"""The damper that reduces most: mass, gap, number and other numbers of bodies, as designed and within tolerances.

Both searches are scipy's differential evolution (Storn and Price, 1997), which evaluates a whole generation at a time,
on all workers. The second starts from the best designs of the first, and judges each by the same sample of the
tolerances (a Latin hypercube and the design itself), so that designs differ by their own values, not by chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.store import finite
from vanedamp.files.toml_input import tables
from vanedamp.studies.band import drive
from vanedamp.studies.headline import Headline, headline
from vanedamp.studies.numbers import Box
from vanedamp.studies.optimisation.checkpoint import DesignCheckpoint
from vanedamp.studies.optimisation.gradient import descend
from vanedamp.studies.optimisation.measures import SERVICE
from vanedamp.studies.optimisation.record import Optimisation, Optimum
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION
from vanedamp.studies.optimisation.tolerances import estimate
from vanedamp.studies.terminal import stage
from vanedamp.studies.worst_start import STARTS, worst_start, worst_words

#: generations of a search, at least
_GENERATIONS = 5
_Deviation = Mapping[str, float]


def optimise(
    study: Study,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    provenance: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
) -> Optimisation:
    """Search, map and compare. The same study and seed give the same answer, whatever the executor.

    progress: called with the number of runs done and of those expected; checkpoint: a file to which finished runs are
    written and from which an interrupted search resumes; the caller removes it once the result is safe
    (files.checkpoint_file.clear).
    """
    with DesignCheckpoint(checkpoint, study, provenance or {}) as kept:
        return _optimised(study, _Trial(study, executor, progress, deviations(study), kept), dict(provenance or {}))


def _optimised(study: Study, trial: _Trial, provenance: dict[str, Any]) -> Optimisation:
    table = study.table
    with stage("search as designed"):
        first, gradient = descend(study, trial.tried, trial.best_designs(trial.search(False, [])))
    trial.begins(1)
    with stage("search within tolerances"):
        second = trial.search(True, trial.best_designs(first)) if len(trial.sample) > 1 else first
    trial.begins(2)
    nominal, robust = trial.optimum(first), trial.optimum(second)
    if robust.amplitude_tolerances > nominal.amplitude_tolerances:
        robust = nominal  # the search as designed has found the better one
    if robust.amplitude < nominal.amplitude:
        nominal = robust
    masses, gaps = study.map_axes
    best = nominal.design.values
    along = {name: study.places(name) for name in study.table.variables.along}
    changed = [{"mass_ratio": mass, "gap_ratio": gap} for mass in masses.tolist() for gap in gaps.tolist()]
    changed += [{name: value} for name, values in along.items() for value in values.tolist()]
    with stage("map"):
        amplitudes = trial.judge([study.design(best | each) for each in changed], robust=False)
    split = len(masses) * len(gaps)
    tried_designs, tried_amplitudes, tried_robust = zip(*trial.history, strict=True)
    best = {"nominal": nominal.design, "robust": robust.design}
    responses = {name: trial.response(design) for name, design in best.items()}
    curves = best if table.by_amplitude else {}
    headlines = {name: trial.headline(design, responses[name][0]) for name, design in curves.items()}
    trial.begins(3)
    with stage("derivatives by tolerances"):
        estimates = {name: estimate(study, best[name], responses[name][0], trial.sample, trial.within) for name in best}
    with stage("runs from other starts"):
        found = {design: trial.worst_start(design) for design in dict.fromkeys(curves.values())}
    starts = {name: found[design] for name, design in curves.items()}
    return Optimisation(
        study={"optimise": tables(table), "scene": study.scene.to_dict()},
        mass=study.mass,
        amplitude=study.amplitude,
        reference=study.reference,
        resonance_frequency=study.resonance.frequency,
        nominal=replace(nominal, estimate=estimates["nominal"]),
        robust=replace(robust, estimate=estimates["robust"]),
        map_mass_ratio=masses,
        map_gap_ratio=gaps,
        map_amplitude=amplitudes[:split].reshape(len(masses), len(gaps)),
        history_design=np.array([list(design.values.values()) for design in tried_designs], float),
        history_amplitude=np.array(tried_amplitudes),
        history_robust=np.array(tried_robust),
        frequency=study.frequencies,
        undamped=responses["nominal"][1],
        nominal_response=responses["nominal"][0],
        robust_response=responses["robust"][0],
        headlines={name: _of_band(headline) for name, headline in headlines.items()},
        starts=starts,
        gradient=gradient,
        along_value=np.array(list(along.values())),
        along_amplitude=amplitudes[split:].reshape(len(along), -1) if along else amplitudes[split:],
        scenes=trial.scenes,
        trouble=trial.trouble,
        sentence=_sentence(study, nominal, robust, headlines, starts),
        provenance=provenance,
    )


def deviations(study: Study) -> list[_Deviation]:
    """Return the sample of the tolerances: the design itself, and a Latin hypercube over those that are not zero."""
    widths = {name: width.half for name, width in study.widths.items()}
    if not widths:
        return [NO_DEVIATION]
    points = qmc.LatinHypercube(len(widths), seed=study.table.seed).random(study.table.samples)
    names, half = list(widths), np.array(list(widths.values()))
    return [
        NO_DEVIATION,
        *(NO_DEVIATION | dict(zip(names, row, strict=True)) for row in ((2 * points - 1) * half).tolist()),
    ]


class _Trial:
    """Designs tried so far, and the runs that took."""

    def __init__(
        self,
        study: Study,
        executor: Executor | None,
        progress: Callable[[int, int], None] | None,
        sample: Sequence[_Deviation],
        kept: DesignCheckpoint,
    ) -> None:
        self.study, self.sample = study, sample
        self.history: list[tuple[Design, float, bool]] = []
        self.scenes = self.trouble = self._others = 0
        self._executor, self._progress, self._kept = executor, progress, kept
        table = study.table
        self._variables = {name: number for name, number in study.variables.items() if number.min < number.max}
        both = 2 if len(sample) > 1 else 1
        searched = table.evaluations, (both - 1) * table.evaluations * len(sample)
        self._designs = (
            searched[0] + table.gradient_steps * table.by_amplitude, searched[1],
            study.mapped + both * len(sample), both * len(STARTS) * table.by_amplitude,
        )  # fmt: skip
        self.begins(0)

    def begins(self, number: int) -> None:
        """Expect the designs of a stage, at most, and of those after it: both searches, the map, other starts."""
        self._expected = self.scenes + len(self.study.frequencies) * sum(self._designs[number:])

    def optimum(self, design: Design) -> Optimum:
        """Return both amplitudes of a design."""
        nominal, robust = (float(self._tried([design], robust)[0]) for robust in (False, True))
        return Optimum(design, nominal, robust)

    def response(self, design: Design) -> tuple[np.ndarray, np.ndarray]:
        """Return the amplitudes (f,) of a design over the reference, nan where not ok, and those without bodies."""
        damped, undamped, _ = self._run([design], self.sample[:1])
        return damped[0, 0], undamped[0, 0]

    def tried(self, design: Design) -> tuple[float, np.ndarray]:
        """Return the amplitude of a design as it is, and those at the frequencies (f,), nan where a run is not ok."""
        damped, undamped, excess = self._run([design], self.sample[:1])
        amplitude = float(self._judged(damped, undamped, excess)[0])
        self.history.append((design, amplitude, False))
        return amplitude, damped[0, 0]

    def within(self, design: Design, deviation: _Deviation) -> float:
        """Return the amplitude of a design that is off by a deviation."""
        return float(self._judged(*self._run([design], [deviation]))[0])

    def headline(self, design: Design, damped: np.ndarray) -> Headline:
        """Return the headline of a design's amplitudes (f,) over the reference."""
        known, (undamped, fixed, peaks) = self.study.reference * damped, self.study.linear(design, self.sample[0])
        none = np.full(len(known), np.nan)
        curves = (known, known, none, none, none, undamped, fixed)
        return headline(self.study.frequencies, *curves, peaks, along_frequency=True)

    def worst_start(self, design: Design) -> dict[str, Any]:
        """Return the worst curve of a design as it is, from several starts (worst_start.worst_start)."""
        scene = self.study.scene_of(design, NO_DEVIATION, float(self.study.frequencies[0]))
        found = worst_start(scene, self.study.frequencies, self._executor, lambda done, _: self._tell(done))
        self._others += found["starts"] * len(self.study.frequencies)
        return found

    def search(self, robust: bool, designs: Sequence[Design]) -> Design:
        """Return the best design by differential evolution, from the first of some designs or from a Latin hypercube.

        robust: within the tolerances, or as designed.
        """
        table, names, box = self.study.table, list(self._variables), Box(self._variables.values())
        if not names:
            return self._design([])
        bounds = box.ends.T.tolist()
        size = max(5, table.evaluations // max(_GENERATIONS, math.isqrt(table.evaluations)))
        first = np.array([[design.values[name] for name in names] for design in designs[:size]], float)
        first = box.spread(first) if designs else first
        if not designs:
            first = qmc.scale(qmc.LatinHypercube(len(names), seed=table.seed).random(size), *np.transpose(bounds))

        def objective(columns: np.ndarray) -> np.ndarray:
            return self._tried([self._design(box.gathered(column)) for column in np.atleast_2d(columns.T)], robust)

        minimum = differential_evolution(
            objective, bounds, init=first, maxiter=max(table.evaluations // size - 1, 1), tol=0.0, polish=False,
            seed=table.seed, updating="deferred", vectorized=True, integrality=[name == "bodies" for name in names],
        )  # fmt: skip
        return self._design(box.gathered(minimum.x))

    def best_designs(self, best: Design) -> list[Design]:
        """Return the designs so far, that one first, then the others from the best to the worst."""
        ordered = sorted(self.history, key=lambda entry: (entry[0] != best, entry[1]))
        return list(dict.fromkeys([best, *(design for design, _, _ in ordered)]))

    def _tried(self, designs: Sequence[Design], robust: bool) -> np.ndarray:
        """Return the amplitudes of `judge`, and keep them in the history."""
        amplitudes = self.judge(designs, robust)
        self.history += [(design, float(a), robust) for design, a in zip(designs, amplitudes, strict=True)]
        return amplitudes

    def _design(self, values: Sequence[float] | np.ndarray) -> Design:
        """Return the design of the variables' values; the others are held."""
        held = {name: number.min for name, number in self.study.variables.items()}
        return self.study.design(held | dict(zip(self._variables, map(float, values), strict=True)))

    def judge(self, designs: Sequence[Design], robust: bool) -> np.ndarray:
        """Return the amplitudes (d,) of designs within the tolerances, or as they are."""
        return self._judged(*self._run(designs, self.sample if robust else self.sample[:1]))

    def _judged(self, damped: np.ndarray, undamped: np.ndarray, excess: np.ndarray) -> np.ndarray:
        """Return the amplitudes (d,) of what counts of runs (d, s, f).

        Beyond a limit a design has damped nothing, and is the worse the farther it is beyond.
        """
        table = self.study.table
        # a design with a run that is not ok has damped nothing
        bad = np.isnan(damped)
        damped = np.where(bad, np.fmax(undamped, 1.0), damped)
        band = damped.max(axis=2) if table.over_band == "worst" else damped.mean(axis=2)
        amplitudes = band.max(axis=1) if table.over_tolerances == "worst" else band.mean(axis=1)
        beyond = np.fmax.reduce(excess, axis=(1, 2))
        lost = bad.any(axis=(1, 2)) | (beyond > 0.0)
        return np.where(lost, np.fmax(amplitudes, 1.0) * (1.0 + np.fmax(beyond, 0.0)), amplitudes)

    def _run(
        self, designs: Sequence[Design], sample: Sequence[_Deviation]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the amplitudes (d, s, f) over the reference at the same level, with the bodies and without, and by
        how much runs exceed their limits.

        nan with the bodies where a run is not ok, and without them where it is no scene.
        """  # fmt: skip
        shape = (len(designs), len(sample), len(self.study.frequencies))
        damped, undamped, excess = np.zeros((3, *shape))
        more = [self.study.level_deviation(deviation) if self.study.table.linear else 0.0 for deviation in sample]
        levels = self.study.reference * (1 + np.array(more))[:, None]
        for count in sorted({design.bodies for design in designs}):
            places = [place for place, design in enumerate(designs) if design.bodies == count]
            changes = self.study.changes(designs[places[0]])
            moved = [self.study.moved(changes, designs[place], deviation) for place in places for deviation in sample]
            points = [drive(self.study.scene, float(f)) | each for each in moved for f in self.study.frequencies]
            run = self._kept.run(self.study.with_bodies(count), points, self._executor, self._tell)
            self.scenes += len(points)
            ok = run[:, 3] == 1.0
            self.trouble += int(np.count_nonzero(~ok))
            for amplitudes, values in ((damped, np.where(ok, run[:, 0], np.nan)), (undamped, run[:, 1])):
                amplitudes[places] = values.reshape(len(places), *shape[1:]) / levels
            excess[places] = run[:, 2].reshape(len(places), *shape[1:])
        return damped, undamped, excess

    def _tell(self, done: int) -> None:
        """Show progress: the runs done of the list at hand."""
        if self._progress is not None:
            done += self.scenes + self._others
            self._progress(done, max(self._expected, done))


_KEYS = (
    "damped_peak", "damped_peak_at", "peak_ratio", "undamped_peak", "undamped_peak_at", "fixed_peak", "fixed_peak_at",
    "peak_at_edge", "undamped_at_edge", "fixed_at_edge", "spacing", "half_power_width", "too_coarse", "points",
    "points_left_out",
)  # fmt: skip


def _of_band(headline: Headline) -> dict[str, Any]:
    """Return the results of a headline on the measure in the band."""
    data: dict[str, Any] = finite(headline.to_json())
    return {key: data[key] for key in _KEYS}


def _sentence(
    study: Study, nominal: Optimum, robust: Optimum, headlines: Mapping[str, Headline],
    starts: Mapping[str, dict[str, Any]],
) -> str:  # fmt: skip
    table = study.table
    if not table.by_amplitude:
        return _measured_sentence(study, nominal, robust)
    if table.over_band == "mean":
        of = "the mean without bodies in the band"
    elif headlines["nominal"].undamped_at_edge:
        of = f"the highest amplitude without bodies in the band, {study.reference:.3g} m"
    else:
        of = "the maximum without bodies (worst in the band)"
    left = f"{1 - nominal.reduction:.0%} left"
    text = f"{_format_design(nominal.design, study)} gains {nominal.reduction:.0%} of {of} ({left}); "
    text += worst_words(starts["nominal"])
    if study.widths:
        kind = "at worst" if table.over_tolerances == "worst" else "in the mean"
        text += (
            f"; it gains {nominal.reduction_tolerances:.0%} {kind} within the tolerances; robust: "
            f"{_format_design(robust.design, study)} gains {robust.reduction:.0%}, "
            f"{robust.reduction_tolerances:.0%} {kind}; {worst_words(starts['robust'])}"
        )
    remarks = dict.fromkeys(remark for headline in headlines.values() for remark in headline.remarks)
    return f"{'; '.join([text, *remarks])}."


def _measured_sentence(study: Study, nominal: Optimum, robust: Optimum) -> str:
    """Return the answer where stress, life or wear counts."""
    table = study.table
    of = {
        "stress": f"of the stress without bodies ({study.reference / 1e6:.4g} MPa)",
        "life": f"of the worst hot spot's life used in {SERVICE:g} h",
        "wear": f"of X worn off in {SERVICE:g} h",
    }.get(table.measure, f"of the limit of {table.measure}")
    text = f"{_format_design(nominal.design, study)}: {nominal.amplitude:.3g} {of}, {table.over_band} of the band"
    if study.widths:
        text += (
            f"; {nominal.amplitude_tolerances:.3g} within the tolerances; robust: "
            f"{_format_design(robust.design, study)}: {robust.amplitude:.3g}, {robust.amplitude_tolerances:.3g} within"
        )
    return f"{text}; one start only: every run begins as the scene."


def _format_design(design: Design, study: Study) -> str:
    text = "1 body" if design.bodies == 1 else f"{design.bodies} bodies"
    if design.mass_ratio is not None:
        text += f" of together {design.mass_ratio:.2%} of the mass ({1e3 * design.mass_ratio * study.mass:.3g} g)"
    named = [f"{path} = {value:.4g} {unit_of(path)}".removesuffix(" 1") for path, value in design.numbers]
    if design.gap_ratio is not None:
        named = [f"a gap of {design.gap_ratio:.2f} X ({1e6 * design.gap_ratio * study.amplitude:.3g} µm)", *named]
    if not design.bodies:
        return ", ".join(named)
    return f"{text} with {', '.join(named)}" if named else text
