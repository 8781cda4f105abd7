"""What a period map returns: a state at the start of an excitation period goes to the state some periods later.

States are physical: modal coordinates of the structure and their rates, then those of the bodies relative to their
cavities, in the order of RestartState, without the coordinates that a body does not have.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np


class PassageStatus(StrEnum):
    """How a passage ended."""

    OK = "ok"
    #: an event is tangential within round-off: the map has a kink there, and the derivative is that of one side
    GRAZING = "grazing"
    #: events that do not follow from each other meet at one instant, and their order matters: the derivative is that
    #: of motions in which they still meet, and others part from it by a kink or a jump
    COINCIDENT = "coincident"
    #: no exact derivative, and the matrix is not to be used: contact forces that the laws leave open, a wedged block
    UNDETERMINED = "undetermined"
    #: the engine did not reach the end: event budget, undecided, accuracy lost, diverged, ill-conditioned
    STOPPED = "stopped"


class Crossing(NamedTuple):
    """An event on the way.

    time: s since the start; name: of the event with its bodies, corners and surfaces, the same in every passage, such
    as "impact c.left.0" or "sticks 0"; speed: rate of its event function at the crossing, in units of the function a
    second: zero is grazing; energy: J that it takes away.
    """

    time: float
    name: str
    speed: float
    energy: float


class Passage(NamedTuple):
    """What a period map returns for a state (k,).

    state: (k,) after the periods; derivative: (k, k) of it with respect to the state before, one-sided where the map
    has kinks; crossings: the events in order, of which the names are the sequence that tells branches apart;
    clearance: the smallest distance to an event that did not happen (a gap that nearly closed, a force near its bound),
    as a share of its scale (free travel, bound), and which: (share, name); inf where nothing came near;
    peaks: (periods,) m, largest magnitude of the response's displacement in each period, as in a Response.
    """

    state: np.ndarray
    derivative: np.ndarray
    crossings: tuple[Crossing, ...]
    clearance: tuple[float, str]
    status: PassageStatus
    peaks: np.ndarray

    @property
    def sequence(self) -> tuple[str, ...]:
        """Names of the events in order."""
        return tuple(crossing.name for crossing in self.crossings)
