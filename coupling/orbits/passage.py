"""The contract of a period map: a state at the start of an excitation period goes to the state some periods later.

States are physical: modal coordinates of the structure and their rates, then those of the bodies relative to their
cavities, in the order of RestartState, without the coordinates that a body does not have.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene


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


class PeriodMap(Protocol):
    """A period map of a scene."""

    @property
    def scene(self) -> Scene:
        """The scene with the map's parameter at its value."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates, such as "mode 0", "mode 0 rate", "body 0 slip"."""

    @property
    def scale(self) -> np.ndarray:
        """Typical sizes (k,), by which coordinates are divided before they are compared."""

    @property
    def periods(self) -> int:
        """Excitation periods that the map passes."""

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""

    def at(self, value: float) -> PeriodMap:
        """Return the map of the same scene with its parameter (any dotted key of it) set to a value.

        Raises InputError for a value that makes it no scene.
        """

    def over(self, periods: int) -> PeriodMap:
        """Return the map of the same scene over another number of periods."""

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors."""

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry."""
