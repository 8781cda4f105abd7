"""A block beside the slider of the same mass, over the frequency: responses, tilt and lift, impacts, time a period.

The scene is that of the paper's half gap, with one mode. The block begins with a tilt of 1e-5 rad and hits its walls
before it has settled on the floor; a block that lies flat stays so and is a slider.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.rows import Rows
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import validate

#: kg, N/m, m of the rigid model of the cluster; share of the body's mass; gap over the amplitude without bodies
MASS, STIFFNESS, DAMPING, AMPLITUDE, SHARE, GAP = 0.15696, 3.6046e7, 0.002, 7e-5, 0.02, 0.5
NATURAL = float(np.sqrt(STIFFNESS / MASS) / (2 * np.pi))
SHAPES: dict[str, dict[str, Any]] = {
    "slider": {},
    "block": {"shape": "block", "length": 6.88e-3, "height": 4.8e-3, "tilt": 1e-5},
}


@dataclass(frozen=True)
class Bodies(Benchmark):
    """Frequencies, over the natural one, and periods of a run, of which some are dropped."""

    ratios: tuple[float, ...]
    periods: int
    transient: int

    NAME = "bodies"
    COLUMNS = (
        "shape", "ratio", "status", "amplitude", "tilt_max", "lift_share", "impacts_per_period", "seconds_per_period",
        "undamped", "fixed",
    )  # fmt: skip

    def rows(self, folder: Path) -> dict[str, Row]:
        return {
            f"{shape} at {ratio:g} of the natural frequency": Row(
                1.5e-5 * self.periods, partial(_point, ratio, shape, self), _text
            )
            for ratio in self.ratios
            for shape in SHAPES
        }

    def measure(self, rows: Rows) -> Result:
        for shape in SHAPES:
            simulate(body_scene(1.0, shape, 2, 0))  # loads compiled functions
        return super().measure(rows)

    def result(self, values: Mapping[str, Any]) -> Result:
        return {"points": list(values.values())}

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        """Draw the responses, and frames of the block at its peak."""
        from benchmarks.bodies.figures import bodies_figure
        from benchmarks.bodies.motion_figure import block_motion, motion_figure

        bodies_figure(result["points"], folder / "bench_bodies.png")
        peak = max((row for row in result["points"] if row["shape"] == "block"), key=lambda row: row["amplitude"])
        motion = block_motion(body_scene(peak["ratio"], "block", self.periods, self.transient))
        motion_figure(motion, folder / "bench_bodies_motion.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield the table of the points, and what a block costs."""
        yield f"{'f/f1':>8} {'slider':>8} {'block':>8} {'tilt, mrad':>11} {'lifted':>7}"
        by = {shape: [row for row in result["points"] if row["shape"] == shape] for shape in SHAPES}
        for slider, block in zip(by["slider"], by["block"], strict=True):
            tilt = f"{1e3 * block['tilt_max']:11.3f} {block['lift_share']:7.2f}"
            yield f"{slider['ratio']:8.4f} {slider['amplitude']:8.3f} {block['amplitude']:8.3f} {tilt}"
        cost = [
            np.median([row["seconds_per_period"] / max(row["impacts_per_period"], 1.0) for row in by[shape]])
            for shape in SHAPES
        ]
        yield f"time a period and impact: slider {1e6 * cost[0]:.2f} us, block {1e6 * cost[1]:.2f} us"


FULL = Bodies(tuple(np.round(np.linspace(0.96, 1.03, 57), 6)), 3000, 1000)
QUICK = Bodies((0.98, 1.0, 1.01), 600, 400)


def body_scene(ratio: float, shape: str, periods: int, transient: int, **body: Any) -> Scene:
    """Return the scene at a frequency over the natural one. body: further keys of the damper."""
    damper = {"cavity": "c1", "mass": SHARE * MASS, "friction": 0.4, "restitution": 0.7} | SHAPES[shape] | body
    return validate(
        Scene,
        {
            "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": DAMPING},
            "excitation": {
                "frequency": ratio * NATURAL, "resonance_amplitude": AMPLITUDE, "resonance_near": NATURAL
            },
            "initial": {"velocity": 0.5 * AMPLITUDE * 2 * np.pi * NATURAL},
            "cavity": [{"name": "c1", "gap": GAP * AMPLITUDE, "play": 2e-4}], "damper": [damper],
            "time": {"periods": periods, "transient": transient},
        },
        "bodies",
    )  # fmt: skip


def _text(point: Mapping[str, Any]) -> str:
    return f"amplitude {point['amplitude']:.3f}, {point['impacts_per_period']:.2f} impacts per period"


def _point(ratio: float, shape: str, effort: Bodies) -> dict[str, Any]:
    scene = body_scene(ratio, shape, effort.periods, effort.transient)
    clock = time.thread_time()
    response: Response = simulate(scene)
    spent = time.thread_time() - clock
    free, glued = linear_responses(scene)
    frequency = np.array([ratio * NATURAL])
    return {
        "shape": shape, "ratio": ratio, "status": response.status.value,
        "amplitude": response.amplitude_mean / AMPLITUDE,
        "tilt_max": (response.tilt_max or (None,))[0], "lift_share": (response.lift_share or (None,))[0],
        "impacts_per_period": response.impacts_per_period, "seconds_per_period": spent / response.periods,
        "undamped": float(free.amplitude(frequency)[0]) / AMPLITUDE,
        "fixed": float(glued.amplitude(frequency)[0]) / AMPLITUDE,
    }  # fmt: skip
