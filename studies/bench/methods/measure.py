"""Speed against accuracy: every method on the same scenes, with the same machine, in turns.

Periodic scenes: largest error of response and slips at ten times of every period, relative to their ranges, against
the exact engine, whose own error is against 40 digits for one mode. Scenes that never repeat: error of the mean
amplitude, with the 95 % confidence intervals of both means. Times are CPU times per excitation period, without set-up.
Other programs (bench.methods.peers) take part where they are installed and can express the scene.
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

from vanedamp.coupling.engine import simulate
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.steady_state import mean_confidence
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS, SteppingOptions
from vanedamp.coupling.scene.structures import Rigid
from vanedamp.files.store import write_csv, write_json
from vanedamp.files.toml_input import InputError
from vanedamp.studies.bench.engine.hand_written_loop import ImpactOscillator
from vanedamp.studies.bench.engine.inside import time_of_a_period
from vanedamp.studies.bench.engine.reference_solutions import truth
from vanedamp.studies.bench.methods import scenes
from vanedamp.studies.bench.methods.full_mesh_comparison import CurveEffort, curve, ladder
from vanedamp.studies.bench.methods.peers import PEERS, PeerRun, run_peer
from vanedamp.studies.bench.timing import Clock, in_turns, machine, spread
from vanedamp.studies.terminal import progress

_SEED = 20_260_102
#: samples a period by which periodic responses are compared, as many as solve_ivp's least steps there; more for means
_SAMPLES, _LEAST = 10, 40
#: error of a state that is as good as zero
_FLOOR = 1e-13
#: status of a run that was left out, and the one tolerance for means
DEAR, _ONE = "too dear for a mean", 1e-4


@dataclass(frozen=True)
class Effort:
    """Rounds of timing, steps per period, tolerances of solve_ivp, periods of comparison, of means, of the reference.

    ivp: periods of solve_ivp's means; dearest: steps that a mean may cost; timed: steps of a timed run; modes:
    fixed-interface modes of the cluster (None: no finite elements); ladder: those of the model ladder; peers: steps a
    period of other programs; others: periods of their means; curve: the damped curve of a whole mesh.
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
    peers: tuple[int, ...] = ()
    others: int = 0
    curve: CurveEffort | None = None


FULL = Effort(3, (100, 300, 1000, 3000, 10_000), (1e-4, 1e-6, 1e-8, 1e-10), 10, 2000, 30_000, 400, 1e7, 100_000, 10,
              (0, 1, 2, 4, 7, 10, 15, 20), (300, 1000), 500, CurveEffort())  # fmt: skip
QUICK = Effort(2, (100, 1000), (1e-4, 1e-8), 3, 200, 600, 40, 1e6, 50_000, None, (), (300,), 100)


