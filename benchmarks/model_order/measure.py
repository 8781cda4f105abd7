"""The ladder of models, charted: contact laws against the number of modes, error against cost.

A bar on a wall, which has an exact solution; the shipped cluster with a loose body, all laws against one finest model;
and the automatic choices, of a number of modes and of slider or block, on trial.

The finest model of the cluster is the one with the most modes and a contact that yields by its own spring and by what
these modes lack of the wall's flexibility. Its contact has a limit as modes are added, and a loss that is given;
Newton's law has no limit, and a massless boundary without loss is another contact.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result
from benchmarks.engine.inside import times_in_turns
from benchmarks.model_order.bar_on_wall import LAWS as BAR_LAWS
from benchmarks.model_order.bar_on_wall import bounce
from benchmarks.model_order.body_trial import SEED as BODY_SEED
from benchmarks.model_order.body_trial import body_rows, body_trial_text, run_body_trial
from benchmarks.model_order.body_trial import summary as body_summary
from benchmarks.model_order.scenes import SEED
from benchmarks.model_order.structures import cluster_model
from benchmarks.model_order.trial import run_trial, summary, trial_rows, trial_text
from benchmarks.rows import Rows, Take, at_once
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import warm_up
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless

#: contact tables of the cluster's scenes; stiffness: shorter contacts than the first 25 modes can follow
LAWS: dict[str, dict[str, Any]] = {
    "newton": {"law": "newton"},
    "compliant": {"law": "compliant", "stiffness": 1e8},
    "compliant and residual": {"law": "compliant", "stiffness": 1e8, "residual": True},
    "residual alone": {"law": "compliant", "residual": True},
    "massless": {"law": "massless"},
}
#: the law of the finest model, against which all are measured
REFERENCE = "compliant and residual"
# share of the structure's mass in the body, of the undamped maximum in the gap, and restitution where a law has one
_BODY, _GAP, _RESTITUTION = 0.02, 0.5, 0.7
_AMPLITUDE = 3e-5
# where a body starts, of its gap: several steady states can exist
_STARTS = (0.0, 0.3)
# rounds of the clocks, and between which periods of a run they measure
_ROUNDS, _LENGTHS = 3, (50, 150)
_BAR, _TIMES = "bar on a wall", "cluster: times"


@dataclass(frozen=True)
class Ladder(Benchmark):
    """Sizes of models, numbers of runs and lengths of them."""

    degree: int
    modes: tuple[int, ...]
    frequencies: int
    periods: int
    bar_modes: tuple[int, ...]
    trials: dict[str, int]
    trial_periods: int
    body_trials: int
    body_periods: int

    NAME = FILES = "ladder"

    def expected(self, folder: Path) -> dict[str, float]:
        runs = self.frequencies * len(_STARTS) * self.periods
        expected = {_BAR: 0.3 * len(self.bar_modes)}
        expected |= {_row(law, modes): 1e-5 * runs * (1 + 0.2 * modes) for law in LAWS for modes in self.modes}
        expected |= {_TIMES: 5.0} | dict.fromkeys(trial_rows(self.trials), 0.03 * self.trial_periods)
        return expected | dict.fromkeys(body_rows(self.body_trials), 0.01 * self.body_periods)

    def measure(self, rows: Rows) -> Result:
        file = rows.folder / "ladder_rom.h5"
        cluster_model(self.degree, max(self.modes)).save(file)
        result: Result = {"bar": rows.take(_BAR, partial(bar_errors, self.bar_modes))}
        result["cluster"] = cluster_curves(file, self, rows.take)
        result["auto"] = summary(run_trial(rows.folder, SEED, self.trials, self.trial_periods, rows.take))
        verdicts = run_body_trial(rows.folder, BODY_SEED, self.body_trials, self.body_periods, rows.take)
        return result | {"bodies": body_summary(verdicts) | {"periods": self.body_periods}}

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.model_order import figures

        figures.bar_figure(result["bar"], folder / "ladder_bar.png")
        figures.cluster_figure(result["cluster"], folder / "ladder_cluster.png")
        figures.auto_figure(result["auto"], folder / "ladder_auto.png")
        figures.bodies_figure(result["bodies"], folder / "ladder_bodies.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the errors and verdicts."""
        bar, cluster = result["bar"], result["cluster"]
        yield "bar on a wall, error of the second apex's time, by modes " + ", ".join(map(str, bar["modes"]))
        for law, errors in bar["time"].items():
            yield f"  {law:10} " + "  ".join(f"{error:.1e}" for error in errors)
        finest = f"{cluster['reference']['law']}, {cluster['reference']['modes']} modes"
        yield f"cluster, error of the mean amplitude against {finest}, by modes " + ", ".join(
            map(str, cluster["modes"])
        )
        for law, entry in cluster["laws"].items():
            yield f"  {law:22} " + "  ".join(f"{error:.1e}" for error in entry["error"])
        yield from trial_text(result["auto"])
        yield from body_trial_text(result["bodies"])


