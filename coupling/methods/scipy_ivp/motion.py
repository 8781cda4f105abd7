"""The motion between two events as a linear system: rates, forces and event functions.

Between two events every unit keeps its state, and all is linear in the extended state (z, 1, cos, sin) of the
excitation's harmonics. z = (q, v, d, s) holds coordinates and velocities, and again the gaps of the units and the
speeds of all rows. Zeros at an event are then zero to the last bit, and a gap grows from there with all digits.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import OPEN, STICK
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_laws import (
    Grip,
    contacts_of,
    possible_events,
    presses,
    rubs,
    signals_of,
    slip_towards,
    ways,
)

#: derivatives that are evaluated, and the order of a zero whose derivatives all vanish
_LEVELS, NEVER = 7, 99
#: values below this fraction of the terms that they are sums of are round-off
ROUND_OFF = 1e-11
#: fraction of a row's motion by which forces may fail to hold it
_LOST = 1e-7
#: gaps below these fractions of the play, and of the terms that they are sums of, are closed; the second ones are those
#: of rigid planar bodies, whose corners are to meet a surface together
_TOUCH, _TOUCH_EXTENDED = (0.0, 2e-14), (1e-11, 10 * ROUND_OFF)

#: of units (numerics.codes); a closed contact without friction slips to the right
States = tuple[int, ...]


class Wrong(NamedTuple):
    """A defect of a choice of states: a unit, and the state that it should have instead."""

    unit: int
    state: int


class Unforced:
    """A system without forces of its contacts, on the extended state: size of z, extent, slices, accelerations.

    Those of springs before sliders are in it: they do not depend on whether the sliders, of units sprung (u,), move.
    pull (j, extent): their forces on their drivers; ease (u,): how far a slider that slips moves on as the gap opens,
    in the direction of slip. The sliders' speeds in the state are zero.
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
        self.sliders, self.sprung = self.q.stop - sliders, system.slider >= 0
        self.pull = np.zeros((sliders, self.extent))
        self.pull[:, self.q] = -system.tangential[:, None] * system.elongation
        forces[: self.sliders] += system.elongation[:, : self.sliders].T @ self.pull
        self.accelerations = forces / system.mass[:, None]
        self.relative = system.J @ self.accelerations
        self.respond = (system.J / system.mass).T  # (N, 2u)
        self.normal, self.slip = system.J[:u], system.J[u:]
        self.contact = contacts_of(system)
        self.soft = self.contact & np.isfinite(system.spring)
        self.rigid = self.contact & ~self.soft
        self.rubs = rubs(system)
        self.gap, self.speed = np.eye(self.extent)[self.d], np.eye(self.extent)[self.s]
        spring = np.where(self.soft, system.spring, 0.0)
        self.ease = np.zeros(u)
        self.ease[self.sprung] = system.ease
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
        """Return the states that a unit with a slider may have, which moves with its spring at its bound.

        now, sizes: (extent,) the state and its terms; speed: of its driver, m/s.
        """
        pull, room = self.pull[self.system.slider[r]], self.system.friction[r] * self.push[r]
        force, limit = float(pull @ now), self.system.limit[r] + max(float(room @ now), 0.0)
        noise = ROUND_OFF * (limit + float((np.abs(pull) + np.abs(room)) @ sizes))
        if abs(force) < limit - noise:
            return [STICK]
        way = slip_towards(-force) if limit > noise else slip_towards(speed)
        speed = way * speed + self.ease[r] * float(self.speed[r] @ now)
        if speed < -slow:
            return [STICK]
        return [way] if speed > slow else [STICK, way]


class Holding:
    """The rows that states keep at rest, and what their forces do (system.unit_laws.Grip).

    kept (k,): rows; inverse (k, k): forces of the kept rows that give them accelerations; possible: whether there are
    such forces.
    """

    def __init__(self, free: Unforced, state: np.ndarray) -> None:
        system, u = free.system, free.u
        self.closed = np.flatnonzero((state != OPEN) & free.rigid)
        self.stick = np.flatnonzero((state == STICK) & free.rubs & ~free.sprung)
        self.drag = (ways(state) * system.friction)[self.closed]
        self.kept = np.concatenate([self.closed, u + self.stick])
        rows, lever, self.inverse = Grip.of(system, self.closed, self.drag, self.stick)
        left = rows - rows @ lever @ (self.inverse @ rows)
        sizes = np.abs(rows).max(axis=1, initial=0.0)
        self.possible = bool(np.all(np.abs(left).max(axis=1, initial=0.0) <= _LOST * sizes))

    def spread(self, forces: np.ndarray, u: int) -> np.ndarray:
        """Return the forces (2u, ...) of all rows from the kept ones (k, ...)."""
        count, spread = len(self.closed), np.zeros((2 * u, *forces.shape[1:]))
        spread[self.closed] = forces[:count]
        spread[u + self.closed] = -(self.drag * forces[:count].T).T
        spread[u + self.stick] = forces[count:]
        return spread


class LinearMotion:
    """The linear motion while units keep their states (u,): rate (extent, extent), force (2u, extent), event functions.

    guard (k, extent): positive until its event; pressed: (u,) contacts whose springs push; possible: whether forces can
    hold the coordinates that the states keep at rest.
    """

    def __init__(self, free: Unforced, states: States) -> None:
        system, u = free.system, free.u
        state = self.state = np.array(states, int)
        holding, way = Holding(free, state), ways(state)[:, None]
        self.possible = holding.possible
        if not self.possible:
            return
        self.pressed = free.soft & presses(state)
        force = np.zeros((2 * u, free.extent))
        force[:u][self.pressed] = free.push[self.pressed]
        force[u:] = -way * np.where(free.sprung, 0.0, system.friction)[:, None] * force[:u]
        force[u:, free.one] -= np.where(free.contact | free.sprung, 0.0, way[:, 0] * system.limit)
        pushed = free.relative[holding.kept] + system.delassus[holding.kept] @ force
        force += holding.spread(-holding.inverse @ pushed, u)
        self.rate = np.zeros((free.extent, free.extent))
        self.rate[free.q, free.v] = np.eye(free.n)
        drawn = free.sprung & (state != STICK)
        eased = (way[:, 0] * free.ease)[drawn, None] * free.normal[drawn]
        self.rate[free.sliders + system.slider[drawn], free.v] = free.slip[drawn] + eased
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
        self._watch(free)

    def _watch(self, free: Unforced) -> None:
        """Set the event functions of all units, in their order, and their messages where negative."""
        system, way, one = free.system, ways(self.state), np.eye(free.extent)[free.one]
        events, self.wrong, speed = possible_events(system, self.state), list[Wrong](), free.speed.copy()
        speed[free.u :] += (way * free.ease)[:, None] * free.speed[: free.u]  # of sliders
        self.guard = np.zeros((len(events), free.extent))
        for guard, (r, event) in zip(self.guard, events, strict=True):
            signals = signals_of(r, free.gap, speed, self.force, one)
            guard[:] = event.function(event.factors(system, r, way[r]), signals)
            self.wrong.append(Wrong(r, event.after))
        self._sizes = np.abs(self.guard)

    def judge(self, now: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, list[Wrong]]:
        """Return the orders (k,) of the event functions at an extended state, and which turn negative at once.

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
