"""The motion of a scene of sliders as linear flows in scaled coordinates, apart from the engine's modes.

The state is u = (y, w, z): coordinates q = (p, x) times root mass and a typical frequency, their rates times root mass,
elongations of Jenkins elements times the root of their stiffness. Energies are squares of u, so that the constraint of
a closed row is an orthogonal projection and every matrix has entries of the order of the frequencies.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.numerics.codes import CLOSED, SPRUNG, STICK, TOUCHING
from vanedamp.coupling.orbits.saltation import LinearFlow, held
from vanedamp.coupling.system.system import System


class SliderDynamics:
    """Flows of a system by the states of its rows (numerics.codes), and its rows as functionals of u.

    scale: displacement per modal coordinate (system.assembly.physical_scale). place, speed: (r, k) functionals of u,
    displacement less rest and velocity of each row; springs: rows of Jenkins elements; to_state, from_state: (k, k)
    between u and the state of the contract (orbits.passage).
    """

    def __init__(self, system: System, scale: float) -> None:
        self.system, self.scale = system, scale
        n, b, size = system.modes, system.bodies, system.modes + system.bodies
        friction = np.arange(len(system.J)) < system.friction_rows
        self.springs = np.flatnonzero(friction & np.isfinite(system.spring) & (system.limit > 0))
        self.root = np.sqrt(system.mass)
        contacts = np.isfinite(system.spring) & ~friction
        stiff = system.stiffness + (system.spring[contacts, None] * system.J[contacts] ** 2).sum(axis=0)
        self.rate = np.maximum(np.sqrt(stiff) / self.root, system.omega)
        self.k = 2 * size + len(self.springs)
        none = np.zeros((len(system.J), len(self.springs)))
        self._on_rates = system.J / self.root
        self.place = np.hstack([self._on_rates / self.rate, 0 * self._on_rates, none])
        self.speed = np.hstack([0 * self._on_rates, self._on_rates, none])
        self._flows: dict[bytes, LinearFlow] = {}
        # (displacement, velocity, slip, slip velocity, elongation) from (p, x, p', x', elongation)
        relative = np.block([[np.eye(n) * scale, np.zeros((n, b))], [-system.floor, np.eye(b)]])
        absolute = np.block([[np.eye(n) / scale, np.zeros((n, b))], [system.floor / scale, np.eye(b)]])
        units = 1 / np.r_[self.root * self.rate, self.root, np.sqrt(system.spring[self.springs])]
        order = np.r_[0:n, size : size + n, n:size, size + n : 2 * size, 2 * size : self.k]
        springs = np.eye(len(self.springs))
        self.to_state = (block_diag(relative, relative, springs) * units)[order]
        self.from_state = (block_diag(absolute, absolute, springs) / units[:, None])[:, order]

    @property
    def rates(self) -> slice:
        """Places of the rates w in u."""
        return slice(len(self.root), 2 * len(self.root))

    def constraints(self, state: np.ndarray) -> np.ndarray:
        """Return (m,) the rigid rows that are at rest in the states (r,) of all rows."""
        friction = np.arange(len(state)) < self.system.friction_rows
        return np.flatnonzero(np.where(friction, state == STICK, state == CLOSED))

    def flow(self, state: np.ndarray, applied: np.ndarray) -> LinearFlow:
        """Return the flow with the rows in states (r,), constant forces applied (r,) to those that are not at rest."""
        key = state.tobytes() + applied.tobytes()
        if key not in self._flows:
            free = self.free_flow(state, applied)
            project = held(self._on_rates[self.constraints(state)])
            A, constant, wave = free.A.copy(), free.constant.copy(), free.wave.copy()
            A[self.rates], constant[self.rates] = project @ A[self.rates], project @ constant[self.rates]
            wave[:, self.rates] = wave[:, self.rates] @ project
            self._flows[key] = LinearFlow(A, constant, wave, self.system.frequency)
        return self._flows[key]

    def free_flow(self, state: np.ndarray, applied: np.ndarray) -> LinearFlow:
        """Return the same without the forces of the rigid rows at rest."""
        system, size = self.system, len(self.root)
        places, rates = slice(0, size), self.rates
        A, constant = np.zeros((self.k, self.k)), np.zeros(self.k)
        A[places, rates] = np.diag(self.rate)
        A[rates, places] = -np.diag(system.stiffness / self.root**2 / self.rate)
        A[rates, rates] = -system.damping / self.root / self.root[:, None]
        constant[rates] = (system.weight + applied @ system.J) / self.root
        for r in np.flatnonzero(state == SPRUNG):
            if r >= system.friction_rows:
                A[rates] += np.multiply.outer(self._on_rates[r], self.push(r))
                constant[rates] -= system.spring[r] * system.rest[r] * self._on_rates[r]
            else:
                z = 2 * size + int(np.flatnonzero(self.springs == r)[0])
                A[rates] += np.multiply.outer(self._on_rates[r], self.push(r))
                A[z] = np.sqrt(system.spring[r]) * self.speed[r]
        wave = np.zeros((len(system.frequency), self.k), complex)
        wave[:, rates] = system.load / self.root
        return LinearFlow(A, constant, wave, system.frequency)

    def push(self, r: int) -> np.ndarray:
        """Return the force of the closed spring of row r as a functional (k,) of u, without its constant part."""
        system = self.system
        if r >= system.friction_rows:
            force: np.ndarray = -system.spring[r] * self.place[r] - system.dashpot[r] * self.speed[r]
            return force
        force = np.zeros(self.k)
        force[2 * len(self.root) + int(np.flatnonzero(self.springs == r)[0])] = -np.sqrt(system.spring[r])
        return force

    def force(self, state: np.ndarray, r: int) -> np.ndarray:
        """Return (m,) shares s of the free rates w' in the force of rigid row r at rest: it is s . w'."""
        rows = self.constraints(state)
        on_rates = self._on_rates[rows]
        share: np.ndarray = -np.linalg.pinv(on_rates @ on_rates.T, rcond=1e-12, hermitian=True)[rows == r][0] @ on_rates
        return share

    def impulse(self, rows: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of an impact at rows (m,), which change their speeds by -slope (m,) times."""
        on_rates, jump = self._on_rates[rows], np.eye(self.k)
        inverse = np.linalg.pinv(on_rates @ on_rates.T, rcond=1e-12, hermitian=True)
        jump[self.rates, self.rates] -= on_rates.T @ inverse @ ((1.0 + slope)[:, None] * on_rates)
        return jump

    def kick(self, impulse: np.ndarray) -> np.ndarray:
        """Return the jump (k,) of u by the impulses (r,) of all rows, N s."""
        jump = np.zeros(self.k)
        jump[self.rates] = impulse @ self._on_rates
        return jump

    def settled(self, state: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of a state that begins with rows at rest: what disturbs them dies out at once.

        Slips that stick and gaps that are closed come to rest by forces between the two sides only, which keep their
        momentum and, of closed gaps, their centre of mass: a projection in the metric of mass. A Jenkins element that
        slides has its elongation from its bound.
        """
        rows = self.constraints(state)
        jump = self.closed(state)
        jump[self.rates, self.rates] = held(self._on_rates[rows])
        sliding = 2 * len(self.root) + np.flatnonzero(state[self.springs] != SPRUNG)
        jump[sliding, sliding] = 0.0
        return jump

    def closed(self, state: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of places whose closed gaps close without time: they keep their centre."""
        rows = np.flatnonzero((state == CLOSED) | (state == TOUCHING))
        size, jump = len(self.root), np.eye(self.k)
        jump[:size, :size] = self.rate[:, None] * held(self._on_rates[rows]) / self.rate
        return jump

    @cached_property
    def cavity(self) -> np.ndarray:
        """(b,) number of the first body in each body's cavity."""
        system, first = self.system, np.arange(self.system.bodies)
        for left, right in zip(system.left_body, system.right_body, strict=True):
            if left >= 0 and right >= 0:
                first[right] = first[left]
        return first

    @cached_property
    def free_travel(self) -> np.ndarray:
        """(b,) free travel of each body's cavity, m."""
        system, travel = self.system, np.zeros(self.system.bodies)
        for r in range(system.friction_rows, len(system.J)):
            for body in (system.left_body[r], system.right_body[r]):
                if body >= 0:
                    travel[body] = system.free_travel[r]
        return travel