def run_work_precision(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure; write work_precision.json, .csv and a figure into a folder. Returns what the JSON holds."""
    started = time.perf_counter()
    rng = np.random.default_rng(_SEED)
    result: dict[str, Any] = {"machine": machine(), "seed": _SEED, "effort": asdict(effort), "charts": {}}
    folder.mkdir(parents=True, exist_ok=True)
    with progress("work-precision") as report, tempfile.TemporaryDirectory() as temporary:
        by_name = _scenes(effort, Path(temporary))
        for done, (name, (scene, repeats)) in enumerate(by_name.items()):
            report(done, len(by_name) + 2)
            result["charts"][name] = _chart(scene, repeats, effort, rng)
        if effort.modes is not None:
            result["ladder"] = ladder(Path(temporary), effort.ladder, effort.rounds, rng)
        if effort.curve is not None:
            report(len(by_name) + 1, len(by_name) + 2)
            result["curve"] = curve(Path(temporary), effort.curve)
    result["wall_time_s"] = time.perf_counter() - started
    write_json(folder / "work_precision.json", result)
    _write_csv(result, folder / "work_precision.csv")
    from vanedamp.studies.bench.methods.figures import work_precision_figure

    work_precision_figure(result, folder / "work_precision.png")
    return result


def print_summary(result: Mapping[str, Any]) -> None:
    """Print for every chart whether the exact engine is on its Pareto front."""
    for name, chart in result["charts"].items():
        better = chart["dominated_by"]
        print(
            f"{name}: the exact engine is {'on the front' if not better else 'not on the front: ' + ', '.join(better)}"
        )


def _scenes(effort: Effort, folder: Path) -> dict[str, tuple[Scene, bool]]:
    """Return the scenes by name, and whether they repeat."""
    checked = {"time.periods": effort.checked, "time.transient": 0}
    by_name = {
        "periodic 1:1 impact": (scenes.periodic(3000).replace(checked), True),
        "chatter": (scenes.chatter().replace(checked), True),
        "single damper, non-periodic": (scenes.single(), False),
        "double damper in one cavity, non-periodic": (scenes.double(), False),
    }
    if effort.modes is not None:
        by_name["cluster, reduced model"] = (scenes.Cluster(folder).scene(effort.modes), False)
    return by_name


def _chart(scene: Scene, repeats: bool, effort: Effort, rng: np.random.Generator) -> dict[str, Any]:
    """Return the times and errors of every method on a scene."""
    periods = effort.checked if repeats else effort.reference
    reference = _run(scene, periods, repeats)
    variants = _variants(scene, repeats, effort)
    points = [_point(key, variant, reference, repeats, effort) for key, variant in variants.items()]
    for point in points:
        # a method may fail later than in the periods that are compared
        lasts = variants[point["method"], point["setting"]].replace({"time.periods": _lengths(point, effort)[1]})
        if point["status"] == "ok":
            point["status"] = simulate(lasts).status.value
    if repeats and isinstance(scene.structure, Rigid):
        points[0]["error"] = _own_error(scene, effort.checked)
    others, absent = _peers(scene, reference, repeats, effort)
    points += others
    good = [point for point in points if point["status"] == "ok"]
    clocks: dict[str, Clock] = {}
    for i, point in enumerate(good):
        key = (point["method"], point["setting"])
        if key in variants:
            clocks[str(i)] = partial(time_of_a_period, variants[key], _lengths(point, effort))
        else:
            clocks[str(i)] = partial(_peer_time, scene, key, _lengths(point, effort)[1])
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
        "absent": absent,
    }  # fmt: skip


def _variants(scene: Scene, repeats: bool, effort: Effort) -> dict[tuple[str, float], Scene]:
    """Return the scene by every method, under its label and setting; the exact engine is the first."""
    made = {}
    for label, (method, variant) in scenes.charted().items():
        options = dict(variant.options)
        settings: tuple[float, ...] = effort.tolerances if variant.tolerance else effort.steps
        if variant.tolerance and issubclass(METHODS.part(method).Options, SteppingOptions):
            options["steps_per_period"] = _SAMPLES if repeats else _LEAST
        for setting in settings if variant.setting else (0,):
            changed = options | ({variant.setting: setting} if variant.setting else {})
            made[label, float(setting)] = scenes.by(scene, method=method, **changed)
    return made


def _by_tolerance(label: str) -> bool:
    """Whether the setting of a method or a peer is a tolerance."""
    return PEERS[label].tolerance if label in PEERS else scenes.charted()[label][1].tolerance


def _peers(
    scene: Scene, reference: Response, repeats: bool, effort: Effort
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Return the points of the peers, and why others have none."""
    points, absent = [], {}
    for name, peer in PEERS.items():
        settings = effort.tolerances if peer.tolerance else tuple(float(count) for count in effort.peers)
        for setting in settings:
            if peer.tolerance and not repeats and setting != _ONE:
                points.append(_new_point((name, setting), DEAR))
                continue
            periods = effort.checked if repeats else (effort.ivp if peer.tolerance else effort.others)
            try:
                run = run_peer(name, scene, periods, setting, _SAMPLES if repeats else 0)
            except InputError as refused:
                absent[name] = str(refused)
                break
            points.append(_peer_point((name, setting), run, reference, repeats))
    return points, absent


def _peer_point(key: tuple[str, float], run: PeerRun, reference: Response, repeats: bool) -> dict[str, Any]:
    point = _new_point(key, run.status) | {"penetration": run.penetration}
    if run.status != "ok":
        return point
    if repeats:
        return point | {"error": _state_error(run.samples, reference), "floor": _FLOOR}
    late = run.peak[_dropped(len(run.peak)) :]
    return point | _mean_error(float(late.mean()), mean_confidence(late), reference)


def _peer_time(scene: Scene, key: tuple[str, float], periods: int) -> float:
    return run_peer(key[0], scene, periods, key[1]).seconds / periods


def _dropped(periods: int) -> int:
    """Return the periods of a transient before a mean."""
    return max(periods // 4, min(500, periods // 2))


def _run(scene: Scene, periods: int, repeats: bool) -> Response:
    return simulate(
        scene.replace({"time.periods": periods, "time.transient": 0 if repeats else _dropped(periods)}),
        samples_per_period=_SAMPLES if repeats else 0,
    )


def _new_point(key: tuple[str, float], status: str) -> dict[str, Any]:
    """Return a point without figures; `floor`: the error below which the comparison is undecided."""
    return {
        "method": key[0], "setting": key[1], "status": status, "error": None, "interval": None, "floor": 0.0,
        "energy_residual": 0.0, "penetration": 0.0, "time": None,
    }  # fmt: skip


def _point(key: tuple[str, float], scene: Scene, reference: Response, repeats: bool, effort: Effort) -> dict[str, Any]:
    """Return the status and error of one run."""
    method, setting = key
    by_tolerance = _by_tolerance(method)
    periods = effort.checked if repeats else (effort.ivp if by_tolerance else effort.means)
    steps = scene.solver.smallest_steps if isinstance(scene.solver, SteppingOptions) else 0
    if not repeats and (steps * periods > effort.dearest or (by_tolerance and setting != _ONE)):
        return _new_point(key, DEAR)  # no error, rather than that of a run too short for its transient
    response = _run(scene, periods, repeats)
    point = _new_point(key, response.status.value)
    point |= {"energy_residual": response.energy_residual, "penetration": response.penetration}
    if point["status"] != "ok":
        return point
    if repeats:
        samples = np.column_stack([response.displacement, response.body_displacement])
        return point | {"error": _state_error(samples, reference), "floor": _FLOOR}
    return point | _mean_error(response.amplitude_mean, response.amplitude_mean_confidence, reference)


def _own_error(scene: Scene, periods: int) -> float:
    """Return the error of the exact engine at the periods' ends over the ranges of x, x', r, r', against 40 digits."""
    exact = truth(ImpactOscillator.of(scene), periods)
    response = _run(scene, periods, True)
    ours = np.column_stack([response.section, response.slip, response.slip_velocity])
    return float((np.abs(ours - exact) / np.abs(exact).max(axis=0)).max())


def _state_error(samples: np.ndarray, reference: Response) -> float:
    """Return the largest deviation of samples (k, 1 + b) relative to the ranges."""
    exact = np.column_stack([reference.displacement, reference.body_displacement])
    size = np.ptp(exact, axis=0)
    return float((np.abs(samples - exact)[:, size > 0] / size[size > 0]).max())


def _mean_error(mean: float, confidence: float | None, reference: Response) -> dict[str, float]:
    interval = (confidence or 0.0) / reference.amplitude_mean
    theirs = (reference.amplitude_mean_confidence or 0.0) / reference.amplitude_mean
    error = abs(mean / reference.amplitude_mean - 1)
    return {"error": error, "interval": interval, "floor": float(np.hypot(interval, theirs))}


def _lengths(point: Mapping[str, Any], effort: Effort) -> tuple[int, int]:
    """Return two lengths of a run in periods, so that the longer takes some tenths of a second."""
    if _by_tolerance(point["method"]):
        return 1, 3
    long = effort.timed / (point["setting"] or 25)
    if point["method"] in PEERS:
        return 0, max(int(long / 10), 2)
    long = int(np.clip(long, 12, 20_000))
    return max(long // 6, 1), long


def _write_csv(result: Mapping[str, Any], path: Path) -> None:
    """Write one line a point."""
    names = ("method", "setting", "status", "error", "interval", "floor", "energy_residual", "penetration")
    rows = []
    for scene, chart in result["charts"].items():
        for point in chart["points"]:
            times = point["time"] or {}
            row = [point[name] for name in names] + [times.get(key, "") for key in ("median", "low", "high")]
            rows.append((scene, *("" if value is None else value for value in row)))
    write_csv(path, ("scene", *names, "time_s", "time_low_s", "time_high_s"), rows)
