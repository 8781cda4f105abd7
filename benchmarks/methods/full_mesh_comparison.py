"""The whole mesh step by step beside reduced models of it: the model ladder, and three figures of a damped curve.

Ladder: the shipped cluster over its first periods, before chaos parts the models. Curve: a coarser mesh of the same
cluster, whose periods are cheap enough for steady states; its reduced model has the same lumped mass, so that
reduction only lies between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.engine.inside import times_in_turns
from benchmarks.methods.full_mesh_run import explicit_run, glued_frequencies_hz
from benchmarks.methods.scenes import Cluster
from benchmarks.rows import Take, at_once
from benchmarks.timing import spread
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.linear_response import receptance
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.interface import Interface

#: periods over which models are compared, before chaos parts them, and the body's speed at the start (m/s)
_FIRST, _START = 3, 0.3
#: error at which whole mesh and reduced model are compared in cost
_GOOD = 0.02
#: frequencies and periods of the forced response whose cost is extrapolated
_CURVE = (61, 1000)


#: rows in their order, and about what each takes, s
LADDER_ROWS = {"ladder: reduced models": 6.0, "ladder: whole mesh": 10.0}
CURVE_ROWS = {"curve: reduced model": 8.0} | {
    f"curve: whole mesh {where}": 25.0
    for where in ("below the onset", "above the onset", "before the peak", "at the peak", "after the peak")
}


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


def ladder(folder: Path, counts: tuple[int, ...], rounds: int, seed: int, take: Take = at_once) -> dict[str, Any]:
    """Measure reduced models by the exact engine, and the whole mesh by central differences.

    Error: largest of the first periods' peaks against the finest reduced model, relative. take: rows LADDER_ROWS.
    """
    cluster = Cluster(folder)
    reduced, whole = LADDER_ROWS

    @cache
    def finest() -> Scene:
        return cluster.scene(counts[-1]).replace({"damper.0.velocity": _START})

    models = take(reduced, lambda: _reduced_models(finest(), counts, rounds, seed))
    full = take(whole, lambda: _whole_mesh(cluster, finest(), np.array(models["best"])))
    errors = models["error"]
    # the least number of modes from which on all models are good enough
    enough = counts[max((i + 1 for i, error in enumerate(errors) if error > _GOOD), default=0)]
    factor = full["time"] / models["time"][counts.index(enough)]["median"]
    return {
        "modes": list(counts), "time": models["time"], "error": errors, "full": full,
        "speed_up": {"modes": enough, "factor": factor},
    }  # fmt: skip


def _reduced_models(finest: Scene, counts: tuple[int, ...], rounds: int, seed: int) -> dict[str, Any]:
    """Return time a period and error of the models with these numbers of modes, and the finest's peaks, m."""
    variants = {str(count): finest.replace({"structure.modes": count}) for count in counts}
    times = times_in_turns(variants, (500, 2000), rounds, np.random.default_rng(seed))
    first = {"time.periods": _FIRST, "time.transient": 0}
    peaks = [simulate(scene.replace(first)).peak for scene in variants.values()]
    return {
        "time": [spread(values) for values in times.values()], "best": peaks[-1].tolist(),
        "error": [float(np.abs(peak / peaks[-1] - 1).max()) for peak in peaks],
    }  # fmt: skip


def _whole_mesh(cluster: Cluster, finest: Scene, best: np.ndarray) -> dict[str, Any]:
    """Return steps, time a period and error of the whole mesh, and what a damped curve would take."""
    full = explicit_run(*cluster.elements(), finest, 2 * math.pi * finest.frequency, _FIRST)
    return {
        "free_dofs": full.size, "steps": full.steps, "time": full.seconds_per_step * full.steps,
        "error": float(np.abs(full.peak / best - 1).max()), "curve": list(_CURVE),
        "curve_days": full.curve_seconds(_CURVE[1], _CURVE[0]) / 86400,
    }  # fmt: skip


def curve(folder: Path, effort: CurveEffort = CurveEffort(), take: Take = at_once) -> dict[str, Any]:
    """Measure fixed frequency, onset and damped peak: reduced model by the exact engine, and whole mesh.

    take: rows CURVE_ROWS.
    """
    reduced, *of_mesh = CURVE_ROWS
    coarse = _Coarse(folder / "coarse", effort)
    ours = take(reduced, coarse.reduced)
    below, above = (
        take(row, partial(coarse.mesh, ours["onset_hz"] * (1 + side * effort.wide)))
        for row, side in zip(of_mesh[:2], (-1, 1), strict=True)
    )
    best = min(max(int(np.argmax(ours["amplitude"])), 1), effort.points - 2)
    at = ours["at_hz"][best - 1 : best + 2]
    damped = [take(row, partial(coarse.mesh, frequency)) for row, frequency in zip(of_mesh[2:], at, strict=True)]
    return ours | {
        "modes": effort.modes, "periods": effort.periods, "time": damped[0]["time"], "onset_within": effort.wide,
        "impacts_below_above": [below["impacts"], above["impacts"]],
        "peak_hz": at, "peak": ours["amplitude"][best - 1 : best + 2], "mesh_peak": [run["mean"] for run in damped],
        "peak_error": max(run["mean"] for run in damped) / max(ours["amplitude"]) - 1,
    }  # fmt: skip


class _Coarse:
    """The coarse mesh and its reduced model."""

    def __init__(self, folder: Path, effort: CurveEffort) -> None:
        self._cluster, self._effort = Cluster(folder, effort.size, lumped=True), effort

    @cached_property
    def scene(self) -> Scene:
        """A gap of half the peak, with an onset well below the resonance."""
        effort, scene = self._effort, self._cluster.scene(self._effort.modes)
        return scene.replace({
            "cavity.0.gap": 0.5 * _amplitude(scene), "time.periods": effort.periods, "time.transient": effort.dropped
        })  # fmt: skip

    @cached_property
    def elements(self) -> tuple[SystemMatrices, Interface]:
        """The mesh."""
        return self._cluster.elements()

    def reduced(self) -> dict[str, Any]:
        """Return frequencies without and with the body fixed, of both; onset and damped curve of the reduced model."""
        scene = self.scene
        free, glued = glued_frequencies_hz(*self.elements, scene)
        ours = [_peak_of(scene, fixed) for fixed in (False, True)]
        at, amplitudes = _damped(scene, ours[1], ours[0], self._effort.points)
        return {
            "free_dofs": len(self.elements[0].free), "free_hz": [ours[0], free], "fixed_hz": [ours[1], glued],
            "fixed_error": glued / ours[1] - 1, "onset_hz": _onset(scene, ours[1], ours[0]),
            "undamped": _amplitude(scene), "at_hz": at.tolist(), "amplitude": amplitudes.tolist(),
        }  # fmt: skip

    def mesh(self, frequency: float) -> dict[str, Any]:
        """Return mean amplitude (m) and impacts of the whole mesh at a frequency (Hz), and its time a period, s."""
        effort, scene = self._effort, self.scene.replace({"excitation.frequency": frequency})
        run = explicit_run(*self.elements, scene, 2 * math.pi * _peak_of(self.scene, False), effort.periods)
        late = slice(effort.dropped, None)
        return {
            "mean": float(run.peak[late].mean()), "impacts": int(run.impacts[late].sum()),
            "time": run.seconds_per_step * run.steps,
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
