"""The motion of a system while its units keep their states: nothing else solves for accelerations.

In coordinates s = sqrt(M) q, where the mass matrix is one,

    s'' = P (-K s - C s' + weight + loads),    P = 1 - W (R W)^-1 R,

with R the rows that are kept at rest (gaps of closed contacts, slips that stick) and W the directions of their forces:
a contact that slips has its friction in the direction of its normal force, W_N - sigma mu W_T, so that P is oblique.
Closed compliant contacts and the springs of sliders at rest are parts of K and C. A slider has no mass: it rests, or
follows its driver, at the distance by which its bound stretches the spring between them.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vanedamp.coupling.numerics.codes import OPEN, STICK
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_laws import SINGULAR, contacts_of, presses, rubs, ways, wrenches

#: acceleration left in rows at rest per unit load, beyond which forces are computed without the square of the rows'
#: condition number
_SQUARED = 1e-13
#: coordinates and accelerations that constraints hold, times their terms: smaller values are zero
HELD_ROUND_OFF = 1e-15


def attached(system: System, held: np.ndarray, moving: np.ndarray | None = None, across: bool = False) -> np.ndarray:
    """Return the motions (N, k) of a structure with bodies `held` (b,) at rest on their floors, others not there.

    By the modes (n,), then by the positions of bodies `moving` (b,), none of which is held. across: whether bodies that
    are held follow their floors across the cavity and in its rotation, too.
    """
    n = system.modes
    alone: list[int] = [] if moving is None else np.flatnonzero(moving).tolist()
    motions = np.zeros((len(system.mass), n + len(alone)))
    motions[:n, :n] = np.eye(n)
    motions[system.along, :n] = held[:, None] * system.floor[:, :n]
    for k, b in enumerate(alone):
        motions[system.along[b], n + k] = 1.0
    for b in np.flatnonzero(held & (system.tilt >= 0)) if across else ():
        x = system.along[b]
        motions[x + 1, :n], motions[x + 2, :n] = system.rise[b, :n], system.turn[b, :n]
    return motions


def mass_of(system: System, motions: np.ndarray) -> np.ndarray:
    """Return the mass matrix (k, k) of a system that has motions (N, k) only."""
    mass: np.ndarray = (motions.T * system.mass) @ motions
    return mass


def matrices(system: System, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass, damping and stiffness (k, k) of a system that has motions (N, k) only, without sliders' springs."""
    return mass_of(system, motions), motions.T @ system.damping @ motions, motions.T @ system.stiffness @ motions


def times(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return matrix @ columns; numpy would make a real matrix complex for complex columns."""
    if columns.dtype != complex or matrix.dtype == complex:
        return np.asarray(matrix @ columns)
    return np.asarray(matrix @ np.ascontiguousarray(columns).view(float)).view(complex)


def null_space(matrix: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, k) of what a matrix (m, n) makes zero."""
    _, size, turned = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])
    return np.asarray(turned[np.count_nonzero(size > SINGULAR * size.max(initial=0.0)) :].T)


