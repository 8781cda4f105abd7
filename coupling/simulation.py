"""A scene in, a response out: resolve what is "auto", then run the scene with its method (methods.registry)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from vanedamp.coupling.methods.registry import WALLS, respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.by_sector import sectors
from vanedamp.coupling.response.evaluation import Fields, Observer, Outcome
from vanedamp.coupling.response.moved_start import Mean, moved
from vanedamp.coupling.response.observers import EVENT_LIST, TOGETHER, samples, wear
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.scene.structures import Ring
from vanedamp.coupling.strength.contact_strength import CONTACTS, wanted
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.coupling.strength.stress_observer import StressObserver
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
    start = start or chosen.start
    known = {"scene": scene, "estimate": chosen.estimate, "advice": chosen.advice, "warnings": chosen.warnings}
    observers = [Observer(lambda *_: known), *observers_of(chosen.scene, events, samples_per_period)]
    if moved_start:
        observers.append(Observer(partial(_from_moved, start, progress)))
    return respond(chosen.scene, observers, start, progress, started)


def observers_of(scene: Scene, events: bool = False, samples_per_period: int = 0) -> list[Observer]:
    """Return what a run keeps of a scene without open choices; arguments as in `simulate`."""
    spots = spots_of(scene)
    return [
        WALLS,
        samples(samples_per_period),
        *([EVENT_LIST] if events else []),
        *([] if scene.wear is None else [wear(scene)]),
        *([sectors(scene)] if isinstance(scene.structure, Ring) else []),
        *([] if spots is None else [StressObserver(spots, samples_per_period)]),
        *([CONTACTS] if wanted(scene) else []),
        TOGETHER,
    ]


def _from_moved(
    start: RestartState | None, progress: Callable[[int, int], None] | None, scene: Scene, run: Outcome, known: Fields
) -> Fields:
    """Return the results of a second run from bodies a little aside, and a warning if they are others.

    None where no body hits anything, for a run that is not ok, and where the bodies cannot begin elsewhere.
    """
    hit = known["impacts_per_period"] or run.counters.get("impacts")  # the transient's choose a state as well
    if known["status"] is not Status.OK or not hit or not scene.damper:
        return {}
    tolerance = 2 * scene.time.tolerance
    places = moved(scene, scene.positions if start is None else start.slip.tolist())
    if start is None:
        bodies = tuple(replace(body, position=place) for body, place in zip(scene.damper, places, strict=True))
        scene = replace(scene, damper=bodies)
    else:
        start = replace(start, slip=frozen(places))
    try:
        second = vars(respond(scene, start=start, progress=progress))
    except InputError:  # a tilted body at a wall
        return {}
    one, other = (_mean(each) for each in (known, second))
    agrees = one.agrees(other, tolerance)
    names = "amplitude_mean_dynamic", "amplitude_mean_confidence", "impacts_per_period", "classification"
    results = {"agrees": agrees, "status": other.status} | {name: second[name] for name in names}
    return {"moved_start": results, "warnings": () if agrees else (one.sentence(other),)}


def _mean(found: Fields) -> Mean:
    confidence = found["amplitude_mean_confidence"]
    return Mean(found["status"].value, found["amplitude_mean_dynamic"], math.nan if confidence is None else confidence)
