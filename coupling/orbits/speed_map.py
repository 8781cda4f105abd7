"""The period map of a reduced model along the speed of rotation (orbits.passage.PeriodMap).

The structure's modes turn with the speed, and states of different speeds are compared along a branch. So they are in
the modes of one speed, that of the branch's begin: x_here = T x with T of system.modal_basis.modal_transfer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vanedamp.coupling.orbits.passage import Passage, PeriodMap
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.modal_basis import modal_transfer


@dataclass(frozen=True, eq=False)
class SpeedMap:
    """A period map at a speed, of states in the modes of another one.

    here: the map in the modes of its own speed; reference: rad/s, the speed of the states' modes.
    """

    here: PeriodMap
    reference: float

    @property
    def scene(self) -> Scene:
        """The scene at the map's speed."""
        return self.here.scene

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates; modes are those of the reference."""
        return self.here.names

    @property
    def scale(self) -> np.ndarray:
        """Typical sizes (k,), those at the begin of the branch."""
        return self.here.scale

    @property
    def periods(self) -> int:
        """Excitation periods that the map passes."""
        return self.here.periods

    @cached_property
    def _turn(self) -> tuple[np.ndarray, np.ndarray]:
        """The matrix (k, k) from states to those in the modes of the own speed, and its inverse."""
        structure = self.scene.structure
        assert isinstance(structure, Rom)
        modal = modal_transfer(structure, self.reference, self.scene.speed)
        n, turn = len(modal), np.eye(len(self.scale))
        turn[:n, :n] = turn[n : 2 * n, n : 2 * n] = modal  # displacements, then rates
        return turn, np.linalg.inv(turn)

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        turn, back = self._turn
        passage = self.here(turn @ state)
        return passage._replace(state=back @ passage.state, derivative=back @ passage.derivative @ turn)

    def at(self, value: float) -> SpeedMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return SpeedMap(self.here.at(value), self.reference)

    def over(self, periods: int) -> SpeedMap:
        """Return the map of the same scene over another number of periods."""
        return SpeedMap(self.here.over(periods), self.reference)

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""
        return self._turn[1] @ self.here.state_of(at_speed_of(self.scene, restart))

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""
        return self.here.restart_of(self._turn[0] @ state)

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors."""
        return self._turn[1] @ self.here.linear_orbit()

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry."""
        turn, back = self._turn
        image = self.here.mirrored(turn @ state)
        return None if image is None else back @ image
