"""Integrands of figures over a motion z: products of its functionals, and their derivatives by numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Flow, ScaledDynamics
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.numbers import Parameters

#: energies that are integrals of powers, as in records.ENERGIES
POWERS = ("excitation", "viscous", "friction", "contact")


class Functionals(NamedTuple):
    """Functionals (m, K) of z, and their derivatives (P, m, K)."""

    rows: np.ndarray
    slopes: np.ndarray

    def of(self, z: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return their values (n, m) along a motion z (n, K), Z (n, K, P), and derivatives (n, m, P)."""
        values, turns = z @ self.rows.T, np.tensordot(z, self.slopes, axes=(1, 2))
        return values, self.rows @ Z + turns.transpose(0, 2, 1)


class Products(NamedTuple):
    """Products of two lists of functionals (m,), each of which adds to the sums (r,) of `adds` (r, m)."""

    left: Functionals
    right: Functionals
    adds: np.ndarray

    def of(self, z: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the products (n, m) along a motion, and their derivatives (n, m, P)."""
        (a, of_a), (b, of_b) = self.left.of(z, Z), self.right.of(z, Z)
        return a * b, of_a * b[:, :, None] + a[:, :, None] * of_b


def joined(parts: Sequence[Functionals]) -> Functionals:
    """Return functionals in one list."""
    rows, slopes = zip(*parts, strict=True)
    return Functionals(np.concatenate(rows), np.concatenate(slopes, axis=1))


def response_of(dynamics: ScaledDynamics, numbers: Parameters) -> Functionals:
    """Return the displacement, m."""
    return Functionals(dynamics.response[None], numbers.parts.response[:, None])


def slipping(flow: Flow) -> np.ndarray:
    """Return the units (m,) that slip in a flow."""
    return np.flatnonzero(flow.way)


def momentum_of(dynamics: ScaledDynamics, numbers: Parameters) -> Functionals:
    """Return the momentum of the bodies along their cavities, kg m/s."""
    along, n, K = dynamics.system.along, len(dynamics.root), len(dynamics.turn)
    rows, slopes = np.zeros((1, K)), np.zeros((len(numbers), 1, K))
    rows[0, n + along] = dynamics.root[along]  # m v = root w
    slopes[:, 0, n + along] = numbers.parts.root[:, along]
    return Functionals(rows, slopes)


def integrands_of(flow: Flow, numbers: Parameters) -> Products:
    """Return integrands of a motion in a flow: x^2, m^2, and the powers by POWERS, W."""
    dynamics, of, moved = flow.dynamics, numbers.parts, derivative_of(flow, numbers)
    system, u, K = dynamics.system, len(flow.state), len(dynamics.turn)
    speeds = Functionals(np.eye(K)[dynamics.rates], np.zeros((len(numbers), len(dynamics.root), K)))
    harmonics, damped = np.zeros(K), np.zeros(K)
    harmonics[dynamics.one + 1 :], damped[dynamics.rates] = 1.0, -1.0
    n, slips, x = flow.solved.pressed, u + slipping(flow), response_of(dynamics, numbers)
    gap, of_dashpot = Functionals(dynamics.speed[n], of.speed[:, n]), of.dashpot[:, n, None]
    dashpot = system.dashpot[n, None]
    left = (
        x,
        Functionals(dynamics.load * harmonics, of.load * harmonics),
        Functionals(dynamics.load * damped, of.load * damped),
        Functionals(-flow.forces[slips], -moved.forces[:, slips]),
        Functionals(dashpot * gap.rows, of_dashpot * gap.rows + dashpot * gap.slopes),
    )
    right = x, speeds, speeds, Functionals(dynamics.speed[slips], of.speed[:, slips]), gap
    owner = np.repeat(np.arange(len(left)), [len(each.rows) for each in left])
    return Products(joined(left), joined(right), 1.0 * (owner == np.arange(len(left))[:, None]))
