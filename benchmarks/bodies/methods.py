"""A block by every method and by another program: error over cost, with friction and without; the price of a block.

The error is that of response and slip in the first two periods, over their ranges, against the exact engine, whose own
error is against solve_ivp with a tight tolerance. Blocks are chaotic: nearby starts part later, and one in which two
corners hit almost together parts at once for steps that cannot tell them apart. Hence medians over several starts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result
from benchmarks.bodies.measure import SHAPES, body_scene
from benchmarks.engine.inside import time_of_a_period
from benchmarks.methods.peers import PEERS, run_peer, settings_of_peers, version
from benchmarks.methods.scenes import Key, by, charted, settings, solved
from benchmarks.rows import Rows
from benchmarks.timing import spread
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: periods and samples by which motions are compared, and the coefficients of friction
PERIODS, SAMPLES, FRICTION = 2, 10, (0.4, 0.0)
#: tolerance of the reference that checks the exact engine
_TIGHT = 1e-12
_PRICE = "price of a block"


@dataclass(frozen=True)
class BlockMethods(Benchmark):
    """Starts that errors are medians of, steps a period, those of peers, tolerances; periods and rounds of timing."""

    starts: int
    steps: tuple[int, ...]
    peers: tuple[int, ...]
    tolerances: tuple[float, ...]
    timed: int
    rounds: int

    NAME = "bodies_methods"
    COLUMNS = ("friction", "method", "setting", "status", "error", "low", "high", "seconds_per_period")

    def expected(self, folder: Path) -> dict[str, float]:
        names = [_row(friction, key) for friction in FRICTION for key in _keys(self)]
        return dict.fromkeys(names, 0.2 * self.starts) | {_PRICE: 10.0}

    def measure(self, rows: Rows) -> Result:
        points: list[dict[str, Any]] = []
        absent: dict[str, str] = {}

        @cache
        def exact(friction: float) -> list[np.ndarray]:
            return [simulate_block(block_scene(start, friction))[1] for start in range(self.starts)]

        def measured(friction: float, key: Key) -> dict[str, Any]:
            try:
                return _point(key, friction, exact(friction), self)
            except InputError as refused:
                return {"absent": str(refused)}

        for friction, key in itertools.product(FRICTION, _keys(self)):
            row, label = _row(friction, key), key[0]
            if label in absent:
                rows.leave_out(row, absent[label])
                continue
            inputs = asdict(self) | ({"version": version(label)} if label in PEERS else {})
            point = rows.take(row, partial(measured, friction, key), inputs=inputs, tell=_text)
            if "absent" in point:
                absent[label] = point["absent"]
            else:
                points.append({"friction": friction} | point)
        return {"points": points, "absent": absent, "price": rows.take(_PRICE, partial(_price, self))}

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.bodies.figures import methods_figure

        methods_figure(result, folder / "bench_bodies_methods.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the table of the points, who is absent, and what a block costs beside a slider."""
        yield f"{'friction':>8} {'method':<28} {'setting':>9} {'error':>9} {'us a period':>12}"
        for row in result["points"]:
            figures = f"{row['status']:>9}"
            if row["error"] is not None:
                figures = f"{row['error']:9.2g} {1e6 * row['seconds_per_period']:12.4g}"
            yield f"{row['friction']:8g} {row['method']:<28} {row['setting']:9g} {figures}"
        yield from (f"without {label}: {reason}" for label, reason in result["absent"].items())
        for name, price in result["price"].items():
            scale, unit = (1.0, "impacts") if name == "impacts" else (1e6, "us")
            block, slider = scale * price["block"], scale * price["slider"]
            yield f"{name}: block {block:.4g}, slider {slider:.4g} {unit} a period, ratio {block / slider:.3g}"


FULL = BlockMethods(15, (200, 1000, 5000, 20_000, 100_000), (200, 1000, 5000, 20_000), (1e-4, 1e-6, 1e-8, 1e-10), 30, 4)
QUICK = BlockMethods(3, (200, 5000), (200,), (1e-6,), 10, 2)


