"""Does `modes = "auto"` answer as the whole model does from the same start? Random chains and figure 12, four starts.

    python -m benchmarks.model_order.starts [FIRST [COUNT]]
    python -m benchmarks.model_order.starts figure12

The runs are long, so that a choice is made at all: for few periods it is the whole model. A miss is a mean amplitude
that differs by more than the tolerance, of the peak without bodies; a sure one by more than both confidences as well.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.model_order.scenes import chain_trial
from benchmarks.model_order.trial import LONG
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import Chosen, choose
from vanedamp.coupling.model_order.confirmation import with_modes
from vanedamp.coupling.scene.scene import Scene, Time

#: chains that nothing was settled on, tolerance, and positions at which the body begins, of its gap
SEED, COUNT, TOLERANCE, STARTS = 4000, 100, 0.02, (0.0, -0.3, 0.2, 0.45)
_RUN = Time(3000, 1000)


@dataclass(frozen=True)
class Verdict:
    """A choice of modes against the whole model. (s,): differences of means by start, their confidences, over the peak.

    apart: range of the whole model's means; seconds: of the choice, and of a run of the whole model with the default
    length.
    """

    model: str
    whole: int
    warned: bool
    errors: np.ndarray
    confidences: np.ndarray
    apart: float
    choice_seconds: float
    run_seconds: float

    def missed(self, surely: bool = False) -> bool:
        """Say whether the tolerance is exceeded from one of the starts."""
        return bool(np.any(self.errors - surely * self.confidences > TOLERANCE))

    def __str__(self) -> str:
        errors = " ".join(f"{error:.3f}" for error in self.errors)
        notes = " MISSED" * self.missed() + " surely" * self.missed(True) + " warned" * self.warned
        return f"{self.model:>4} of {self.whole}, off by {errors}, {self.choice_seconds:.2f} s" + notes


def judge(scene: Scene, undamped: float) -> Verdict:
    """Return the verdict on a scene with an open number of modes. undamped: peak without bodies, m."""
    began = time.thread_time()
    chosen = choose(scene)
    choice_seconds = time.thread_time() - began
    estimate: dict[str, Any] = chosen.estimate or {}
    size = estimate["ladder"][-1]["modes"]
    own, whole = chosen.scene, with_modes(scene, size)
    began = time.thread_time()
    respond(replace(whole, time=Time()))
    run_seconds = time.thread_time() - began
    means, confidences = _means(whole, undamped)
    others = (means, confidences) if own.structure == whole.structure else _means(own, undamped)
    return Verdict(
        f"{estimate['modes']}{'+' * estimate['attached']}", size, _warned(chosen), np.abs(others[0] - means),
        np.hypot(others[1], confidences), float(np.ptp(means)), choice_seconds, run_seconds,
    )  # fmt: skip


def _warned(chosen: Chosen) -> bool:
    return any("steady states differ" in warning for warning in chosen.warnings)


def _means(scene: Scene, undamped: float) -> np.ndarray:
    """Return mean amplitudes and their confidences (2, s), over the peak."""
    places = [start * scene.cavity[0].gap for start in STARTS]
    runs = [respond(replace(scene.replace({"damper.0.position": place}), time=_RUN)) for place in places]
    return np.array([[run.amplitude_mean, run.amplitude_mean_confidence or 0.0] for run in runs]).T / undamped


def chain_verdict(seed: int, folder: Path) -> Verdict:
    """Return the verdict on a random chain, whose model is left in the folder."""
    trial = chain_trial(folder / f"chain{seed}.h5", seed)
    scene = trial.scene.replace({"structure.tolerance": TOLERANCE, "time.periods": LONG})
    return judge(scene, trial.undamped)


def _chains(first: int, count: int) -> None:
    verdicts = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            verdicts.append(chain_verdict(seed, Path(folder)))
            print(seed, verdicts[-1], flush=True)
    spent = np.array([[found.choice_seconds, found.run_seconds] for found in verdicts])
    missed, surely, warned, whole = (
        sum(values) for values in zip(*(
            (found.missed(), found.missed(True), found.warned, found.model == str(found.whole)) for found in verdicts
        ), strict=True)
    )  # fmt: skip
    print(
        f"{count} chains: {missed} beyond {TOLERANCE}, {surely} surely; {warned} warned; {whole} take the whole model"
    )
    choice, run = spent.sum(axis=0)
    print(f"choices {choice:.1f} s, runs {run:.1f} s, median ratio {np.median(spent[:, 0] / spent[:, 1]):.1f}")


def _figure_12(folder: Path) -> None:
    """Print the choice for the demonstration's figure 12, and what one mode and the choice miss at its points."""
    from vanedamp.coupling.sweep.grid import Points, grid
    from vanedamp.studies.demo.demo import EFFORT, FIGURES
    from vanedamp.studies.demo.figure_study import Session, prepare

    structure = prepare(folder)
    figure = Session(structure, folder, None, EFFORT).figure(FIGURES["fig12"].file)
    scene, peak = figure.scenes["reduced"], structure.amplitude
    began = time.thread_time()
    points = grid(scene)
    seconds = time.thread_time() - began
    estimate = points.estimate or {}
    print(f"choice, {seconds:.1f} s: {estimate['sentence']}", *points.warnings, sep="\n")
    models = {"one mode": 1, "choice": estimate["modes"], "whole model": estimate["ladder"][-1]["modes"]}
    bare = Points(points.base)
    made = [bare.raw(values) for values in scene.sweep_points()[1]]
    means = {
        modes: np.array([_means(with_modes(item, modes), peak) for item in made]) for modes in set(models.values())
    }
    whole = means[models["whole model"]]
    for name, modes in models.items():
        errors = np.abs(means[modes] - whole)
        beyond = errors[:, 0].max(axis=1) > estimate["tolerance"]
        surely = (errors[:, 0] - np.hypot(means[modes], whole)[:, 1] > estimate["tolerance"]).any(axis=1)
        print(f"{name}: {beyond.sum()} of {len(made)} points beyond {estimate['tolerance']}, {surely.sum()} surely")


def main(arguments: Sequence[str]) -> None:
    """Print the verdicts."""
    if list(arguments) == ["figure12"]:
        with tempfile.TemporaryDirectory() as folder:
            _figure_12(Path(folder))
    else:
        _chains(*(int(given) for given in [*arguments, *[str(SEED), str(COUNT)][len(arguments) :]]))


if __name__ == "__main__":
    main(sys.argv[1:])
