"""Derivatives of a run by a number of its scene, by differences of runs of the engine.

Nothing of coupling/derivatives enters but the coordinates of a state. Central differences of eighth order at several
steps; the step whose eighth and sixth order agree best counts, and by how much they differ is the estimate of the
error, beside round-off. Runs on all sides must have the same events.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: weights of the differences of sixth and eighth order, at 1, 2, ... steps to either side
_SIXTH = np.array([3 / 4, -3 / 20, 1 / 60, 0.0])
_EIGHTH = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
#: steps that are tried, relative to the size of the number, until the error is this small
STEPS, ENOUGH = (1e-3, 1e-4, 1e-2, 1e-5, 1e-6), 1e-10
#: round-off of a run's results relative to their sizes, apart from what its derivatives multiply
_ROUND_OFF = 3e-15
#: events per period after which a run is given up
MOST_EVENTS = 1000
FIGURES = (
    "amplitude_mean", "amplitude_max", "amplitude_rms", "amplitude_harmonic", "phase", "attached_mass_fraction"
)  # fmt: skip
ENERGIES = ("excitation", "viscous", "friction", "impact", "contact", "stored")


class Observed(NamedTuple):
    """Results of a run: by name, one array each; its events, counted by their names; their sizes, by name."""

    results: dict[str, np.ndarray]
    events: Counter[tuple]
    sizes: dict[str, np.ndarray]


class Difference(NamedTuple):
    """Derivatives by name, and estimates of their errors, relative to `relative`; whether all runs had one sequence.

    relative: by name, the larger of size and derivative, of a relative change of the number; base: the run itself.
    """

    derivative: dict[str, np.ndarray]
    error: dict[str, float]
    relative: dict[str, np.ndarray]
    same: bool
    base: Observed


def observed(scene: Scene, walked: PeriodMap, state: np.ndarray | None, periods: int) -> Observed | None:
    """Return the results of a run of so many periods; None where it makes no scene or does not end.

    walked: the period map of the scene, whose coordinates states have; state: (k,) at the start, None: the scene's own.
    """
    start = None if state is None else walked.restart_of(state)
    short = {"time": {"periods": periods, "transient": 0}, "solver": {"max_events": MOST_EVENTS * periods}}
    response = simulate(scene.replace(short), events=True, start=start)
    if response.final is None or response.status not in (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN):
        return None
    hits = impacts_of(response)
    energies = np.array([response.energy[name] for name in ENERGIES])
    results = {
        "state": walked.state_of(response.final), "peak": response.peak,
        "impact_time": hits[:, 0], "impact_speed": hits[:, 1],
        **{name: _one(getattr(response, name)) for name in FIGURES},
        **{f"energy.{name}": energies[[k]] for k, name in enumerate(ENERGIES)},
    }  # fmt: skip
    motion = np.array([max(float(response.amplitude_max), 1e-300)])
    fastest = np.abs(hits[:, 1]).max(initial=0.0) or 1.0
    sizes = {"state": walked.scale, "impact_time": np.array([1.0 / walked.scene.frequency])} | {
        "impact_speed": np.array([fastest])
    }
    sizes |= dict.fromkeys(("peak", *FIGURES[:4]), motion) | dict.fromkeys(FIGURES[4:], np.ones(1))
    sizes |= dict.fromkeys([f"energy.{name}" for name in ENERGIES], np.array([np.abs(energies).max() or 1.0]))
    return Observed(results, Counter(_name(event) for event in response.event_list), sizes)


def impacts_of(response: Response) -> np.ndarray:
    """Return times and speeds (m, 2) of the impacts of a run, in the order of their names and times."""
    found = [event for event in response.event_list if event.kind == "impact"]
    found.sort(key=lambda event: (_name(event), event.time))
    return np.array([(event.time, abs(event.relative_velocity_before)) for event in found]).reshape(-1, 2)


def _one(value: float | None) -> np.ndarray:
    return np.array([np.nan if value is None else value])


def _name(event) -> tuple:
    return event.kind, event.damper, event.side, event.corner


def difference(observe: Callable[[float], Observed | None], size: float) -> Difference | None:
    """Return the derivative by a number at 0 of what is observed; None without any run on both sides.

    size: of the number.
    """
    base = observe(0.0)
    if base is None:
        return None
    best: Difference | None = None
    for step in STEPS:
        found = _at_step(observe, base, size, step)
        if found is None:
            continue
        if best is None or (found.same and not best.same):
            best = found
        elif found.same == best.same:
            best = _better(best, found)
        if best.same and max(best.error.values()) <= ENOUGH:
            break
    return best


def _better(one: Difference, other: Difference) -> Difference:
    names = {name: min((one, other), key=lambda each: each.error[name]) for name in one.error}
    parts = ({name: getattr(which, field)[name] for name, which in names.items()} for field in Difference._fields[:3])
    return Difference(*parts, one.same, one.base)


def _at_step(
    observe: Callable[[float], Observed | None], base: Observed, size: float, step: float
) -> Difference | None:
    shape, sides = {name: values.shape for name, values in base.results.items()}, []
    for j in (1, 2, 3, 4):
        pair = observe(j * step * size), observe(-j * step * size)
        if any(side is None or any(side.results[name].shape != shape[name] for name in shape) for side in pair):
            return None  # another number of impacts, or no end
        sides.append(pair)
    same = all(side.events == base.events for pair in sides for side in pair)
    derivative, error, relative = {}, {}, {}
    for name, values in base.results.items():
        changes = np.array([_change(name, ahead, back) for ahead, back in sides])
        sixth, eighth = (np.tensordot(weights, changes, 1) / (step * size) for weights in (_SIXTH, _EIGHTH))
        most = np.abs(eighth).max(initial=0.0) if name != "state" else np.abs(eighth / base.sizes[name]).max()
        most = most * base.sizes[name] if name == "state" else most
        relative[name] = np.maximum(base.sizes[name], most * size) / size
        derivative[name] = eighth
        apart = np.abs((sixth - eighth) / relative[name]).max(initial=0.0) if values.size else 0.0
        error[name] = float(apart + _ROUND_OFF / step) if np.isfinite(apart) else np.inf
        if np.isnan(values).all() and np.isnan(eighth).all():
            error[name] = 0.0
    return Difference(derivative, error, relative, same, base)


def _change(name: str, ahead: Observed, back: Observed) -> np.ndarray:
    change = ahead.results[name] - back.results[name]
    return (change + np.pi) % (2 * np.pi) - np.pi if name == "phase" else change


def by_number(scene: Scene, found: PeriodMap, path: str, size: float, value: float, state, way, periods: int):
    """Return the derivative by a number of a run that begins with a state (k,) + way (k,) times the change.

    state, way: None for the scene's own start.
    """

    def observe(change: float) -> Observed | None:
        try:
            walked = found.at(value + change) if change else found
            begun = None if state is None else state + (0.0 if way is None else way * change)
            return observed(walked.scene, walked, begun, periods)
        except InputError:
            return None

    return difference(observe, size)


def by_start(scene: Scene, found: PeriodMap, state: np.ndarray, j: int, periods: int) -> Difference | None:
    """Return the derivative by a coordinate of the start."""
    unit = np.eye(len(state))[j]
    return difference(lambda change: observed(scene, found, state + change * unit, periods), float(found.scale[j]))
