"""States of scenes with bodies in the plane: in the order of RestartState, as the engine has them, mirror images."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vanedamp.coupling.numerics.codes import STICK
from vanedamp.coupling.orbits.planar_names import UnitNames
from vanedamp.coupling.planar.contact_flow import ContactFlows
from vanedamp.coupling.response.restart import state_at
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Motion, assemble
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen


class Frame:
    """A scene's system, and its states (k,) in the order of RestartState against those of the engine, (q, q')."""

    def __init__(self, scene: Scene) -> None:
        self.system = assemble(scene)
        self.names, self.scene = UnitNames(scene, self.system), scene
        self.flows: list[ContactFlows] = []  # that all passages share
        self.extended = np.flatnonzero(self.system.tilt >= 0)
        size, sliders = len(self.system.mass), len(self.system.tangential)
        #: friction dampers that are Jenkins elements (j,), each with its elongation as a state; its slider has no rate
        self.drawn = self.system.body[len(self.system.body) - sliders :]
        #: their elongations (j,) at their bounds, m
        self.longest = self.system.limit[len(self.system.limit) - sliders :] / self.system.tangential
        units = np.eye(2 * size)
        self.to_state = np.column_stack([self.state_of(self.restart_at(z[:size], z[size:])) for z in units])
        moves = slice(0, 2 * size - sliders)
        self.from_state = np.zeros((2 * size, len(self.to_state)))
        self.from_state[moves] = np.linalg.inv(self.to_state[:, moves])

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """Return the gaps (u,) at coordinates (N,), m."""
        gaps: np.ndarray = self.system.rest + self.system.J[: len(self.system.rest)] @ q
        return gaps

    def restart_at(self, q: np.ndarray, v: np.ndarray) -> RestartState:
        """Return the restart state of coordinates (N,) and their rates."""
        return state_at(self.system, Motion(q, v))

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) of a restart state."""
        out_of_line = (restart.lift, restart.lift_velocity, restart.tilt, restart.tilt_rate)
        return np.concatenate([
            restart.displacement, restart.velocity, restart.slip, restart.slip_velocity,
            *(part[self.extended] for part in out_of_line), restart.elongation[self.drawn],
        ])  # fmt: skip

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the restart state of a state (k,)."""
        n, b, more = self.system.modes, self.system.bodies, len(self.extended)
        parts = np.split(np.asarray(state, float), np.cumsum([n, n, b, b, more, more, more, more]))
        whole, elongation = np.zeros((4, b)), np.zeros(self.system.dampers)
        whole[:, self.extended], elongation[self.drawn] = parts[4:8], parts[8]
        return RestartState(*map(frozen, (*parts[:4], elongation, self.system.travels, *whole)))

    def glued(self) -> tuple[np.ndarray, np.ndarray]:
        """Return complex amplitudes (e, n) of the structure with all bodies at rest on their floors; its sag (n,).

        Amplitudes are inf at a resonance without damping.
        """
        system, n = self.system, self.system.modes
        lying = np.eye(len(system.mass))[:, :n]
        for b, x in enumerate(system.along):
            lying[x] = system.floor[b, :n]
            if system.tilt[b] >= 0:
                lying[x + 1], lying[x + 2] = system.rise[b, :n], system.turn[b, :n]
        mass, stiffness, damping = (
            lying.T @ part @ lying for part in (np.diag(system.mass), system.stiffness, system.damping)
        )
        omega = system.frequency[:, None, None]
        dynamic = stiffness + 1j * omega * damping - omega**2 * mass
        sag = np.linalg.solve(stiffness, system.weight @ lying)
        try:
            return np.linalg.solve(dynamic, (system.load @ lying)[:, :, None])[:, :, 0], sag
        except np.linalg.LinAlgError:
            return np.full((len(omega), n), np.inf + 0j), sag

    def followed(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return maps (N, N) of coordinates and of rates to those with sliders where they are in states (u,).

        Those of Jenkins elements that slip follow what draws them, others rest.
        """
        system, size, sliders = self.system, len(self.system.mass), len(self.system.tangential)
        places, rates = np.eye(size), np.eye(size)
        for j, row in enumerate(system.elongation):
            a, drawn = size - sliders + j, np.r_[row[: size - sliders], np.zeros(sliders)]
            slips = state[len(state) - sliders + j] != STICK
            rates[a] = drawn if slips else 0.0
            places[a] = drawn if slips else places[a]
        return places, rates

    def rates(self, amplitude: np.ndarray) -> np.ndarray:
        """Return the rates (n,) at phase zero of complex amplitudes (e, n)."""
        rates: np.ndarray = ((1j * self.system.frequency) @ amplitude).real
        return rates

    def sizes(self) -> np.ndarray:
        """Return sizes (k,) of the coordinates: linear response, plays, tilts that take them, and these times omega."""
        system, omega = self.system, float(self.system.frequency[0])
        reach = system.scale * np.abs(self.glued()[0]).sum(axis=0)
        damper = self.scene.damper
        cavity = [self.scene.cavity[index] for index in system.cavity]
        gap = np.array([each.gap for each in cavity])
        lift, tilt = np.ones(len(gap)), np.ones(len(gap))
        for b in self.extended:
            lift[b] = cavity[b].play or gap[b]
            tilt[b] = lift[b] / (2.0 * max(damper[b].half_extent))
        # a structure that nothing excites, or nothing damps, moves by its start and the bodies
        largest = np.abs(reach).max(initial=0.0)
        largest = largest if 0.0 < largest < np.inf else float(gap.max(initial=0.0)) or 1.0
        reach = np.where(np.isfinite(reach), np.maximum(np.abs(reach), 1e-6 * largest), largest)
        most = np.zeros(system.dampers)
        most[self.drawn] = self.longest
        size = RestartState(
            *map(frozen, (reach, omega * reach, gap, omega * gap, most, (), lift, omega * lift, tilt, omega * tilt))
        )
        return frozen(self.state_of(size))

    @cached_property
    def image(self) -> np.ndarray | None:
        """Map (k, k) of states to their mirror images; None for a scene without that symmetry."""
        system = self.system
        turned = image_of(system)
        if turned is None:
            return None
        both = np.kron(np.eye(2), turned)
        image: np.ndarray = self.to_state @ both @ self.from_state
        return image


