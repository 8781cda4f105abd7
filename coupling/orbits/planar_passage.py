"""The period map of scenes with bodies in the plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.orbits.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.planar_frame import Frame
from vanedamp.coupling.orbits.planar_walk import Walk
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


@dataclass(frozen=True, eq=False)
class PlanarMap:
    """The period map of a scene with bodies in the plane (orbits.passage.PeriodMap).

    parameter: dotted path in the scene; scale: (k,) sizes of the coordinates, the same along a branch.
    """

    scene: Scene
    parameter: str
    periods: int
    scale: np.ndarray

    @cached_property
    def _frame(self) -> Frame:
        return Frame(self.scene)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates."""
        modes, bodies = range(self._frame.system.modes), range(self._frame.system.bodies)
        groups = [("mode", modes, ""), ("body", bodies, " slip"), *(
            ("body", self._frame.extended.tolist(), name) for name in (" lift", " tilt")
        )]  # fmt: skip
        return tuple(
            f"{who} {i}{name}{rate}" for who, numbers, name in groups for rate in ("", " rate") for i in numbers
        ) + tuple(f"friction damper {i} elongation" for i in self._frame.drawn)

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        if not np.all(np.isfinite(state)):
            nothing = np.full((len(state), len(state)), np.nan)
            return Passage(state, nothing, (), (np.inf, ""), PassageStatus.STOPPED, np.full(self.periods, np.nan))
        return Walk(self._frame, self.restart_of(state), self.scale, self.periods).passage()

    def at(self, value: float) -> PlanarMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return replace(self, scene=self.scene.replace({self.parameter: value}))

    def over(self, periods: int) -> PlanarMap:
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
        frame = self._frame
        amplitude, sag = frame.glued()
        if not np.all(np.isfinite(amplitude)):
            raise InputError("excitation.frequency: at a resonance without damping no motion repeats; change it")
        p, rate = frame.system.scale * (amplitude.sum(axis=0).real + sag), frame.system.scale * frame.rates(amplitude)
        slip, none = np.array([damper.position for damper in self.scene.damper]), np.zeros(frame.system.bodies)
        unloaded = np.zeros(frame.system.dampers)
        lying = RestartState(*map(frozen, (p, rate, slip, none, unloaded, (), none, none, none, none)))
        return frame.state_of(lying)

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry.

        None, too, where the engine does not come so far.
        """
        image = self._frame.image
        if image is None:
            return None
        walk = Walk(self._frame, self.restart_of(state), self.scale, 1)
        if walk.passage().status is PassageStatus.STOPPED:
            return None
        half, _ = walk.middle.after(0.5 * self._frame.system.period - walk.middle.time)
        mirrored: np.ndarray = image @ self._frame.to_state @ half
        return mirrored


def planar_map(scene: Scene, parameter: str, periods: int) -> PlanarMap:
    """Return the period map of a scene with bodies in the plane. Raises InputError for one that it cannot run."""
    check_waveform(scene, "exact")
    return PlanarMap(scene, parameter, periods, Frame(scene).sizes())
