"""The motion between two events as a linear system, for an integrator: rates, forces of rows and event functions.

The state z = (p, d, p', s) holds the structure's modal coordinates, the displacements of all rows (slips, elongations
of springs before sliders, gaps; system.line_system), and both their rates. That gaps are differences of slips is a
linear invariant, which Runge-Kutta methods keep to round-off; and a closed gap, or a slip that sticks, is zero to the
last bit. With 1, cos and sin of the excitation's harmonics behind it, everything is a linear functional of this
extended state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.system.line_system import LineSystem

# states of a row: no force; at rest by an unknown force; at rest while other rows carry its force, which is constant;
# sliding; a spring that holds or presses; a soft contact that has ended at zero force, before its gap is open
UNFORCED, REST, HELD, SLIDE, SPRUNG, LOOSE = range(6)
# meaning of an event function: a gap closes; a slip stops; a force reaches its low or high bound; a gap that was
# left under compression opens; its spring would push again
GAP, SLIP, LOW, HIGH, OPENS, PUSHES = range(10, 16)
#: order of a zero whose derivatives all vanish: the function is not watched
NEVER = 99


@dataclass(frozen=True)
class Contacts:
    """States of the rows (r,), the forces (r,) of those that slide or are held, and orders of zeros.

    order: (r,) of the zero that gap, slip or force of a row has now; side: (r,) bound at which a force is, LOW or HIGH.
    """

    state: np.ndarray
    held: np.ndarray
    order: np.ndarray
    side: np.ndarray


class Guards(NamedTuple):
    """Event functions, positive until their event: (k, extended state), the row, kind and order of each."""

    functional: np.ndarray
    row: np.ndarray
    kind: np.ndarray
    order: np.ndarray


class Unforced:
    """The system without any force of rows: sizes, places in the state, and accelerations."""

    def __init__(self, system: LineSystem) -> None:
        n, r = system.modes, len(system.delassus)
        self.system, self.n, self.r, self.size = system, n, r, 2 * (n + r)
        self.p, self.d = slice(0, n), slice(n, n + r)
        self.p_rate, self.s = slice(n + r, 2 * n + r), slice(2 * n + r, 2 * (n + r))
        e = len(system.frequency)
        self.extent, self.one = self.size + 1 + 2 * e, self.size
        self.cosine, self.sine = slice(self.size + 1, self.size + 1 + e), slice(self.size + 1 + e, self.extent)
        self.soft = np.isfinite(system.spring)
        contacts = np.arange(r) >= system.friction_rows
        self.rigid_contact, self.soft_contact = contacts & ~self.soft, contacts & self.soft
        self.slider = ~contacts & self.soft
        self.friction = ~contacts & ~self.soft
        self.limit = system.limit
        modes, bodies = system.of_structure, system.of_bodies
        self.by_mass = bodies.J / bodies.mass
        self.structure = np.zeros((n, self.extent))
        self.structure[:, self.p], self.structure[:, self.p_rate] = -np.diag(modes.stiffness), -modes.damping
        self.structure[:, self.cosine], self.structure[:, self.sine] = modes.load.real.T, -modes.load.imag.T
        self.accelerations = modes.J @ self.structure
        self.accelerations[:, self.one] += self.by_mass @ bodies.weight
        self.accelerations[:, self.cosine] += self.by_mass @ bodies.load.real.T
        self.accelerations[:, self.sine] -= self.by_mass @ bodies.load.imag.T

    def extended(self, t: float | np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the states (size, ...) at times t (...) with 1, cos and sin below them."""
        phase = np.multiply.outer(self.system.frequency, np.asarray(t, float))
        return np.concatenate([z, np.ones((1, *phase.shape[1:])), np.cos(phase), np.sin(phase)])

    def rates(self, motion: Motion, extended: np.ndarray) -> np.ndarray:
        """Return the rates (size + 3,) of an extended state, or of its rates."""
        frequency = self.system.frequency
        turn = -frequency * extended[self.sine], frequency * extended[self.cosine]
        return np.concatenate([motion.rate @ extended, [0.0], *turn])


class Motion:
    """The linear system that the states of the rows name.

    rate: (size, extent), z' on the extended state; force: (r, extent), of all rows.
    """

    def __init__(self, unforced: Unforced, contacts: Contacts) -> None:
        u, system = unforced, unforced.system
        self.unforced, self.contacts = u, contacts
        state, mobility = contacts.state, system.delassus
        self.force = np.zeros((u.r, u.extent))
        self.force[:, u.one] = contacts.held
        for r in np.flatnonzero(state == SPRUNG):
            self.force[r, u.d.start + r], self.force[r, u.s.start + r] = -system.spring[r], -system.dashpot[r]
        closed = np.flatnonzero(state == REST)
        if len(closed):
            free = (u.accelerations + mobility @ self.force)[closed]
            self.force[closed] -= np.linalg.solve(mobility[np.ix_(closed, closed)], free)
        accelerations = u.accelerations + mobility @ self.force
        accelerations[(state == REST) | (state == HELD)] = 0.0
        self.rate = np.zeros((u.size, u.extent))
        self.rate[u.p, u.p_rate] = np.eye(u.n)
        self.rate[u.d, u.s] = np.diag(~(u.slider & (state == SLIDE)))
        self.rate[u.p_rate] = u.structure + system.of_structure.J.T @ self.force
        self.rate[u.s] = accelerations

    def guards(self) -> Guards:
        """Return the event functions."""
        found: list[tuple[np.ndarray, int, int, int]] = []
        for r in range(self.unforced.r):
            found += self._guards_of(r)
        functionals = np.array([entry[0] for entry in found]).reshape(len(found), self.unforced.extent)
        row, kind, order = (np.array([entry[i] for entry in found], int) for i in (1, 2, 3))
        return Guards(functionals, row, kind, order)

    def _guards_of(self, r: int) -> list[tuple[np.ndarray, int, int, int]]:
        u, contacts = self.unforced, self.contacts
        state, order, side = contacts.state[r], int(contacts.order[r]), contacts.side[r]
        place, speed = np.zeros((2, u.extent))
        place[u.d.start + r] = speed[u.s.start + r] = 1.0
        contact = r >= u.system.friction_rows
        if state == SLIDE:
            return [] if order == NEVER else [(-np.sign(contacts.held[r]) * speed, r, SLIP, order)]
        if state == UNFORCED:
            return [(place, r, GAP, order)] if contact and order != NEVER else []
        if state == LOOSE:
            push = u.system.spring[r] * place + u.system.dashpot[r] * speed
            return [(-place, r, OPENS, 0)] + ([] if order == NEVER else [(push, r, PUSHES, order)])
        if state == HELD:
            return []
        bound = np.zeros(u.extent)
        bound[u.one] = u.limit[r]
        found = [(bound + self.force[r], LOW)] + ([] if contact else [(bound - self.force[r], HIGH)])
        orders = [order if kind == side else 0 for _, kind in found]
        return [(guard, r, kind, o) for (guard, kind), o in zip(found, orders, strict=True) if o != NEVER]
