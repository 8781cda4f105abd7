"""Measurements whose truth is known: a scene's forced responses at two levels and a decay, with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.files.toml_input import validate
from vanedamp.studies.identification.data import Measured, decay, forced
from vanedamp.studies.identification.decay import interpolated
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.tables import SearchTable, Sought

FORCE, FREQUENCY = "excitation.force", "excitation.frequency"
#: relative standard deviation of all amplitudes
NOISE = 0.02
SCENE: dict[str, Any] = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "force": 0.5},
    "cavity": [{"name": "c1", "gap": 1e-3}],
    "damper": [{"cavity": "c1", "mass": 0.03, "friction": 0.25, "restitution": 0.6}],
    "ring_down": {"start": "displacement", "displacement": 1e-3, "periods": 6},
    "time": {"periods": 300, "transient": 200},
}
#: the same with a block that is higher than friction lets it stand
BLOCK = {"shape": "block", "length": 0.01, "height": 0.06}
PLAY = 5e-5
NUMBERS = {
    "damper.0.friction": Sought(0.05, 0.9, 0.45),
    "damper.0.restitution": Sought(0.2, 0.95, 0.8),
    "cavity.c1.gap": Sought(5e-4, 2e-3, 1.3e-3),
    "structure.damping_ratio": Sought(0.003, 0.03, 0.005, scale="log"),
}
#: with friction that holds the body at the lowest level, whatever it is
HELD = NUMBERS | {"damper.0.friction": Sought(0.1, 0.8, 0.45)}
TRUTH = np.array([0.25, 0.6, 1e-3, 0.01])
#: force (N) and frequencies (Hz), chosen for what they tell: the body slides without impacts, and strikes both walls
LEVELS = {0.1: (15.45, 15.55, 15.6, 15.65, 15.85, 15.9), 0.5: (15.15, 15.2, 16.05, 16.25)}
#: force at which friction holds the body
STUCK = {0.02: (15.2, 15.35, 15.5, 15.6, 15.75, 15.85, 16.0, 16.2)}
#: times of the first half cycles, s: later ones depend on the numbers roughly, after many impacts
TIMES = tuple((0.5 * np.arange(1, 6) / 15.7).tolist())


@cache
def scene(block: bool = False) -> Scene:
    """Return the scene, or that with a block."""
    data = SCENE
    if block:
        data = SCENE | {
            "cavity": [SCENE["cavity"][0] | {"play": PLAY}], "damper": [SCENE["damper"][0] | BLOCK],
        }  # fmt: skip
    return validate(Scene, data, "truth")


@cache
def exact(block: bool, stuck: bool) -> tuple[tuple[float, ...], ...]:
    """Return the amplitudes of each level, and of the decay unless the body is to stick, m."""
    base, rows = scene(block), []
    for force, frequencies in (STUCK if stuck else LEVELS).items():
        points = (base.replace({FORCE: force, FREQUENCY: frequency}) for frequency in frequencies)
        rows.append(tuple(simulate(point).amplitude_mean for point in points))
    if not stuck:
        half = ring_down(base).half_cycles
        rows.append(tuple(interpolated(np.array(TIMES), half.time, np.log(half.amplitude)).tolist()))
    return tuple(rows)


def study(
    seed: int, block: bool = False, stuck: bool = False, search: SearchTable | None = None,
    numbers: Mapping[str, Sought] | None = None,
) -> IdentificationStudy:  # fmt: skip
    """Return a study of the scene with a slider, with measurements of it, or of a block, whose noise has a seed."""
    rng, rows = np.random.default_rng(seed), exact(block, stuck)
    levels, measured = STUCK if stuck else LEVELS, list[Measured]()
    for (force, frequencies), row in zip(levels.items(), rows, strict=False):
        measured.append(forced(f"{force:g} N", frequencies, _noisy(row, rng), {FORCE: force}, noise=NOISE))
    if not stuck:
        measured.append(decay("decay", TIMES, _noisy(rows[-1], rng), {}, noise=NOISE))
    return IdentificationStudy(scene(), numbers or NUMBERS, measured, search or SearchTable())


def _noisy(values: Sequence[float], rng: np.random.Generator) -> np.ndarray:
    return np.array(values) * np.exp(NOISE * rng.standard_normal(len(values)))
