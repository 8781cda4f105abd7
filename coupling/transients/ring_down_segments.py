"""What a ring-down asks of the segments of a run: the followed modal coordinate, its speed, and energies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import CLOSED, OPEN
from vanedamp.coupling.response.segment import Segment, beyond_line

#: share of the largest speed below which a mode is not felt
_FELT = 1e-9


class Energy(NamedTuple):
    """Energies at a time, J: of structure, bodies and springs together; of the structure's modes, and kinetic of it."""

    total: float
    structure: float
    kinetic: float


class Followed:
    """A segment of a free motion, with one modal coordinate followed.

    start, duration: s; rate: (m,) 1/s; wave: (m,) coefficients of exp(rate t) in the coordinate; powers: (3,) value,
    slope and second derivative of the rest.
    """

    def __init__(self, segment: Segment, mode: int) -> None:
        self.start, self.duration = segment.start, segment.duration
        self._segment, self.rate, self.wave = segment, segment.rate, segment.shape[mode] * segment.amplitude
        self.powers = np.array([segment.q[mode], segment.v[mode], segment.bend[mode]])

    @property
    def fastest(self) -> float:
        """Angular frequency of the fastest mode that the followed coordinate feels, rad/s."""
        speed = np.abs(self.wave * self.rate)
        felt = speed > _FELT * speed.max(initial=0.0)
        return float(np.abs(self.rate[felt]).max(initial=0.0))

    def coordinate(self, t: float) -> float:
        """Return the followed modal coordinate after a time t, s."""
        constant, slope, bend = self.powers
        return float(constant + t * (slope + 0.5 * t * bend) + (self.wave @ beyond_line(self.rate * t)).real)

    def speed(self, t: np.ndarray) -> np.ndarray:
        """Return the rates (k,) of the followed modal coordinate after times t (k,), s."""
        turned = np.expm1(np.multiply.outer(t, self.rate))
        speed: np.ndarray = self.powers[1] + t * self.powers[2] + (turned @ (self.wave * self.rate)).real
        return speed

    def energy(self, t: float) -> Energy:
        """Return the energies after a time t, s."""
        system, (q, v) = self._segment.system, self._segment.at(t)
        n, u, massive = system.modes, system.contacts, slice(len(q) - len(system.tangential))
        kinetic = 0.5 * float(v[:n] @ v[:n])
        total = 0.5 * float(system.mass[massive] @ v[massive] ** 2 + q @ system.stiffness @ q)
        total -= float(system.weight[n:] @ q[n:])
        state = self._segment.state[:u]
        pressed = np.isfinite(system.spring[:u]) & ((state < OPEN) | (state == CLOSED))
        gap = (system.rest[:u] + system.J[:u] @ q)[pressed]
        total += 0.5 * float(system.spring[:u][pressed] @ gap**2 + system.tangential @ (system.elongation @ q) ** 2)
        return Energy(total, kinetic + 0.5 * float(q[:n] @ system.stiffness[:n, :n] @ q[:n]), kinetic)