def block_scene(start: int, friction: float, periods: int = PERIODS) -> Scene:
    """Return the scene at resonance: the block begins above the floor, tilted more from start to start."""
    return body_scene(1.0, "block", periods, 0, lift=8e-5, tilt=2e-3 * (1 + 0.05 * start), friction=friction)


def _row(friction: float, key: Key) -> str:
    return f"friction {friction:g}: {key[0]}, {key[1]:g}"


def _text(point: Mapping[str, Any]) -> str:
    return point.get("absent") or (point["status"] if point["error"] is None else f"error {point['error']:.2g}")


def simulate_block(scene: Scene) -> tuple[str, np.ndarray]:
    """Return the status of a run and its samples: response and slip (k, 2), m."""
    response = simulate(scene, samples_per_period=SAMPLES)
    return response.status.value, np.column_stack([response.displacement, response.body_displacement])


def _keys(effort: BlockMethods) -> list[Key]:
    """Return methods and peers with each of their settings; of peers those that take steps."""
    return [*settings(effort.steps, effort.tolerances), *settings_of_peers(effort.peers, ())]


def _point(key: Key, friction: float, exact: list[np.ndarray], effort: BlockMethods) -> dict[str, Any]:
    """Return status, error and cost. Raises InputError where a method or a peer does not take the scene."""
    label, setting = key
    errors, seconds, status = [], 0.0, Status.OK.value
    for start, reference in enumerate(exact):
        scene = block_scene(start, friction)
        if label in PEERS:
            run = run_peer(label, scene, PERIODS, setting, SAMPLES)
            status, samples, seconds = run.status, run.samples, seconds + run.seconds / PERIODS / len(exact)
        elif charted()[label][0] == "exact":  # judged by another method
            status, samples = simulate_block(by(scene, method="solve_ivp", rtol=_TIGHT, steps_per_period=SAMPLES))
        else:
            status, samples = simulate_block(solved(scene, key, SAMPLES))
        if status != Status.OK.value:
            break
        errors.append(float((np.abs(samples - reference) / np.ptp(reference, axis=0)).max()))
    point = {"method": label, "setting": setting, "status": status}
    if status != Status.OK.value:
        return point | dict.fromkeys(("error", "low", "high", "seconds_per_period"))
    if label not in PEERS:
        seconds = _seconds(solved(block_scene(0, friction), key, SAMPLES), effort)
    found = spread(np.array(errors))
    return point | {"error": found["median"], "low": found["low"], "high": found["high"], "seconds_per_period": seconds}


def _seconds(scene: Scene, effort: BlockMethods) -> float:
    """Return the processor time of a period after the first, which loads compiled functions, s: the least of rounds."""
    last = 3 if scene.solver.method == "solve_ivp" else max(effort.timed, 3)
    return min(time_of_a_period(scene, (1, last)) for _ in range(effort.rounds))


def _price(effort: BlockMethods) -> dict[str, dict[str, float]]:
    """Return the processor time of a period (s) of slider and block by each method, and the impacts of both there."""
    tables: dict[str, dict[str, Any]] = {
        "exact": {}, "moreau": {"steps_per_period": effort.steps[1]}, "penalty": {"steps_per_period": effort.steps[1]},
        "solve_ivp": {"rtol": 1e-9},
    }  # fmt: skip
    price: dict[str, dict[str, float]] = {method: {} for method in (*tables, "impacts")}
    for shape in SHAPES:
        begin = {"lift": 8e-5, "tilt": 2e-3} if shape == "block" else {}
        scene = body_scene(1.0, shape, effort.timed, 0, **begin)
        price["impacts"][shape] = simulate(scene).impacts_per_period
        for method, options in tables.items():
            price[method][shape] = _seconds(by(scene, method=method, **options), effort)
    return price
