"""Moreau's time stepping with projected Gauss-Seidel sweeps, in plain numpy: slow, of first order, and independent.

It shares with the engine the matrices of the scene only.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.planar.constraints import PlanarMotion, PlanarSystem


def time_stepping(system: PlanarSystem, initial: PlanarMotion, periods: float, steps: int, sweeps: int = 200):
    """Return coordinates (steps * periods + 1, N) at the ends of the steps, `steps` a period."""
    h, u = system.period / steps, len(system.rest)
    q, v = initial.q.copy(), initial.v.copy()
    normal, slip = system.J[:u], system.J[u:]
    compliance = system.J / system.mass
    path = [q.copy()]
    for step in range(round(periods * steps)):
        time = (step + 0.5) * h
        middle = q + 0.5 * h * v
        force = system.weight + (system.load * np.exp(1j * system.frequency * time)[:, None]).real.sum(axis=0)
        force = force - system.stiffness @ middle - system.damping @ v
        before, after = v, v + h * force / system.mass
        contacts = np.arange(u) < system.contacts
        closed = np.flatnonzero(contacts & (system.rest + normal @ middle <= 0.0))
        rubs = np.flatnonzero(~contacts)
        impulse = np.zeros(2 * u)
        for _ in range(sweeps):
            change = 0.0
            for r in [*closed, *rubs]:
                if r < system.contacts:
                    target = normal[r] @ after + system.restitution[r] * (normal[r] @ before)
                    change = max(change, _project(impulse, after, compliance, system, r, target, 0.0, np.inf))
                bound = system.friction[r] * impulse[r] + system.limit[r] * h
                if bound > 0.0 or impulse[u + r] != 0.0:
                    change = max(
                        change, _project(impulse, after, compliance, system, u + r, slip[r] @ after, -bound, bound)
                    )
            if change <= 1e-14 * np.abs(impulse).max(initial=1e-300):
                break
        v = after
        q = middle + 0.5 * h * v
        path.append(q.copy())
    return np.array(path)


def _project(impulse, v, compliance, system, row, speed, low, high):
    """Set one impulse so that the speed vanishes, or to its bound; change v. Returns the size of the change."""
    new = min(max(impulse[row] - speed / system.delassus[row, row], low), high)
    change = new - impulse[row]
    impulse[row] = new
    v += compliance[row] * change
    return abs(change)
