"""A scene in, a response out: resolve "auto", then run the scene with its method (methods.registry)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from vanedamp.coupling.methods.registry import WALLS, respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response import contact_friction
from vanedamp.coupling.response.by_sector import sectors
from vanedamp.coupling.response.evaluation import Fields, Observer, Outcome
from vanedamp.coupling.response.moved_start import KEPT, Mean, moved
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
    state that another run has left (`Response.final`), instead of the scene's initial one, where the method can;
    progress: called with periods done and to do; moved_start: run a second time, from bodies
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
    """Return the observers of a scene without open choices; arguments as in `simulate`."""
    return [
        WALLS,
        samples(samples_per_period),
        *([EVENT_LIST] if events else []),
        *parts_of_run(scene, samples_per_period),
        TOGETHER,
    ]


def parts_of_run(scene: Scene, samples_per_period: int = 0) -> list[Observer]:
    """Return the observers for quantities of a run; samples_per_period: of others."""
    spots = spots_of(scene)
    return [
        *parts_of(scene),
        *([] if spots is None else [StressObserver(spots, samples_per_period)]),
        *([contact_friction.FRICTION_BY_CONTACT] if contact_friction.wanted(scene) else []),
    ]


def parts_of(scene: Scene) -> list[Observer]:
    """Return the observers for quantities of any motion of a scene: wear, sectors, contact strength."""
    return [
        *([] if scene.wear is None else [wear(scene)]),
        *([sectors(scene)] if isinstance(scene.structure, Ring) else []),
        *([CONTACTS] if wanted(scene) else []),
    ]


def _from_moved(
    start: RestartState | None, progress: Callable[[int, int], None] | None, scene: Scene, run: Outcome, known: Fields
) -> Fields:
    """Return the results of a second run from bodies a little aside, and a warning if they are others.

    None where no body hits anything, for a run that is not ok, and where the bodies cannot begin elsewhere.
    """
    # those of the transient choose a state as well
    hit = run.records.impacts[known["transient"] : run.periods].any() or run.counters.get("impacts")
    if known["status"] is not Status.OK or not hit or not scene.damper:
        return {}
    places = moved(scene, scene.positions if start is None else start.slip.tolist())
    if start is None:
        bodies = tuple(replace(body, position=position) for body, position in zip(scene.damper, places, strict=True))
        scene = replace(scene, damper=bodies)
    else:
        start = replace(start, slip=frozen(places))
    try:
        second = respond(scene, start=start, progress=progress)
    except InputError:  # a tilted body at a wall
        return {}
    one = Mean.of(known["status"].value, known["quantities"])
    other = Mean.of(second.status.value, second.quantities)
    results, warnings = one.compared(other, scene.time.tolerance)
    results |= {name: getattr(second, name) for name in (*KEPT, "classification")}
    return {"moved_start": results, "warnings": warnings}
