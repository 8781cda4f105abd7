"""A scene in, a response out: resolve what is "auto", then run the scene with its method (methods.registry)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.strength import contact_strength
from vanedamp.coupling.strength.watched import watched


def simulate(
    scene: Scene | str | Path,
    events: bool = False,
    samples_per_period: int = 0,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Run a scene, or the one in a TOML file, from time zero over `scene.time.simulated` excitation periods.

    events: keep the list of events; samples_per_period: keep that many equidistant samples of each period; start: the
    state that another run has left (`Response.final`), in place of the scene's initial one, where the method can;
    progress: called with the number of periods done and of those to do.
    Raises InputError for a scene that the model does not allow; numerical failure is a status of the response.
    """
    started = time.perf_counter()
    scene = loaded(scene)
    chosen = choose(scene)
    rounded = contact_strength.wanted(chosen.scene)
    response = watched(chosen.scene, events or rounded, samples_per_period, start or chosen.start, progress)
    if rounded:
        response = contact_strength.with_contacts(chosen.scene, response, events)
    took = time.perf_counter() - started
    return replace(
        response, estimate=chosen.estimate, advice=chosen.advice,
        warnings=chosen.warnings + response.warnings, wall_time_s=took,
    )  # fmt: skip
