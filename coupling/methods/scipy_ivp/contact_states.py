"""Which rows rest, slide, open or press after an event, derivative by derivative.

Forces and accelerations of the rows at rest complement each other (Pfeiffer and Glocker, 1996, chapter 5). Where a
force is at its bound and its row does not accelerate, as at the instant at which bodies let go, their rates obey the
same complementarity, and so on up to the first derivatives that do not vanish: the motion is analytic between events.
Where the force or the gap of a spring is zero, its first derivative that is not zero decides.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.motion import (
    HELD,
    HIGH,
    LOOSE,
    LOW,
    NEVER,
    REST,
    SLIDE,
    SPRUNG,
    UNFORCED,
    Contacts,
    Unforced,
)
from vanedamp.coupling.numerics.codes import AT_HIGH, AT_LOW
from vanedamp.coupling.numerics.complementarity import new_problem, solve_box

#: derivatives that are looked at
_LEVELS = 6
#: forces and accelerations below this share of the terms that they are sums of are round-off
_ROUND_OFF = 1e-12
#: a row whose mobility beside others is below this share of its own depends on them
_DEPENDENCE = 1e-9


def decide(unforced: Unforced, t: float, z: np.ndarray) -> Contacts | None:
    """Return the states of all rows at a state z (size,) whose zeros are exact.

    None if a complementarity problem has no solution.
    """
    return _Decision(unforced, t, z).contacts()


class _Decision:
    """Derivatives of structure and rows, level by level: p[k], d[k], force[k] are the k-th; p and d lead by two."""

    def __init__(self, unforced: Unforced, t: float, z: np.ndarray) -> None:
        u = self.unforced = unforced
        system = u.system
        self.p, self.d = [z[u.p], z[u.p_rate]], [z[u.d], z[u.s]]
        self.force: list[np.ndarray] = []
        self.turn = np.exp(1j * system.frequency * t)
        self.state, self.side = np.full(u.r, UNFORCED), np.full(u.r, -1)
        self.order, self.held = np.zeros(u.r, int), np.zeros(u.r)
        self.bound, self.moving = np.full(u.r, -1), np.zeros(u.r, bool)
        self.problem = new_problem(u.r)
        #: rows at rest; springs at a bound
        self.resting = u.rigid_contact & (self.d[0] == 0) & (self.d[1] == 0)
        self.resting |= u.friction & (u.limit > 0) & (self.d[1] == 0)
        self.open_springs: set[int] = set()
        self.state[self.resting] = REST
        self._classify()

    def contacts(self) -> Contacts | None:
        for k in range(_LEVELS):
            if not self._level(k):
                return None
            held = self._hold()
            if not self.open_springs and not held.any():
                break
        else:
            self.order[held] = NEVER
            self._give_up_springs()
        return Contacts(self.state, self.held, self.order, np.maximum(self.side, self.bound))

    # -- by displacements and velocities only

    def _classify(self) -> None:
        u, (d, s) = self.unforced, self.d
        for r in range(u.r):
            if u.friction[r] and u.limit[r] > 0 and s[r] != 0:
                self._slide(r, np.sign(s[r]))
            elif u.rigid_contact[r] and not self.resting[r]:
                self.order[r] = 0 if d[r] > 0 else 1
            elif u.slider[r] and u.limit[r] > 0:
                self._classify_slider(r)
            elif u.soft_contact[r]:
                self._classify_soft(r)

    def _classify_slider(self, r: int) -> None:
        u, (d, s) = self.unforced, self.d
        pull = u.system.spring[r] * d[r]
        self.state[r] = SPRUNG
        if abs(pull) < (1 - _ROUND_OFF) * u.limit[r]:
            return
        self.side[r] = LOW if pull > 0 else HIGH
        if s[r] == 0:
            self.open_springs.add(r)
        elif s[r] * pull > 0:
            self._slide(r, np.sign(pull))
        else:
            self.order[r] = 1

    def _classify_soft(self, r: int) -> None:
        u, (d, s) = self.unforced, self.d
        terms = np.array([-u.system.spring[r] * d[r], -u.system.dashpot[r] * s[r]])
        if d[r] == 0:
            if s[r] == 0:
                self.open_springs.add(r)
            else:
                self._decide_gap(r, 1, s[r])
        elif d[r] < 0:
            push = terms.sum()
            if abs(push) <= _ROUND_OFF * np.abs(terms).max():
                self.open_springs.add(r)
            else:
                self.state[r] = SPRUNG if push > 0 else LOOSE

    def _slide(self, r: int, sign: float, order: int = 0) -> None:
        self.state[r], self.held[r], self.order[r] = SLIDE, -sign * self.unforced.limit[r], order

    def _decide_gap(self, r: int, order: int, value: float) -> None:
        """Decide a soft contact at zero gap, whose first derivative that is not zero has this order and value."""
        self.open_springs.discard(r)
        dashpot = self.unforced.system.dashpot[r] > 0
        self.state[r] = SPRUNG if value < 0 else UNFORCED
        self.side[r] = LOW
        self.order[r] = order - (1 if dashpot and value < 0 else 0)

    # -- one derivative after the other

    def _level(self, k: int) -> bool:
        """Add k-th derivatives of forces and accelerations. Returns False if the problem has no solution."""
        u, system = self.unforced, self.unforced.system
        known = self._known(k)
        turn = (1j * system.frequency) ** k * self.turn
        modes, loose = system.of_structure, system.of_bodies
        structure = (turn @ modes.load).real - modes.stiffness * self.p[k] - modes.damping @ self.p[k + 1]
        bodies = u.by_mass @ (turn @ loose.load).real + (u.by_mass @ loose.weight if k == 0 else 0.0)
        free = modes.J @ structure + bodies + system.delassus @ known
        scale = float(self._sizes(k, known).max(initial=0.0))
        members = np.flatnonzero(self.resting)
        members = np.concatenate([members[self.side[members] < 0], members[self.side[members] >= 0]])
        force = known.copy()
        if len(members):
            if not self._solve(k, members, free, scale):
                return False
            force[members] = self.problem.force[: len(members)]
        acceleration = system.delassus @ (force - known) + free
        left = self._leave(k, members, scale)
        acceleration[members] = 0.0
        acceleration[left] = self.left
        self.force.append(force)
        self.p.append(structure + modes.J.T @ force)
        self.d.append(acceleration)
        self._decide_springs(k, _ROUND_OFF * scale)
        return True

    def _known(self, k: int) -> np.ndarray:
        """Return k-th derivatives of the forces of rows that are not at rest."""
        u = self.unforced
        known = np.where(self.state == SLIDE, self.held, 0.0) if k == 0 else np.zeros(u.r)
        for r in np.flatnonzero(self.state == SPRUNG):
            known[r] = -u.system.spring[r] * self.d[k][r] - u.system.dashpot[r] * self.d[k + 1][r]
        return known

    def _sizes(self, k: int, known: np.ndarray) -> np.ndarray:
        """Return sizes of the terms that accelerations are sums of: by amplitude, as zero has its round-off."""
        system, u = self.unforced.system, self.unforced
        modes, loose = system.of_structure, system.of_bodies
        own = np.sqrt(modes.stiffness)
        rate = np.abs(self.p[k + 1]) + own * np.abs(self.p[k])
        modal = own * rate + np.abs(modes.damping) @ rate + system.frequency**k @ np.abs(modes.load)
        bodies = system.frequency**k @ np.abs(loose.load) + (np.abs(loose.weight) if k == 0 else 0.0)
        return np.abs(modes.J) @ modal + np.abs(u.by_mass) @ bodies + np.abs(system.delassus) @ np.abs(known)

    def _solve(self, k: int, members: np.ndarray, free: np.ndarray, scale: float) -> bool:
        problem, count, side = self.problem, len(members), self.side[members]
        contact = members >= self.unforced.system.friction_rows
        limit = self.unforced.limit[members]
        low, high = np.where(contact, 0.0, -limit), np.where(contact, np.inf, limit)
        if k > 0:
            low, high = np.where(side == LOW, 0.0, -np.inf), np.where(side == HIGH, 0.0, np.inf)
        problem.matrix[:count, :count] = self.unforced.system.delassus[np.ix_(members, members)]
        problem.b[:count], problem.low[:count], problem.high[:count] = free[members], low, high
        problem.forced[:count] = 0
        return bool(solve_box(problem, count, scale))

    def _leave(self, k: int, members: np.ndarray, scale: float) -> np.ndarray:
        """Release the rows that accelerate; note for the others at which bound their force is, if any."""
        problem, u = self.problem, self.unforced
        left, values = [], []
        for i, r in enumerate(members):
            state, force, a = problem.state[i], problem.force[i], problem.acceleration[i]
            near = _ROUND_OFF * scale / problem.matrix[i, i]
            if state in (AT_LOW, AT_HIGH) and abs(a) > _ROUND_OFF * scale:
                left.append(int(r))
                values.append(a)
                self._release(int(r), k, 1.0 if state == AT_LOW else -1.0)
                continue
            if k == 0:
                self.held[r] = force
                contact = r >= u.system.friction_rows
                low, high = (0.0, np.inf) if contact else (-u.limit[r], u.limit[r])
                self.side[r] = LOW if force - low <= near else HIGH if high - force <= near else -1
            elif self.side[r] >= 0 and abs(force) > near:
                self.bound[r], self.side[r], self.order[r] = self.side[r], -1, k
            if k > 0:
                self.moving[r] |= abs(force) > near
        self.left = np.array(values)
        return np.array(left, int)

    def _hold(self) -> np.ndarray:
        """Choose independent rows whose forces hold all that is at rest: REST; the forces of the others stay: HELD.

        First those whose force has room on both sides, as these hold the rows that depend on them. Returns the rows
        (r,) at rest with a force at its bound, on which the next derivative decides.
        """
        rank = np.where(self.side >= 0, 2, np.where(self.moving, 0, 1))
        chosen: list[int] = []
        at_bound = np.zeros(len(rank), bool)
        for r in sorted(np.flatnonzero(self.resting), key=lambda r: rank[r]):
            if self._independent(r, chosen):
                chosen.append(r)
                at_bound[r] = rank[r] == 2
        self.state[self.resting] = HELD
        self.state[chosen] = REST
        return at_bound

    def _independent(self, r: int, chosen: list[int]) -> bool:
        mobility = self.unforced.system.delassus
        rest = mobility[r, r]
        if chosen:
            across = mobility[chosen, r]
            rest -= across @ np.linalg.solve(mobility[np.ix_(chosen, chosen)], across)
        return bool(rest > _DEPENDENCE * mobility[r, r])

    def _release(self, r: int, k: int, sign: float) -> None:
        self.resting[r] = False
        if r < self.unforced.system.friction_rows:
            self._slide(r, sign, k + 1)
        else:
            self.state[r], self.held[r], self.order[r] = UNFORCED, 0.0, k + 2

    # -- springs at a bound

    def _decide_springs(self, k: int, tolerance: float) -> None:
        """Decide springs by the sign of the first derivative that does not vanish: of a gap, of a force, of a slip."""
        u = self.unforced
        for r in sorted(self.open_springs):
            a = self.d[k + 2][r]
            if u.slider[r]:
                if abs(a) > tolerance:
                    self.open_springs.discard(r)
                    outwards = 1.0 if self.side[r] == LOW else -1.0
                    if outwards * a > 0:
                        self._slide(r, outwards, k + 1)
                    else:
                        self.order[r] = k + 2
            elif self.d[0][r] == 0:
                if abs(a) > tolerance:
                    self._decide_gap(r, k + 2, a)
            else:
                push = -u.system.spring[r] * self.d[k + 1][r] - u.system.dashpot[r] * a
                if abs(push) > tolerance * u.system.dashpot[r]:
                    self.open_springs.discard(r)
                    self.state[r] = SPRUNG if push > 0 else LOOSE
                    self.side[r], self.order[r] = LOW, k + 1

    def _give_up_springs(self) -> None:
        for r in self.open_springs:
            self.order[r] = NEVER
            if self.unforced.soft_contact[r]:
                self.state[r] = UNFORCED
