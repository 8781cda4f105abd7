"""A scene as small dense matrices, for the reference integrator.

Coordinates: q of the structure, r of the bodies relative to their cavities. Every contact and friction force is
internal to r, so that with h the forces that the cavities exert on the bodies

    M q'' = f sin t - C q' - K q - W h,        r'' = h / m + g - a sin t - W^T q''

Time is measured in radians of the excitation, length in half of the narrowest gap, mass in kg.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from coupling.scene import Prescribed, Rigid, Scene
from rom.reduced import ReducedModel


def neighbour_restitution(left: float, right: float) -> float:
    """Restitution between two bodies: the geometric mean of their restitutions at a wall."""
    return math.sqrt(left * right)


class System:
    """A scene in matrices.

    W (n, b) interface rows, m (b,) masses, friction (b,) largest friction forces, G (c, b) and reach (c,): the opening
    G r + reach of every contact, pairs (c, 2): the bodies to its left and right, -1 for a wall.
    """

    def __init__(self, scene: Scene, reduced: ReducedModel | None = None) -> None:
        if scene.contact.law != "newton":
            raise NotImplementedError(f"contact law {scene.contact.law}")
        self.omega = 2 * math.pi * scene.excitation.frequency
        self.length = min((cavity.gap for cavity in scene.cavity), default=2.0) / 2
        self._bodies(scene)
        self._contacts(scene)
        self._structure(scene, reduced)
        self.size = 2 * (len(self.M) + len(self.m)) + 3

    def _bodies(self, scene: Scene) -> None:
        unit = self.length * self.omega**2
        gravity = scene.gravity
        self.m = np.array([damper.mass for damper in scene.damper])
        loads = [
            damper.mass * gravity.normal if damper.normal_load is None else damper.normal_load
            for damper in scene.damper
        ]
        self.friction = np.array(
            [damper.friction * max(load, 0.0) / unit for damper, load in zip(scene.damper, loads, strict=True)]
        )
        self.weight = np.full(len(self.m), gravity.tangential / unit)
        self.r0 = np.array([damper.position for damper in scene.damper]) / self.length
        self.rd0 = np.array([damper.velocity for damper in scene.damper]) / (self.length * self.omega)

    def _contacts(self, scene: Scene) -> None:
        rows, reach, restitution, pairs = [], [], [], []
        for cavity in scene.cavity:
            row = [index for index, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
            for left, right in itertools.pairwise([-1, *row, -1] if row else []):
                opening = np.zeros(len(self.m))
                k = [scene.damper[index].restitution for index in (left, right) if index >= 0]
                if left >= 0:
                    opening[left] = -1.0
                if right >= 0:
                    opening[right] = 1.0
                rows.append(opening)
                reach.append(0.0 if len(k) == 2 else cavity.gap / 2 / self.length)
                restitution.append(neighbour_restitution(*k) if len(k) == 2 else k[0])
                pairs.append((left, right))
        self.G = np.array(rows).reshape(len(rows), len(self.m))
        self.reach = np.array(reach)
        self.restitution = np.array(restitution)
        self.pairs = pairs

    def _structure(self, scene: Scene, reduced: ReducedModel | None) -> None:
        """M, C, K, force, W, base acceleration and initial state; a prescribed motion has no coordinates at all."""
        excitation, bodies = scene.excitation, len(self.m)
        unit = self.length * self.omega**2
        base = (excitation.base_acceleration or 0.0) / unit
        if excitation.resonance_amplitude is not None:
            raise NotImplementedError("resonance_amplitude: give the force")
        self.table = 0.0
        if isinstance(scene.structure, Prescribed):
            self.table = scene.structure.displacement_amplitude / self.length
            M, C, K = np.zeros((3, 0, 0))
            self.output, self.W, load = np.zeros(0), np.zeros((0, bodies)), np.zeros(0)
            self.base = np.full(bodies, -self.table)
        elif isinstance(scene.structure, Rigid):
            structure = scene.structure
            M, C, K = np.array([structure.mass, structure.viscous, structure.stiffness]).reshape(3, 1, 1)
            self.output, self.W, load = np.ones(1), np.ones((1, bodies)), M[0]
            self.base = np.full(bodies, base)
        else:
            model = reduced if scene.structure.modes is None else reduced.truncated(scene.structure.modes)
            M, C, K = model.mass, model.damping, model.stiffness
            labels = [self._label(scene, damper.cavity) for damper in scene.damper]
            self.output = model.row(excitation.at)
            self.W = np.array([model.row(label) for label in labels]).reshape(bodies, model.size).T
            # the base moves in the direction of the response
            direction = model.directions[model.interface.index(excitation.at)]
            load = model.base_load @ direction
            along = [model.directions[model.interface.index(label)] @ direction for label in labels]
            self.base = base * np.array(along)
        self.M, self.C, self.K = M, C / self.omega, K / self.omega**2
        self.force = self.output * (excitation.force or 0.0) / unit - load * base
        self.q0 = np.full(len(M), scene.initial.displacement / self.length)
        self.qd0 = np.full(len(M), scene.initial.velocity / (self.length * self.omega))
        self.inverse = np.linalg.inv(M)
        #: Acceleration of r per contact force: the inverse of the contact mass on its diagonal.
        self.D = np.diag(1 / self.m) + self.W.T @ self.inverse @ self.W

    @staticmethod
    def _label(scene: Scene, name: str) -> str:
        labels = {label for cavity in scene.cavity if cavity.name == name for label in cavity.labels() if label}
        if len(labels) != 1:
            raise NotImplementedError(f"cavity '{name}': walls and floor on different interface labels")
        return labels.pop()

    def opening(self, y: np.ndarray) -> np.ndarray:
        """(c,) how far every contact is open."""
        return self.G @ self.split(y)[1] + self.reach

    def speed(self, y: np.ndarray) -> np.ndarray:
        """(c,) how fast every contact opens."""
        return self.G @ self.split(y)[3]

    def extended(self, t: np.ndarray | float, y: np.ndarray) -> np.ndarray:
        """The state of shape (..., ) with 1, sin t and cos t below it."""
        t = np.asarray(t)
        return np.concatenate([y, [np.ones_like(t), np.sin(t), np.cos(t)]])

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of q, r, q', r' in a state."""
        n, b = len(self.M), len(self.m)
        return y[:n], y[n : n + b], y[n + b : 2 * n + b], y[2 * n + b : 2 * (n + b)]

    def kick(self, y: np.ndarray, impulses: np.ndarray) -> None:
        """Apply the impulses (b,) of the cavities on the bodies to the velocities of a state, in place."""
        _, _, qd, rd = self.split(y)
        qd -= self.inverse @ self.W @ impulses
        rd += self.D @ impulses

    def close(self, y: np.ndarray, contact: int, factor: float = 1.0) -> None:
        """Take `factor` times its opening speed from a contact, by an impulse, in place."""
        row = self.G[contact]
        self.kick(y, -factor * (row @ self.split(y)[3]) / (row @ self.D @ row) * row)

    def name(self, contact: int) -> tuple[int, str, float]:
        """Damper and side of a contact, and the sign of its opening speed in the velocity that is reported."""
        left, right = self.pairs[contact]
        if left < 0:
            return right, "left", 1.0
        return left, "right" if right < 0 else "neighbour", 1.0 if right >= 0 else -1.0

    def fastest(self) -> float:
        """The highest undamped frequency of the structure, or the excitation's (which is 1) if that is higher."""
        squares = np.linalg.eigvals(self.inverse @ self.K).real if len(self.M) else np.zeros(0)
        return math.sqrt(max([1.0, *squares]))
