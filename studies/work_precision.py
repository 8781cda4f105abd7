"""Speed against accuracy: every method on the same scenes, with the same machine, in turns.

Periodic scenes: largest error of response and slips at ten times of every period, relative to their ranges, against
the exact engine, whose own error is measured against 40 digits in studies.bench_engine. Scenes that never repeat: error
of the mean amplitude, with the 95 % confidence intervals of both means. Times are CPU times per excitation period from
runs of two lengths.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from coupling.engine import simulate
from coupling.response import Response
from coupling.scene import Scene
from modal.store import write_csv, write_json
from studies import method_scenes as scenes
from studies.terminal import progress
from studies.timing import Clock, in_turns, machine, seconds, spread

_SEED = 20_260_102
#: samples a period by which periodic responses are compared; also the least number of solve_ivp's steps
_SAMPLES = 10
#: periods over which models are compared, before chaos parts them, and the body's speed at the start (m/s)
_FIRST, _START = 3, 0.3
#: status of a run that was not made, and the tolerance of solve_ivp for means
DEAR, _ONE = "too dear for a mean", 1e-4
EXACT, IVP = "exact engine", "solve_ivp, DOP853 with events"


@dataclass(frozen=True)
class Effort:
    """Rounds of timing, steps per period, tolerances of solve_ivp, periods of comparison, of means, of the reference.

    ivp: periods of solve_ivp's means; dearest: steps that a mean may cost; timed: steps of a timed run; modes:
    fixed-interface modes of the cluster (None: no finite elements); ladder: those of the model ladder.
    """

    rounds: int
    steps: tuple[int, ...]
    tolerances: tuple[float, ...]
    checked: int
    means: int
    reference: int
    ivp: int
    dearest: float
    timed: int
    modes: int | None
    ladder: tuple[int, ...]


FULL = Effort(3, (100, 300, 1000, 3000, 10_000), (1e-4, 1e-6, 1e-8, 1e-10), 10, 2000, 30_000, 1000, 1e7, 200_000, 10,
              (0, 1, 2, 4, 7, 10, 15, 20))  # fmt: skip
QUICK = Effort(2, (100, 1000), (1e-4, 1e-8), 3, 200, 600, 40, 1e6, 50_000, None, ())


def run_work_precision(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure; write work_precision.json, .csv and a figure into a folder. Returns what the JSON holds."""
    started = time.perf_counter()
    rng = np.random.default_rng(_SEED)
    result: dict[str, Any] = {"machine": machine(), "seed": _SEED, "effort": asdict(effort), "charts": {}}
    folder.mkdir(parents=True, exist_ok=True)
    with progress("work-precision") as report, tempfile.TemporaryDirectory() as temporary:
        made = _scenes(effort, Path(temporary))
        for done, (name, (scene, repeats)) in enumerate(made.items()):
            report(done, len(made) + 1)
            result["charts"][name] = _chart(scene, repeats, effort, rng)
        if effort.modes is not None:
            result["ladder"] = _ladder(Path(temporary), effort, rng)
    result["wall_time_s"] = time.perf_counter() - started
    write_json(folder / "work_precision.json", result)
    _write_csv(result, folder / "work_precision.csv")
    from studies.method_figures import work_precision_figure

    work_precision_figure(result, folder / "work_precision.png")
    return result


def tell(result: Mapping[str, Any]) -> None:
    """Print for every chart whether the exact engine is on its Pareto front."""
    for name, chart in result["charts"].items():
        better = chart["dominated_by"]
        print(
            f"{name}: the exact engine is {'on the front' if not better else 'not on the front: ' + ', '.join(better)}"
        )


def _scenes(effort: Effort, folder: Path) -> dict[str, tuple[Scene, bool]]:
    """Scenes by name, and whether they repeat."""
    checked = {"time.periods": effort.checked, "time.transient": 0}
    made = {
        "periodic 1:1 impact": (scenes.periodic(3000).replace(checked), True),
        "chatter": (scenes.chatter().replace(checked), True),
        "single damper, non-periodic": (scenes.single(), False),
        "double damper in one cavity, non-periodic": (scenes.double(), False),
    }
    if effort.modes is not None:
        made["cluster, reduced model"] = (scenes.cluster(folder, effort.modes), False)
    return made


def _chart(scene: Scene, repeats: bool, effort: Effort, rng: np.random.Generator) -> dict[str, Any]:
    """Times and errors of every method on a scene."""
    periods = effort.checked if repeats else effort.reference
    reference = _run(scene, periods, repeats)
    variants = {(EXACT, 0.0): scene}
    for name, options in scenes.STEPPING.items():
        variants |= {
            (name, float(count)): scenes.by(scene, steps_per_period=count, **options) for count in effort.steps
        }
    variants |= {
        (IVP, rtol): scenes.by(scene, method="solve_ivp", rtol=rtol, steps_per_period=_SAMPLES)
        for rtol in effort.tolerances
    }
    points = [_point(key, variant, reference, repeats, effort) for key, variant in variants.items()]
    for point in points:
        # a method may fail later than in the periods that are compared
        lasts = variants[point["method"], point["setting"]].replace({"time.periods": _lengths(point, effort)[1]})
        if point["status"] == "ok":
            point["status"] = simulate(lasts).status.value
    good = [point for point in points if point["status"] == "ok"]
    clocks: dict[str, Clock] = {
        str(i): partial(_clock, variants[point["method"], point["setting"]], _lengths(point, effort))
        for i, point in enumerate(good)
    }
    for point, times in zip(good, in_turns(clocks, effort.rounds, rng).values(), strict=True):
        point["time"] = spread(np.maximum(times, 1e-9))
    exact = points[0]
    better = [
        f"{point['method']}, {point['setting']:g}"
        for point in good[1:]
        if point["time"]["median"] < exact["time"]["median"] and point["error"] <= max(exact["error"], exact["floor"])
    ]
    return {
        "scene": scene.to_dict(), "repeats": repeats, "classification": reference.classification,
        "impacts_per_period": reference.impacts_per_period, "points": points, "dominated_by": better,
    }  # fmt: skip


