"""What figures integrate over a motion z: products of its functionals, and their derivatives by numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.numbers import Numbers

#: energies that are integrals of powers, as in records.ENERGIES
POWERS = ("excitation", "viscous", "friction", "contact")


class Functionals(NamedTuple):
    """Functionals (m, K) of z, and their derivatives (P, m, K)."""

    rows: np.ndarray
    own: np.ndarray

    def of(self, z: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return their values (n, m) along a motion z (n, K), Z (n, K, P), and derivatives (n, m, P)."""
        values, turns = z @ self.rows.T, np.tensordot(z, self.own, axes=(1, 2))
        return values, self.rows @ Z + turns.transpose(0, 2, 1)


class Product(NamedTuple):
    """The sum of the products of two lists of functionals."""

    left: Functionals
    right: Functionals

    def each(self, z: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the products (n, m) along a motion, and their derivatives (n, m, P)."""
        (a, of_a), (b, of_b) = self.left.of(z, Z), self.right.of(z, Z)
        return a * b, of_a * b[:, :, None] + a[:, :, None] * of_b

    def of(self, z: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return its values (n,) along a motion, and derivatives (n, P)."""
        value, turns = self.each(z, Z)
        return value.sum(axis=1), turns.sum(axis=1)


def response_of(dynamics: Dynamics, numbers: Numbers) -> Functionals:
    """Return the displacement, m."""
    return Functionals(dynamics.response[None], numbers.parts.response[:, None])


def each_of(rows: np.ndarray, own: np.ndarray) -> list[Functionals]:
    """Return functionals (m, K) with derivatives (P, m, K) one by one."""
    return [Functionals(rows[[k]], own[:, [k]]) for k in range(len(rows))]


def slipping(flow: Flow) -> np.ndarray:
    """Return the units (m,) that slip in a flow."""
    return np.flatnonzero(flow.way)


def momentum_of(dynamics: Dynamics, numbers: Numbers) -> Functionals:
    """Return the momentum of the bodies along their cavities, kg m/s."""
    along, n, K = dynamics.system.along, len(dynamics.root), len(dynamics.turn)
    rows, own = np.zeros((1, K)), np.zeros((len(numbers), 1, K))
    rows[0, n + along] = dynamics.root[along]  # m v = root w
    own[:, 0, n + along] = numbers.parts.root[:, along]
    return Functionals(rows, own)


def powers_of(flow: Flow, numbers: Numbers) -> list[Product]:
    """Return the powers of a flow by POWERS, W."""
    dynamics, of, moved = flow.dynamics, numbers.parts, derivative_of(flow, numbers)
    system, u, K = dynamics.system, len(flow.state), len(dynamics.turn)
    speeds = Functionals(np.eye(K)[dynamics.rates], np.zeros((len(numbers), len(dynamics.root), K)))
    harmonics, damped = np.zeros(K), np.zeros(K)
    harmonics[dynamics.one + 1 :], damped[dynamics.rates] = 1.0, -1.0
    presses = np.zeros(u, bool)
    presses[flow.solved.pressed] = True
    dashpot, of_dashpot = np.where(presses, system.dashpot, 0.0), np.where(presses, of.dashpot, 0.0)
    slips = slipping(flow)
    slip = Functionals(dynamics.speed[u:][slips], of.speed[:, u:][:, slips])
    gap = Functionals(dynamics.speed[:u], of.speed[:, :u])
    lost = dashpot[:, None] * gap.rows, of_dashpot[:, :, None] * gap.rows + dashpot[:, None] * gap.own
    return [
        Product(Functionals(dynamics.load * harmonics, of.load * harmonics), speeds),
        Product(Functionals(dynamics.load * damped, of.load * damped), speeds),
        Product(Functionals(-flow.forces[u:][slips], -moved.forces[:, u:][:, slips]), slip),
        Product(Functionals(*lost), gap),
    ]
