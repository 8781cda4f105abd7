"""The record of a sensitivity: values, their derivatives by numbers of the scene, and whether these mean something."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

#: reasons why derivatives do not have what some quantities need, by names of sources (arguments of their formulas)
NOT_IN_DERIVATIVES: dict[str, str] = {
    "confidence": "is no property of the motion",
    "unbalanced": "is round-off, a check of the run",
    "overlap": "the exact engine enters no rigid wall: it is 0",
    "neglected": "bounds an error of the model, not of the motion",
    **dict.fromkeys(("undamped", "fixed"), "is of the linear structure: take differences of its curve, without runs"),
    **dict.fromkeys(("undamped_top", "fixed_top"), "is of a curve over the frequency, not of one motion"),
    "stress": "is not differentiated: take differences of runs, whose stress is exact",
    "lyapunov": "is the growth of these derivatives in a motion that does not repeat",
    **dict.fromkeys(("section", "slip", "slip_velocity"), "is a series of states: `state_derivative` has the last"),
    "transient": "is a number of periods",
    "contact_friction": "is of runs and sweeps",
}


#: data of a motion, with derivatives "<name>_derivative"; all but the first one are series
SERIES = ("state", "peak", "impact_time", "impact_speed", "motion")


class SensitivityStatus(StrEnum):
    """Whether derivatives exist and mean something. Unless `ok`, there are none, nor figures."""

    OK = "ok"
    """there are derivatives, but for numbers that the note names: nan"""
    GRAZING = "grazing"
    """an event is tangential, or a run begins with one: derivatives differ from side to side"""
    COINCIDENT = "coincident"
    """events that do not follow from each other meet at one instant"""
    UNDETERMINED = "undetermined"
    """contact forces that the laws do not determine, or a kink of the equations in every number"""
    STOPPED = "stopped"
    """the engine did not reach the end, or the search found no orbit"""
    FOLD = "fold"
    """the orbit is at a fold or another point where it does not depend smoothly on numbers"""
    PARTS = "parts"
    """neighbouring motions part so fast that derivatives say nothing of a finite change"""


class Impact(NamedTuple):
    """An impact: time, s, speed of approach, m/s, and derivatives (P,) of both."""

    time: float
    speed: float
    of_time: np.ndarray
    of_speed: np.ndarray


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """A motion's figures and their derivatives by P numbers of its scene.

    paths            of the numbers; derivatives are by a unit of each
    status, note     whether there are derivatives, and why not
    values           quantities by the names that a Response has, "<name>.<label or number>" of those with a dimension;
                     energies as "energy.friction", harmonics of other orders as "harmonic.3.amplitude"
    derivatives      (P,) of each figure
    names            (k,) of the coordinates of states
    state            (k,) of an orbit at the start of its period; of a run at its end
    state_derivative (k, P)
    peak             (n,) m, largest displacement of each period; peak_derivative: (n, P)
    impact_time      (m,) s, of impacts on rigid and compliant contacts, one for those at one instant
    impact_time_derivative (m, P)
    impact_speed     (m,) m/s, of approach; impact_speed_derivative: (m, P)
    time             (t,) s of the samples
    motion           (t, 3) displacement, velocity and acceleration then; motion_derivative: (t, 3, P)
    """

    paths: tuple[str, ...]
    status: SensitivityStatus
    note: str
    values: Mapping[str, float]
    derivatives: Mapping[str, np.ndarray]
    names: tuple[str, ...]
    state: np.ndarray
    state_derivative: np.ndarray
    peak: np.ndarray
    peak_derivative: np.ndarray
    impact_time: np.ndarray
    impact_speed: np.ndarray
    impact_time_derivative: np.ndarray
    impact_speed_derivative: np.ndarray
    time: np.ndarray
    motion: np.ndarray
    motion_derivative: np.ndarray

    @property
    def complete(self) -> bool:
        """Whether there are derivatives by all numbers."""
        return self.status is SensitivityStatus.OK and bool(np.isfinite(self.state_derivative).all())

    def to_json(self) -> dict[str, Any]:
        """Return figures and derivatives as plain data, by figure and path."""
        return {
            "status": self.status.value, "note": self.note, "values": dict(self.values),
            "derivatives": {
                name: dict(zip(self.paths, map(float, turns), strict=True)) for name, turns in self.derivatives.items()
            },
        }  # fmt: skip
