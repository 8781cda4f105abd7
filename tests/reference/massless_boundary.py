"""A boundary without mass, as published, and its motion in time, by other means than rom and coupling use.

Monjaraz-Tec, Gross and Krack (2022), Computers and Structures 259, 106698: the MacNeal method and the Craig-Bampton
method with a massless boundary, written for nodal boundary coordinates q_b and modal coordinates q_i,

    K_bb q_b + K_bi q_i = f_b,    q_i'' + D_ii q_i' + K_ib q_b + K_ii q_i = f_i.

The motion: at every instant the boundary's forces solve the linear complementarity problem of its static balance, and
what is left is an ordinary differential equation of q_i with a Lipschitz right-hand side.
"""

import itertools

import numpy as np
from scipy import linalg
from scipy.integrate import solve_ivp


def macneal(mass, stiffness, boundary, modes):
    """(K, shapes): singular-mass form in (q_b, q_i), mass blkdiag(0, I), of a supported structure (dense matrices)."""
    squares, shapes = linalg.eigh(stiffness, mass, subset_by_index=[0, modes - 1])
    flexibility = np.linalg.inv(stiffness)[np.ix_(boundary, boundary)]
    at = shapes[boundary]
    residual = np.linalg.inv(flexibility - at / squares @ at.T)
    return np.block([[residual, -residual @ at], [-at.T @ residual, np.diag(squares) + at.T @ residual @ at]]), at


def craig_bampton(mass, stiffness, boundary, modes):
    """The same in constraint modes, made orthogonal to the fixed-interface modes in the mass, and these modes."""
    inner = np.setdiff1d(np.arange(len(mass)), boundary)
    constraint = -np.linalg.solve(stiffness[np.ix_(inner, inner)], stiffness[np.ix_(inner, boundary)])
    shapes = linalg.eigh(stiffness[np.ix_(inner, inner)], mass[np.ix_(inner, inner)], subset_by_index=[0, modes - 1])[1]
    share = shapes.T @ (mass[np.ix_(inner, boundary)] + mass[np.ix_(inner, inner)] @ constraint)
    basis = np.zeros((len(mass), len(boundary) + modes))
    basis[boundary, : len(boundary)] = np.eye(len(boundary))
    basis[inner, : len(boundary)] = constraint - shapes @ share
    basis[inner, len(boundary) :] = shapes
    return basis.T @ stiffness @ basis


def frequencies(stiffness, boundary):
    """Angular natural frequencies of a singular-mass form; so many boundary coordinates follow statically."""
    held, mixed = stiffness[:boundary, :boundary], stiffness[:boundary, boundary:]
    return np.sqrt(linalg.eigvalsh(stiffness[boundary:, boundary:] - mixed.T @ np.linalg.solve(held, mixed)))


class Boundary:
    """A model with residual flexibility, bodies between walls, and forces on them by complementarity.

    model: mass-normalised natural modes with residual_flexibility; contacts: (label, body, sign, gap), sign 1 where the
    wall is to the right of the body; coupled: all of the flexibility, or its diagonal at the walls alone.
    """

    def __init__(self, model, masses, contacts, force, omega, at, coupled=True):
        self.squares, self.damping = np.diag(model.stiffness), model.damping
        self.masses, self.omega, self.load = np.array(masses), omega, force * model.row(at)
        walls = [model.interface.index(label) for label, *_ in contacts]
        self.signs = np.array([sign for *_, sign, _ in contacts], float)
        self.rows, self.gaps = model.selection[walls], np.array([gap for *_, gap in contacts])
        self.owners = np.array([body for _, body, *_ in contacts])
        self.bodies = np.eye(len(masses))[self.owners]
        flexibility = model.residual_flexibility
        self.yields = np.outer(self.signs, self.signs) * flexibility[np.ix_(walls, walls)]
        self.driven = force * self.signs * flexibility[walls, model.interface.index(at)]
        if not coupled:
            self.yields, self.driven = np.diag(np.diag(self.yields)), 0.0 * self.driven

    def forces(self, time, eta, bodies):
        """(contacts,) pushes, N, which leave no contact overlapped and pull none."""
        free = self.gaps + self.signs * (self.rows @ eta - self.bodies @ bodies)
        free = free + self.driven * np.sin(self.omega * time)
        closed = np.flatnonzero(free < 0)
        if len(closed) == 0:
            return np.zeros(len(free))
        # both walls of a body, on one label, cannot touch at once
        for size in range(1, len(self.masses) + 1):
            for chosen in itertools.combinations(range(len(free)), size):
                if len(set(self.owners[list(chosen)])) < size:
                    continue
                push = np.zeros(len(free))
                push[list(chosen)] = -np.linalg.solve(self.yields[np.ix_(chosen, chosen)], free[list(chosen)])
                if np.all(push >= 0) and np.all(free + self.yields @ push >= -1e-12 * np.abs(free).max()):
                    return push
        raise AssertionError("no solution of the complementarity problem")

    def rate(self, time, state):
        """Time derivative of (eta, eta', bodies, bodies')."""
        n, b = len(self.squares), len(self.masses)
        eta, speed, bodies, rates = np.split(state, [n, 2 * n, 2 * n + b])
        push = self.signs * self.forces(time, eta, bodies)
        acceleration = (
            self.load * np.sin(self.omega * time) + self.rows.T @ push - self.squares * eta - self.damping @ speed
        )
        return np.concatenate([speed, acceleration, rates, -(self.bodies.T @ push) / self.masses])

    def run(self, start, times, **options):
        """States (t, 2 n + 2 b) at times, from rest but for the bodies' (positions, velocities)."""
        n = len(self.squares)
        state = np.concatenate([np.zeros(2 * n), *start])
        settings = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-13} | options
        return solve_ivp(self.rate, (0.0, times[-1]), state, t_eval=times, **settings).y.T
