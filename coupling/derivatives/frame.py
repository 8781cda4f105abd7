"""States of a scene in the order of RestartState and in its system's, (q, q'): names, sizes, mirror images."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.symmetry import Symmetry, mirror_of, wave_of
from vanedamp.coupling.response.restart import at_speed_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.flow import attached, matrices
from vanedamp.coupling.system.linear_response import linear_response
from vanedamp.coupling.system.modal_basis import transfer_of
from vanedamp.coupling.system.resonance import steady_motion
from vanedamp.coupling.system.system import SURFACES, System
from vanedamp.coupling.tangents.dual import array, inverse, zeros
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


class Frame:
    """A scene's system, and its states (k,).

    speed: of rotation at which the states' modes were taken, rad/s; None: the scene's own. A reduced model's modes turn
    with the speed, and states of different speeds are compared along a branch (system.modal_basis.modal_transfer).
    begin: periods of the excitation from its start to time zero of the system and of the states.
    to_state, from_state: (k, 2N) and (2N, k), between (q, q') and states; sliders have no rates
    of these: the elongations of their springs are states. longest: (j,) m, typical elongations at their bounds.
    """

    def __init__(self, scene: Scene, speed: float | None = None, begin: float = 0.0) -> None:
        self.speed, self.begin = speed, begin
        self.scene, self.system = scene, _later(assemble(scene), begin)
        self._turn: Any = np.eye(self.system.modes)  # from modes of the states to the scene's own, and back
        self._back: Any = self._turn
        if speed is not None and isinstance(scene.structure, Rom):
            self._turn = transfer_of(scene, speed)
            self._back = inverse(self._turn)
        self.extended = np.flatnonzero(self.system.tilt >= 0)
        size, sliders = len(self.system.mass), len(self.system.tangential)
        self.longest = self._longest()
        self.to_state = self._to_state()
        moves = slice(0, 2 * size - sliders)
        self.from_state = zeros((2 * size, len(self.to_state)))
        self.from_state[moves] = inverse(self.to_state[:, moves])

    def _longest(self) -> np.ndarray:
        """Return elongations (j,) at bounds, of contacts as far as their gaps let their springs be pressed."""
        system = self.system
        unit = system.sprung
        press = [0.0 if r >= system.contacts else system.friction[r] * system.spring[r] * system.play[r] for r in unit]
        return (system.limit[unit] + array(press)) / system.tangential

    def _to_state(self) -> np.ndarray:
        """Return the map (k, 2N) of (q, q') to states."""
        system, unit, more = self.system, np.eye(len(self.system.mass)), self.extended
        x = system.along[more]
        parts = (
            self._back @ (system.scale * unit[: system.modes]), unit[system.along] - system.floor,
            unit[x + 1] - system.rise[more], unit[x + 2] - system.turn[more],
        )  # fmt: skip
        size, first = len(unit), 0
        matrix = zeros((2 * size - len(system.elongation), 2 * size))
        for rows in parts:
            middle, last = first + len(rows), first + 2 * len(rows)
            matrix[first:middle, :size], matrix[middle:last, size:] = rows, rows
            first = last
        matrix[first:, :size] = system.elongation
        return matrix

    @property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates."""
        modes, bodies = range(self.system.modes), range(self.system.bodies)
        groups = [("mode", modes, ""), ("body", bodies, " slip"), *(
            ("body", self.extended.tolist(), name) for name in (" lift", " tilt")
        )]  # fmt: skip
        return tuple(
            f"{who} {i}{name}{rate}" for who, numbers, name in groups for rate in ("", " rate") for i in numbers
        ) + tuple(
            f"{'friction damper' if r >= self.system.contacts else SURFACES[self.system.surface[r]]} "
            f"{self.system.body[r]} elongation"
            for r in self.system.sprung
        )

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) of a restart state."""
        restart, back = at_speed_of(self.scene, restart), self._back
        out_of_line = (restart.lift, restart.lift_velocity, restart.tilt, restart.tilt_rate)
        return np.concatenate([
            back @ restart.displacement, back @ restart.velocity, restart.slip, restart.slip_velocity,
            *(part[self.extended] for part in out_of_line), restart.elongation[self.system.drawn],
        ])  # fmt: skip

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the restart state of a state (k,)."""
        n, b, more = self.system.modes, self.system.bodies, len(self.extended)
        parts = np.split(np.asarray(state, float), np.cumsum([n, n, b, b, more, more, more, more]))
        whole, elongation = np.zeros((4, b if self.system.in_plane else 0)), np.zeros(self.system.elongations)
        whole[:, self.extended], elongation[self.system.drawn] = parts[4:8], parts[8]
        structure = (self._turn @ part for part in parts[:2])
        return RestartState(*map(frozen, (*structure, *parts[2:4], elongation, self.system.travels, *whole)))

    def _glued(self) -> np.ndarray:
        """Return complex amplitudes (e, n) of the structure with all bodies at rest on their floors, joints open.

        Amplitudes are inf at a resonance without damping.
        """
        system, e = self.system, len(self.system.frequency)
        lying = attached(system, np.ones(system.bodies, bool), across=True)
        mass, damping, stiffness = matrices(system, lying)
        try:
            return steady_motion(stiffness, damping, mass, system.load @ lying, system.frequency)
        except np.linalg.LinAlgError:
            return np.full((e, system.modes), np.inf + 0j)

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without events: all bodies rest on their floors, and joints stick.

        Raises InputError at a resonance without damping.
        """
        system, stuck = self.system, linear_response(self.system, True, across=True)
        frequency, closed = stuck.order * system.omega, (system.rest <= 0.0) & np.isfinite(system.spring)
        closed &= system.without_body
        pushes = system.weight - (system.spring[closed] * system.rest[closed]) @ system.J[: len(closed)][closed]
        try:
            amplitude = stuck.steady(stuck.load, frequency)
            sag = stuck.steady(attached(system, np.ones(system.bodies, bool), across=True).T @ pushes, np.zeros(1))[0]
        except np.linalg.LinAlgError:
            raise InputError(
                "excitation.frequency: at a resonance without damping no motion repeats; change it"
            ) from None
        moved, elongation = (amplitude.sum(axis=0) + sag).real, np.zeros(system.elongations)
        elongation[system.drawn] = system.elongation[:, : system.modes] @ moved
        parts = {
            "displacement": system.scale * moved,
            "velocity": system.scale * ((1j * frequency) @ amplitude).real,
            "slip": self.scene.positions, "elongation": elongation,
        }  # fmt: skip
        still = self.restart_of(np.zeros(len(self.to_state)))
        return self.state_of(replace(still, **{name: frozen(part) for name, part in parts.items()}))

    def sizes(self) -> np.ndarray:
        """Return sizes (k,) of the coordinates: linear response, plays, tilts that take them, and these times omega."""
        system, omega = self.system, self.system.omega
        reach = np.abs(system.scale) * np.abs(self._glued()).sum(axis=0)
        cavity = [self.scene.cavity[index] for index in system.cavity]
        gap = np.array([each.gap for each in cavity])
        lift, tilt = np.ones((2, len(gap)))
        for b in self.extended:
            lift[b] = cavity[b].play or gap[b]
            tilt[b] = lift[b] / (2.0 * max(self.scene.damper[b].half_extent))
        # a structure that nothing excites, or nothing damps, moves by its start and the bodies
        farthest = float(np.r_[gap, system.travels].max(initial=0.0))
        largest = reach.max(initial=0.0)
        largest = largest if 0.0 < largest < np.inf else farthest or 1.0
        reach = np.where(np.isfinite(reach), np.maximum(reach, 1e-3 * largest), largest)
        of_extended = (lift, omega * lift, tilt, omega * tilt)
        return frozen(np.concatenate([
            reach, omega * reach, gap, omega * gap, *(part[self.extended] for part in of_extended), self.longest
        ]))  # fmt: skip

    @cached_property
    def mirror(self) -> Symmetry | None:
        """Its symmetry x(t) -> -x(t + T/2), of states (k,); None for a scene without it."""
        return self._of_states(mirror_of(self.system))

    @cached_property
    def wave(self) -> Symmetry | None:
        """Its symmetry of travelling waves, of states (k,); None for a scene without it."""
        return self._of_states(wave_of(self.scene, self.system))

    def _of_states(self, symmetry: Symmetry | None) -> Symmetry | None:
        if symmetry is None:
            return None
        return symmetry._replace(image=self.to_state @ np.kron(np.eye(2), symmetry.image) @ self.from_state)


def _later(system: System, begin: float) -> System:
    """Return a system whose time zero is some periods after the start of one of its excitation."""
    if not begin:
        return system
    turned = system.phases(np.array([2.0 * np.pi * begin]))[0]
    return system._replace(load=system.load * turned[:, None], table=system.table * turned)
