"""Contact states of the reference integrator: the linear motion in each, how it ends, and which one comes next."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from reference_system import System

STUCK = 0
#: Relative velocities below this are zero at an event (length and time in the units of the system).
ZERO = 1e-11
#: Order of a guard all of whose derivatives vanish.
VANISHES = 5
#: What counts as zero for the derivatives (columns) of an opening, of a velocity and of a force per mass (rows).
#: Openings and velocities are made exactly zero at events, all else carries round-off.
LIMITS = np.array([[0, 0, 1, 100, 100], [0, 1, 100, 100, 100], [1, 100, 100, 100, 100]]) * ZERO


class Mode(NamedTuple):
    """Contact state: per body STUCK or the direction it slides in, and the contacts that press."""

    floor: tuple[int, ...]
    closed: frozenset[int]


@dataclass(frozen=True)
class Flow:
    """The linear motion in one mode, on the extended state (q, r, q', r', 1, sin t, cos t) of size s.

    rate (s, s): z' = rate z. guards (g, s): rows that are positive as long as the mode lasts. level (g,): 0 for an
    opening, 1 for a velocity, 2 for a force per mass. press (c, s): the closing acceleration of every contact.
    """

    rate: np.ndarray
    guards: np.ndarray
    level: np.ndarray
    press: np.ndarray

    @functools.cached_property
    def derivatives(self) -> np.ndarray:
        """Rows of the guards and their first derivatives, (VANISHES + 1, g, s)."""
        rows = [self.guards]
        for _ in range(VANISHES):
            rows.append(rows[-1] @ self.rate)
        return np.array(rows)

    @functools.cached_property
    def relative(self) -> np.ndarray:
        """The derivatives for a state in which r counts from the start of a piece of motion: openings without reach."""
        rows = self.derivatives.copy()
        rows[0, self.level == 0, -3] = 0.0
        return rows

    def signs(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First derivative of each guard that is not zero: (its order, its value, its sign)."""
        values = self.derivatives[:VANISHES] @ z
        alive = np.vstack([np.abs(values) > LIMITS[self.level, :].T, np.ones(values.shape[1], bool)])
        order = alive.argmax(axis=0)
        leading = np.vstack([values, np.zeros(values.shape[1])])[order, np.arange(values.shape[1])]
        return order, leading, np.sign(leading)