class StateFlow:
    """A system with units in their states (u,), in coordinates sqrt(M) q.

    root: (N,) root of the masses; rows: (2u, N) J; drawn: (2u, N) motions by forces of rows: a slider that moves hands
    its force on to its driver. rubs: (u,) whether units have friction; way: (u,) direction in which they slip, or 0;
    drag: (u,) friction per normal force.
    closed, pressed: rigid and compliant contacts with forces; touching: rigid ones that are closed; stick: units whose
    slips are kept at rest; slides: friction elements that slip, with the forces `known`; holds: sliders (of j) that
    rest; drivers: (j, N) motions by which the others move; follow: (j, N) motions of all.
    kept: (k,) rows at rest; wrench: (N, k) directions of their forces; push: (N, p) of those of compliant contacts;
    spring, dashpot: (p, N) and preload: (p,) their forces. stiffness, damping: (N, N); weight: (N,) without preload;
    load: (e, N). oblique: (N, N) accelerations by loads; carried: (k, N) forces of the kept rows by loads, the least
    where these depend on each other; left: largest acceleration of a kept row per unit of load and length: forces that
    have no solution leave more than round-off.
    squared: allowed remainder before forces are computed without the square of the rows' condition number.
    """

    def __init__(self, system: System, state: np.ndarray, squared: float = _SQUARED) -> None:
        u, yields = len(state), np.isfinite(system.spring)
        self.system, self.state, self.u, self.sliders = system, state, u, len(system.tangential)
        self.root = root = np.sqrt(system.mass)
        rows = self.rows = system.J / root
        contact, way = contacts_of(system), ways(state)
        self.way, self.drag, self.rubs = way, way * system.friction, rubs(system)
        self.closed, self.pressed = (np.flatnonzero(presses(state) & contact & of) for of in (~yields, yields))
        self.touching = np.flatnonzero((state != OPEN) & contact & ~yields)
        self.stick, self.slides = np.flatnonzero((state == STICK) & self.rubs), np.flatnonzero(~contact & (way != 0))
        sprung = system.sprung
        rests = state[sprung] == STICK
        self.holds = np.flatnonzero(rests)
        self.drawn = rows.copy()
        self.drawn[u + sprung] += system.elongation / root
        self.drivers = self.drawn[u + sprung] + (way[sprung] * system.ease)[:, None] * rows[sprung]
        self.follow = self.drivers * (root[len(root) - self.sliders :] * ~rests)[:, None]
        self.kept, self.known = np.concatenate([self.closed, u + self.stick]), -(way * system.limit)[self.slides]
        self.wrench = wrenches(rows, self.closed, self.drag[self.closed], self.stick)
        self.push = wrenches(self.drawn, self.pressed, self.drag[self.pressed], self.stick[:0])
        self.spring, self.dashpot = (
            matrix[self.pressed, None] * rows[self.pressed] for matrix in (system.spring, system.dashpot)
        )
        self.preload = system.spring[self.pressed] * system.rest[self.pressed]
        stiffness, damping = (matrix / root / root[:, None] for matrix in (system.stiffness, system.damping))
        self.stiffness, self.damping = stiffness + self.push @ self.spring, damping + self.push @ self.dashpot
        if len(self.holds):
            stretch = system.elongation[self.holds] / root
            self.stiffness = self.stiffness + stretch.T @ (system.tangential[self.holds, None] * stretch)
        self.weight = system.weight / root + self.known @ self.drawn[u + self.slides]
        self.load = system.load / root
        self.carried, self.oblique, self.left = _forces(rows[self.kept], self.wrench, squared)

    @property
    def stuck(self) -> np.ndarray:
        """Whether units (u,) stick."""
        return (self.state == STICK) & self.rubs

    @cached_property
    def inverse(self) -> np.ndarray:
        """Motions (N, k) that move one of the kept rows each, the least."""
        return np.asarray(np.linalg.pinv(self.rows[self.kept], rcond=SINGULAR))

    @cached_property
    def undetermined(self) -> np.ndarray:
        """Forces (k, n) in the kept rows' null space, which laws leave free. Normal in units of the rows' lengths."""
        rows = self.rows[self.kept]
        scale = 1 / np.linalg.norm(rows, axis=1)
        # on the rows' span: the mobility of rows that nearly depend on each other has the square of their condition
        felt = self.inverse @ rows @ self.wrench * scale
        return scale[:, None] * null_space(felt) if len(rows) else np.zeros((0, 0))

    @cached_property
    def held(self) -> np.ndarray:
        """Whether constraints hold the slip of a unit (u,), which may count as slipping."""
        slips = self.drawn[self.u :].copy()
        slips[self.system.sprung] = self.drivers
        free = slips - slips @ self.inverse @ self.rows[self.kept]
        return np.asarray(np.linalg.norm(free, axis=1) <= SINGULAR * np.linalg.norm(slips, axis=1))

    def spread(self, solved: np.ndarray, pushes: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the forces (2u, ...) of all rows from those solved for (k, ...) and of springs (p, ...)."""
        acting, count = np.concatenate([self.closed, self.pressed]), len(self.closed)
        forces = np.zeros((2 * self.u, *solved.shape[1:]), solved.dtype)
        forces[self.closed], forces[self.pressed] = solved[:count], pushes
        forces[self.u + acting] = -(self.drag[acting] * forces[acting].T).T
        forces[self.u + self.stick] = solved[count:]
        return forces

    def followed(self, motion: np.ndarray) -> np.ndarray:
        """Return motions (N, ...) with sliders as they are: at rest, or as their drivers."""
        moved = motion.copy()
        if self.sliders:
            moved[-self.sliders :] = times(self.follow, motion)
        return moved

    def settled(self, motion: np.ndarray, terms: np.ndarray) -> np.ndarray:
        """Return motions as `followed` does; constrained rows are at rest, not at round-off of terms (N, c)."""
        moved = self.followed(motion)
        moved[np.abs(moved) <= HELD_ROUND_OFF * np.abs(terms).max(axis=0, initial=0.0)] = 0.0
        return moved

    # --- as functionals of (s, s', 1, cos(omega_h t), sin(omega_h t)), K of them

    def known_forces(self, open_force: np.ndarray) -> np.ndarray:
        """Return the forces (2u, K) of springs, of sliders at their limits, and of constants `open_force` (2u,)."""
        one, columns = 2 * len(self.root), 2 * len(self.root) + 1 + 2 * len(self.load)
        pushes = np.zeros((len(self.pressed), columns))
        pushes[:, :one], pushes[:, one] = -np.hstack([self.spring, self.dashpot]), -self.preload
        forces = self.spread(np.zeros((len(self.kept), columns)), pushes)
        forces[:, one] += open_force
        forces[self.u + self.slides, one] = self.known
        return forces

    def free(self, open_force: np.ndarray) -> np.ndarray:
        """Return the accelerations (N, K) without the kept rows' forces. open_force: as in known_forces."""
        constant = self.weight - self.push @ self.preload + open_force @ self.drawn
        loads = constant[:, None], self.load.real.T, -self.load.imag.T
        return np.hstack([-self.stiffness, -self.damping, *loads])

    def generator(self, free: np.ndarray) -> np.ndarray:
        """Return X (K, K) of d/dt z = X z from the accelerations that `free` returns."""
        size, omega = len(self.root), self.system.frequency
        X = np.zeros((free.shape[1], free.shape[1]))
        X[:size, size : 2 * size] = np.eye(size)
        X[size : 2 * size] = self.settled(self.oblique @ free, free)
        cosine = np.arange(2 * size + 1, 2 * size + 1 + len(omega))
        X[cosine, cosine + len(omega)], X[cosine + len(omega), cosine] = -omega, omega
        return X


def _forces(rows: np.ndarray, wrench: np.ndarray, squared: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the forces of kept rows (k, N), accelerations (N, N), both by loads, and StateFlow.left."""
    size = rows.shape[1]
    if not len(rows):
        return np.zeros((0, size)), np.eye(size), 0.0
    mobility = rows @ wrench
    scale = 1 / np.linalg.norm(rows, axis=1)
    inverse = np.linalg.pinv(mobility * scale * scale[:, None], rcond=SINGULAR) * scale * scale[:, None]
    carried = -inverse @ rows
    oblique = np.eye(size) + wrench @ carried
    left = _left(rows, oblique, scale)
    if left >= squared:
        carried, oblique = _forces_of_near_dependent(rows, wrench, scale, carried, oblique)
        left = _left(rows, oblique, scale)
    return carried, oblique, left


def _left(rows: np.ndarray, oblique: np.ndarray, scale: np.ndarray) -> float:
    """Return the largest acceleration that is left in a row that is to have none, per unit of load and length."""
    return float(np.abs((rows @ oblique) * scale[:, None]).max())


def _forces_of_near_dependent(
    rows: np.ndarray, wrench: np.ndarray, scale: np.ndarray, carried: np.ndarray, oblique: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces and accelerations as `_forces` does, for rows that nearly depend on each other.

    The mobility of a block that stands wedged on two corners, one almost above the other, has the square of their
    rows' condition. Not so the projector N (Y^T N)^-1 Y^T on the motions N that the rows leave, along the
    wrenches, to which Y is normal. Where there is none, as wrenches and rows differ in rank, those given are
    returned.
    """
    wrench = wrench * scale
    free = null_space(rows * scale[:, None])
    normal = null_space(wrench.T)
    meeting = normal.T @ free  # cosines
    if free.shape != normal.shape or np.linalg.svd(meeting, compute_uv=False).min(initial=1.0) < SINGULAR:
        return carried, oblique
    oblique = free @ np.linalg.solve(meeting, normal.T)
    carried = np.linalg.pinv(wrench, rcond=SINGULAR) @ (oblique - np.eye(len(oblique))) * scale[:, None]
    return carried, oblique
