"""The motion between two events as a linear system: rates, forces and event functions.

Between two events every unit keeps its state, and all is linear in the extended state (z, 1, cos, sin) of the
excitation's harmonics. z = (q, v, d, s) holds coordinates and velocities, and again the gaps of the units and the
speeds of all rows. Zeros at an event are then zero to the last bit, and a gap grows from there with all digits.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.system.system import System

#: states of a unit; a closed contact without friction slips to the right; LOOSE: a spring is compressed without force
OPEN, STICK, LEFT, RIGHT, LOOSE = range(5)
_WAY = np.array([0.0, 0.0, -1.0, 1.0, 0.0])
#: derivatives that are evaluated, and the order of a zero whose derivatives all vanish
_LEVELS, NEVER = 7, 99
#: values below this fraction of the terms that they are sums of are round-off
ROUND_OFF = 1e-11
#: relative tolerance of rows that depend on each other
_DEPENDENT = 1e-9
#: fraction of a row's motion by which forces may fail to hold it
_LOST = 1e-7
#: gaps below these fractions of the play, and of the terms that they are sums of, are closed; the second ones are those
#: of rigid planar bodies, whose corners are to meet a surface together
_TOUCH, _TOUCH_EXTENDED = (0.0, 2e-14), (1e-11, 10 * ROUND_OFF)

States = tuple[int, ...]


class Wrong(NamedTuple):
    """What speaks against a choice of states: a unit, and the state that it should have instead."""

    unit: int
    state: int


class Unforced:
    """A system without forces of its contacts, on the extended state: size of z, extent, slices, accelerations.

    Those of the springs of Jenkins elements are in it: they do not depend on whether their sliders, the last units
    (sprung (u,)), move. pull (j, extent): their forces on what draws them. The sliders' speeds in the state are zero.
    gap (u, extent), speed (2u, extent): of the units; push (u, extent): forces of contacts that yield; relative
    (2u, extent): accelerations of the rows.
    """

    def __init__(self, system: System) -> None:
        n, e, u = len(system.mass), len(system.frequency), len(system.rest)
        self.system, self.n, self.u, self.size = system, n, u, 2 * n + 3 * u
        self.q, self.v, self.d, self.s = (slice(*ends) for ends in pairwise((0, n, 2 * n, 2 * n + u, self.size)))
        self.one, self.extent = self.size, self.size + 1 + 2 * e
        self.cosine, self.sine = slice(self.one + 1, self.one + 1 + e), slice(self.one + 1 + e, self.extent)
        self.load = np.zeros((n, self.extent))
        self.load[:, self.cosine], self.load[:, self.sine] = system.load.real.T, -system.load.imag.T
        forces = self.load.copy()
        forces[:, self.q], forces[:, self.v] = -system.stiffness, -system.damping
        forces[:, self.one] = system.weight
        sliders = len(system.tangential)
        self.sliders, self.sprung = self.q.stop - sliders, np.arange(u) >= u - sliders
        self.pull = np.zeros((sliders, self.extent))
        self.pull[:, self.q] = -system.tangential[:, None] * system.elongation
        forces[: self.sliders] += system.elongation[:, : self.sliders].T @ self.pull
        self.accelerations = forces / system.mass[:, None]
        self.relative = system.J @ self.accelerations
        self.respond = (system.J / system.mass).T  # (N, 2u)
        self.normal, self.slip = system.J[:u], system.J[u:]
        self.contact = np.arange(u) < system.contacts
        self.soft = self.contact & np.isfinite(system.spring)
        self.rigid = self.contact & ~self.soft
        self.rubs = np.where(self.contact, system.friction, system.limit) > 0.0
        self.gap, self.speed = np.eye(self.extent)[self.d], np.eye(self.extent)[self.s]
        spring = np.where(self.soft, system.spring, 0.0)
        self.push = -spring[:, None] * self.gap - system.dashpot[:, None] * self.speed[:u]
        self.extends = self.rigid & ~system.without_body  # whether a rigid contact is of a planar body
        self.extends[self.extends] = system.tilt[system.body[self.extends]] >= 0

    def extended(self, t: float | np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the states z (size, ...) at times t (...) with 1, cos and sin below them."""
        phase = np.multiply.outer(self.system.frequency, np.asarray(t, float))
        return np.concatenate([z, np.ones((1, *phase.shape[1:])), np.cos(phase), np.sin(phase)])

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """Return the gaps (u, ...) at coordinates q (N, ...), m."""
        gaps: np.ndarray = (self.normal @ q).T + self.system.rest
        return gaps.T

    def touch(self, q: np.ndarray) -> np.ndarray:
        """Return the gaps (u,) below which contacts are closed, m. q: (N,) sizes of the coordinates."""
        terms = np.stack([np.where(self.contact, self.system.play, 0.0), self.system.rest + np.abs(self.normal) @ q])
        touch: np.ndarray = (np.where(self.extends[:, None], _TOUCH_EXTENDED, _TOUCH).T * terms).max(axis=0)
        return touch

    def ways_of_slider(self, r: int, now: np.ndarray, sizes: np.ndarray, speed: float, slow: float) -> list[int]:
        """Return the states that a Jenkins element (unit r) may have: its slider moves with its spring at its bound.

        now, sizes: (extent,) the state and its terms; speed: of what draws it, m/s.
        """
        pull = self.pull[r - self.u]
        force, limit = float(pull @ now), self.system.limit[r]
        way = RIGHT if force < 0.0 else LEFT
        if abs(force) < limit - ROUND_OFF * (limit + float(np.abs(pull) @ sizes)) or _WAY[way] * speed < -slow:
            return [STICK]
        return [way] if _WAY[way] * speed > slow else [STICK, way]


