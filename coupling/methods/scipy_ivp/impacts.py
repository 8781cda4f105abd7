"""Impacts by Newton's law in Moreau's form with Coulomb's at all closed contacts at once, by trying their states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.scipy_ivp.contact_states import search
from vanedamp.coupling.methods.scipy_ivp.motion import ROUND_OFF, Holding, States, Unforced, Wrong
from vanedamp.coupling.numerics.codes import OPEN, SLIP_LEFT, SLIP_RIGHT, STICK
from vanedamp.coupling.system.unit_laws import slip_towards, slips

#: sweeps that guess the states of an impact, the change that ends them, and how near to its bound a force slips
_SWEEPS, _CONVERGED, _NEARLY = 200, 1e-9, 1e-6
#: bisections of the restitution of an impact that would increase the energy
_HALVINGS = 50


class ImpactSolution(NamedTuple):
    """Impulses (2u,), velocities (N,) after them, and the states (u,) of the contacts meanwhile."""

    impulse: np.ndarray
    v: np.ndarray
    state: np.ndarray


def impact(free: Unforced, v: np.ndarray, closed: Sequence[int], restitution: np.ndarray) -> ImpactSolution | None:
    """Return the impact of the closed contacts; None without a solution.

    restitution: (u,). Where the impact would increase the energy, or has no solution, all coefficients are smaller by
    one factor.
    """
    solution = _impulses(free, v, closed, restitution)
    if solution is not None and _gain(free, v, solution) <= 0.0:
        return solution
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        solution = _impulses(free, v, closed, middle * restitution)
        low, high = (middle, high) if solution is not None and _gain(free, v, solution) <= 0.0 else (low, middle)
    return _impulses(free, v, closed, low * restitution)


def _gain(free: Unforced, v: np.ndarray, solution: ImpactSolution) -> float:
    """Return the energy that an impact brings beyond round-off, J."""
    mass = free.system.mass
    return float(mass @ (solution.v**2 - v**2) - 1e-12 * mass @ v**2)


def _impulses(free: Unforced, v: np.ndarray, closed: Sequence[int], restitution: np.ndarray) -> ImpactSolution | None:
    J, u = free.system.J, free.u
    speed, rebound = J @ v, restitution * np.minimum(free.normal @ v, 0.0)
    slow = ROUND_OFF * float((np.abs(J) @ np.abs(v)).max(initial=0.0))
    options = [[OPEN] for _ in range(u)]
    for r in closed:
        options[r] = [STICK, SLIP_RIGHT, SLIP_LEFT, OPEN] if free.rubs[r] else [SLIP_RIGHT, OPEN]

    def judge(states: States) -> tuple[ImpactSolution, list[Wrong]] | None:
        # friction elements are free of impulses
        holding = Holding(free, np.array(states, int))
        if not holding.possible:
            return None
        left = speed[holding.kept]
        left[: len(holding.closed)] += rebound[holding.closed]
        impulse = holding.spread(-holding.inverse @ left, u)
        after = v + free.respond @ impulse
        left = J[holding.kept] @ after
        left[: len(holding.closed)] += rebound[holding.closed]
        if np.abs(left).max(initial=0.0) > slow:  # rows that depend on each other, but are to part
            return None
        return ImpactSolution(impulse, after, np.array(states)), _violation(
            free, states, impulse, after, rebound, slow, closed
        )

    return search(options, _sweep(free, v, closed, rebound), judge)


def _sweep(free: Unforced, v: np.ndarray, closed: Sequence[int], rebound: np.ndarray) -> list[int]:
    """Return the states (u,) that projected Gauss-Seidel sweeps arrive at, to begin with (Jean 1999)."""
    system, u = free.system, free.u
    rows = [row for r in closed for row in ((r, u + r) if free.rubs[r] else (r,))]
    mobility = system.delassus[np.ix_(rows, rows)].tolist()
    speed = (system.J[rows] @ v + np.r_[rebound, np.zeros(u)][rows]).tolist()
    impulse, bound = [0.0] * len(rows), 0.0
    for _ in range(_SWEEPS):
        largest = 0.0
        for i, row in enumerate(rows):
            low, high = (0.0, np.inf) if row < u else (-bound, bound)
            change = min(max(impulse[i] - speed[i] / mobility[i][i], low), high) - impulse[i]
            impulse[i] += change
            speed = [value + response * change for value, response in zip(speed, mobility[i], strict=True)]
            bound = system.friction[row % u] * impulse[i]
            largest = max(largest, abs(change))
        if largest <= _CONVERGED * max(map(abs, impulse), default=0.0):
            break
    state, by_row = [OPEN] * u, dict(zip(rows, impulse, strict=True))
    for r in closed:
        push, drag = by_row[r], by_row.get(u + r, 0.0)
        if push > 0.0:
            sticks = free.rubs[r] and abs(drag) < (1 - _NEARLY) * system.friction[r] * push
            state[r] = STICK if sticks else slip_towards(-drag)
    return state


def _violation(
    free: Unforced, states: States, impulse: np.ndarray, after: np.ndarray, rebound: np.ndarray, slow: float,
    closed: Sequence[int],
) -> list[Wrong]:  # fmt: skip
    """Return the defects of impulses (2u,) and the velocities (N,) that they leave."""
    u, least, wrong = free.u, ROUND_OFF * float(np.abs(impulse).max(initial=0.0)), []
    for r in closed:
        push, drag, bound = impulse[r], impulse[u + r], free.system.friction[r] * impulse[r]
        if states[r] == OPEN:
            if free.normal[r] @ after + rebound[r] < -slow:
                wrong.append(Wrong(r, STICK))
        elif push < -least:
            wrong.append(Wrong(r, OPEN))
        elif states[r] == STICK and abs(drag) > bound + least:
            wrong.append(Wrong(r, slip_towards(-drag)))
        elif slips(states[r]) and free.rubs[r] and states[r] * (free.slip[r] @ after) < -slow:
            wrong.append(Wrong(r, STICK))
    return wrong
