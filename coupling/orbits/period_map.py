"""The period map of a scene: a state at the start of an excitation period goes to the state some periods later."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.dynamics import Dynamics
from vanedamp.coupling.orbits.event_names import EventNames
from vanedamp.coupling.orbits.frame import Frame
from vanedamp.coupling.orbits.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.walk import PassageWalk
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import EventRun
from vanedamp.coupling.scene.rotation import SPEEDS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """The period map of a scene, over excitation periods.

    scene: with the map's parameter (a dotted path in it) at its value; scale: (k,) typical sizes of the coordinates,
    the same along a branch, by which they are divided before they are compared; speed: of rotation whose modes those
    of states are, rad/s; None: the scene's own.
    """

    scene: Scene
    parameter: str
    periods: int
    scale: np.ndarray
    speed: float | None = None
    #: the last run, whose subsystems the next one shares
    _earlier: list[EventRun] = field(default_factory=list, init=False)

    @cached_property
    def _frame(self) -> Frame:
        return Frame(self.scene, self.speed)

    @cached_property
    def _dynamics(self) -> Dynamics:
        return Dynamics(self._frame, self.scale)

    @cached_property
    def _event_names(self) -> EventNames:
        return EventNames(self.scene, self._frame.system)

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates, such as "mode 0", "mode 0 rate", "body 0 slip"."""
        return self._frame.names

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        if not np.all(np.isfinite(state)):
            nothing = np.full((len(state), len(state)), np.nan)
            return Passage(state, nothing, (), (np.inf, ""), PassageStatus.STOPPED, np.full(self.periods, np.nan))
        return self._walk(state, self.periods)[0]

    def _walk(self, state: np.ndarray, periods: int) -> tuple[Passage, np.ndarray | None]:
        """Return a passage from a state (k,), and the state half a period after the start."""
        walk = PassageWalk(self._frame, self._dynamics, self._event_names, state, periods, *self._earlier)
        passage = walk.passage()
        self._earlier[:] = [walk.run]
        return passage, walk.half_way

    def at(self, value: float) -> PeriodMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return replace(self, scene=self.scene.replace({self.parameter: value}))

    def over(self, periods: int) -> PeriodMap:
        """Return the map of the same scene over another number of periods."""
        return replace(self, periods=periods)

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""
        return self._frame.state_of(restart)

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""
        return self._frame.restart_of(state)

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors.

        Raises InputError at a resonance without damping.
        """
        return self._frame.linear_orbit()

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry.

        None, too, where the engine does not come so far.
        """
        image = self._frame.image
        if image is None:
            return None
        passage, half = self._walk(state, 1)
        return None if half is None or passage.status is PassageStatus.STOPPED else image @ half


def period_map(scene: Scene, parameter: str = "excitation.frequency", periods: int = 1) -> PeriodMap:
    """Return the map of a scene over excitation periods, with a number of it as parameter (dotted path).

    What the scene leaves open is chosen first. Raises InputError for a scene that the exact engine cannot run.
    """
    if scene.solver.method != "exact":
        raise InputError(
            f'solver.method: orbits are those of the exact engine, not of "{scene.solver.method}"; take "exact"'
        )
    chosen = choose(scene).scene
    check_waveform(chosen, "exact")
    turns = parameter in SPEEDS and isinstance(chosen.structure, Rom)
    return PeriodMap(chosen, parameter, periods, Frame(chosen).sizes(), chosen.speed if turns else None)
