"""The automatic choice of a model on trial: is the error it promises kept, and could a cheaper model have kept it?

Every scene runs with all numbers of modes. The error of a model is the largest deviation, over three frequencies around
the damped peak, of its mean amplitude from that of the whole model, in units of the undamped peak. Its cost is CPU time
per period, within runs and in turns.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.engine.inside import times_in_turns
from benchmarks.model_order.scenes import Trial, trials
from benchmarks.rows import Take, at_once
from vanedamp.coupling.model_order.selection import select_model_orders
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.store import write_csv

TOLERANCES = (0.1, 0.03, 0.01)
#: periods of a scene for which a choice is made: for few it is the whole model
LONG = 40_000
#: a model: number of natural modes, and whether attachment modes come with them
Kind = tuple[int, bool]
_STARTS = (-0.3, 0.2)
#: numbers of modes tried, without and with attachment modes, in addition to those chosen and all of them
_COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 20, 25, 32)
#: rounds of the clocks, and between which periods of a run they measure
_ROUNDS, _LENGTHS = 3, (50, 150)


@dataclass(frozen=True)
class Verdict:
    """One scene and tolerance: what was chosen, what it turned out to be, and the cheapest model within the tolerance.

    Models by `format_model`; errors in units of the undamped peak; confidence: of the error, 95 %; costs in s a period.
    """

    scene: str
    tolerance: float
    modes: str
    estimate: float
    error: float
    confidence: float
    cost: float
    cheapest_modes: str
    cheapest_cost: float

    @property
    def kept(self) -> bool:
        """Say whether the error is within the tolerance."""
        return self.error <= self.tolerance

    @property
    def ratio(self) -> float:
        """Cost over that of the cheapest model within the tolerance."""
        return self.cost / self.cheapest_cost


def trial_rows(counts: Mapping[str, int]) -> list[str]:
    """Return the rows of a trial in their order, one a scene."""
    structures = [structure for structure, count in counts.items() for _ in range(count)]
    return [f"automatic choice, {structure} {index}" for index, structure in enumerate(structures, 1)]


def run_trial(folder: Path, seed: int, counts: dict[str, int], periods: int, take: Take = at_once) -> list[Verdict]:
    """Return verdicts of a number of scenes of each structure, written to auto.csv of the folder.

    take: rows trial_rows.
    """
    drawn = trials(folder, seed, counts)
    verdicts: list[Verdict] = []
    for index, (row, trial) in enumerate(zip(trial_rows(counts), drawn, strict=True), 1):
        judged = take(row, partial(_judged, trial, f"{trial.structure} {index}", periods))
        verdicts += [Verdict(**item) for item in judged]
    names = list(asdict(verdicts[0]))
    rows = [[*asdict(item).values(), item.kept, item.ratio] for item in verdicts]
    write_csv(folder / "auto.csv", [*names, "kept", "ratio"], rows)
    return verdicts


def _judged(trial: Trial, name: str, periods: int) -> list[dict[str, Any]]:
    return [asdict(verdict) for verdict in judge(trial, name, periods)]


def judge(trial: Trial, name: str, periods: int) -> list[Verdict]:
    """Return the verdicts of one scene, one for each tolerance."""
    scenes = [trial.scene.replace({"excitation.frequency": frequency}) for frequency in trial.frequencies]
    chosen: dict[float, dict[str, Any]] = {}
    for tolerance in TOLERANCES:
        chosen[tolerance] = chosen_for(trial, tolerance)
    kinds = _kinds(chosen.values())
    deviations, confidences = errors(scenes, kinds, trial.undamped, periods)
    costs = _costs(scenes[len(scenes) // 2], kinds)
    verdicts = []
    for tolerance, estimate in chosen.items():
        place = kinds.index((estimate["modes"], estimate["attached"]))
        within = [i for i, error in enumerate(deviations) if error <= tolerance]
        best = min(within, key=lambda i: costs[i])
        verdicts.append(
            Verdict(
                name, tolerance, format_model(kinds[place]), float(estimate["error"]), float(deviations[place]),
                float(confidences[place]), float(costs[place]), format_model(kinds[best]), float(costs[best]),
            )
        )  # fmt: skip
    return verdicts


def chosen_for(trial: Trial, tolerance: float) -> dict[str, Any]:
    """Return the estimate of the model that is chosen for a trial's band and a tolerance."""
    scene = trial.scene.replace({"structure.tolerance": tolerance, "time.periods": LONG})
    scene = scene.replace({"excitation.resonance_near": [min(trial.band), max(trial.band)]})
    scenes = [scene.replace({"excitation.frequency": frequency}) for frequency in trial.band]
    estimate = select_model_orders(scenes)[0].estimate
    assert estimate is not None
    return estimate


