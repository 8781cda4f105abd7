"""Steady states of a sweep: which of its runs differ only in how they begin, and in which motion each ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.quantities.amplitude import amplitude_mean, amplitude_mean_dynamic
from vanedamp.coupling.quantities.impacts import attached_mass_fraction, impacts_per_period
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.store import frozen

#: keys of a body that say how it begins
_BODY = ("position", "velocity", "lift", "lift_velocity", "tilt", "tilt_rate")
#: tables that say how a run begins
_TABLES = ("initial", "continuation")
#: measures that distinguish steady states, and the size below which their differences count as absolute ones
_FINGERPRINT = {amplitude_mean_dynamic.name: 0.0, attached_mass_fraction.name: 1.0, impacts_per_period.name: 1.0}


class SteadyState(NamedTuple):
    """A motion in which runs end: its classification, means of its runs (m, 1, 1), and how many runs end in it."""

    classification: str
    amplitude_mean: float
    attached_mass_fraction: float
    impacts_per_period: float
    runs: int

    @property
    def motion(self) -> str:
        """The classification, and the impacts of a motion that repeats."""
        if not self.classification.startswith("periodic"):
            return self.classification
        return f"{self.classification}, {self.impacts_per_period:.3g} impacts per period"


@dataclass(frozen=True, eq=False)
class SteadyStates:
    """Where the runs of a sweep end.

    starts      axes along which only the start of the runs changes
    parameters  the other axes
    label       shape of the grid: number of the state in which a run ends, among those at the same values of the
                parameters, by rising mean amplitude; -1 for a run that is not ok
    states      (*parameters) objects, each the list of states at a point of the parameters
    """

    starts: tuple[str, ...]
    parameters: tuple[str, ...]
    label: np.ndarray
    states: np.ndarray

    @property
    def count(self) -> np.ndarray:
        """Number of states found at each point of the parameters; 0 where no run is ok."""
        counts: np.ndarray = np.vectorize(len, otypes=[int])(self.states)
        return counts


def is_start(path: str) -> bool:
    """Say whether a key of a scene changes only how a run begins, neither system nor excitation."""
    steps = path.split(".")
    return steps[0] in _TABLES or (steps[0] == "damper" and steps[-1] in _BODY)


def steady_states(sweep: Sweep, tolerance: float = 0.01) -> SteadyStates:
    """Return in which steady state each run of a sweep ends.

    Runs from other starts end in the same state if they have the same classification and their mean amplitudes,
    attached mass fractions and impacts per period agree: within `tolerance`, relative, or within the confidence
    interval of a motion that does not repeat. Chains of such neighbours are one state. None of these depends on the
    period at which a run ends. A motion and its mirror image have them in common and count as one.
    """
    paths = list(sweep.axes)
    starts, parameters = ([path for path in paths if is_start(path) == start] for start in (True, False))
    order = [paths.index(path) for path in (*parameters, *starts)]
    shape = [sweep.shape[axis] for axis in order]
    points = np.transpose(np.arange(sweep.status.size).reshape(sweep.shape), order)
    points = points.reshape(int(np.prod(shape[: len(parameters)])), -1)
    label = np.full(sweep.status.size, -1)
    states = np.empty(len(points), object)
    ok = sweep.status.ravel() == "ok"
    for number, indices in enumerate(points):
        indices = indices[ok[indices]]
        label[indices], states[number] = _states(sweep, indices, tolerance)
    return SteadyStates(
        tuple(starts), tuple(parameters), frozen(label.reshape(sweep.shape), int),
        states.reshape(shape[: len(parameters)]),
    )  # fmt: skip


def _states(sweep: Sweep, indices: np.ndarray, tolerance: float) -> tuple[np.ndarray, list[SteadyState]]:
    """Return labels (n,) and states of the runs at some points of the grid, which differ only in their start."""
    if not len(indices):
        return np.zeros(0, int), []
    classification = sweep.classification.ravel()[indices]
    measures = {name: np.nan_to_num(getattr(sweep, name).ravel()[indices]) for name in _FINGERPRINT}
    amplitude = measures[amplitude_mean_dynamic.name]
    confidence = np.nan_to_num(sweep.amplitude_mean_confidence.ravel()[indices])
    relative = np.divide(confidence, amplitude, out=np.zeros_like(amplitude), where=amplitude > 0)
    half = np.maximum(tolerance / 2, np.where(classification == "non-periodic", relative, 0.0))
    widths = [half * np.maximum(np.abs(values), _FINGERPRINT[name]) for name, values in measures.items()]
    group, count = np.unique(classification, return_inverse=True)[1], 0
    while count != (count := group.max() + 1):  # a split by one measure may open a gap in another
        for values, width in zip(measures.values(), widths, strict=True):
            group = _split(group, values, width)
    by_amplitude = np.argsort([amplitude[group == number].mean() for number in range(count)], kind="stable")
    label, states = np.argsort(by_amplitude)[group], []
    for number in range(count):
        members = label == number
        means = {
            name: float(np.nan_to_num(getattr(sweep, name).ravel()[indices][members]).mean())
            for name in (amplitude_mean.name, attached_mass_fraction.name, impacts_per_period.name)
        }
        states.append(SteadyState(classification[members][0], **means, runs=int(members.sum())))
    return label, states


def _split(group: np.ndarray, values: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return groups (n,), from 0, whose values are chains: intervals value +- half of neighbours overlap."""
    order = np.lexsort([values, group])
    values, half, sorted_group = values[order], half[order], group[order]
    apart = (np.diff(sorted_group) != 0) | (np.diff(values) > half[1:] + half[:-1])
    result = np.empty_like(group)
    result[order] = np.concatenate([[0], np.cumsum(apart)])
    return result
