"""A scene in, a response out: resolve what is "auto", then run the scene with its method (methods.registry)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.by_sector import Sectors
from vanedamp.coupling.response.evaluation import Observer, Outcome
from vanedamp.coupling.response.moved_start import Mean, moved
from vanedamp.coupling.response.observers import AsOne, Events, Samples, Wear
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, loaded
from vanedamp.coupling.strength.contact_strength import ContactObserver
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
    observers = observers_of(chosen.scene, events, samples_per_period)
    if moved_start:
        observers.append(MovedStart(start, progress))
    known = {"scene": scene, "estimate": chosen.estimate, "advice": chosen.advice, "warnings": chosen.warnings}
    return respond(chosen.scene, observers, start, progress, known, started)


def observers_of(scene: Scene, events: bool = False, samples_per_period: int = 0) -> list[Observer]:
    """Return what a run keeps of a scene without open choices; arguments as in `simulate`."""
    spots, pair = spots_of(scene), scene.contact.pair
    return [
        Samples(samples_per_period),
        *([Events()] if events else []),
        *([] if scene.wear is None else [Wear()]),
        Sectors(),
        *([] if spots is None else [StressObserver(spots, samples_per_period)]),
        *([] if pair is None or pair.radius is None else [ContactObserver()]),
        AsOne(),
    ]


class MovedStart(Observer):
    """Runs a second time, from bodies a little aside, and warns if the results are others.

    start, progress: those of the first run.
    """

    def __init__(self, start: RestartState | None, progress: Callable[[int, int], None] | None) -> None:
        self.start, self.progress = start, progress

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the results of the second run.

        None where no body hits anything, for a run that is not ok, and where the bodies cannot begin elsewhere.
        """
        hit = found["impacts_per_period"] or run.counters.get("impacts")  # the transient's choose a state as well
        if found["status"] is not Status.OK or not hit or not scene.damper:
            return {}
        start, tolerance = self.start, 2 * scene.time.tolerance
        places = moved(scene, scene.positions if start is None else start.slip.tolist())
        if start is None:
            bodies = tuple(replace(body, position=place) for body, place in zip(scene.damper, places, strict=True))
            scene = replace(scene, damper=bodies)
        else:
            start = replace(start, slip=frozen(places))
        try:
            second = vars(respond(scene, start=start, progress=self.progress))
        except InputError:  # a tilted body at a wall
            return {}
        one, other = (_mean(each) for each in (found, second))
        agrees = one.agrees(other, tolerance)
        names = "amplitude_mean_dynamic", "amplitude_mean_confidence", "impacts_per_period", "classification"
        results = {"agrees": agrees, "status": other.status} | {name: second[name] for name in names}
        return {"moved_start": results, "warnings": () if agrees else (one.sentence(other),)}


def _mean(found: Mapping[str, Any]) -> Mean:
    confidence = found["amplitude_mean_confidence"]
    return Mean(found["status"].value, found["amplitude_mean_dynamic"], math.nan if confidence is None else confidence)
