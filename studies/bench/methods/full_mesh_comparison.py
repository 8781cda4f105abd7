"""The whole mesh step by step beside reduced models of it: the model ladder, and three figures of a damped curve.

Ladder: the shipped cluster over its first periods, before chaos parts the models. Curve: a coarser mesh of the same
cluster, whose periods are cheap enough for steady states; its reduced model has the same lumped mass, so that
reduction only lies between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.engine import simulate
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.linear_response import receptance
from vanedamp.studies.bench.engine.inside import time_of_a_period
from vanedamp.studies.bench.methods.full_mesh_run import explicit_run, glued_frequencies_hz
from vanedamp.studies.bench.methods.scenes import Cluster
from vanedamp.studies.bench.timing import Clock, in_turns, spread

#: periods over which models are compared, before chaos parts them, and the body's speed at the start (m/s)
_FIRST, _START = 3, 0.3
#: error at which whole mesh and reduced model are compared in cost
_GOOD = 0.02
#: frequencies and periods of the forced response whose cost is extrapolated
_CURVE = (61, 1000)


@dataclass(frozen=True)
class CurveEffort:
    """Element size of the coarse mesh (m), modes of its reduced model, periods of a point and those not evaluated.

    wide: relative distance from the onset at which the whole mesh is tried; points: frequencies of the reduced curve.
    """

    size: float = 0.009
    modes: int = 20
    periods: int = 240
    dropped: int = 160
    wide: float = 0.002
    points: int = 25


def ladder(folder: Path, counts: tuple[int, ...], rounds: int, rng: np.random.Generator) -> dict[str, Any]:
    """Measure reduced models by the exact engine, and the whole mesh by central differences.

    Error: largest of the first periods' peaks against the finest reduced model, relative.
    """
    cluster = Cluster(folder)
    finest = cluster.scene(counts[-1]).replace({"damper.0.velocity": _START})
    variants = {count: finest.replace({"structure.modes": count}) for count in counts}
    clocks: dict[str, Clock] = {str(n): partial(time_of_a_period, scene, (500, 2000)) for n, scene in variants.items()}
    times = in_turns(clocks, rounds, rng)
    peaks = {
        n: simulate(scene.replace({"time.periods": _FIRST, "time.transient": 0})).peak for n, scene in variants.items()
    }
    best = peaks[counts[-1]]
    errors = [float(np.abs(peak / best - 1).max()) for peak in peaks.values()]
    full = explicit_run(*cluster.elements(), finest, 2 * math.pi * finest.frequency, _FIRST)
    # the least number of modes from which on all models are good enough
    enough = counts[max((i + 1 for i, error in enumerate(errors) if error > _GOOD), default=0)]
    per_period = full.seconds_per_step * full.steps
    return {
        "modes": list(counts), "time": [spread(values) for values in times.values()], "error": errors,
        "full": {
            "free_dofs": full.size, "steps": full.steps, "time": per_period,
            "error": float(np.abs(full.peak / best - 1).max()), "curve": list(_CURVE),
            "curve_days": full.curve_seconds(_CURVE[1], _CURVE[0]) / 86400,
        },
        "speed_up": {"modes": enough, "factor": per_period / float(np.median(times[str(enough)]))},
    }  # fmt: skip


def curve(folder: Path, effort: CurveEffort = CurveEffort()) -> dict[str, Any]:
    """Measure fixed frequency, onset and damped peak: reduced model by the exact engine, and whole mesh."""
    cluster = Cluster(folder / "coarse", effort.size, lumped=True)
    scene = cluster.scene(effort.modes)
    gap = 0.5 * _amplitude(scene)  # half the peak, with an onset well below the resonance
    scene = scene.replace(
        {"cavity.0.gap": gap, "time.periods": effort.periods, "time.transient": effort.dropped}
    )  # fmt: skip
    matrices, interface = cluster.elements()
    free, glued = glued_frequencies_hz(matrices, interface, scene)
    ours = [_peak_of(scene, fixed) for fixed in (False, True)]
    onset = _onset(scene, ours[1], ours[0])
    at, amplitudes = _damped(scene, ours[1], ours[0], effort.points)

    def mesh(frequency: float) -> tuple[float, int, float]:
        excited = scene.replace({"excitation.frequency": frequency})
        run = explicit_run(matrices, interface, excited, 2 * math.pi * ours[0], effort.periods)
        late = slice(effort.dropped, None)
        return float(run.peak[late].mean()), int(run.impacts[late].sum()), run.seconds_per_step * run.steps

    below, above = mesh(onset * (1 - effort.wide)), mesh(onset * (1 + effort.wide))
    best = int(np.argmax(amplitudes))
    near = range(max(best - 1, 0), min(best + 2, len(at)))
    damped = [mesh(float(at[i])) for i in near]
    return {
        "free_dofs": len(matrices.free), "modes": effort.modes, "periods": effort.periods, "time": damped[0][2],
        "free_hz": [ours[0], free], "fixed_hz": [ours[1], glued], "fixed_error": glued / ours[1] - 1,
        "onset_hz": onset, "onset_within": effort.wide, "impacts_below_above": [below[1], above[1]],
        "peak_hz": [float(at[i]) for i in near], "peak": [float(amplitudes[i]) for i in near],
        "mesh_peak": [mean for mean, _, _ in damped],
        "peak_error": max(mean for mean, _, _ in damped) / float(amplitudes.max()) - 1,
        "undamped": _amplitude(scene), "at_hz": at.tolist(), "amplitude": amplitudes.tolist(),
    }  # fmt: skip


def _amplitude(scene: Scene) -> float:
    amplitude = scene.excitation.resonance_amplitude
    assert amplitude is not None
    return amplitude


def _peak_of(scene: Scene, fixed: bool) -> float:
    """Return the frequency of the first resonance, Hz, by a fine grid around the model's own."""
    grid = scene.frequency * np.linspace(0.93, 1.03, 20_001)
    return float(grid[np.abs(receptance(scene, grid, fixed)).argmax()])


def _onset(scene: Scene, low: float, high: float) -> float:
    """Return the lowest frequency (Hz) between two with impacts in the steady state, by bisection."""
    low *= 0.98
    while high - low > 1e-5 * high:
        middle = 0.5 * (low + high)
        struck = simulate(scene.replace({"excitation.frequency": middle})).impacts_per_period > 0
        low, high = (low, middle) if struck else (middle, high)
    return high


def _damped(scene: Scene, low: float, high: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequencies (points,) and mean amplitudes of the damped curve."""
    at = np.linspace(0.985 * low, 1.01 * high, points)
    amplitudes = [simulate(scene.replace({"excitation.frequency": float(f)})).amplitude_mean for f in at]
    return at, np.array(amplitudes)
