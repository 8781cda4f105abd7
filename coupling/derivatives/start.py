"""The start of a passage: where the engine begins from a state, and the derivative of that."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.derivatives.constraints import Constraints
from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.jump import impact, scaled
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.numerics.codes import HELD, OPEN, STICK
from vanedamp.coupling.response.segment import Event, Segment
from vanedamp.coupling.system.system import FLOOR
from vanedamp.coupling.system.unit_laws import contacts_of, presses

#: gaps this close are closed, relative to the free travel; speeds this slow count as zero, relative to the fastest
_SHUT, _STILL = 1e-12, 1e-12
#: a force this close to its bound is at it: relative to its terms, and to what all loads together could make of it
_NEAR, _ROUND_OFF = 1e-9, 1e-13


class Start:
    """A state (k,) that a passage is to begin with, of a system of these dynamics.

    turns: (k, P) how numbers of the scene change it; None: they do not. given: whether the motion begins so whatever
    happens: then only what numbers change may make it kink there.
    """

    def __init__(
        self, dynamics: Dynamics, state: np.ndarray, numbers: Numbers | None = None, turns: np.ndarray | None = None,
        given: bool = False,
    ) -> None:  # fmt: skip
        #: columns (k + P,) of derivatives whose motions may make a kink: only those by numbers if the start is given
        self.counts = slice(len(state) if given else 0, None)
        #: derivative (2N, k + P), as that of a passage, before units that are at rest stop what it would move
        self.unheld = np.zeros((dynamics.one, 0))
        self.frame, self.dynamics, self.system, self._given = dynamics.frame, dynamics, dynamics.system, state
        self._numbers, self._constraints = numbers, Constraints(dynamics, numbers)
        self._turns = np.zeros((len(state), 0 if numbers is None else len(numbers))) if turns is None else turns

    def closed(self, segment: Segment) -> np.ndarray:
        """Return whether contacts (u,) are closed as a segment begins, with or without force."""
        system, u = self.system, len(segment.state)
        gap, rate = system.rest + system.J[:u] @ segment.q, system.J[:u] @ segment.v
        # one at rest that parts from now on has been closed until now
        rests = (gap <= _SHUT * system.play) & (np.abs(rate) <= _STILL * segment.speed)
        return np.asarray(contacts_of(system) & ((segment.state != OPEN) | rests))

    def derivative(
        self, event: Event, segment: Segment, flow: Flow, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, PassageStatus]:
        """Return the derivative of u at the start of the first segment, and its defect, if any.

        By the state (2N, k), and by numbers (2N, P). event: at time zero; z: (K,) then. Raises Untrusted
        (derivatives.jump).
        """
        dynamics, status, k = self.dynamics, PassageStatus.OK, len(self._given)
        u, given = z[: dynamics.one], dynamics.from_state @ self._given
        M = self._placed(segment, z)
        n = self.system.modes
        # of the largest mode: the bodies may move others by more than what the loads let expect of them
        if np.any(np.abs((u - given)[:n]) > _SHUT * dynamics.typical[:n].max(initial=0.0)):
            status = PassageStatus.GRAZING  # the structure would begin beyond a stop
        hit = event.struck[event.impulse[event.struck] != 0.0]
        rows = dynamics.speed[hit, : dynamics.one]
        if np.any(np.abs(rows @ given) > _STILL * np.abs(rows) @ np.abs(given)):
            status = PassageStatus.GRAZING  # an impact at the very start, which another state has a period before
            w = given[dynamics.rates]
            jump = impact(self.system, w / dynamics.root, event, segment.speed, self._numbers)
            M[dynamics.rates] = scaled(dynamics, jump, w, self._numbers)(M[dynamics.rates])
        if self._begins_at_event(segment, flow, z, M) or self._loose(segment, flow, z, M):
            status = PassageStatus.GRAZING
        self.unheld = np.hstack([M[:, :k] * dynamics.scale, M[:, k:]])
        M = self._constraints.begun(segment.state, self.closed(segment), z)(M)
        return M[:, :k], M[:, k:], status

    def _placed(self, segment: Segment, z: np.ndarray) -> np.ndarray:
        """Return the derivative (2N, k + P) of u that a run begins with: bodies in walls are moved out of them.

        Springs of friction dampers are unloaded to their bounds.
        """
        system, dynamics, k = self.system, self.dynamics, len(self._given)
        kept, first = np.hstack([np.eye(k), self._turns]), k - len(self.frame.drawn)
        own, numbers = np.zeros((dynamics.one, self._turns.shape[1])), self._numbers
        sliding = np.flatnonzero(np.abs(self._given[first:]) > self.frame.longest)
        kept[first + sliding] = 0.0
        if numbers is not None:
            of, sign = numbers.parts, np.sign(self._given[first:][sliding])
            bound = of.limit[:, dynamics.jenkins] - self.frame.longest * of.tangential
            kept[first + sliding, k:] = (sign * (bound / system.tangential)[:, sliding]).T
            own = (of.from_state @ (dynamics.to_state @ z[: dynamics.one])).T
        slips = 2 * system.modes + np.arange(system.bodies)
        slip = segment.q[system.along] - system.floor @ segment.q
        travel = [self.frame.scene.cavity[index].gap for index in system.cavity]
        pushed = slips[np.abs(slip - self._given[slips]) > _SHUT * np.array(travel)]
        if len(pushed):
            # gaps of bodies that were pushed and are closed now stay closed
            gap = dynamics.gap[:, : dynamics.one] @ dynamics.from_state
            shut = np.abs(system.rest + system.J[: len(gap)] @ segment.q) <= _SHUT * system.play
            shut &= np.any(gap[:, pushed] != 0.0, axis=1) & contacts_of(system)
            kept[pushed] = 0.0
            opened = gap[shut] @ kept
            if numbers is not None:
                opened[:, k:] += dynamics.gap[shut, : dynamics.one] @ own + (numbers.parts.gap[:, shut] @ z).T
            kept[pushed] = -np.linalg.pinv(gap[np.ix_(shut, pushed)]) @ opened
        M = dynamics.from_state @ kept
        M[:, k:] += own
        return np.asarray(M)

    def _begins_at_event(self, segment: Segment, flow: Flow, z: np.ndarray, M: np.ndarray) -> bool:
        """Return whether a contact parts with a speed, or begins to slip, as the passage begins.

        M: (2N, k + P) of the start, which may keep what is to count.
        """
        system, u = self.system, len(segment.state)
        gap = system.rest + system.J[:u] @ segment.q
        parts = contacts_of(system) & (segment.state == OPEN) & (gap <= _SHUT * system.play) & ~self.closed(segment)
        slides = (flow.way != 0.0) & ~flow.slips_held & flow.rubs
        faster = flow.way * (self.dynamics.speed[u:] @ flow.X @ z) > 0.0  # one that stops at once has been at rest
        slips = slides & faster & (np.abs(system.J[u:] @ segment.v) <= _STILL * segment.speed)
        if self.counts.start:
            parts &= self._turned("gap", np.arange(u), z, M)
            slips &= self._turned("speed", u + np.arange(u), z, M)
        return bool(np.any(parts | slips))

    def _opens(self, r: int, z: np.ndarray, M: np.ndarray) -> bool:
        """Return whether motions that count open a contact at the start."""
        return not self.counts.start or bool(self._turned("gap", np.array([r]), z, M).any())

    def _turned(self, what: str, rows: np.ndarray, z: np.ndarray, M: np.ndarray) -> np.ndarray:
        """Return whether numbers change some functionals (m,), "gap" or "speed", at the start."""
        functional, own = getattr(self.dynamics, what)[rows], M[:, len(self._given) :]
        turned = functional[:, : len(own)] @ own
        if self._numbers is not None:
            turned = turned + (getattr(self._numbers.parts, what)[:, rows] @ z).T
        return np.asarray(np.abs(turned).max(axis=1, initial=0.0) > _NEAR * np.abs(functional) @ self.dynamics.typical)

    def _loose(self, segment: Segment, flow: Flow, z: np.ndarray, M: np.ndarray) -> bool:
        """Return whether a unit begins at rest that nothing keeps there: closed without force, or stuck at its bound.

        A body that friction and a contact hold at once needs the contact for what its friction could not hold. M: as in
        _begins_at_event, and where friction could hold all, only what opens the contact counts.
        """
        system, units, unit = self.system, len(segment.state), np.arange(len(segment.state))
        force = flow.forces @ z
        noise = _NEAR * np.abs(flow.forces) @ self.dynamics.typical + _ROUND_OFF * flow.possible_forces
        closed = contacts_of(system) & np.isinf(system.spring) & presses(segment.state)
        touched = system.J[:units, system.along] != 0.0  # (u, bodies)
        floors = (unit >= system.contacts) & (system.surface == FLOOR)
        holds = floors & np.isin(segment.state, (STICK, HELD))
        for r in np.flatnonzero(closed & (system.friction == 0.0)):
            room = [system.limit[own].sum() - force[r] - force[units:][own].sum() * system.J[r, system.along[body]]
                    for body in np.flatnonzero(touched[r]) for own in (holds & (system.body == body),)]  # fmt: skip
            least, edge = min(room, default=-force[r]), noise[r] + _NEAR * system.limit[holds].max(initial=0.0)
            if least >= -edge and (least <= edge or self._opens(r, z, M)):
                return True
        stuck = flow.stuck & (unit >= system.contacts) & (unit < self.dynamics.jenkins.start)
        at_bound = stuck & (np.abs(force[units:]) >= (1.0 - _NEAR) * system.limit)
        beside = [np.any(touched[closed, system.body[r]]) if floors[r] else False for r in unit]
        return bool(np.any(at_bound & ~np.array(beside, bool)))
