"""Equations for heyoka, linear between events, and what sticks and stays closed: decided in numpy when an event asks.

Lengths are over the smallest free travel, times angles of the excitation, as heyoka's tolerance is that of the largest
component.
"""

from __future__ import annotations

import itertools

import numpy as np

from vanedamp.coupling.system.assembly import Coordinates
from vanedamp.coupling.system.line_system import LineSystem

#: speeds, and differences of a force from its bound, that are zero
STILL = 1e-9
#: angle: bounces that would end within it have ended
_CHATTER = 1e-5


class Model:
    """A system over z: coordinates u (n,), their rates, cos and sin of the harmonics, 1.

    Rows are those of the system: slips of bodies, then contacts. Their forces are over friction's limit, those of rigid
    contacts over what gives a unit of acceleration, those of springs over that of a unit's overlap.
    """

    def __init__(self, system: LineSystem) -> None:
        self.system, self.n, self.order = system, len(system.mass), system.order.astype(float)
        omega, contact = system.omega, np.arange(len(system.J)) >= system.friction_rows
        self.length = float(system.play.min())
        moved = np.abs(system.J).max(axis=0)
        self.size = self.length / np.where(moved > 0, moved, 1.0)
        self.row, self.rest = system.J * self.size / self.length, system.rest / self.length
        self.response, self.damped = system.response * self.size, system.dashpot * omega / system.spring
        unit = system.mass * self.size * omega**2  # force of a unit's acceleration, N
        soft = contact & np.isfinite(system.spring)
        force = np.where(contact, self.length * omega**2 / np.diag(system.delassus), system.limit)
        force[soft] = system.spring[soft] * self.length
        #: accelerations (n,) by a unit of each row's force; without any, over z
        self.push = system.J / unit * force[:, None]
        load = system.load.T / unit[:, None]
        self.free = np.column_stack([
            np.diag(-system.stiffness / omega**2), -system.damping * self.size * omega / unit[:, None], load.real,
            -load.imag, system.weight / unit,
        ])  # fmt: skip
        #: rate of the response over z, with that of a base whose motion it is
        self.speed = np.r_[
            np.zeros(self.n), self.response, -self.order * system.table.imag, -self.order * system.table.real, 0.0
        ]
        #: rows with friction, walls with springs, rigid walls
        self.rubs = np.flatnonzero(~contact & (system.limit > 0)).tolist()
        self.soft, self.hard = np.flatnonzero(soft).tolist(), np.flatnonzero(contact & ~soft).tolist()
        #: whether rigid contacts may stay closed, which needs friction or weight, or a base that pushes
        self.rests = bool(self.rubs) or bool(system.of_bodies.weight.any()) or not system.modes

    def start(self, motion: Coordinates) -> np.ndarray:
        """Return u and its rate of a motion."""
        return np.r_[motion.q / self.size, motion.v / self.size / self.system.omega]

    def extended(self, state: np.ndarray, angle: float) -> np.ndarray:
        """Return z."""
        return np.r_[state, np.cos(self.order * angle), np.sin(self.order * angle), 1.0]

    def base(self, angles: np.ndarray) -> np.ndarray:
        """Return the displacement of a base whose motion is the response, m."""
        found: np.ndarray = (self.system.phases(angles) @ self.system.table).real
        return found

    def of_spring(self, row: int) -> np.ndarray:
        """Return the force of a closed spring with its dashpot, over z."""
        return -np.r_[self.row[row], self.damped[row] * self.row[row], np.zeros(2 * len(self.order)), self.rest[row]]


class States:
    """States of contacts and friction: closed contacts; directions of slip, 0 where it sticks."""

    def __init__(self, model: Model) -> None:
        self.model, self.closed, self.slips = model, set[int](), dict.fromkeys(model.rubs, 0.0)
        #: present accelerations, over z
        self.accelerations = model.free

    def decide(self, z: np.ndarray) -> dict[int, np.ndarray]:
        """Decide what sticks and which rigid contacts stay closed. Returns the forces of these rows, over z."""
        model = self.model
        speeds = model.row @ z[model.n : 2 * model.n]
        for row in self.slips:
            self.slips[row] = float(np.sign(speeds[row])) if abs(speeds[row]) > STILL else 0.0
        while True:
            free = model.free.copy()
            for row in self.closed.intersection(model.soft):
                free += np.outer(model.push[row], model.of_spring(row))
            for row, sign in self.slips.items():
                free[:, -1] -= sign * model.push[row]
            fixed = [row for row, sign in self.slips.items() if sign == 0.0]
            fixed += [row for row in model.hard if row in self.closed]
            forces = -np.linalg.solve(model.row[fixed] @ model.push[fixed].T, model.row[fixed] @ free)
            self.accelerations = free + model.push[fixed].T @ forces
            if not self._release(fixed, forces @ z, forces @ self._trend(z)):
                return dict(zip(fixed, forces, strict=True))

    def _release(self, rows: list[int], forces: np.ndarray, trends: np.ndarray) -> bool:
        """Open and let slip what its force cannot hold: beyond its bound, or there and going on. Returns whether."""
        released = False
        for row, force, trend in zip(rows, forces, trends, strict=True):
            contact, sign = row in self.model.hard, float(np.sign(force))
            over, further = (-force, -trend) if contact else (abs(force) - 1.0, sign * trend)
            if over > STILL or (over > -STILL and further > 0):
                released = True
                if contact:
                    self.closed.discard(row)
                else:
                    self.slips[row] = -sign
        return released

    def _trend(self, z: np.ndarray) -> np.ndarray:
        """Return the rate of z."""
        n, order = self.model.n, self.model.order
        cosine, sine = z[2 * n : -1].reshape(2, -1)
        return np.r_[z[n : 2 * n], self.accelerations @ z, -order * sine, order * cosine, 0.0]

    def collide(self, row: int, z: np.ndarray) -> np.ndarray:
        """Return what an impact adds to the rates, by Newton's law at all that touches; a chatter ends closed."""
        model = self.model
        bounce, rate = float(model.system.restitution[row]), z[model.n : 2 * model.n]
        rebound, pull = -bounce * (model.row[row] @ rate), -(model.row[row] @ (self.accelerations @ z))
        ended = rebound < STILL or 2 * rebound < _CHATTER * pull * (1 - bounce)
        touching = [row, *self.closed.intersection(model.hard)]
        speeds, work = model.row[touching] @ rate, model.row[touching] @ model.push[touching].T
        target = np.r_[0.0 if ended else rebound, np.zeros(len(touching) - 1)]
        for active in _subsets(len(touching)):
            impulse = np.linalg.solve(work[np.ix_(active, active)], (target - speeds)[active])
            after = speeds + work[:, active] @ impulse
            if impulse.min() >= 0 and (after - target).min() > -STILL:
                break
        self.closed -= {other for other, speed in zip(touching, after, strict=True) if speed > STILL}
        if ended:
            self.closed.add(row)
        jump: np.ndarray = impulse @ model.push[touching][active]
        return jump


def _subsets(count: int) -> list[list[int]]:
    """Return the subsets of the first numbers that hold 0, small ones first."""
    others = range(1, count)
    return [[0, *rest] for size in range(count) for rest in itertools.combinations(others, size)]
