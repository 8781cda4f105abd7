"""A scene in, a response out: resolve what is "auto", then run the scene with its method (methods.registry)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.moved_start import Mean, as_one, moved
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.strength import contact_strength
from vanedamp.coupling.strength.watched import watched
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


def simulate(
    scene: Scene | str | Path,
    events: bool = False,
    samples_per_period: int = 0,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
    moved_start: bool = False,
) -> Response:
    """Run a scene, or the one in a TOML file, from time zero over `scene.time.simulated` excitation periods.

    events: keep the list of events; samples_per_period: keep that many equidistant samples of each period; start: the
    state that another run has left (`Response.final`), in place of the scene's initial one, where the method can;
    progress: called with the number of periods done and of those to do; moved_start: run a second time, from bodies
    about 1e-9 of their gap aside, and say in `Response.moved_start`, and a warning, whether the mean amplitude differs.
    Raises InputError for a scene that the model does not allow; numerical failure is a status of the response.
    """
    started = time.perf_counter()
    scene = loaded(scene)
    chosen = choose(scene)
    rounded = contact_strength.wanted(chosen.scene)
    start = start or chosen.start
    response = watched(chosen.scene, events or rounded, samples_per_period, start, progress)
    if rounded:
        response = contact_strength.with_contacts(chosen.scene, response, events)
    notes = response.warnings
    if response.impacts_per_period:
        notes += as_one(chosen.scene, *(part[response.transient :] for part in (response.slip, response.slip_velocity)))
    other, doubt = _from_moved(chosen.scene, response, start, progress) if moved_start else (None, ())
    took = time.perf_counter() - started
    return replace(
        response, estimate=chosen.estimate, advice=chosen.advice,
        warnings=chosen.warnings + notes + doubt, wall_time_s=took, moved_start=other, scene=scene,
    )  # fmt: skip


def _from_moved(
    scene: Scene, response: Response, start: RestartState | None, progress: Callable[[int, int], None] | None
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """Return the results of a second run from bodies a little aside, and a warning if they are others.

    None where no body hits anything, for a run that is not ok, and where the bodies cannot begin elsewhere.
    """
    hit = response.impacts_per_period or response.counters.get("impacts")  # the transient's choose a state as well
    if response.status is not Status.OK or not hit or not scene.damper:
        return None, ()
    places = moved(scene, scene.positions if start is None else start.slip.tolist())
    if start is None:
        bodies = tuple(replace(body, position=place) for body, place in zip(scene.damper, places, strict=True))
        scene = replace(scene, damper=bodies)
    else:
        start = replace(start, slip=frozen(places))
    try:
        second = respond(scene, start=start, progress=progress)
    except InputError:  # a tilted body at a wall
        return None, ()
    one, other = (_mean(each) for each in (response, second))
    agrees = one.agrees(other, 2 * scene.time.tolerance)
    names = "amplitude_mean_dynamic", "amplitude_mean_confidence", "impacts_per_period", "classification"
    found = {"agrees": agrees, "status": other.status} | {name: getattr(second, name) for name in names}
    return found, () if agrees else (one.sentence(other),)


def _mean(response: Response) -> Mean:
    confidence = response.amplitude_mean_confidence
    return Mean(response.status.value, response.amplitude_mean_dynamic, math.nan if confidence is None else confidence)