def _run(scene: Scene, periods: int, repeats: bool) -> Response:
    transient = 0 if repeats else max(periods // 4, min(500, periods // 2))
    return simulate(
        scene.replace({"time.periods": periods, "time.transient": transient}),
        samples_per_period=_SAMPLES if repeats else 0,
    )


def _point(key: tuple[str, float], scene: Scene, reference: Response, repeats: bool, effort: Effort) -> dict[str, Any]:
    """Status and error of one run; `floor` is the error below which the comparison cannot tell."""
    method, setting = key
    small = 10 if scene.solver.method == "cosim" else 1  # steps of the bodies within a macro-step
    periods = effort.checked if repeats else (effort.ivp if method == IVP else effort.means)
    if not repeats and (setting * small * periods > effort.dearest or (method == IVP and setting != _ONE)):
        # no error, rather than that of a run too short for its transient
        return {
            "method": method, "setting": setting, "status": DEAR, "error": None, "interval": None, "floor": 0.0,
            "energy_residual": 0.0, "penetration": 0.0, "time": None,
        }  # fmt: skip
    response = _run(scene, periods, repeats)
    error, floor, interval = None, 0.0, None
    if response.status.value == "ok" and repeats:
        ours, theirs = (np.column_stack([r.displacement, r.body_displacement]) for r in (response, reference))
        size = np.ptp(theirs, axis=0)
        error = float((np.abs(ours - theirs)[:, size > 0] / size[size > 0]).max())
        floor = 1e-13
    elif response.status.value == "ok":
        error = abs(response.amplitude_mean / reference.amplitude_mean - 1)
        interval = (response.amplitude_mean_confidence or 0.0) / reference.amplitude_mean
        floor = float(np.hypot(interval, (reference.amplitude_mean_confidence or 0.0) / reference.amplitude_mean))
    return {
        "method": method, "setting": setting, "status": response.status.value, "error": error, "interval": interval,
        "floor": floor, "energy_residual": response.energy_residual, "penetration": response.penetration, "time": None,
    }  # fmt: skip


def _lengths(point: Mapping[str, Any], effort: Effort) -> tuple[int, int]:
    """Two lengths of a run in periods, so that the longer takes some tenths of a second."""
    if point["method"] == IVP:
        return 1, 3
    long = effort.timed / (25 if point["method"] == EXACT else point["setting"])
    long = int(np.clip(long, 12, 20_000))
    return max(long // 6, 1), long


def _clock(scene: Scene, lengths: tuple[int, int]) -> float:
    short, long = (seconds(simulate, scene.replace({"time.periods": count, "time.transient": 0})) for count in lengths)
    return (long - short) / (lengths[1] - lengths[0])


def _ladder(folder: Path, effort: Effort, rng: np.random.Generator) -> dict[str, Any]:
    """The cluster from a start with an impact: reduced models by the exact engine, the whole mesh step by step.

    Error: largest of the periods' peaks over the first periods, against the finest reduced model, relative.
    """
    finest = scenes.cluster(folder, effort.ladder[-1]).replace({"damper.0.velocity": _START})
    made = {count: finest.replace({"structure.modes": count}) for count in effort.ladder}
    clocks: dict[str, Clock] = {str(count): partial(_clock, scene, (500, 2000)) for count, scene in made.items()}
    times = in_turns(clocks, effort.rounds, rng)
    peaks = {count: _run(scene, _FIRST, True).peak for count, scene in made.items()}
    best = peaks[effort.ladder[-1]]
    errors = [float(np.abs(peak / best - 1).max()) for peak in peaks.values()]
    full = scenes.cluster_elements(folder, effort.ladder[-1], finest, _FIRST)
    # the least number of modes from which on all models are good enough
    enough = effort.ladder[max((i + 1 for i, error in enumerate(errors) if error > 0.02), default=0)]
    medians = dict(zip(effort.ladder, (float(np.median(values)) for values in times.values()), strict=True))
    per_period = full.seconds_per_step * full.steps
    return {
        "modes": list(effort.ladder), "time": [spread(values) for values in times.values()], "error": errors,
        "full": {
            "free_dofs": full.size, "steps": full.steps, "time": per_period,
            "error": float(np.abs(full.peak / best - 1).max()),
            "curve_days": full.curve_seconds(1000, 61) / 86400,
        },
        "speed_up": {"modes": enough, "factor": per_period / medians[enough]},
    }  # fmt: skip


def _write_csv(result: Mapping[str, Any], path: Path) -> None:
    """One line a point."""
    names = ("method", "setting", "status", "error", "interval", "floor", "energy_residual", "penetration")
    rows = []
    for scene, chart in result["charts"].items():
        for point in chart["points"]:
            times = point["time"] or {}
            row = [point[name] for name in names] + [times.get(key, "") for key in ("median", "low", "high")]
            rows.append((scene, *("" if value is None else value for value in row)))
    write_csv(path, ("scene", *names, "time_s", "time_low_s", "time_high_s"), rows)
