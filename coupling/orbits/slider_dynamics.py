"""The motion of a scene of sliders as linear flows in scaled coordinates, apart from the engine's modes.

The state is u = (y, w, z): coordinates q = (p, x) times root mass and a typical frequency, their rates times root mass,
elongations of Jenkins elements times the root of their stiffness. Energies are squares of u, so that the constraint of
a closed row is an orthogonal projection and every matrix has entries of the order of the frequencies.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from vanedamp.coupling.numerics.codes import (
    CLOSED,
    FORCE,
    OPEN,
    POSITION,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
    VELOCITY,
)
from vanedamp.coupling.orbits.saltation import LinearFlow, held
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.linear_response import glued_mass
from vanedamp.coupling.system.system import System
from vanedamp.files.store import frozen


class SliderDynamics:
    """Flows of a system by the states of its rows (numerics.codes), and its rows as functionals of u.

    whole: the scene's system; system: its rows; scale: displacement per modal coordinate. place, speed: (r, k)
    functionals of u, displacement less rest and velocity of each row; springs: rows of Jenkins elements; to_state,
    from_state: (k, k) between u and the state of the contract (orbits.passage); sizes: (k,) of that state in a typical
    motion.
    """

    def __init__(self, whole: System, sizes: np.ndarray | None = None) -> None:
        self.whole, self.system = whole, line_system(whole)
        system, scale = self.system, self.system.scale
        self.scale = scale
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
        self._distances: dict[bytes, tuple[np.ndarray, list[int], list[int]]] = {}
        # (displacement, velocity, slip, slip velocity, elongation) from (p, x, p', x', elongation)
        relative = np.block([[np.eye(n) * scale, np.zeros((n, b))], [-system.floor, np.eye(b)]])
        absolute = np.block([[np.eye(n) / scale, np.zeros((n, b))], [system.floor / scale, np.eye(b)]])
        units = 1 / np.r_[self.root * self.rate, self.root, np.sqrt(system.spring[self.springs])]
        order = np.r_[0:n, size : size + n, n:size, size + n : 2 * size, 2 * size : self.k]
        springs = np.eye(len(self.springs))
        self.to_state = (block_diag(relative, relative, springs) * units)[order]
        self.sizes = self._typical_sizes() if sizes is None else sizes
        self.from_state = (block_diag(absolute, absolute, springs) / units[:, None])[:, order]

    def glued_amplitude(self) -> np.ndarray:
        """Return the complex amplitudes (e, n) of p with all bodies at rest on their floors; inf where undamped."""
        system = self.system
        modes, bodies = system.of_structure, system.of_bodies
        load = modes.load + bodies.load @ system.floor
        omega = system.frequency[:, None, None]
        dynamic = np.diag(modes.stiffness) + 1j * omega * modes.damping - omega**2 * glued_mass(self.whole)
        try:
            amplitude: np.ndarray = np.linalg.solve(dynamic, load[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:
            return np.full(load.shape, np.inf + 0j)
        return amplitude

    def _typical_sizes(self) -> np.ndarray:
        """Return sizes (k,) of the coordinates: linear response, free travel, and these times omega."""
        system, omega = self.system, self.system.omega
        reach = self.scale * np.abs(self.glued_amplitude()).sum(axis=0)
        travel = np.r_[self.free_travel, system.free_travel[system.friction_rows :]]
        travel = travel[np.isfinite(travel) & (travel > 0)]
        farthest = float(travel.max(initial=0.0))
        # a structure that nothing excites, or nothing damps, moves by its start and the bodies
        largest = reach.max(initial=0.0)
        largest = largest if 0.0 < largest < np.inf else farthest or 1.0
        reach = np.where(np.isfinite(reach), np.maximum(reach, 1e-6 * largest), largest)
        springs = system.limit[self.springs] / system.spring[self.springs]
        return frozen(np.r_[reach, omega * reach, self.free_travel, omega * self.free_travel, springs])

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

    def distances(self, state: np.ndarray, applied: np.ndarray) -> tuple[np.ndarray, list[int], list[int]]:
        """Return functionals (m, K) of the extended state that do not vanish before an event, their rows and orders.

        Each as a share of its scale: gaps of the free travel, speeds of a typical one, forces of their bound, or of the
        terms that they are sums of.
        """
        key = state.tobytes() + applied.tobytes()
        if key not in self._distances:
            self._distances[key] = self._list_distances(state, applied)
        return self._distances[key]

    def _list_distances(self, state: np.ndarray, applied: np.ndarray) -> tuple[np.ndarray, list[int], list[int]]:
        system, flow, found = self.system, self.flow(state, applied), []
        width = len(flow.generator)
        free = self.free_flow(state, applied)
        free_rates = free.generator[self.rates] * np.r_[np.ones(self.k), np.full(width - self.k, free.size / flow.size)]
        one = np.eye(width)[self.k] / flow.size
        wide = np.zeros((len(state), width - self.k))
        place, speed = np.hstack([self.place, wide]), np.hstack([self.speed, wide])
        for r, kind in enumerate(state):
            friction = r < system.friction_rows
            if kind in (SLIP_LEFT, SLIP_RIGHT):
                found.append((kind * speed[r] / self.typical_speed[r], r, VELOCITY))
            elif kind == OPEN:
                found.append(((place[r] + system.rest[r] * one) / system.free_travel[r], r, POSITION))
            elif kind == SPRUNG and friction:
                force = np.r_[self.push(r), wide[r]]
                found += [(one + sign * force / system.limit[r], r, FORCE) for sign in (1, -1)]
            elif kind in (STICK, CLOSED) and friction == (kind == STICK):
                share = self.force(state, r)
                force = share @ free_rates
                if friction:
                    found += [(one + sign * force / system.limit[r], r, FORCE) for sign in (1, -1)]
                else:
                    found.append((force / self.typical_force(share), r, FORCE))
        functionals = np.array([entry[0] for entry in found]).reshape(len(found), width)
        return functionals, [entry[1] for entry in found], [int(entry[2]) for entry in found]

    def typical_force(self, share: np.ndarray) -> float:
        """Return the size of a force by its shares (N,) of the rates of a typical motion, N."""
        typical = self.rate * (np.abs(self.from_state) @ self.sizes)[self.rates]
        return float(np.abs(share) @ (typical + np.abs(self.system.load).sum(axis=0) / self.root))

    @cached_property
    def typical_speed(self) -> np.ndarray:
        """(r,) speed of each row in a typical motion, m/s."""
        speed: np.ndarray = np.abs(self.speed) @ (np.abs(self.from_state) @ self.sizes)
        return speed

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

    def owner(self, r: int) -> int:
        """Return the cavity of a row, by the number of its first body; -1: none."""
        bodies = np.flatnonzero(self.system.of_bodies.J[r])
        return int(self.cavity[bodies[0]]) if len(bodies) else -1

    @cached_property
    def free_travel(self) -> np.ndarray:
        """(b,) free travel of each body's cavity, m."""
        system, travel = self.system, np.zeros(self.system.bodies)
        for r in range(system.friction_rows, len(system.J)):
            for body in (system.left_body[r], system.right_body[r]):
                if body >= 0:
                    travel[body] = system.free_travel[r]
        return travel
