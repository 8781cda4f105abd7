"""Newton's law at all touching contacts at once, and the end of a chatter, for an integrator.

Pfeiffer and Glocker (1996), chapter 8. Chatter: Nordmark and Piiroinen (2009); a row of bodies can meet infinitely
often in finite time without being pressed together (McNamara and Young 1992).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.motion import Unforced
from vanedamp.coupling.numerics.codes import AT_LOW, DEPENDENT
from vanedamp.coupling.numerics.complementarity import Problem, solve_box
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.coupling.system.restitution import restitutions_at

#: a flight shorter than this share of a period, and all that follow it, are the end of a chatter
CHATTER = 3e-7
#: impacts of a contact that follow each other within this share of a period are the end of a collapse
COLLAPSE = 1e-24
#: gaps that close within this share of a period close now, unless they have been closed for this share of it
TOUCH, FRESH = 1e-14, 1e-9
#: speeds below this share of the fastest are zero
STILL = 1e-12


class Impact(NamedTuple):
    """Impacts of the contacts `row`: speeds before and after, impulses, and the lost energy, J."""

    row: np.ndarray
    before: np.ndarray
    after: np.ndarray
    impulse: np.ndarray
    loss: float


def simultaneous_impacts(
    u: Unforced, z: np.ndarray, pressing: np.ndarray, resting: np.ndarray, collapsed: np.ndarray, problem: Problem
) -> Impact | None:
    """Let the touching contacts of state z (size,) collide, in place. None without a solution.

    pressing: (r,) acceleration with which each contact closes, or would if it were open; a rebound that it ends within
    CHATTER does not take place (0: all rebounds do). resting: (r,) contacts closed so far, which do not leave for less.
    collapsed: (r,) contacts that have collided at this very instant.
    """
    system = u.system
    touching = np.flatnonzero(u.rigid_contact & (z[u.d] == 0))
    before = z[u.s][touching]
    restitution = restitutions_at(system, touching, -before)
    share = np.maximum(1 - restitution, 0.1)
    slow = share * 0.5 * CHATTER * system.period * np.maximum(pressing[touching], 0.0)
    restitution = np.where(collapsed[touching] | (-restitution * before < slow), 0.0, restitution)
    target = -restitution * np.minimum(before, 0.0)
    tied = np.zeros(len(touching), bool)
    while True:
        if not _solve(system, touching, before - target, tied, problem):
            return None
        k = len(touching)
        impulse, state = problem.force[:k].copy(), problem.state[:k].copy()
        leaving = problem.acceleration[:k] + target
        hold = resting[touching] & ~tied & (state == AT_LOW) & (leaving < slow)
        if not hold.any():
            break
        tied |= hold
        target = np.where(hold, 0.0, target)
    z[u.s] += system.delassus[:, touching] @ impulse
    z[u.p_rate] += system.of_structure.J[touching].T @ impulse
    struck = (impulse != 0) | (state == DEPENDENT)
    after = np.where(struck, target, z[u.s][touching])
    z[u.s.start + touching] = after
    return Impact(touching, before, after, impulse, -0.5 * float(impulse @ (before + after)))


def _solve(system: LineSystem, touching: np.ndarray, excess: np.ndarray, tied: np.ndarray, problem: Problem) -> bool:
    k = len(touching)
    problem.matrix[:k, :k] = system.delassus[np.ix_(touching, touching)]
    problem.b[:k], problem.high[:k], problem.forced[:k] = excess, np.inf, 0
    problem.low[:k] = np.where(tied, -np.inf, 0.0)
    return bool(solve_box(problem, k, 0.0))


def zero_round_off(u: Unforced, z: np.ndarray, fastest: float, touch: np.ndarray) -> None:
    """Set to zero, in place, values that are zero to round-off: gaps about to close, speeds of closed ones, slips.

    touch: (r,) time (s) within which a gap closes that is closed now.
    """
    still = STILL * fastest
    touching = u.rigid_contact & (z[u.d] <= touch * np.maximum(-z[u.s], still))
    z[u.d] = np.where(touching, 0.0, z[u.d])
    stopped = (touching | u.friction) & (np.abs(z[u.s]) <= still)
    z[u.s] = np.where(stopped, 0.0, z[u.s])
