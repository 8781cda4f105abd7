"""Runs of scenes without open choices: the exact engine's state, records and subsystems, and the response they leave.

Other methods (`solver.method`) are those of methods.time_stepping.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vanedamp.coupling.exact.event_driven import EngineRun
from vanedamp.coupling.response.evaluation import Run, evaluate, run_scene
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import Handover
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError


def respond(
    scene: Scene,
    events: bool = False,
    samples_per_period: int = 0,
    start: Handover | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """The response of a scene without open choices (coupling.engine.simulate says the rest)."""
    started = time.perf_counter()
    run = run_of(scene, events, samples_per_period, start)
    status, transient = run_scene(run, scene, progress)
    final = run.final() if isinstance(run, EngineRun) else None
    return replace(evaluate(scene, run.outcome(), status, transient, started), final=final)


def run_with_response(scene: Scene, functional: np.ndarray, samples_per_period: int) -> Response:
    """A run whose response is another functional (n,) of the structure's modes; with a fixed number of periods.

    `scene` has no open choices. Raises InputError for a scene that the model does not allow.
    """
    started = time.perf_counter()
    run = EngineRun(scene, False, samples_per_period, functional)
    status, transient = run_scene(run, scene)
    return evaluate(scene, run.outcome(), status, transient, started)


def run_of(scene: Scene, events: bool, samples_per_period: int, start: Handover | None = None) -> Run:
    """A run of the scene's method, not yet begun."""
    if scene.solver.method == "exact":
        return EngineRun(scene, events, samples_per_period, start=start)
    if start is not None:
        raise InputError(f"continuation: is for solver.method exact, not {scene.solver.method}")
    from vanedamp.coupling.methods.time_stepping import begin_run  # its kernels are loaded when they are wanted

    return begin_run(scene, events, samples_per_period)
