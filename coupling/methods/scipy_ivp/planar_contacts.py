"""Contacts of bodies with extent for an integrator: which states are possible, by trying them.

Between two events every unit keeps its state, and the motion is linear in the extended state (q, v, 1, cos, sin) of
the excitation's harmonics; so are gaps, slips and forces. States are right if nothing of these turns negative that must
not: of a quantity that is zero now, the first derivative that is not zero decides. The search repairs one state after
the other, and tries all of them in turn where that goes round in circles (Glocker and Pfeiffer 1996 solve the same by
complementarity). Impacts are the same question for velocities and impulses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, islice, product
from typing import NamedTuple, TypeVar

import numpy as np

from vanedamp.coupling.system.system import System

#: states of a unit; a closed contact without friction slips to the right
OPEN, STICK, LEFT, RIGHT = range(4)
_WAY = np.array([0.0, 0.0, -1.0, 1.0])
#: derivatives that are looked at, and the order of a zero whose derivatives all vanish
_LEVELS, NEVER = 7, 99
#: values below this share of the terms that they are sums of are round-off
ROUND_OFF = 1e-11
#: share of their size below which rows depend on each other
_DEPENDENT = 1e-9
#: share of a row's motion by which forces may fail to hold it
_LOST = 1e-7
#: states that may be tried in turn: all of six contacts with friction, and what is near of more
_MOST = 5000
#: sweeps that guess the states of an impact, the change that ends them, and how near to its bound a force slips
_SWEEPS, _CONVERGED, _NEARLY = 200, 1e-9, 1e-6
#: bisections of the restitution of an impact that would bring energy
_HALVINGS = 50

States = tuple[int, ...]
Found = TypeVar("Found")


class Wrong(NamedTuple):
    """What speaks against a choice of states: a unit, and the state that it should have instead."""

    unit: int
    state: int


class Unforced:
    """A system without forces of its contacts, on the extended state: size 2N, extent, slices, accelerations.

    Those of the springs of Jenkins elements are in it: they do not depend on whether their sliders, the last units
    (sprung (u,)), move. pull (j, extent): their forces on what draws them. The sliders' speeds in the state are zero.
    """

    def __init__(self, system: System) -> None:
        n, e = len(system.mass), len(system.frequency)
        self.system, self.n, self.u, self.size, self.one = system, n, len(system.rest), 2 * n, 2 * n
        self.q, self.v, self.extent = slice(0, n), slice(n, 2 * n), 2 * n + 1 + 2 * e
        self.cosine, self.sine = slice(2 * n + 1, 2 * n + 1 + e), slice(2 * n + 1 + e, self.extent)
        self.load = np.zeros((n, self.extent))
        self.load[:, self.cosine], self.load[:, self.sine] = system.load.real.T, -system.load.imag.T
        forces = self.load.copy()
        forces[:, self.q], forces[:, self.v] = -system.stiffness, -system.damping
        forces[:, self.one] = system.weight
        sliders = len(system.tangential)
        self.sliders, self.sprung = self.q.stop - sliders, np.arange(self.u) >= self.u - sliders
        self.pull = np.zeros((sliders, self.extent))
        self.pull[:, self.q] = -system.tangential[:, None] * system.elongation
        forces[: self.sliders] += system.elongation[:, : self.sliders].T @ self.pull
        self.accelerations = forces / system.mass[:, None]
        self.normal, self.slip = system.J[: self.u], system.J[self.u :]
        self.contact = np.arange(self.u) < system.contacts
        self.rubs = np.where(self.contact, system.friction, system.limit) > 0.0

    def extended(self, t: float | np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the states (2N, ...) at times t (...) with 1, cos and sin below them."""
        phase = np.multiply.outer(self.system.frequency, np.asarray(t, float))
        return np.concatenate([z, np.ones((1, *phase.shape[1:])), np.cos(phase), np.sin(phase)])

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

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """Return the gaps (contacts,) at coordinates q (N,), m."""
        gaps: np.ndarray = (self.system.rest + self.normal @ q)[: self.system.contacts]
        return gaps