class Modes:
    """The contact states of a system."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.flow = functools.lru_cache(maxsize=None)(self._flow)

    def settle(self, t: float, y: np.ndarray) -> Mode:
        """The contact state in which the motion goes on from a state: none of its guards turns negative.

        Tries every combination. The accelerations are unique (the problem is a strictly convex one), so the first
        that fits is the answer.
        """
        system = self.system
        z = system.extended(t, y)
        rd = system.split(y)[3]
        touching = np.flatnonzero((system.opening(y) == 0) & (system.speed(y) == 0)).tolist()
        near = {body for contact in touching for body in system.pairs[contact]}
        options: list[tuple[int, ...]] = []
        for body, velocity in enumerate(rd):
            if system.friction[body] == 0:
                options.append((STUCK, 1) if velocity == 0 and body in near else (1,))
            elif velocity == 0:
                options.append((STUCK, 1, -1))
            else:
                options.append((1,) if velocity > 0 else (-1,))
        for floor in itertools.product(*options):
            for closed in self._closures(floor, touching):
                mode = Mode(floor, closed)
                if np.all(self.flow(mode).signs(z)[2] >= 0):
                    return mode
        raise RuntimeError(f"no consistent contact state at r = {system.split(y)[1]}, r' = {rd}")

    def _closures(self, floor: tuple[int, ...], touching: list[int]) -> list[frozenset[int]]:
        """Sets of contacts that may press: between stuck bodies and walls all, between moving bodies any."""
        fixed, free = set(), []
        for contact in touching:
            states = [STUCK if body < 0 else floor[body] for body in self.system.pairs[contact]]
            if all(state == STUCK for state in states):
                fixed.add(contact)
            elif STUCK not in states:
                free.append(contact)
        subsets = itertools.chain.from_iterable(itertools.combinations(free, k) for k in range(len(free) + 1))
        return [frozenset(fixed.union(subset)) for subset in subsets]

    def side(self, body: int, mode: Mode) -> str:
        """What a stuck body rests against: a wall ("left", "right"), a "neighbour" or just the "floor"."""
        sides = [
            "neighbour" if min(self.system.pairs[c]) >= 0 else self.system.name(c)[1]
            for c in mode.closed
            if body in self.system.pairs[c]
        ]
        return min(sides, key=["left", "right", "neighbour"].index, default="floor")

    def _flow(self, mode: Mode) -> Flow:
        system = self.system
        n, b = len(system.M), len(system.m)
        one, sine = system.size - 3, system.size - 2
        slide = -np.array(mode.floor) * system.friction
        # accelerations without the forces that hold contacts
        structure = np.zeros((n, system.size))
        structure[:, :n] = -system.inverse @ system.K
        structure[:, n + b : 2 * n + b] = -system.inverse @ system.C
        structure[:, one] = -system.inverse @ system.W @ slide
        structure[:, sine] = system.inverse @ system.force
        bodies = -system.W.T @ structure
        bodies[:, one] += slide / system.m + system.weight
        bodies[:, sine] -= system.base
        stuck = [index for index, state in enumerate(mode.floor) if state == STUCK]
        moving = [c for c in sorted(mode.closed) if not self._holds(c, mode)]
        held = np.vstack([np.eye(b)[stuck].reshape(-1, b), system.G[moving].reshape(-1, b)])
        forces = -np.linalg.solve(held @ system.D @ held.T, held @ bodies)
        structure -= system.inverse @ system.W @ held.T @ forces
        bodies += system.D @ held.T @ forces
        bodies[stuck] = 0.0
        for contact in moving:
            left, right = system.pairs[contact]
            bodies[right] = bodies[left]
        rate = np.zeros((system.size, system.size))
        rate[: n + b, n + b : 2 * (n + b)] = np.eye(n + b)
        rate[n + b : 2 * n + b] = structure
        rate[2 * n + b : 2 * (n + b)] = bodies
        rate[sine, sine + 1], rate[sine + 1, sine] = 1.0, -1.0
        guards = self._guards(mode, dict(zip(stuck, forces, strict=False)), forces[len(stuck) :])
        return Flow(rate, *guards, -system.G @ bodies)

    def _holds(self, contact: int, mode: Mode) -> bool:
        """Whether a wall or a stuck body takes part in the contact."""
        return any(body < 0 or mode.floor[body] == STUCK for body in self.system.pairs[contact])

    def _guards(self, mode: Mode, hold: dict[int, np.ndarray], press: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        system = self.system
        n, b = len(system.M), len(system.m)
        rows, levels = [], []
        for contact in range(len(system.pairs)):
            if contact not in mode.closed:
                row = np.zeros(system.size)
                row[n : n + b] = system.G[contact]
                row[system.size - 3] = system.reach[contact]
                rows.append(row)
                levels.append(0)
        for body, direction in enumerate(mode.floor):
            if direction != STUCK and system.friction[body] > 0:
                rows.append(direction * np.eye(system.size)[2 * n + b + body])
                levels.append(1)
        rows += [force / system.m.mean() for force in press]
        for chain, left_open, right_open in self._chains(mode):
            rows += self._margins(chain, left_open, right_open, hold)
        levels += [2] * (len(rows) - len(levels))
        return np.array(rows).reshape(len(rows), system.size), np.array(levels, dtype=int)

    def _chains(self, mode: Mode) -> list[tuple[list[int], bool, bool]]:
        """Rows of stuck bodies that touch: (bodies from left to right, nothing on the left, nothing on the right)."""
        system, chains = self.system, []
        for contact, (_, first) in enumerate(system.pairs):
            if first < 0 or mode.floor[first] != STUCK:
                continue
            left = system.pairs[contact][0]
            if contact in mode.closed and left >= 0:
                continue
            chain, at = [first], contact + 1
            while at in mode.closed and system.pairs[at][1] >= 0:
                chain.append(system.pairs[at][1])
                at += 1
            chains.append((chain, contact not in mode.closed, at not in mode.closed))
        return chains

    def _margins(
        self, chain: list[int], left_open: bool, right_open: bool, hold: dict[int, np.ndarray]
    ) -> list[np.ndarray]:
        """What is left of the friction that holds each end of a chain, per mass.

        Contacts push and never pull: the bodies at an open left end can be pushed to the left by their successor, so
        that friction alone must supply what pushes them to the right; and the same from the right.
        """
        system, rows = self.system, []
        for count in range(1, len(chain) + 1):
            for bodies, is_open, sign in ((chain[:count], left_open, -1.0), (chain[-count:], right_open, 1.0)):
                if is_open:
                    row = sign * sum(hold[body] for body in bodies)
                    row[system.size - 3] += system.friction[bodies].sum()
                    rows.append(row / system.m[bodies].sum())
        return rows
