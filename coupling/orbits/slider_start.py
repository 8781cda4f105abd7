"""The start of a passage: where the engine begins from a state, and the derivative of that."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.exact.state import State
from vanedamp.coupling.numerics.codes import CLOSED, STICK, TOUCHING
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.line_system import row_motion

#: a force this close to its bound, as a share of its terms, is at it
_NEAR = 1e-9


def clipped(dynamics: SliderDynamics, start: RestartState, initial: RestartState) -> np.ndarray:
    """Return the derivative (k, k) of the state that a run begins with: bodies in walls are moved out of them.

    Springs of friction dampers are unloaded to their bounds.
    """
    system = dynamics.system
    n, b = system.modes, system.bodies
    kept = np.eye(dynamics.k)
    moved = np.flatnonzero((initial.elongation != start.elongation)[dynamics.springs - b])
    kept[2 * (n + b) + moved, 2 * (n + b) + moved] = 0.0
    pushed = np.flatnonzero(initial.slip != start.slip)
    if len(pushed):
        # gaps of bodies that were pushed and are closed now stay closed
        gap, slips = dynamics.place @ dynamics.from_state, 2 * n + np.arange(b)
        rows = np.arange(system.friction_rows, len(system.J))
        p = initial.displacement / system.scale
        places, _ = row_motion(system, initial.slip, initial.slip_velocity, p, 0.0 * p, initial.elongation)
        shut = np.abs(places[rows]) <= SIMULTANEOUS * system.free_travel[rows]
        rows = rows[shut & np.any(gap[np.ix_(rows, slips[pushed])] != 0.0, axis=1)]
        follow = -np.linalg.pinv(gap[np.ix_(rows, slips[pushed])]) @ gap[rows]
        follow[:, slips[pushed]] = 0.0
        kept[slips[pushed]] = follow
    return kept


def loose(dynamics: SliderDynamics, st: State, u: np.ndarray) -> bool:
    """Whether a row begins at rest that nothing keeps there: a gap closed without force, a stick at its bound.

    A body that friction and a wall hold at once is kept at the wall by what friction could not hold.
    """
    system, state = dynamics.system, st.state
    rows, closed = dynamics.constraints(state), (state == CLOSED) | (state == TOUCHING)
    if not len(rows):
        return False
    free = dynamics.free_flow(state, st.applied_force).rate(u, 0.0)[dynamics.rates]
    share = np.array([dynamics.force(state, r) for r in rows])
    force = st.applied_force.copy()
    force[rows] = share @ free
    noise = _NEAR * float((np.abs(share) @ np.abs(free)).max())
    for r in rows[rows < system.friction_rows]:
        beside = (system.left_body == r) | (system.right_body == r)
        if abs(force[r]) >= (1.0 - _NEAR) * system.limit[r] and not np.any(beside & closed):
            return True
    for r in np.flatnonzero(closed):
        press, holds = force[r], 0.0
        for body in (int(system.left_body[r]), int(system.right_body[r])):
            if body >= 0 and state[body] >= STICK:
                press += force[body] * system.J[r, system.modes + body]
                holds += system.limit[body]
        if press <= (1.0 + _NEAR) * holds + noise:
            return True
    return False