class Holding:
    """The rows that states keep at rest, and the wrenches of their forces: W_N - way mu W_T of a contact that slips.

    inverse (k, k): forces of the kept rows that give them accelerations; possible: whether there are such forces.
    """

    def __init__(self, free: Unforced, state: np.ndarray) -> None:
        system = free.system
        self.state = state
        self.closed = np.flatnonzero((state != OPEN) & free.contact)
        self.stick = np.flatnonzero((state == STICK) & free.rubs & ~free.sprung)
        self.drag = (_WAY[state] * system.friction)[self.closed]
        self.rows = np.vstack([free.normal[self.closed], free.slip[self.stick]])
        self.wrench = self.rows.copy()
        self.wrench[: len(self.closed)] -= self.drag[:, None] * free.slip[self.closed]
        scale = 1 / np.sqrt(np.maximum((self.rows**2 / system.mass).sum(axis=1), 1e-300))
        mobility = (self.rows / system.mass) @ self.wrench.T * scale * scale[:, None]
        inverse = np.linalg.pinv(mobility, rcond=_DEPENDENT) if len(scale) else mobility
        self.inverse = inverse * scale[:, None] * scale
        left = self.rows - (self.rows / system.mass) @ self.wrench.T @ self.inverse @ self.rows
        sizes = np.abs(self.rows).max(axis=1, initial=0.0)
        self.possible = bool(np.all(np.abs(left).max(axis=1, initial=0.0) <= _LOST * sizes))

    def spread(self, forces: np.ndarray, u: int) -> np.ndarray:
        """Return the forces (2u, ...) of all rows from those of the kept ones (k, ...)."""
        count, spread = len(self.closed), np.zeros((2 * u, *forces.shape[1:]))
        spread[self.closed] = forces[:count]
        spread[u + self.closed] = -(self.drag * forces[:count].T).T
        spread[u + self.stick] = forces[count:]
        return spread


class Motion:
    """The linear motion while units keep their states (u,): rate (extent, extent), force (2u, extent), event functions.

    guard (k, extent): positive until its event; order (k,): of its zero now, as `judge` has found it.
    """

    def __init__(self, free: Unforced, state: np.ndarray) -> None:
        system, u = free.system, free.u
        holding = Holding(free, state)
        self.state, self.possible = state, holding.possible
        force = np.zeros((2 * u, free.extent))
        slides = np.where(free.contact | free.sprung, 0.0, -_WAY[state] * system.limit)
        force[u:, free.one] = slides
        pushed = free.accelerations + (system.J / system.mass).T @ force
        force += holding.spread(-holding.inverse @ (holding.rows @ pushed), u)
        self.rate = np.zeros((free.extent, free.extent))
        self.rate[free.q, free.v] = np.eye(free.n)
        drawn = free.sprung & (state != STICK)
        self.rate[free.sliders + np.flatnonzero(drawn[free.sprung]), free.v] = free.slip[drawn]
        self.rate[free.v] = free.accelerations + (system.J / system.mass).T @ force
        self.rate[free.cosine, free.sine] = -np.diag(system.frequency)
        self.rate[free.sine, free.cosine] = np.diag(system.frequency)
        #: of the sums that rates are: those of coordinates that contacts hold cancel
        self.terms = np.abs(self.rate)
        self.terms[free.v] = np.abs(free.accelerations) + (np.abs(system.J) / system.mass).T @ np.abs(force)
        force[u:][free.sprung] = free.pull
        self.force = force
        guards, self.wrong = _guards(free, state, force)
        self.guard = np.reshape(guards, (len(guards), free.extent))
        self.order = np.zeros(len(guards), int)

    def judge(self, now: np.ndarray, sizes: np.ndarray) -> list[Wrong]:
        """Set the orders of the event functions at an extended state (extent,); return what turns negative at once.

        sizes: (extent,) of the state's terms, whose round-off is no value.
        """
        open_, wrong = np.ones(len(self.guard), bool), []
        self.order[:] = NEVER
        for level in range(_LEVELS):
            value, noise = self.guard @ now, ROUND_OFF * (np.abs(self.guard) @ sizes)
            decided = open_ & (np.abs(value) > noise)
            self.order[decided] = level
            wrong += [self.wrong[k] for k in np.flatnonzero(decided & (value < 0.0))]
            open_ &= ~decided
            if not open_.any():
                break
            now, sizes = self.rate @ now, self.terms @ sizes
        return wrong