class Holding:
    """The rows that states keep at rest, and the wrenches of their forces: W_N - way mu W_T of a contact that slips.

    kept (k,): rows; inverse (k, k): forces of the kept rows that give them accelerations; possible: whether there are
    such forces.
    """

    def __init__(self, free: Unforced, state: np.ndarray) -> None:
        system, u = free.system, free.u
        self.closed = np.flatnonzero((state != OPEN) & free.rigid)
        self.stick = np.flatnonzero((state == STICK) & free.rubs & ~free.sprung)
        self.drag = (_WAY[state] * system.friction)[self.closed]
        self.kept = np.concatenate([self.closed, u + self.stick])
        mobility = system.delassus[np.ix_(self.kept, self.kept)]
        mobility[:, : len(self.closed)] -= self.drag * system.delassus[np.ix_(self.kept, u + self.closed)]
        scale = 1 / np.sqrt(np.maximum(np.diag(system.delassus)[self.kept], 1e-300))
        scaled = mobility * scale * scale[:, None]
        inverse = np.linalg.pinv(scaled, rcond=_DEPENDENT) if len(scale) else scaled
        self.inverse = inverse * scale[:, None] * scale
        rows = system.J[self.kept]
        left = rows - mobility @ (self.inverse @ rows)
        sizes = np.abs(rows).max(axis=1, initial=0.0)
        self.possible = bool(np.all(np.abs(left).max(axis=1, initial=0.0) <= _LOST * sizes))

    def spread(self, forces: np.ndarray, u: int) -> np.ndarray:
        """Return the forces (2u, ...) of all rows from the kept ones (k, ...)."""
        count, spread = len(self.closed), np.zeros((2 * u, *forces.shape[1:]))
        spread[self.closed] = forces[:count]
        spread[u + self.closed] = -(self.drag * forces[:count].T).T
        spread[u + self.stick] = forces[count:]
        return spread


