"""The motion of a system while its units keep their states, solved by projectors: a reference for system.flow.

M q'' = -K q - C q' + loads + W lambda, with W the directions of the forces of units: a contact that slips has its
friction in the direction of its normal force, W_N - sigma mu W_T. What closed contacts and units that stick hold, is
held by forces for which J q'' = 0: accelerations are projected, obliquely where friction slips, onto the motions N that
the constraints leave, along the wrenches, to which Y is normal: N (Y^T N)^-1 Y^T. The forces follow from what the
projection takes away.
"""

import numpy as np
from scipy.linalg import null_space

from vanedamp.coupling.numerics import codes

#: singular values below this are zero: rows that depend on each other
DEPENDENT = 1e-9


def flow(system, state, open_force):
    """Return d/dt z = X z, (K, K), and the forces (2u, K) of the units, with units in states (u,).

    z = (s, s', 1, cos(omega_h t), sin(omega_h t)), s = sqrt(M) q. open_force: (2u,) constants that the laws leave open.
    """
    root, u, e = np.sqrt(system.mass), len(state), len(system.frequency)
    size, rows = len(root), system.J / root
    places, rates, one = slice(0, size), slice(size, 2 * size), 2 * size
    cosine, sine = slice(one + 1, one + 1 + e), slice(one + 1 + e, one + 1 + 2 * e)
    gap, speed, load = np.zeros((u, sine.stop)), np.zeros((2 * u, sine.stop)), np.zeros((size, sine.stop))
    gap[:, places], gap[:, one], speed[:, rates] = rows[:u], system.rest, rows
    load[:, places] = -system.stiffness / root / root[:, None]
    load[:, rates] = -system.damping / root / root[:, None]
    load[:, one] = system.weight / root
    load[:, cosine], load[:, sine] = system.load.real.T / root[:, None], -system.load.imag.T / root[:, None]
    # known forces, and their coordinates: the force of a moving slider acts on what draws it
    contact, rigid = np.arange(u) < system.contacts, np.isinf(system.spring)
    pressed = (state < codes.OPEN) | (state == codes.CLOSED)
    way = (state == codes.SLIP_RIGHT).astype(float) - (state == codes.SLIP_LEFT)
    drag = (way * system.friction)[:, None]
    closed, springs = np.flatnonzero(contact & pressed & rigid), np.flatnonzero(contact & pressed & ~rigid)
    stick = np.flatnonzero((state == codes.STICK) & (~contact | (system.friction > 0.0)))
    slides = np.flatnonzero(~contact & (way != 0.0))
    forces, acts = np.zeros((2 * u, sine.stop)), rows.copy()
    forces[:, one] = open_force
    forces[springs] = -system.spring[springs, None] * gap[springs] - system.dashpot[springs, None] * speed[springs]
    forces[u + springs] = -drag[springs] * forces[springs]
    forces[u + slides, one] = -(way * system.limit)[slides]
    jenkins, drawn = slice(u - len(system.tangential), None), system.elongation / root
    holds = state[jenkins] == codes.STICK
    acts[u:][jenkins][~holds] += drawn[~holds]
    free = load + acts.T @ forces
    free[:, places] -= drawn[holds].T @ (system.tangential[holds, None] * drawn[holds])
    # and those that hold
    kept = np.concatenate([closed, u + stick])
    wrench = np.vstack([rows[closed] - drag[closed] * rows[u + closed], rows[u + stick]]).T
    left = oblique(rows[kept], wrench) @ free
    length = np.linalg.norm(rows[kept], axis=1)  # of forces that depend on each other, the least by these
    carried = (np.linalg.pinv(wrench / length, rcond=DEPENDENT) @ (left - free)) / length[:, None]
    forces[kept] += carried
    forces[u + closed] -= drag[closed] * carried[: len(closed)]
    X = np.zeros((sine.stop, sine.stop))
    X[places, rates], X[rates] = np.eye(size), left
    for a, moves, row in zip(range(size - len(holds), size), ~holds, drawn, strict=True):
        X[size + a] = moves * root[a] * (row[: size - len(holds)] @ left[: size - len(holds)])
    X[cosine, sine], X[sine, cosine] = -np.diag(system.frequency), np.diag(system.frequency)
    return X, forces


def oblique(rows, wrench):
    """Return the projector (N, N) of accelerations onto what rows (m, N) leave, along wrenches (N, m).

    By bases of both sides, whose condition is not the square of the condition of nearly dependent rows. Where
    these differ in number, as wrenches depend on each other and rows do not, by the least squares of the rows.
    """
    if not len(rows):
        return np.eye(rows.shape[1])
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    rows, wrench = rows / length, wrench / length.T
    free, normal = null_space(rows, rcond=DEPENDENT), null_space(wrench.T, rcond=DEPENDENT)
    if free.shape == normal.shape:
        meeting = normal.T @ free
        if np.linalg.svd(meeting, compute_uv=False).min(initial=1.0) > DEPENDENT:
            return free @ np.linalg.solve(meeting, normal.T)
    inverse = np.linalg.pinv(rows @ wrench, rcond=DEPENDENT)
    return np.eye(rows.shape[1]) - wrench @ inverse @ rows