def _guards(free: Unforced, state: np.ndarray, force: np.ndarray) -> tuple[list[np.ndarray], list[Wrong]]:
    """Return the event functions (k, extent) of all units, and what each says where it is negative."""
    system, u, guards, wrong = free.system, free.u, [], []

    def watch(guard: np.ndarray, unit: int, instead: int) -> None:
        guards.append(guard)
        wrong.append(Wrong(unit, instead))

    for r in range(u):
        if free.contact[r] and state[r] == OPEN:
            gap = np.zeros(free.extent)
            gap[free.q], gap[free.one] = free.normal[r], system.rest[r]
            watch(gap, r, STICK)
            continue
        bound = system.friction[r] * force[r]
        if free.contact[r]:
            watch(force[r], r, OPEN)
        else:
            bound[free.one] = system.limit[r]
        if state[r] == STICK and free.rubs[r]:
            watch(bound - force[u + r], r, LEFT)
            watch(bound + force[u + r], r, RIGHT)
        elif free.rubs[r]:
            speed = np.zeros(free.extent)
            speed[free.v] = _WAY[state[r]] * free.slip[r]
            watch(speed, r, STICK)
    return guards, wrong


def search(
    options: Sequence[Sequence[int]], begin: Sequence[int], judge: Callable[[States], tuple[Found, list[Wrong]] | None]
) -> Found | None:
    """Return what `judge` makes of the first states it finds nothing wrong with; None if there are none.

    options: the states that each unit may have; begin: those to begin with. `judge` returns None where the states are
    impossible.
    """
    at, seen = tuple(begin), set[States]()
    while at not in seen:
        seen.add(at)
        judged = judge(at)
        if judged is None:
            break
        found, wrong = judged
        if not wrong:
            return found
        unit, state = wrong[0]
        if state not in options[unit]:
            state = next((other for other in options[unit] if (other == OPEN) == (state == OPEN)), at[unit])
        at = (*at[:unit], state, *at[unit + 1 :])
    for states in islice(_around(options, begin), _MOST):
        if states not in seen:
            judged = judge(states)
            if judged is not None and not judged[1]:
                return judged[0]
    return None


def _around(options: Sequence[Sequence[int]], begin: Sequence[int]) -> Iterator[States]:
    """Yield all states, those first that differ from `begin` in few units."""
    others = [[state for state in choice if state != at] for choice, at in zip(options, begin, strict=True)]
    units = [unit for unit, choice in enumerate(others) if choice]
    for count in range(1, len(units) + 1):
        for changed in combinations(units, count):
            for states in product(*(others[unit] for unit in changed)):
                at = list(begin)
                for unit, state in zip(changed, states, strict=True):
                    at[unit] = state
                yield tuple(at)


def decide(free: Unforced, now: np.ndarray, sizes: np.ndarray, present: np.ndarray, touch: np.ndarray, slow: float):
    """Return the motion that begins at an extended state (extent,); None if no states are possible.

    present: (u,) states so far; touch: (contacts,) gaps below which contacts are closed, m; slow: speed that is none.
    """
    gaps, v = free.gaps(now[free.q]), now[free.v]
    speed, slip = free.normal @ v, free.slip @ v
    options, begin = [], []
    for r in range(free.u):
        ways = [STICK, RIGHT, LEFT] if abs(slip[r]) <= slow else [RIGHT if slip[r] > 0.0 else LEFT]
        if not free.rubs[r]:
            ways = [RIGHT] if free.contact[r] else [OPEN]
        if free.sprung[r]:
            ways = free.ways_of_slider(r, now, sizes, slip[r], slow)
        if free.contact[r]:
            ways = [*ways, OPEN] if gaps[r] <= touch[r] and speed[r] <= slow else [OPEN]
        options.append(ways)
        begin.append(int(present[r]) if present[r] in ways else ways[0])

    def judge(states: States) -> tuple[Motion, list[Wrong]] | None:
        motion = Motion(free, np.array(states))
        return (motion, motion.judge(now, sizes)) if motion.possible else None

    return search(options, begin, judge)


class Impact(NamedTuple):
    """Impulses (2u,), velocities (N,) after them, and the states (u,) of the contacts meanwhile."""

    impulse: np.ndarray
    v: np.ndarray
    state: np.ndarray