class Motion:
    """The linear motion while units keep their states (u,): rate (extent, extent), force (2u, extent), event functions.

    guard (k, extent): positive until its event; pressed: (u,) contacts whose springs push; possible: whether forces can
    hold the coordinates that the states keep at rest.
    """

    def __init__(self, free: Unforced, states: States) -> None:
        system, u = free.system, free.u
        state = self.state = np.array(states, int)
        holding, way = Holding(free, state), _WAY[state][:, None]
        self.possible = holding.possible
        if not self.possible:
            return
        self.pressed = free.soft & (state != OPEN) & (state != LOOSE)
        force = np.zeros((2 * u, free.extent))
        force[:u][self.pressed] = free.push[self.pressed]
        force[u:] = -way * system.friction[:, None] * force[:u]
        force[u:, free.one] -= np.where(free.contact | free.sprung, 0.0, way[:, 0] * system.limit)
        pushed = free.relative[holding.kept] + system.delassus[holding.kept] @ force
        force += holding.spread(-holding.inverse @ pushed, u)
        self.rate = np.zeros((free.extent, free.extent))
        self.rate[free.q, free.v] = np.eye(free.n)
        drawn = free.sprung & (state != STICK)
        self.rate[free.sliders + np.flatnonzero(drawn[free.sprung]), free.v] = free.slip[drawn]
        self.rate[free.v] = free.accelerations + free.respond @ force
        self.rate[free.d], self.rate[free.s] = free.speed[:u], free.relative + system.delassus @ force
        self.rate[free.s][holding.kept] = 0.0
        self.rate[free.cosine, free.sine] = -np.diag(system.frequency)
        self.rate[free.sine, free.cosine] = np.diag(system.frequency)
        #: of the sums that form rates: terms of coordinates that contacts hold cancel
        self.terms = np.abs(self.rate)
        self.terms[free.v] = np.abs(free.accelerations) + np.abs(free.respond) @ np.abs(force)
        self.terms[free.s] = np.abs(free.relative) + np.abs(system.delassus) @ np.abs(force)
        force[u:][free.sprung] = free.pull
        self.force = force
        self._watch(free, way)

    def _watch(self, free: Unforced, way: np.ndarray) -> None:
        """Set the event functions of all units, in their order, and what each says where it is negative."""
        state, u, force = self.state, free.u, self.force
        closed = free.contact & (state != OPEN) & (state != LOOSE)
        bound = free.system.friction[:, None] * force[:u]
        bound[:, free.one] += free.system.limit
        stick, loose = free.rubs & (state == STICK), state == LOOSE
        kinds = [
            (free.gap, free.contact & (state == OPEN), STICK), (-free.gap, loose, OPEN), (-free.push, loose, STICK),
            (force[:u], closed, OPEN), (bound - force[u:], stick, LEFT), (bound + force[u:], stick, RIGHT),
            (way * free.speed[u:], free.rubs & (way[:, 0] != 0.0), STICK),
        ]  # fmt: skip
        unit = np.concatenate([np.flatnonzero(which) for _, which, _ in kinds])
        order = np.argsort(unit, kind="stable")
        self.guard = np.concatenate([rows[which] for rows, which, _ in kinds])[order]
        instead = np.repeat([state for *_, state in kinds], [np.count_nonzero(which) for _, which, _ in kinds])
        self.wrong = [Wrong(*pair) for pair in zip(unit[order].tolist(), instead[order].tolist(), strict=True)]
        self._sizes = np.abs(self.guard)

    def judge(self, now: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, list[Wrong]]:
        """Return the orders (k,) of the event functions at an extended state, and what turns negative at once.

        now: (extent,) the state; sizes: (extent,) of its terms, whose round-off is no value.
        """
        order, open_, wrong = np.full(len(self.guard), NEVER), np.ones(len(self.guard), bool), []
        for level in range(_LEVELS):
            value, noise = self.guard @ now, ROUND_OFF * (self._sizes @ sizes)
            decided = open_ & (np.abs(value) > noise)
            order[decided] = level
            wrong += [self.wrong[k] for k in np.flatnonzero(decided & (value < 0.0))]
            open_ &= ~decided
            if not open_.any():
                break
            now, sizes = self.rate @ now, self.terms @ sizes
        return order, wrong