def image_of(system: System) -> np.ndarray | None:
    """Return the map (N, N) of coordinates to those of the mirror image; None where that is another scene."""
    size, u, bodies = len(system.mass), len(system.rest), len(system.along)
    image = np.zeros((size, size))
    image[: size if not bodies else system.along[0]] = -np.eye(size)[: size if not bodies else system.along[0]]
    for index in set(system.cavity.tolist()):
        row = np.flatnonzero(system.cavity == index)
        for b, partner in zip(row, row[::-1], strict=True):
            x, y = system.along[b], system.along[partner]
            if (system.tilt[b] >= 0) != (system.tilt[partner] >= 0):
                return None
            image[x, y] = -1.0
            if system.tilt[b] >= 0:
                image[x + 1, y + 1], image[x + 2, y + 2] = 1.0, -1.0
    same = lambda a, b: np.allclose(a, b, rtol=1e-12, atol=1e-14 * np.abs(a).max(initial=0.0))  # noqa: E731
    half = np.exp(1j * np.pi * np.round(system.frequency / system.frequency[0]))
    if not (
        same(image.T @ np.diag(system.mass) @ image, np.diag(system.mass))
        and same(image.T @ system.stiffness @ image, system.stiffness)
        and same(image.T @ system.damping @ image, system.damping)
        and same(system.load * half[:, None] @ image, system.load)
        and same(system.weight @ image, system.weight)
    ):
        return None
    kinds = np.column_stack(
        [system.friction, system.limit, system.restitution, system.dashpot, np.nan_to_num(system.spring, posinf=-1.0),
         np.nan_to_num(system.rest), np.nan_to_num(system.play, posinf=-1.0)]
    )  # fmt: skip
    normal, slip = system.J[:u], system.J[u:]
    for r in range(u):
        partners = [
            o for o in range(u)
            if same(normal[r], normal[o] @ image) and same(kinds[r], kinds[o])
            and (same(slip[r], -slip[o] @ image) or same(slip[r], slip[o] @ image))
        ]  # fmt: skip
        if not partners:
            return None
    return image
