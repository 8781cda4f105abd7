"""The period map of a scene of sliders (orbits.passage.PeriodMap)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vanedamp.coupling.exact.subsystem_assembly import Flows
from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.orbits.passage import Passage, PassageStatus
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.orbits.slider_names import RowNames
from vanedamp.coupling.orbits.slider_symmetry import mirror_of
from vanedamp.coupling.orbits.slider_walk import Walk
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


@dataclass(frozen=True, eq=False)
class SliderMap:
    """The period map of a scene of sliders, for the contract of orbits.passage.

    parameter: dotted path in the scene; scale: (k,) sizes of the coordinates, the same along a branch.
    """

    scene: Scene
    parameter: str
    periods: int
    scale: np.ndarray

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates."""
        modes, bodies = range(self._dynamics.system.modes), range(self._dynamics.system.bodies)
        springs = self._dynamics.springs - self._dynamics.system.bodies
        return (
            *(f"mode {i}" for i in modes), *(f"mode {i} rate" for i in modes), *(f"body {i} slip" for i in bodies),
            *(f"body {i} slip rate" for i in bodies), *(f"friction damper {i} elongation" for i in springs),
        )  # fmt: skip

    @cached_property
    def _dynamics(self) -> SliderDynamics:
        return SliderDynamics(assemble(self.scene), self.scale)

    @cached_property
    def _names_of_rows(self) -> RowNames:
        return RowNames(self.scene, self._dynamics.system)

    @cached_property
    def _flows(self) -> list[Flows]:
        """The engine's subsystems, which all passages of a map share."""
        return []

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        if not np.all(np.isfinite(state)):
            nothing = np.full((len(state), len(state)), np.nan)
            return Passage(state, nothing, (), (np.inf, ""), PassageStatus.STOPPED, np.full(self.periods, np.nan))
        return self._walk(state).passage

    def _walk(self, state: np.ndarray) -> Walk:
        walk = Walk(self._dynamics, self._names_of_rows, self.restart_of(state), self.periods, self._flows)
        self._flows[:] = [walk.run.flows]
        return walk

    def at(self, value: float) -> SliderMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return replace(self, scene=self.scene.replace({self.parameter: value}))

    def over(self, periods: int) -> SliderMap:
        """Return the map of the same scene over another number of periods."""
        return replace(self, periods=periods)

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""
        springs = restart.elongation[self._dynamics.springs - self._dynamics.system.bodies]
        return np.r_[restart.displacement, restart.velocity, restart.slip, restart.slip_velocity, springs]

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""
        system = self._dynamics.system
        n, b, friction = system.modes, system.bodies, system.friction_rows
        parts = np.split(np.asarray(state, float), np.cumsum([n, n, b, b]))
        elongation = np.zeros(friction - b)
        elongation[self._dynamics.springs - b] = parts[4]
        return RestartState(*map(frozen, (*parts[:4], elongation, system.free_travel[friction:])))

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors.

        Raises InputError at a resonance without damping.
        """
        dynamics, system = self._dynamics, self._dynamics.system
        b, amplitude = system.bodies, dynamics.glued_amplitude()
        if not np.all(np.isfinite(amplitude)):
            raise InputError("excitation.frequency: at a resonance without damping no motion repeats; change it")
        weight = system.of_bodies.weight @ system.floor
        p = amplitude.sum(axis=0).real + weight / system.of_structure.stiffness
        rate = ((1j * system.frequency) @ amplitude).real
        place = [damper.position for damper in self.scene.damper]
        return np.concatenate([dynamics.scale * p, dynamics.scale * rate, place, np.zeros(b + len(dynamics.springs))])

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry.

        None, too, where the engine does not come so far.
        """
        mirror = self._mirror
        if mirror is None:
            return None
        half = self._walk(state).half_way()
        return None if half is None else mirror @ half

    @cached_property
    def _mirror(self) -> np.ndarray | None:
        return mirror_of(self._dynamics)


def slider_map(scene: Scene, parameter: str, periods: int) -> SliderMap:
    """Return the period map of a scene of sliders. Raises InputError for one that the exact engine cannot run."""
    check_waveform(scene, "exact")
    return SliderMap(scene, parameter, periods, SliderDynamics(assemble(scene)).sizes)