def format_model(kind: Kind) -> str:
    """Return a model as text: "3", or "3+" with attachment modes."""
    return f"{kind[0]}{'+' * kind[1]}"


def _kinds(chosen: Collection[Mapping[str, Any]]) -> list[Kind]:
    """Return the models to try, the whole one last."""
    rungs = {(rung["modes"], rung["attached"]) for estimate in chosen for rung in estimate["ladder"]}
    whole = max(rungs)[0]
    # attachment modes make a model larger, so that many modes with them are the whole
    tried = {(count, attached) for count in _COUNTS for attached in (False, True) if count < whole - attached * 4}
    picked = {(estimate["modes"], estimate["attached"]) for estimate in chosen}
    return [*sorted((tried | picked) - {(whole, False)}), (whole, False)]


def errors(
    scenes: Sequence[Scene], kinds: Sequence[Kind], undamped: float, periods: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors (kinds,) of models against the last, and the 95 % confidence of each.

    undamped: m; the scenes differ in frequency.
    """
    means, widths = np.zeros((2, len(kinds), len(scenes)))
    for i, kind in enumerate(kinds):
        for j, scene in enumerate(scenes):
            runs = [simulate(_fixed(scene, kind, periods, start)) for start in _STARTS]
            means[i, j] = np.mean([run.amplitude_mean for run in runs]) / undamped
            parts = [run.amplitude_mean_confidence or 0.0 for run in runs]
            widths[i, j] = np.linalg.norm(parts) / len(parts) / undamped
    deviations = np.abs(means - means[-1])
    worst = (np.arange(len(kinds)), deviations.argmax(axis=1))
    return deviations[worst], np.hypot(widths, widths[-1])[worst]


def _costs(scene: Scene, kinds: Sequence[Kind]) -> np.ndarray:
    """Return the seconds per period (kinds,), medians over the rounds."""
    models = {format_model(kind): _fixed(scene, kind, _LENGTHS[1], _STARTS[0]) for kind in kinds}
    times = times_in_turns(models, _LENGTHS, _ROUNDS, np.random.default_rng(0))
    return np.array([np.median(values) for values in times.values()])


def _fixed(scene: Scene, kind: Kind, periods: int, start: float) -> Scene:
    modes, attached = kind
    structure = scene.to_dict()["structure"] | {"modes": modes, "natural": True, "attached": attached}
    return scene.replace({
        "structure": structure, "time.periods": periods, "time.transient": periods // 8,
        "damper.0.position": start * scene.cavity[0].gap,
    })  # fmt: skip


def summary(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return how many kept their tolerance, and within twice the cheapest cost, and the largest of both ratios."""
    return {
        "verdicts": [asdict(item) | {"kept": item.kept, "ratio": item.ratio} for item in verdicts],
        "number": len(verdicts),
        "kept": sum(item.kept for item in verdicts),
        "within_twice": sum(item.ratio <= 2.0 for item in verdicts),
        "largest_ratio": max(item.ratio for item in verdicts),
        "largest_error": max(item.error / item.tolerance for item in verdicts),
    }


def trial_text(result: dict[str, Any]) -> Iterator[str]:
    """Yield the verdicts as lines."""
    yield ("automatic choice: scene, tolerance, modes, estimated and true error (95 %), cost, cheapest model, ratio")
    for row in result["verdicts"]:
        yield (
            f"  {row['scene']:11} {row['tolerance']:5}  {row['modes']:>3}  {row['estimate']:.4f}  {row['error']:.4f} "
            f"({row['confidence']:.4f})  {1e6 * row['cost']:6.1f} us  {row['cheapest_modes']:>3}  {row['ratio']:.2f}"
            + ("" if row["kept"] else "  MISSED")
        )
    yield (
        f"  {result['kept']} of {result['number']} within their tolerance, {result['within_twice']} within twice the "
        f"cheapest cost (largest ratio {result['largest_ratio']:.2f})"
    )
