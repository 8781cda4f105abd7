"""Derivatives of a run by a number of its scene, by differences of runs of the engine.

Nothing of coupling/derivatives enters but the coordinates of a state. Central differences of eighth order at several
steps; the step whose eighth and sixth order agree best counts, and by how much they differ is the estimate of the
error, beside round-off. Runs on all sides must have the same events.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.quantities.quantity import labels, table
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: weights of the differences of sixth and eighth order, at 1, 2, ... steps to either side
_SIXTH = np.array([3 / 4, -3 / 20, 1 / 60, 0.0])
_EIGHTH = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
#: steps that are tried, relative to the size of the number, until the error is this small
STEPS, ENOUGH = (1e-3, 1e-4, 1e-2, 1e-5, 1e-6), 1e-10
#: steps of which two are to agree
SURE = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
#: round-off of a run's results relative to their sizes, apart from what its derivatives multiply
_ROUND_OFF = 3e-15
#: amplitude, relative to the size of the first coordinate, of a motion that is none
STILL = 1e-6
#: events per period after which a run is given up
MOST_EVENTS = 200
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


class Coordinates(NamedTuple):
    """How a restart state is one (k,) of a period map: numbers of the bodies in the plane, of the Jenkins elements."""

    extended: list[int]
    drawn: list[int]
    scale: np.ndarray

    @classmethod
    def of(cls, scene: Scene, scale: np.ndarray) -> Coordinates:
        """Return those of a scene without a reduced model that turns. scale: (k,) sizes of coordinates."""
        planar = [i for i, damper in enumerate(scene.damper) if damper.form.planar]
        drawn = [i for i, damper in enumerate(scene.friction_damper) if damper.stiffness is not None]
        return cls(planar, drawn, scale)

    def state_of(self, final: RestartState) -> np.ndarray:
        """Return the state (k,)."""
        across = (final.lift, final.lift_velocity, final.tilt, final.tilt_rate)
        return np.concatenate([
            final.displacement, final.velocity, final.slip, final.slip_velocity,
            *(part[self.extended] for part in across if len(part)), final.elongation[self.drawn],
        ])  # fmt: skip


def observed(scene: Scene, known: Coordinates, start: RestartState | None) -> Observed | None:
    """Return the results of a run of a scene from a state, None: its own; None if it does not end."""
    response = simulate(scene, events=True, start=start)
    if response.final is None or response.status not in (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN):
        return None
    hits = impacts_of(response)
    energies = np.array([response.energy[name] for name in ENERGIES])
    results = {
        "state": known.state_of(response.final), "peak": response.peak,
        "impact_time": hits[:, 0], "impact_speed": hits[:, 1],
        **{name: np.array([value]) for name, value in quantities_of(response).items()},
        **{f"energy.{name}": energies[[k]] for k, name in enumerate(ENERGIES)},
    }  # fmt: skip
    motion = np.array([max(float(response.amplitude_max), STILL * float(known.scale[0]))])
    fastest = np.array([np.abs(hits[:, 1]).max(initial=0.0) or 1.0])
    sizes = {"state": known.scale, "impact_time": np.array([1.0 / scene.frequency]), "impact_speed": fastest}
    sizes |= {"peak": motion} | {name: _size(name, results[name], motion) for name in results if name not in sizes}
    sizes |= dict.fromkeys([f"energy.{name}" for name in ENERGIES], np.array([np.abs(energies).max() or 1.0]))
    return Observed(results, Counter(_name(event) for event in response.event_list), sizes)


def impacts_of(response: Response) -> np.ndarray:
    """Return times and speeds (m, 2) of the impacts of a run, in the order of their names and times."""
    found = [event for event in response.event_list if event.kind == "impact"]
    found.sort(key=lambda event: (_name(event), event.time))
    return np.array([(event.time, abs(event.relative_velocity_before)) for event in found]).reshape(-1, 2)


def quantities_of(response: Response) -> dict[str, float]:
    """Return all quantities of a run that are numbers, those with one dimension as "<name>.<label or place>"."""
    found = {}
    for name, one in table().items():
        value = None if one.text else getattr(response, name)
        if value is not None and not one.dims:
            found[name] = float(value)
        elif value is not None and len(one.dims) == 1 and one.dims != ("section",):
            names = labels(one.dims[0]) or range(len(value))
            found |= {f"{name}.{label}": float(each) for label, each in zip(names, value, strict=True)}
    return {name: value for name, value in found.items() if not np.isnan(value)}


def _size(name: str, value: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the size of a result: of displacements that of the motion, 1 of fractions and angles of phases."""
    one = table().get(name.split(".")[0])
    if one is not None and one.unit == "m":
        return motion
    return np.ones(1) if one is None or one.unit == "1" or name == "phase" else np.abs(value) + (value == 0.0)


def _name(event) -> tuple:
    return event.kind, event.damper, event.side, event.corner


def difference(observe: Callable[[float], Observed | None], size: float, sure: bool = False) -> Difference | None:
    """Return the derivative by a number at 0 of what is observed; None without any run on both sides.

    size: of the number; sure: with steps ten times apart that agree, as the error says: this tells kinks near by.
    """
    base = observe(0.0)
    if base is None:
        return None
    if sure:
        found = [each for step in SURE if (each := _at_step(observe, base, size, step)) is not None and each.same]
        pairs = [_agreeing(one, other) for one, other in itertools.pairwise(found)]
        return reduce(_better, pairs) if pairs else None
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


def _agreeing(one: Difference, other: Difference) -> Difference:
    """Return the first of two, whose error is at least how far the other is from it."""
    apart = {
        name: float(np.abs((values - other.derivative[name]) / one.relative[name]).max(initial=0.0))
        for name, values in one.derivative.items()
    }  # fmt: skip
    return one._replace(error={name: max(error, apart[name]) for name, error in one.error.items()})


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


def by_numbers(
    scene: Scene, walked: PeriodMap, moves: Mapping[str, tuple[float, float]], state: np.ndarray | None,
    way: np.ndarray | None, sure: bool = False,
) -> Difference | None:  # fmt: skip
    """Return the derivative of a run as numbers change together, each by its size per unit.

    walked: the period map of the scene, over the periods of the run; moves: path -> value, size; state, way: (k,) start
    and its derivative, None for the scene's own start; sure: as in `difference`.
    """
    known = Coordinates.of(scene, walked.scale)
    options = {"time": {"periods": walked.periods, "transient": 0}}
    short = scene.replace(options | {"solver": {"max_events": MOST_EVENTS * walked.periods}})

    def observe(change: float) -> Observed | None:
        try:
            moved = short.replace({path: value + change * size for path, (value, size) in moves.items()})
            if state is None or way is None:
                return observed(moved, known, None)
            # of the scene as it is now: a body in touch with a wall would follow it from another gap
            there = replace(walked, given=moved, earlier=[])
            return observed(moved, known, there.restart_of(state + way * change))
        except InputError:
            return None

    return difference(observe, 1.0, sure)
