"""The ladder of models, charted: contact laws against the number of modes, error against cost.

A bar on a wall, which has an exact solution, and the shipped cluster with a loose body, measured against its own finest
model: each law has a limit of its own, or none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coupling.engine import simulate
from coupling.inputs import InputError, read_toml, validate
from coupling.scene import Scene
from coupling.sweep import warm_up
from modal.store import finite, write_json
from rom.reduced import ReducedModel
from studies.bounce import LAWS as BAR_LAWS
from studies.bounce import bounce
from studies.provenance import versions
from studies.terminal import progress

#: contact tables of the cluster's scenes; stiffness: shorter contacts than the first 25 modes can follow
LAWS: dict[str, dict[str, Any]] = {
    "newton": {"law": "newton"},
    "compliant": {"law": "compliant", "stiffness": 1e8},
    "compliant and residual": {"law": "compliant", "stiffness": 1e8, "residual": True},
    "massless": {"law": "massless"},
}
# share of the structure's mass in the body, of the undamped maximum in the gap, and restitution where a law has one
_BODY, _GAP, _RESTITUTION = 0.02, 0.5, 0.7
_AMPLITUDE = 3e-5


@dataclass(frozen=True)
class Effort:
    """How much is computed."""

    degree: int
    modes: tuple[int, ...]
    frequencies: int
    periods: int
    bar_modes: tuple[int, ...]


FULL = Effort(2, (1, 2, 3, 6, 12, 25, 60), 9, 1500, (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30))
QUICK = Effort(1, (1, 2, 3, 6, 12), 3, 150, (1, 2, 4, 8))


def run_ladder(folder: Path, effort: Effort) -> dict[str, Any]:
    """Measure, and write ladder.json with its two figures to the folder, made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--output {folder}: cannot be made ({error.strerror})") from error
    file = folder / "ladder_rom.h5"
    cluster_model(effort).save(file)
    with progress("ladder") as report:
        result = {
            "bar": bar_errors(effort.bar_modes),
            "cluster": cluster_curves(file, effort, report),
            "versions": versions(),
        }
    write_json(folder / "ladder.json", finite(result))
    from studies.ladder_figures import bar_figure, cluster_figure

    bar_figure(result["bar"], folder / "ladder_bar.png")
    cluster_figure(result["cluster"], folder / "ladder_cluster.png")
    return result


def bar_errors(counts: tuple[int, ...]) -> dict[str, Any]:
    """Errors of the bar's second apex, in time and height, for each law and number of modes."""
    runs = {law: [bounce(modes, law) for modes in counts] for law in BAR_LAWS}
    return {
        "modes": list(counts),
        "time": {law: [run.time for run in of] for law, of in runs.items()},
        "height": {law: [run.height for run in of] for law, of in runs.items()},
        "energy": max(run.energy for of in runs.values() for run in of),
    }


def cluster_model(effort: Effort) -> ReducedModel:
    """The shipped cluster as the finest model of the study."""
    from meshes.vane_cluster import SHIPPED
    from studies.config import Case
    from studies.pipeline import assemble, reduction

    data = read_toml(Path(__file__).with_name("demo_case.toml"))
    data["mesh"] = {"file": str(SHIPPED), "degree": effort.degree}
    return reduction(assemble(validate(Case, data, "demo_case.toml")), max(effort.modes))


def cluster_curves(file: Path, effort: Effort, report: Callable[[int, int], None]) -> dict[str, Any]:
    """Mean amplitudes over the frequencies, and the cost, of each law and number of natural modes."""
    model = ReducedModel.load(file)
    first = float(model.natural_frequencies_hz[0])
    mass = 1.0 / float((model.massless(1).row("shroud") ** 2)[0])
    frequencies = first * np.linspace(0.975, 1.005, effort.frequencies)
    curves: dict[str, Any] = {}
    warm_up()
    done, total = 0, len(LAWS) * len(effort.modes)
    for law, contact in LAWS.items():
        curves[law] = {"amplitude": [], "confidence": [], "seconds_per_period": [], "status": []}
        for modes in effort.modes:
            runs = [simulate(_scene(file, modes, contact, mass, frequency, effort)) for frequency in frequencies]
            entry = curves[law]
            entry["amplitude"].append([run.amplitude_mean for run in runs])
            entry["confidence"].append([run.amplitude_mean_confidence or 0.0 for run in runs])
            entry["seconds_per_period"].append(
                float(np.median([run.wall_time_s / max(run.periods, 1) for run in runs]))
            )
            entry["status"].append([run.status.value for run in runs])
            done += 1
            report(done, total)
    for entry in curves.values():
        entry["error"] = _errors(entry)
    return {
        "modes": list(effort.modes), "frequencies_hz": frequencies.tolist(), "undamped": _AMPLITUDE, "laws": curves,
        "periods": effort.periods,
    }  # fmt: skip


def _errors(entry: Mapping[str, Any]) -> list[float]:
    """Root mean square over the frequencies against the same law with the most modes, relative to the undamped peak."""
    finest = np.array(entry["amplitude"][-1])
    return [float(np.sqrt(np.mean((np.array(curve) - finest) ** 2)) / _AMPLITUDE) for curve in entry["amplitude"]]


def _scene(file: Path, modes: int, contact: Mapping[str, Any], mass: float, frequency: float, effort: Effort) -> Scene:
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


def tell(result: Mapping[str, Any]) -> None:
    """Print the errors."""
    bar, cluster = result["bar"], result["cluster"]
    print("bar on a wall, error of the second apex's time, by modes " + ", ".join(map(str, bar["modes"])))
    for law, errors in bar["time"].items():
        print(f"  {law:10} " + "  ".join(f"{error:.1e}" for error in errors))
    print("cluster, error of the mean amplitude against the finest, by modes " + ", ".join(map(str, cluster["modes"])))
    for law, entry in cluster["laws"].items():
        print(f"  {law:22} " + "  ".join(f"{error:.1e}" for error in entry["error"]))
