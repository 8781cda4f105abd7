"""The motion of a system as linear flows by the states of its units.

The state is u = (y, w): coordinates q times root mass and a typical frequency, rates q' times root mass. Energies are
squares of u, and every matrix has entries of the order of the frequencies. Between events it flows by

    z' = X z,    z = (u, size, size cos(omega_h t), size sin(omega_h t)),

where loads and constants are columns of X. Gaps, slips and forces are functionals of z, so that their rates and second
derivatives refer to z: an event function is one row.

The accelerations are those of system.flow.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.series import Series
from vanedamp.coupling.engine.trace import Leg
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.system.flow import StateFlow
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_laws import EVENTS, possible_events, signals_of
from vanedamp.coupling.tangents.dual import values, zeros
from vanedamp.files.store import frozen

#: flows kept
_KEPT = 1000


def _rates(system: System) -> np.ndarray:
    """Return a typical frequency (N,) of each coordinate, rad/s."""
    yields = np.isfinite(system.spring)
    stiff = np.diag(system.stiffness) + system.tangential @ system.elongation**2
    stiff = stiff + (system.spring[yields, None] * system.J[: len(yields)][yields] ** 2).sum(axis=0)
    return np.maximum(np.sqrt(np.maximum(stiff, 0.0) / system.mass), system.omega)


def _size_of_loads(system: System, rate: np.ndarray) -> float:
    loads = np.vstack([system.weight, np.abs(system.load)]) / np.sqrt(system.mass)
    return float(np.abs(loads).max(initial=0.0) / rate.max(initial=0.0)) or 1.0


class ScaledDynamics:
    """Flows of a system with N coordinates by the states of its u units; K = 2N + 1 + 2e entries of z.

    scale: (k,) sizes of states; to_state, from_state: (k, 2N) and (2N, k) between u and states; rows: (2u, N) J in
    coordinates root mass q; gap: (u, K), speed: (2u, K) functionals of gaps and of the rows' speeds; typical: (K,)
    sizes of z in a typical motion; follows (j, 2N), bound, ease (j,): u of a slider that slips is follows u - way
    bound, and, of a contact, + way ease gap, since its bound falls as the gap opens; pulled: (j, N) elongations;
    response: (K,) displacement, m; outputs, tilts: (., K) further outputs, m, and tilts of planar bodies in their
    cavities, rad. like: dynamics of another scene whose frequencies and size serve here, too, so that both compare.
    """

    def __init__(self, frame: Frame, scale: np.ndarray, like: ScaledDynamics | None = None) -> None:
        self.frame, self.system = frame, frame.system
        system = self.system
        size, u, e = len(system.mass), len(system.rest), len(system.frequency)
        self.root = np.sqrt(system.mass)
        self.rate: np.ndarray = _rates(system) if like is None else like.rate
        self.unit = np.concatenate([self.root * self.rate, self.root])  # of u in terms of (q, q')
        self.rows = system.J / self.root
        self.places, self.rates, self.one = slice(0, size), slice(size, 2 * size), 2 * size
        cosine = slice(self.one + 1, self.one + 1 + e)
        sine = slice(cosine.stop, cosine.stop + e)
        self.size: float = _size_of_loads(system, self.rate) if like is None else like.size
        self.turn = zeros((sine.stop, sine.stop))
        self.turn[self.places, self.rates] = np.diag(self.rate)
        self.turn[cosine, sine], self.turn[sine, cosine] = -np.diag(system.frequency), np.diag(system.frequency)
        self.gap, self.speed = zeros((u, sine.stop)), zeros((2 * u, sine.stop))
        self.gap[:, self.places], self.gap[:, self.one] = self.rows[:u] / self.rate, system.rest / self.size
        self.speed[:, self.rates] = self.rows
        self.load = zeros((size, sine.stop))
        self.load[:, self.places] = -system.stiffness / self.root / self.root[:, None] / self.rate
        self.load[:, self.rates] = -system.damping / self.root / self.root[:, None]
        self.load[:, self.one] = system.weight / self.root / self.size
        self.load[:, cosine] = system.load.real.T / self.root[:, None] / self.size
        self.load[:, sine] = -system.load.imag.T / self.root[:, None] / self.size
        self.scale, self.to_state = scale, frame.to_state / self.unit
        self.from_state = self.unit[:, None] * frame.from_state
        self.typical = np.r_[np.abs(values(self.from_state)) @ scale, np.full(1 + 2 * e, self.size)]
        #: units with sliders, and coordinates (j,) of these
        self.sprung = system.sprung
        self.sliders = np.arange(size - len(system.tangential), size)
        drawn = np.where(np.arange(size) < size - len(self.sliders), system.elongation, 0.0)
        own_unit = self.unit[self.sliders], self.root[self.sliders]
        self.follows = np.hstack(
            [own_unit[0][:, None] * drawn / self.unit[:size], own_unit[1][:, None] * drawn / self.root]
        )
        self.bound = own_unit[0] * system.limit[self.sprung] / system.tangential
        self.ease = own_unit[0] * system.ease
        self.pulled = system.elongation / self.root
        self.response = zeros(sine.stop)
        self.response[self.places] = system.response / self.unit[:size]
        self.response[cosine], self.response[sine] = system.table.real / self.size, -system.table.imag / self.size
        outputs, n = len(system.outputs), system.modes
        self.outputs = zeros((outputs, sine.stop))
        self.outputs[:, :n] = system.outputs.reshape(outputs, n) / self.unit[:n]
        extended = np.flatnonzero(system.tilt >= 0)
        self.tilts = zeros((len(extended), sine.stop))
        self.tilts[:, self.places] = (np.eye(size)[system.tilt[extended]] - system.turn[extended]) / self.unit[:size]
        self._flows: dict[bytes, Flow] = {}
        #: flows as compiled functions take them (derivatives.equations)
        self.tables: dict[Any, Any] = {}

    @cached_property
    def per(self) -> np.ndarray:
        """Entries (K,) of z per unit of root mass q, of its rate, and of the constant and the harmonics."""
        size = len(self.root)
        return np.r_[self.rate, np.ones(size), np.full(len(self.turn) - 2 * size, self.size)]

    @cached_property
    def part(self) -> np.ndarray:
        """Numbers (N,) of the parts of the system that are not coupled."""
        system = self.system
        bound = np.vstack([system.J, system.elongation]) != 0.0
        joined = (system.stiffness != 0.0) | (system.damping != 0.0) | (bound.T @ bound)
        return _parts(joined.tobytes(), len(joined))

    def state(self, leg: Leg) -> np.ndarray:
        """Return u (2N,) at the start of a segment."""
        return np.asarray(self.unit * np.concatenate([leg.q, leg.v]))

    def extended(self, u: np.ndarray, time: float) -> np.ndarray:
        """Return z (K,) of a state u (2N,) at a time in the period, s."""
        angle = self.system.frequency * time
        return np.concatenate([u, [self.size], self.size * np.cos(angle), self.size * np.sin(angle)])

    def flow(self, state: np.ndarray, open_force: np.ndarray) -> Flow:
        """Return the flow with units in states (u,). open_force: (2u,) as in a Segment, N."""
        key = state.tobytes() + open_force.tobytes()
        if key not in self._flows:
            if len(self._flows) >= _KEPT:
                self._flows.clear()
            self._flows[key] = Flow(self, state.copy(), open_force.copy())
        return self._flows[key]


class Flow:
    """The flow X (K, K) with units in states (u,), and the forces (2u, K) of the units.

    solved: the same in coordinates root mass q; free: (N, K) accelerations without what holds, known: (2u, K) forces
    but those that hold, carried: (m, K). rubs, way, stuck: (u,) as there; slips_held: (u,) whether constraints hold the
    slip of a unit that counts as slipping.
    """

    def __init__(self, dynamics: ScaledDynamics, state: np.ndarray, open_force: np.ndarray) -> None:
        self.dynamics, self.state, self.solved = dynamics, state, StateFlow(dynamics.system, state, 0.0)
        solved, per = self.solved, dynamics.per
        self.rubs, self.way, self.stuck, self.slips_held = solved.rubs, solved.way, solved.stuck, solved.held
        free = solved.free(open_force)
        self.X = per[:, None] * solved.generator(free) / per
        self.free, self.known = free / per, solved.known_forces(open_force) / per
        self.carried = solved.carried @ self.free
        self.forces = self.known + solved.spread(self.carried)

    @cached_property
    def possible_forces(self) -> np.ndarray:
        """The largest forces (2u,) that hold, by loads of a typical motion's size in any direction."""
        loads = np.linalg.norm(np.abs(self.free) @ self.dynamics.typical)
        return np.asarray(np.abs(self.solved.spread(np.linalg.norm(self.solved.carried, axis=1) * loads)))

    @cached_property
    def named(self) -> np.ndarray:
        """The states (u,) without slips that constraints hold."""
        return np.where(self.slips_held & (self.way != 0.0) & self.rubs, codes.STICK, self.state)

    @cached_property
    def key(self) -> bytes:
        """The key of these states."""
        return self.named.tobytes()

    @cached_property
    def series(self) -> Series:
        """The motions of the flow."""
        return Series(self.X)

    @cached_property
    def possible(self) -> list[tuple[int, int]]:
        """The events that can happen, each by its unit and its code."""
        events = possible_events(self.dynamics.system, self.state)
        return [(r, int(event.code)) for r, event in events if event.order != codes.VELOCITY or not self.slips_held[r]]

    @cached_property
    def margins(self) -> tuple[np.ndarray, np.ndarray]:
        """The functionals (m, K) of the possible events, each relative to its scale, and their rates."""
        dynamics, system, one = self.dynamics, self.dynamics.system, np.zeros(len(self.X))
        margins, one[dynamics.one] = np.zeros((len(self.possible), len(self.X))), 1.0 / dynamics.size
        for margin, (r, code) in zip(margins, self.possible, strict=True):
            event, signals = EVENTS[code], signals_of(r, dynamics.gap, dynamics.speed, self.forces, one)
            functional, scale = event.function(event.factors(system, r, self.way[r]), signals), event.size(system, r)
            typical = float(np.abs(functional) @ dynamics.typical)
            margin[:] = functional / (scale if np.isfinite(scale) else typical or 1.0)
        return margins, margins @ self.X

    @cached_property
    def fastest(self) -> float:
        """Largest rate of change of the motion, 1/s."""
        return float(np.abs(np.linalg.eigvals(self.X)).max(initial=0.0))


@lru_cache(_KEPT)
def _parts(joined: bytes, size: int) -> np.ndarray:
    """Return component labels (size,) of a graph (size, size) in bytes, the same for many systems."""
    labels = connected_components(np.frombuffer(joined, bool).reshape(size, size), directed=False)[1]
    return frozen(labels, int)
