"""What constraints leave of a derivative: closed gaps stay closed, units that stick stay, sliders follow.

Maps of derivatives M (2N, k + P) of u, by k numbers of the start and by P of the scene: a matrix for all, and a part of
its own for the latter, since gaps and directions depend on these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Dynamics
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.system.unit_laws import SINGULAR, rubs, ways


class Affine(NamedTuple):
    """The map M -> matrix M + (0, own): matrix (n, n), own (n, P)."""

    matrix: np.ndarray
    own: np.ndarray

    def __call__(self, M: np.ndarray) -> np.ndarray:
        """Return the derivative (n, k + P) after the map."""
        found = self.matrix @ M
        found[:, M.shape[1] - self.own.shape[1] :] += self.own
        return found

    def then(self, other: Affine) -> Affine:
        """Return this map and then another."""
        return Affine(other.matrix @ self.matrix, other.matrix @ self.own + other.own)

    def part(self, rows: slice) -> Affine:
        """Return the part of some rows, which others do not enter."""
        return Affine(self.matrix[rows, rows], self.own[rows])


class Constraints:
    """The constraints of a system, with what P numbers change in them; numbers: None for P = 0."""

    def __init__(self, dynamics: Dynamics, numbers: Numbers | None) -> None:
        self.dynamics, self.numbers = dynamics, numbers
        self._nothing = np.zeros((dynamics.one, 0 if numbers is None else len(numbers)))

    def held(self, closed: np.ndarray, stuck: np.ndarray, z: np.ndarray) -> Affine:
        """Return the map that keeps contacts (u,) closed and slips zero at z (K,): see Dynamics.held."""
        matrix = self.dynamics.held(closed, stuck)
        if self.numbers is None:
            return Affine(matrix, self._nothing)
        d, of, own, u = self.dynamics, self.numbers.parts, self._nothing.copy(), len(closed)
        normal, both = d.rows[:u][closed], np.vstack([d.rows[:u][closed], d.rows[u:][stuck]])
        moved = np.concatenate([of.rows[:, :u][:, closed], of.rows[:, u:][:, stuck]], axis=1)
        own[d.places] = -d.rate[:, None] * (pseudo_inverse(normal) @ (of.gap[:, closed] @ z).T)
        own[d.rates] = -pseudo_inverse(both) @ (moved @ z[d.rates]).T
        return Affine(matrix, own)

    def followed(self, state: np.ndarray, z: np.ndarray) -> Affine:
        """Return the map of sliders as they are in states (u,): see Dynamics.followed."""
        matrix = self.dynamics.followed(state)
        if self.numbers is None or not len(self.dynamics.sliders):
            return Affine(matrix, self._nothing)
        d, of, own, n = self.dynamics, self.numbers.parts, self._nothing.copy(), len(self.dynamics.root)
        of_jenkins = state[d.jenkins]
        slips = of_jenkins != codes.STICK
        places = of.follows[:, :, :n] @ z[d.places] - ways(of_jenkins) * of.bound
        own[d.sliders[slips]] = places[:, slips].T
        own[n + d.sliders[slips]] = (of.follows[:, :, n:] @ z[d.rates])[:, slips].T
        return Affine(matrix, own)

    def begun(self, state: np.ndarray, closed: np.ndarray, z: np.ndarray) -> Affine:
        """Return the map that contacts `closed` (u,) and units that stick in states (u,) leave at z (K,)."""
        system = self.dynamics.system
        held = self.held(closed & np.isinf(system.spring), (state == codes.STICK) & rubs(system), z)
        return held.then(self.followed(state, z))


def pseudo_inverse(rows: np.ndarray) -> np.ndarray:
    """Return the pseudo-inverse (N, m) of rows that may depend on each other."""
    length = np.linalg.norm(rows, axis=1)
    length = np.where(length > 0.0, length, 1.0)
    return np.asarray(np.linalg.pinv(rows / length[:, None], rcond=SINGULAR) / length)
