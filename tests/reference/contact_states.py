"""Contact states of the reference integrator: the linear motion in each, how it ends, and which one comes next."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.reference.system import System

STUCK = 0
#: States of a compliant contact: apart, pressing, or apart with the wall not yet sprung back.
OPEN, PRESSING, LOOSE = 0, 1, 2
#: Relative velocities below this are zero at an event (length and time in the units of the system).
ZERO = 1e-11
#: Order of a guard all of whose derivatives vanish.
VANISHES = 5
#: What counts as zero for the derivatives (columns) of an opening, of a velocity and of a force per mass (rows).
#: Openings and velocities are made exactly zero at events, all else carries round-off; stiff contacts bring more of it.
LIMITS = np.array([[0, 0, 1, 100, 100], [0, 1, 100, 100, 100], [1, 100, 100, 100, 100], [0, 100, 100, 100, 100]]) * ZERO


class Mode(NamedTuple):
    """Contact state: per body STUCK or the direction it slides in, and the rigid contacts that press.

    soft: OPEN, PRESSING or LOOSE of every compliant contact; casing: STUCK or the direction in which a Jenkins element
    slides.
    """

    floor: tuple[int, ...]
    closed: frozenset[int]
    soft: tuple[int, ...] = ()
    casing: tuple[int, ...] = ()


@dataclass(frozen=True)
class Flow:
    """The linear motion in one mode, on the extended state (q, r, q', r', e, sines, cosines, 1) of size s.

    rate (s, s): z' = rate z. guards (g, s): rows that are positive as long as the mode lasts. level (g,): 0 for an
    opening, 1 for a velocity, 2 for a force per mass, 3 for a velocity beside stiff contacts. press (c, s): the closing
    acceleration of every contact.
    """

    rate: np.ndarray
    guards: np.ndarray
    level: np.ndarray
    press: np.ndarray

    @functools.cached_property
    def fastest(self) -> float:
        """The largest natural frequency or rate of decay, or frequency in the excitation (the first is 1)."""
        return float(np.abs(np.linalg.eigvals(self.rate)).max())

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
        rows[0, self.level == 0, -1] = 0.0
        return rows

    @functools.cached_property
    def limits(self) -> np.ndarray:
        """What counts as zero for the derivatives of every guard, (VANISHES, g)."""
        return LIMITS[self.level, :].T

    def signs(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First derivative of each guard that is not zero: (its order, its value, its sign)."""
        values = self.derivatives[:VANISHES] @ z
        alive = np.abs(values) > self.limits
        order = np.where(alive.any(axis=0), alive.argmax(axis=0), VANISHES)
        leading = np.where(order < VANISHES, values[order - (order == VANISHES), np.arange(len(order))], 0.0)
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
        at_rest = (system.opening(y) == 0) & (system.speed(y) == 0) & (not system.compliant)
        touching = np.flatnonzero(at_rest).tolist()
        near = {body for contact in touching for body in system.pairs[contact]}
        options: list[tuple[int, ...]] = []
        for body, velocity in enumerate(rd):
            if system.friction[body] == 0:
                options.append((STUCK, 1) if velocity == 0 and body in near else (1,))
            elif velocity == 0:
                options.append((STUCK, 1, -1))
            else:
                options.append((1,) if velocity > 0 else (-1,))
        softs = list(itertools.product(*self._soft_options(y)))
        casings = list(itertools.product(*self._casing_options(y)))
        for floor in itertools.product(*options):
            for chosen in itertools.product(self._closures(floor, touching), softs, casings):
                mode = Mode(floor, *chosen)
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

    def _soft_options(self, y: np.ndarray) -> list[tuple[int, ...]]:
        """States that opening and speed allow every compliant contact."""
        system = self.system
        return (
            [_soft_states(*contact) for contact in zip(system.opening(y), system.speed(y), system.delay, strict=True)]
            if system.compliant
            else []
        )

    def _casing_options(self, y: np.ndarray) -> list[tuple[int, ...]]:
        """States that elongation and velocity allow every Jenkins element."""
        system = self.system
        options: list[tuple[int, ...]] = []
        velocity = system.V @ system.split(y)[2]
        for elongation, limit, speed in zip(system.elongation(y), system.limit, velocity, strict=True):
            direction = int(np.sign(elongation))
            if abs(elongation) < limit - ZERO or direction * speed < -ZERO:
                options.append((STUCK,))
            else:
                options.append((direction,) if direction * speed > ZERO else (STUCK, direction))
        return options

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
        harmonics, own = len(system.orders), 2 * (n + b) + len(system.spring)
        one, sines, cosines = -1, slice(own, own + harmonics), slice(own + harmonics, -1)
        slide = -np.array(mode.floor) * system.friction
        # accelerations without the forces that hold contacts
        structure = np.zeros((n, system.size))
        structure[:, :n] = -system.inverse @ system.K
        structure[:, n + b : 2 * n + b] = -system.inverse @ system.C
        structure[:, one] = -system.inverse @ system.W @ slide
        forced = np.outer(system.inverse @ system.force, system.shares)
        structure[:, sines], structure[:, cosines] = forced.real, forced.imag
        springs = slice(2 * (n + b), own)
        structure[:, springs] = -system.inverse @ system.V.T @ np.diag(system.spring)
        push = self._push(mode)
        structure += system.inverse @ system.walls.T @ push
        bodies = -system.W.T @ structure
        bodies += np.diag(1 / system.m) @ system.G.T @ push
        bodies[:, one] += slide / system.m + system.weight
        shaken = np.outer(system.base, system.base_shares)
        bodies[:, sines] -= shaken.real
        bodies[:, cosines] -= shaken.imag
        stuck = [index for index, state in enumerate(mode.floor) if state == STUCK]
        moving = [c for c in sorted(mode.closed) if not self._holds(c, mode)]
        held = np.vstack([np.eye(b)[stuck].reshape(len(stuck), b), system.G[moving].reshape(len(moving), b)])
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
        for element, state in enumerate(mode.casing):
            if state == STUCK:
                rate[2 * (n + b) + element, n + b : 2 * n + b] = system.V[element]
        rate[sines, cosines], rate[cosines, sines] = np.diag(system.orders), -np.diag(system.orders)
        guards = self._guards(mode, dict(zip(stuck, forces, strict=False)), forces[len(stuck) :])
        return Flow(rate, *guards, -system.G @ bodies)

    def _push(self, mode: Mode) -> np.ndarray:
        """(c, s) forces of the compliant contacts on the extended state."""
        push = np.zeros((len(self.system.pairs), self.system.size))
        for contact, state in enumerate(mode.soft):
            if state == PRESSING:
                push[contact] = self.system.stiffness[contact] * self._pressing(contact)
        return push

    def _opening(self, contact: int) -> np.ndarray:
        """(s,) opening of a contact on the extended state."""
        system, row = self.system, np.zeros(self.system.size)
        q, r, _, _ = system.split(row)
        q[:], r[:], row[-1] = system.H[contact], system.G[contact], system.reach[contact]
        return row

    def _pressing(self, contact: int) -> np.ndarray:
        """(s,) force of a compliant contact per stiffness, -(opening + delay * speed)."""
        system, row = self.system, np.zeros(self.system.size)
        _, _, qd, rd = system.split(row)
        qd[:], rd[:] = system.H[contact], system.G[contact]
        return -self._opening(contact) - system.delay[contact] * row

    def _holds(self, contact: int, mode: Mode) -> bool:
        """Whether a wall or a stuck body takes part in the contact."""
        return any(body < 0 or mode.floor[body] == STUCK for body in self.system.pairs[contact])

    def _guards(self, mode: Mode, hold: dict[int, np.ndarray], press: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        system = self.system
        n, b = len(system.M), len(system.m)
        rows, levels, eye = [], [], np.eye(system.size)
        for contact in range(len(system.pairs)):
            if contact not in mode.closed and not system.compliant:
                rows.append(self._opening(contact))
                levels.append(0)
        for body, direction in enumerate(mode.floor):
            if direction != STUCK and system.friction[body] > 0:
                rows.append(direction * eye[2 * n + b + body])
                levels.append(3 if system.compliant else 1)
        rows += [force / system.m.mean() for force in press]
        for chain, left_open, right_open in self._chains(mode):
            rows += self._margins(chain, left_open, right_open, hold)
        for contact, state in enumerate(mode.soft):
            if state == PRESSING:
                rows.append(self._pressing(contact))
            else:
                rows.append(self._opening(contact) * (1.0 if state == OPEN else -1.0))
            if state == LOOSE:
                rows.append(-self._pressing(contact))
        for element, state in enumerate(mode.casing):
            at = 2 * (n + b) + element
            if state == STUCK:
                rows += [system.limit[element] * eye[-1] + sign * eye[at] for sign in (1.0, -1.0)]
            else:
                rows.append(state * np.r_[np.zeros(n + b), system.V[element], np.zeros(system.size - 2 * n - b)])
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
                    row[-1] += system.friction[bodies].sum()
                    rows.append(row / system.m[bodies].sum())
        return rows


def _soft_states(opening: float, speed: float, delay: float) -> tuple[int, ...]:
    """What a compliant contact can be; at a bound the accelerations decide."""
    force = -(opening + delay * speed)
    if opening > ZERO:
        return (OPEN,)
    if opening < -ZERO:
        return (PRESSING,) if force > ZERO else (LOOSE,) if force < -ZERO else (PRESSING, LOOSE)
    if abs(speed) <= ZERO:
        return (OPEN, PRESSING)
    return (PRESSING,) if speed < 0 else (OPEN,)
