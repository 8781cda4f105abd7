"""Result of a period map for a state at the start of an excitation period, and where its event sequence changes.

States are physical: modal coordinates of the structure and their rates, then of the bodies relative to their
cavities, in the order of RestartState, without the coordinates that a body does not have.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np


class PassageStatus(StrEnum):
    """How a passage ended."""

    OK = "ok"
    #: an event is tangential within round-off: the map has a kink there, and the derivative holds on one side
    GRAZING = "grazing"
    #: events that do not follow from each other meet at one instant, and their order matters: the derivative holds
    #: for motions in which they still meet, and others part from it by a kink or a jump
    COINCIDENT = "coincident"
    #: no exact derivative, and do not use the matrix: contact forces that the laws do not determine, a wedged block
    UNDETERMINED = "undetermined"
    #: the engine did not reach the end: event budget, undecided, accuracy lost, diverged, ill-conditioned
    STOPPED = "stopped"


class Crossing(NamedTuple):
    """An event on the way.

    time: s since the start; name: of the event with its bodies, corners and surfaces, the same in every passage, such
    as "impact c.left.0" or "sticks 0"; speed: rate of its event function at the crossing, in units of the function per
    second: zero is grazing; energy: J that it takes away.
    """

    time: float
    name: str
    speed: float
    energy: float


class Passage(NamedTuple):
    """Result of a period map for a state (k,).

    state: (k,) after the periods; derivative: (k, k) of it with respect to the state before, one-sided where the map
    has kinks; crossings: the events in order, of which the names are the sequence that tells branches apart;
    clearance: the smallest distance to an event that did not happen (a gap that nearly closed, a force near its bound),
    relative to its scale (free travel, bound), and which: (fraction, name); inf where nothing came near;
    peaks: (periods,) m, largest magnitude of the response's displacement in each period, as in a Response;
    by_number: (k, P) derivative of the state with respect to the numbers of the map, from the same start.
    """

    state: np.ndarray
    derivative: np.ndarray
    crossings: tuple[Crossing, ...]
    clearance: tuple[float, str]
    status: PassageStatus
    peaks: np.ndarray
    by_number: np.ndarray

    def serves(self, derivative: bool) -> bool:
        """Return whether it has come to its end, and has a derivative if that is wanted."""
        if self.status in (PassageStatus.STOPPED, PassageStatus.UNDETERMINED) or not np.isfinite(self.state).all():
            return False
        return not derivative or bool(np.isfinite(self.derivative).all())

    def scaled(self, scale: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of states in units of their sizes (k,)."""
        return np.asarray(self.derivative * (scale / scale[:, None]))

    @property
    def sequence(self) -> tuple[str, ...]:
        """Names of the events in order."""
        return tuple(crossing.name for crossing in self.crossings)

    @property
    def impacts(self) -> tuple[Crossing, ...]:
        """The impacts in order, one for those at one instant."""
        return tuple(crossing for crossing in self.crossings if "impact " in crossing.name)

    @classmethod
    def stopped(cls, state: np.ndarray, periods: int, numbers: int = 0) -> Passage:
        """Return a passage that ends with its start (k,): nothing of it is known."""
        unknown, peaks = np.full((len(state), len(state) + numbers), np.nan), np.full(periods, np.nan)
        k = len(state)
        return cls(state, unknown[:, :k], (), (np.inf, ""), PassageStatus.STOPPED, peaks, unknown[:, k:])


def forecast(seen: Sequence[tuple[float, Passage]]) -> float | None:
    """Return the arclength at which the sequence of the last two passages of a branch will end, None if unknown.

    seen: arclengths, rising, and passages of one sequence. Quantities that vanish there are continued as straight
    lines: the speeds of crossings, the clearances of events that do not happen, the times between events.
    """
    if len(seen) < 2:
        return None
    (early, one), (late, two) = seen[-2:]
    before, after = _vanishing(one), _vanishing(two)
    times = [
        late + (late - early) * after[name] / (before[name] - after[name])
        for name in before.keys() & after.keys()
        if 0.0 <= after[name] < before[name]
    ]
    return min(times, default=None)


def _vanishing(passage: Passage) -> dict[str, float]:
    """Return the quantities of a passage that are positive and vanish where its sequence ends, by name."""
    crossings = passage.crossings
    values = {f"speed {index}": abs(crossing.speed) for index, crossing in enumerate(crossings)}
    for index, (one, other) in enumerate(itertools.pairwise(crossings)):
        values[f"order {index}"] = other.time - one.time
    if crossings:
        values["start"] = crossings[0].time
    share, name = passage.clearance
    if name:
        values[f"clearance {name}"] = share
    return values


def change(before: Passage, after: Passage | None) -> tuple[str, str]:
    """Return the kind of a special point where the sequence changes, and its description.

    "grazing" where an impact begins or ceases, "sequence" for any other change; after: None if unknown.
    """
    if after is None:
        near = before.clearance[1]
        slow = min(before.crossings, key=lambda crossing: abs(crossing.speed), default=None)
        grazing = before.status is PassageStatus.GRAZING or "impact" in near
        name = near or ("" if slow is None else slow.name)
        return ("grazing" if grazing else "sequence"), f"the sequence of events ends, at {name or 'an unknown event'}"
    lost, new = Counter(before.sequence) - Counter(after.sequence), Counter(after.sequence) - Counter(before.sequence)
    words = [f"{name} begins" for name in new] + [f"{name} ceases" for name in lost]
    kind = "grazing" if any("impact" in name for name in (*lost, *new)) else "sequence"
    return kind, ", ".join(words) or "events change their order"