FULL = Ladder(
    2, (1, 2, 3, 6, 12, 25, 60), 9, 1500, (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30),
    {"cluster": 4, "rod": 3, "beam": 3}, 2000, 40, 2000,
)  # fmt: skip
QUICK = Ladder(1, (1, 2, 3, 6, 12), 3, 1200, (1, 2, 4, 8), {"cluster": 1, "beam": 1}, 200, 3, 900)


def _row(law: str, modes: int) -> str:
    return f"cluster, {law}, {modes} modes"


def bar_errors(counts: tuple[int, ...]) -> dict[str, Any]:
    """Measure the errors of the bar's second apex, in time and height, for each law and number of modes."""
    runs = {law: [bounce(modes, law) for modes in counts] for law in BAR_LAWS}
    return {
        "modes": list(counts),
        "time": {law: [run.time for run in of] for law, of in runs.items()},
        "height": {law: [run.height for run in of] for law, of in runs.items()},
        "energy": max(run.energy for of in runs.values() for run in of),
    }


def cluster_curves(file: Path, effort: Ladder, take: Take = at_once) -> dict[str, Any]:
    """Measure mean amplitudes over the frequencies, their error and cost, for each law and number of natural modes."""
    model = ReducedModel.load(file)
    first = float(model.natural_frequencies_hz[0])
    mass = 1.0 / float((massless(model, 1).row("shroud") ** 2)[0])
    frequencies = first * np.linspace(0.975, 1.005, effort.frequencies)

    def scenes(law: str, modes: int) -> list[Scene]:
        return [_scene(file, modes, LAWS[law], mass, frequency, effort) for frequency in frequencies]

    warm_up()
    curves: dict[str, Any] = {}
    for law in LAWS:
        points = [take(_row(law, modes), partial(_point, scenes(law, modes))) for modes in effort.modes]
        curves[law] = {
            "amplitude": [point["amplitude"] for point in points],
            "confidence": [point["confidence"] for point in points],
            "status": [point["status"] for point in points],
        }
    middle = {
        f"{law}/{modes}": scenes(law, modes)[len(frequencies) // 2] for law in LAWS for modes in effort.modes
    }  # fmt: skip
    times = take(_TIMES, partial(_times, middle))
    finest = np.array(curves[REFERENCE]["amplitude"][-1])
    for law, entry in curves.items():
        entry["seconds_per_period"] = [times[f"{law}/{modes}"] for modes in effort.modes]
        deviations = (np.array(entry["amplitude"]) - finest) / _AMPLITUDE
        entry["error"] = np.sqrt(np.mean(deviations**2, axis=1)).tolist()
        entry["peak_error"] = (np.max(entry["amplitude"], axis=1) / _AMPLITUDE - finest.max() / _AMPLITUDE).tolist()
    return {
        "modes": list(effort.modes), "frequencies_hz": frequencies.tolist(), "undamped": _AMPLITUDE, "laws": curves,
        "periods": effort.periods, "reference": {"law": REFERENCE, "modes": effort.modes[-1]},
    }  # fmt: skip


def _point(scenes: Sequence[Scene]) -> dict[str, Any]:
    """Return mean amplitudes, their confidences (m) and the status of all runs of one law and number of modes."""
    runs = [[simulate(_from(scene, start)) for start in _STARTS] for scene in scenes]
    return {
        "amplitude": [float(np.mean([run.amplitude_mean for run in pair])) for pair in runs],
        "confidence": [
            float(np.linalg.norm([run.amplitude_mean_confidence or 0.0 for run in pair])) / len(pair) for pair in runs
        ],
        "status": [run.status.value for pair in runs for run in pair],
    }  # fmt: skip


def _times(scenes: Mapping[str, Scene]) -> dict[str, float]:
    """Return the seconds a period of scenes, medians over the rounds."""
    times = times_in_turns(scenes, _LENGTHS, _ROUNDS, np.random.default_rng(0))
    return {name: float(np.median(values)) for name, values in times.items()}


def _from(scene: Scene, start: float) -> Scene:
    return scene.replace({"damper.0.position": start * scene.cavity[0].gap})


def _scene(file: Path, modes: int, contact: Mapping[str, Any], mass: float, frequency: float, effort: Ladder) -> Scene:
    damper = {"cavity": "c1", "mass": _BODY * mass, "friction": 0.4}
    if contact["law"] != "massless":
        damper["restitution"] = _RESTITUTION
    data = {
        "structure": {"model": "rom", "file": str(file), "modes": modes, "natural": True},
        "excitation": {"frequency": float(frequency), "resonance_amplitude": _AMPLITUDE, "at": "shroud"},
        "cavity": [{"name": "c1", "gap": _GAP * _AMPLITUDE, "floor": "c1_floor"}],
        "damper": [damper],
        "contact": dict(contact),
        "time": {"periods": effort.periods, "transient": effort.periods // 3},
    }
    return validate(Scene, data, "scene")
