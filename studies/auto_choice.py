"""The automatic choice of a model on trial: is the error it promises kept, and could a cheaper model have kept it?

Every scene runs with all numbers of modes. The error of a model is the largest deviation, over three frequencies around
the damped peak, of its mean amplitude from that of the whole model, in units of the undamped peak. Its cost is CPU time
per period, within runs and in turns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from coupling.choice import settle_all
from coupling.engine import simulate
from coupling.scene import Scene
from modal.store import write_csv
from studies.auto_scenes import Trial, trials
from studies.bench_inside import time_of_a_period
from studies.timing import in_turns

TOLERANCES = (0.1, 0.03, 0.01)
_STARTS = (-0.3, 0.2)
#: numbers of modes tried, besides those chosen and all of them
_COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 20, 25, 32)
#: rounds of the clocks, and between which periods of a run they measure
_ROUNDS, _LENGTHS = 3, (50, 150)


@dataclass(frozen=True)
class Verdict:
    """One scene and tolerance: what was chosen, what it turned out to be, and the cheapest model within the tolerance.

    Errors in units of the undamped peak; confidence: of the error, 95 %; costs in seconds per period.
    """

    scene: str
    tolerance: float
    modes: int
    estimate: float
    error: float
    confidence: float
    cost: float
    cheapest_modes: int
    cheapest_cost: float

    @property
    def kept(self) -> bool:
        """Whether the error is within the tolerance."""
        return self.error <= self.tolerance

    @property
    def ratio(self) -> float:
        """Cost over that of the cheapest model within the tolerance."""
        return self.cost / self.cheapest_cost


def run_trial(
    folder: Path, seed: int, counts: dict[str, int], periods: int, report: Callable[[int, int], None]
) -> list[Verdict]:
    """Verdicts of so many scenes of each structure; written to auto.csv of the folder."""
    drawn = trials(folder, seed, counts)
    verdicts: list[Verdict] = []
    for index, trial in enumerate(drawn):
        verdicts += judge(trial, f"{trial.structure} {index + 1}", periods)
        report(index + 1, len(drawn))
    names = list(asdict(verdicts[0]))
    rows = [[*asdict(item).values(), item.kept, item.ratio] for item in verdicts]
    write_csv(folder / "auto.csv", [*names, "kept", "ratio"], rows)
    return verdicts


def judge(trial: Trial, name: str, periods: int) -> list[Verdict]:
    """Verdicts of one scene, one for each tolerance."""
    scenes = [trial.scene.replace({"excitation.frequency": frequency}) for frequency in trial.frequencies]
    chosen: dict[float, dict[str, Any]] = {}
    for tolerance in TOLERANCES:
        settled = settle_all([scene.replace({"structure.tolerance": tolerance}) for scene in scenes])
        assert settled[0].estimate is not None
        chosen[tolerance] = settled[0].estimate
    whole = max(rung["modes"] for rung in chosen[TOLERANCES[0]]["ladder"])
    picked = {estimate["modes"] for estimate in chosen.values()}
    counts = sorted({count for count in _COUNTS if count < whole} | picked | {whole})
    deviations, confidences = errors(scenes, counts, trial.undamped, periods)
    costs = _costs(scenes[len(scenes) // 2], counts)
    found = []
    for tolerance, estimate in chosen.items():
        place = counts.index(estimate["modes"])
        within = [i for i, error in enumerate(deviations) if error <= tolerance]
        best = min(within, key=lambda i: costs[i])
        found.append(
            Verdict(
                name, tolerance, estimate["modes"], float(estimate["error"]), float(deviations[place]),
                float(confidences[place]), float(costs[place]), counts[best], float(costs[best]),
            )
        )  # fmt: skip
    return found


def errors(
    scenes: Sequence[Scene], counts: Sequence[int], undamped: float, periods: int
) -> tuple[np.ndarray, np.ndarray]:
    """Errors (counts,) of models with so many modes, which are ascending, against the last; 95 % confidence of each.

    undamped: m; the scenes differ in frequency.
    """
    means, widths = np.zeros((2, len(counts), len(scenes)))
    for i, modes in enumerate(counts):
        for j, scene in enumerate(scenes):
            runs = [simulate(_fixed(scene, modes, periods, start)) for start in _STARTS]
            means[i, j] = np.mean([run.amplitude_mean for run in runs]) / undamped
            parts = [run.amplitude_mean_confidence or 0.0 for run in runs]
            widths[i, j] = np.linalg.norm(parts) / len(parts) / undamped
    deviations = np.abs(means - means[-1])
    worst = (np.arange(len(counts)), deviations.argmax(axis=1))
    return deviations[worst], np.hypot(widths, widths[-1])[worst]


def _costs(scene: Scene, counts: Sequence[int]) -> np.ndarray:
    """Seconds per period (counts,), medians over the rounds."""
    clocks = {
        str(modes): partial(time_of_a_period, _fixed(scene, modes, _LENGTHS[1], _STARTS[0]), _LENGTHS)
        for modes in counts
    }
    times = in_turns(clocks, _ROUNDS, np.random.default_rng(0))
    return np.array([np.median(times[str(modes)]) for modes in counts])


def _fixed(scene: Scene, modes: int, periods: int, start: float) -> Scene:
    return scene.replace({
        "structure.modes": modes, "structure.natural": True, "time.periods": periods, "time.transient": periods // 8,
        "damper.0.position": start * scene.cavity[0].gap,
    })  # fmt: skip


def summary(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """How many kept their tolerance, and within twice the cheapest cost, and the largest of both ratios."""
    return {
        "verdicts": [asdict(item) | {"kept": item.kept, "ratio": item.ratio} for item in verdicts],
        "number": len(verdicts),
        "kept": sum(item.kept for item in verdicts),
        "within_twice": sum(item.ratio <= 2.0 for item in verdicts),
        "largest_ratio": max(item.ratio for item in verdicts),
        "largest_error": max(item.error / item.tolerance for item in verdicts),
    }


def tell_trial(result: dict[str, Any]) -> None:
    """Print the verdicts."""
    print("automatic choice: scene, tolerance, modes, estimated and true error (95 %), cost, cheapest model, ratio")
    for row in result["verdicts"]:
        print(
            f"  {row['scene']:11} {row['tolerance']:5}  {row['modes']:3}  {row['estimate']:.4f}  {row['error']:.4f} "
            f"({row['confidence']:.4f})  {1e6 * row['cost']:6.1f} us  {row['cheapest_modes']:3}  {row['ratio']:.2f}"
            + ("" if row["kept"] else "  MISSED")
        )
    print(
        f"  {result['kept']} of {result['number']} within their tolerance, {result['within_twice']} within twice the "
        f"cheapest cost (largest ratio {result['largest_ratio']:.2f})"
    )