def impact(free: Unforced, v: np.ndarray, closed: Sequence[int], restitution: np.ndarray) -> Impact | None:
    """Return Newton's law in Moreau's form with Coulomb's at the closed contacts; None without a solution.

    restitution: (u,). Where the impact would bring energy, or has no solution, all coefficients are smaller by one
    factor.
    """
    found = _impulses(free, v, closed, restitution)
    if found is not None and _gain(free, v, found) <= 0.0:
        return found
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        found = _impulses(free, v, closed, middle * restitution)
        low, high = (middle, high) if found is not None and _gain(free, v, found) <= 0.0 else (low, middle)
    return _impulses(free, v, closed, low * restitution)


def _gain(free: Unforced, v: np.ndarray, found: Impact) -> float:
    """Return the energy that an impact brings beyond round-off, J."""
    mass = free.system.mass
    return float(mass @ (found.v**2 - v**2) - 1e-12 * mass @ v**2)


def _impulses(free: Unforced, v: np.ndarray, closed: Sequence[int], restitution: np.ndarray) -> Impact | None:
    system, u = free.system, free.u
    rebound = restitution * np.minimum(free.normal @ v, 0.0)
    terms = np.abs(system.J) @ np.abs(v)
    slow = ROUND_OFF * float(terms.max(initial=0.0))
    options = [[OPEN] for _ in range(u)]
    for r in closed:
        options[r] = [STICK, RIGHT, LEFT, OPEN] if free.rubs[r] else [RIGHT, OPEN]

    def judge(states: States) -> tuple[Impact, list[Wrong]] | None:
        holding = Holding(free, np.array(states))
        if not holding.possible:
            return None
        left = holding.rows @ v
        left[: len(holding.closed)] += rebound[holding.closed]
        impulse = holding.spread(-holding.inverse @ left, u)
        after = v + (system.J / system.mass).T @ impulse
        left = holding.rows @ after
        left[: len(holding.closed)] += rebound[holding.closed]
        if np.abs(left).max(initial=0.0) > slow:  # rows that depend on each other, but are to part
            return None
        return Impact(impulse, after, np.array(states)), _violation(free, states, impulse, after, rebound, slow, closed)

    return search(options, _sweep(free, v, closed, rebound), judge)


def _sweep(free: Unforced, v: np.ndarray, closed: Sequence[int], rebound: np.ndarray) -> list[int]:
    """Return the states (u,) that projected Gauss-Seidel sweeps arrive at, to begin with (Jean 1999)."""
    system, u, impulse = free.system, free.u, np.zeros(2 * free.u)
    mobility, speed = system.delassus, system.J @ v
    speed[:u] += rebound
    for _ in range(_SWEEPS):
        before = impulse.copy()
        for r in closed:
            bound = np.inf
            for row in (r, u + r) if free.rubs[r] else (r,):
                low = 0.0 if row < u else -bound
                change = min(max(impulse[row] - speed[row] / mobility[row, row], low), bound) - impulse[row]
                impulse[row] += change
                speed += mobility[:, row] * change
                bound = system.friction[r] * impulse[r]
        if np.abs(impulse - before).max() <= _CONVERGED * np.abs(impulse).max():
            break
    state = [OPEN] * u
    for r in closed:
        if impulse[r] > 0.0:
            slips = not free.rubs[r] or abs(impulse[u + r]) >= (1 - _NEARLY) * system.friction[r] * impulse[r]
            state[r] = STICK if not slips else LEFT if impulse[u + r] > 0.0 else RIGHT
    return state


def _violation(
    free: Unforced,
    states: States,
    impulse: np.ndarray,
    after: np.ndarray,
    rebound: np.ndarray,
    slow: float,
    closed: Sequence[int],
) -> list[Wrong]:
    """Return what speaks against impulses (2u,) and the velocities (N,) that they leave."""
    u, least, wrong = free.u, ROUND_OFF * float(np.abs(impulse).max(initial=0.0)), []
    for r in closed:
        push, drag, bound = impulse[r], impulse[u + r], free.system.friction[r] * impulse[r]
        if states[r] == OPEN:
            if free.normal[r] @ after + rebound[r] < -slow:
                wrong.append(Wrong(r, STICK))
        elif push < -least:
            wrong.append(Wrong(r, OPEN))
        elif states[r] == STICK and abs(drag) > bound + least:
            wrong.append(Wrong(r, LEFT if drag > 0.0 else RIGHT))
        elif states[r] in (LEFT, RIGHT) and free.rubs[r] and _WAY[states[r]] * (free.slip[r] @ after) < -slow:
            wrong.append(Wrong(r, STICK))
    return wrong
