"""A scene as small dense matrices, for the reference integrator.

Coordinates: q of the structure, r of the bodies relative to their cavities, e of elongations of Jenkins springs. Every
contact and friction force is internal to r, so that with h the forces that the cavities exert on the bodies

    M q'' = f s(t) - C q' - K q - W h - V^T k e,        r'' = h / m + g - a s(t) - W^T q''

where s is sin t, or a sum of harmonics Im sum_k shares_k exp(i orders_k t); for a that of base_shares, which are shares
orders^2 where a displacement is prescribed.

Compliant walls may push on functionals of their own: M q'' has then (H - G W^T)^T lambda, and h has G^T lambda without
reaction on W, where lambda = -stiffness (opening + delay * speed).

Time is measured in radians of the excitation, length in half of the narrowest gap (or in the elongation at which the
first Jenkins element slips, if that is less), mass in kg.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh

from tests.reference.compliant_collision import damping_ratio
from vanedamp.coupling.scene.bodies import FrictionDamper
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import truncated


def neighbour_restitution(left: float, right: float) -> float:
    """Restitution between two bodies: the geometric mean of their restitutions at a wall."""
    return math.sqrt(left * right)


def largest_elongation(element: FrictionDamper) -> float:
    """Elongation (m) at which a Jenkins element slips."""
    if element.stiffness is None:
        raise NotImplementedError("friction_damper: a rigid Coulomb element; give its stiffness")
    return element.friction * element.normal_force / element.stiffness


class System:
    """A scene in matrices.

    W (n, b) interface rows, m (b,) masses, friction (b,) largest friction forces, G (c, b), H (c, n) and reach (c,):
    the opening G r + H q + reach of every contact, pairs (c, 2): the bodies to its left and right, -1 for a wall.
    compliant: whether contacts are; stiffness (c,) and delay (c,) = damping / stiffness of those.
    V (j, n), spring (j,), limit (j,): functional, stiffness and largest elongation of the Jenkins elements.
    """

    def __init__(self, scene: Scene, reduced: ReducedModel | None = None) -> None:
        self.compliant = scene.contact.law == "compliant"
        self.omega = 2 * math.pi * scene.excitation.frequency
        gaps = [cavity.gap / 2 for cavity in scene.cavity]
        self.length = min(gaps + [largest_elongation(element) for element in scene.friction_damper], default=1.0)
        self._bodies(scene)
        self._contacts(scene)
        self._structure(scene, reduced)
        self.spring = np.array([element.stiffness for element in scene.friction_damper]) / self.omega**2
        self.limit = np.array([largest_elongation(element) for element in scene.friction_damper]) / self.length
        if self.compliant:
            self._compliance(scene)
        elif np.any(np.abs(self.H) > 1e-14):
            raise NotImplementedError("Newton's law with walls and floor on different interface labels")
        else:
            self.H[:] = 0.0  # a touch is a touch to the last bit
        self.size = 2 * (len(self.M) + len(self.m)) + len(self.spring) + 2 * len(self.orders) + 1

    def _bodies(self, scene: Scene) -> None:
        unit = self.length * self.omega**2
        gravity = scene.gravity
        self.m = np.array([damper.mass for damper in scene.damper])
        loads = [
            damper.mass * gravity.components(np.zeros(3))[1] if damper.normal_load is None else damper.normal_load
            for damper in scene.damper
        ]
        self.friction = np.array(
            [damper.friction * max(load, 0.0) / unit for damper, load in zip(scene.damper, loads, strict=True)]
        )
        self.weight = np.full(len(self.m), gravity.components(np.zeros(3))[0] / unit)
        self.r0 = np.array(scene.positions) / self.length
        self.rd0 = np.array([damper.velocity for damper in scene.damper]) / (self.length * self.omega)

    def _contacts(self, scene: Scene) -> None:
        rows, reach, restitution, pairs, cavities = [], [], [], [], []
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
                cavities.append(cavity)
        self.G = np.array(rows).reshape(len(rows), len(self.m))
        self.reach = np.array(reach)
        self.restitution = np.array(restitution)
        self.pairs = pairs
        self._cavities = cavities

    def _structure(self, scene: Scene, reduced: ReducedModel | None) -> None:
        """M, C, K, force, W, H, V, base acceleration and initial state; a prescribed motion has no coordinates."""
        excitation, bodies = scene.excitation, len(self.m)
        unit = self.length * self.omega**2
        base = (excitation.base_acceleration or 0.0) / unit
        given = {1: (1.0, 0.0)} | {part.order: (part.amplitude, part.phase) for part in excitation.harmonic}
        self.orders = np.array(list(given), float)
        self._orders = self.orders.tolist()
        sizes, phases = np.array(list(given.values())).T
        self.shares = self.base_shares = sizes * np.exp(1j * np.radians(phases))
        if excitation.resonance_amplitude is not None:
            raise NotImplementedError("resonance_amplitude: give the force")
        self.table = 0.0
        row: Callable[[str | None], np.ndarray]
        if isinstance(scene.structure, Prescribed):
            self.table = scene.structure.displacement_amplitude / self.length
            M, C, K = np.zeros((3, 0, 0))
            self.output, load = np.zeros(0), np.zeros(0)
            self.base, self.base_shares = np.full(bodies, -self.table), self.shares * self.orders**2
            row = lambda label: np.zeros(0)  # noqa: E731
        elif isinstance(scene.structure, Rigid):
            structure = scene.structure
            M, C, K = np.array([structure.mass, structure.viscous, structure.stiffness]).reshape(3, 1, 1)
            self.output, load = np.ones(1), M[0]
            self.base = np.full(bodies, base)
            row = lambda label: np.ones(1)  # noqa: E731
        else:
            model = reduced if scene.structure.modes is None else truncated(reduced, scene.structure.modes)
            M, C, K = model.mass, model.damping, model.stiffness
            self.output = model.row(excitation.at)
            # the base moves in the direction of the response
            direction = model.directions[model.interface.index(excitation.at)]
            load = model.base_load @ direction
            labels = [self._cavity(scene, damper.cavity).labels()[2] for damper in scene.damper]
            along = [model.directions[model.interface.index(label)] @ direction for label in labels]
            self.base = base * np.array(along)
            row = model.row
        self._functionals(scene, row, len(M))
        self.M, self.C, self.K = M, C / self.omega, K / self.omega**2
        self.force = self.output * (excitation.force or 0.0) / unit - load * base
        if excitation.load:  # of order 1, complex: sines of several phases
            self.force = excitation.level / unit * sum(each.amplitude * row(each.at) for each in excitation.load)
        self.q0 = np.full(len(M), scene.initial.displacement / self.length)
        self.qd0 = np.full(len(M), scene.initial.velocity / (self.length * self.omega))
        self.inverse = np.linalg.inv(M)
        #: Acceleration of r per contact force: the inverse of the contact mass on its diagonal.
        self.D = np.diag(1 / self.m) + self.W.T @ self.inverse @ self.W

    def _functionals(self, scene: Scene, row: Callable[[str | None], np.ndarray], size: int) -> None:
        """W, V and H, which is the floor's share in an opening and, against it, that of the wall."""
        floors = [row(self._cavity(scene, damper.cavity).labels()[2]) for damper in scene.damper]
        self.W = np.array(floors).reshape(len(floors), size).T
        casing = [row(element.at or scene.excitation.at) for element in scene.friction_damper]
        self.V = np.array(casing).reshape(len(casing), size)
        self.walls = np.zeros((len(self.pairs), size))
        for contact, ((left, right), cavity) in enumerate(zip(self.pairs, self._cavities, strict=True)):
            if left < 0:
                self.walls[contact] = -row(cavity.labels()[0])
            elif right < 0:
                self.walls[contact] = row(cavity.labels()[1])
        self.H = self.walls + self.G @ self.W.T

    def _compliance(self, scene: Scene) -> None:
        """Stiffness and delay of the contacts; the damping takes the mass of the structure's first mode at the wall."""
        self.stiffness = np.full(len(self.pairs), scene.contact.stiffness / self.omega**2)
        first = eigh(self.K, self.M)[1][:, 0] if len(self.M) else np.zeros(0)
        inverse_mass = self.G**2 @ (1 / self.m) + (self.walls @ first) ** 2
        zeta = np.array([damping_ratio(k) for k in self.restitution])
        self.delay = 2 * zeta / np.sqrt(self.stiffness * inverse_mass)

    @staticmethod
    def _cavity(scene: Scene, name: str):
        return next(cavity for cavity in scene.cavity if cavity.name == name)

    def opening(self, y: np.ndarray) -> np.ndarray:
        """(c,) how far every contact is open."""
        q, r, _, _ = self.split(y)
        return self.G @ r + self.H @ q + self.reach

    def speed(self, y: np.ndarray) -> np.ndarray:
        """(c,) how fast every contact opens."""
        _, _, qd, rd = self.split(y)
        return self.G @ rd + self.H @ qd

    def press(self, y: np.ndarray) -> np.ndarray:
        """(c, ...) what compliant contacts would push with, if they were closed, in states (s, ...)."""
        q, r, qd, rd = self.split(y)
        opening = (self.G @ r + self.H @ q).T + self.reach
        return (-self.stiffness * (opening + self.delay * (self.G @ rd + self.H @ qd).T)).T

    def extended(self, t: np.ndarray | float, y: np.ndarray) -> np.ndarray:
        """The state of shape (..., ) with sines, cosines and 1 below it."""
        turn = np.multiply.outer(self.orders, np.asarray(t, float))
        return np.concatenate([y, np.sin(turn), np.cos(turn), np.ones((1, *turn.shape[1:]))])

    def harmonics(self, t: float) -> list[float]:
        """Sines, cosines and 1 at one time."""
        turns = [order * t for order in self._orders]
        return [*map(math.sin, turns), *map(math.cos, turns), 1.0]

    def wave(self, shares: np.ndarray, t: np.ndarray | float) -> np.ndarray:
        """Im sum_k shares_k exp(i orders_k t) at times of any shape."""
        return self.phasor(shares, t).imag

    def phasor(self, shares: np.ndarray, t: np.ndarray | float) -> np.ndarray:
        """sum_k shares_k exp(i orders_k t) at times of any shape."""
        return np.tensordot(shares, np.exp(1j * np.multiply.outer(self.orders, t)), 1)

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of q, r, q', r' in a state."""
        n, b = len(self.M), len(self.m)
        return y[:n], y[n : n + b], y[n + b : 2 * n + b], y[2 * n + b : 2 * (n + b)]

    def elongation(self, y: np.ndarray) -> np.ndarray:
        """View of the elongations of the Jenkins springs in a state."""
        first = 2 * (len(self.M) + len(self.m))
        return y[first : first + len(self.spring)]

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
