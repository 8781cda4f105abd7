"""A body in the gap of a driven oscillator: its symmetric motion with two impacts per period, in closed form.

m x'' + c x' + k x = F sin(w t), and a body b at r from the middle of a gap 2 h in it, no friction, restitution e (Masri
and Caughey 1966, J. Appl. Mech. 33; Bapat and Sankar 1985, J. Sound Vib. 99). An impact on the right wall r = h at the
speed of approach u leaves r' = -e u and, by the momentum, gives x' more by j u, j = (1 + e) b / (m + b). Half a period
T later a symmetric motion is its own mirror image, so that

- the body's own speed is the opposite after the impact: x' + (j - e) u = -(x' + u), with x' = -(1 - e + j) u / 2
  before;
- it crosses from wall to wall in T / 2 with that speed, -(1 + e) u m / (2 (m + b)), which gives the structure's place
  at the impact, x = (1 + e) u m T / (8 (m + b)) - h;
- the structure's free motion z, what it has beside the steady one, becomes (0, j u) - z by the flow E of half a period:
  (E + 1) z = (0, j u).

All are linear in u. So the steady motion at the impact, (x, x' + j u) - z, is p + u q. It lies on the ellipse with the
half axes |H|, w |H| of the receptance H F: two values of u, and for each the phase of the impact. Whether the body
stays between the walls on its way is to be seen (`inside`).

The jump of an impact leaves x and r, adds j r' to x' and turns r' to -e r'; with the rates (x', x'', r', -x'') before
and after and the guard r it has a saltation matrix S, the same on both walls. Half a period, mirrored, is -E S; the
orbit's multipliers are the squares of its eigenvalues. One of 1 is a fold, one of -1 the loss of symmetry (a
pitchfork), a pair on the unit circle a Neimark-Sacker point; a multiplier -1 of the orbit would need both +i and -i. An
impact has the determinant e^2, e by the guard and e by the jump, so that the product of all four multipliers is e^4
exp(-c T / m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from tests.reference.orbit_saltation import saltation

#: gradient of the event function, r
_GUARD = np.array([0.0, 0.0, 1.0, 0.0])


@dataclass(frozen=True)
class GapOscillator:
    """The orbit; larger: which of two values of the approach speed u. States are (x, x', r, r')."""

    mass: float
    damping: float
    stiffness: float
    body: float
    half_gap: float
    restitution: float
    force: float
    omega: float
    larger: bool = True

    @property
    def period(self) -> float:
        """Period of the force, s."""
        return 2 * math.pi / self.omega

    @property
    def _passed(self) -> float:
        """Change of x' over the speed of approach."""
        return (1 + self.restitution) * self.body / (self.mass + self.body)

    @property
    def _steady(self) -> complex:
        """H of the steady motion Re(H exp(i w t)) without the body."""
        return -1j * self.force / self._dynamic

    @cached_property
    def _generator(self) -> np.ndarray:
        """Rates (4, 4) of a state per state: a body without force beside the structure."""
        rate = np.array([-self.stiffness, -self.damping]) / self.mass
        generator = np.zeros((4, 4))
        generator[0, 1] = generator[2, 3] = 1.0
        generator[1, :2], generator[3, :2] = rate, -rate
        return generator

    @cached_property
    def approaches(self) -> np.ndarray:
        """Speeds of approach u, m/s, that solve the quadratic equation, complex or negative ones too."""
        place, speed = self._share
        return np.sort_complex(np.roots([
            place[1] ** 2 + (speed[1] / self.omega) ** 2,
            2 * (place[0] * place[1] + speed[0] * speed[1] / self.omega**2),
            place[0] ** 2 + (speed[0] / self.omega) ** 2 - abs(self._steady) ** 2,
        ]))  # fmt: skip

    @property
    def _share(self) -> tuple[np.ndarray, np.ndarray]:
        """p and q of the steady state p + u q after the impact, for place and speed."""
        e, j = self.restitution, self._passed
        half = expm(self._generator[:2, :2] * self.period / 2)
        free = np.linalg.solve(half + np.eye(2), [0.0, j])
        flown = (1 + e) * self.mass * self.period / (8 * (self.mass + self.body))
        return np.array([-self.half_gap, flown - free[0]]), np.array([0.0, (j - (1 - e)) / 2 - free[1]])

    @property
    def approach(self) -> float:
        """Speed of approach u, m/s."""
        return float(self.approaches[1 if self.larger else 0].real)

    @property
    def phase(self) -> float:
        """Phase of the impact on the right wall, in [0, 2 pi)."""
        place, speed = (p + self.approach * q for p, q in self._share)
        return float(np.angle((place - 1j * speed / self.omega) / self._steady)) % (2 * math.pi)

    @property
    def _struck(self) -> tuple[np.ndarray, np.ndarray]:
        """State before and after the impact on the right wall."""
        u, e, j = self.approach, self.restitution, self._passed
        place = (1 + e) * self.mass * self.period / (8 * (self.mass + self.body)) * u - self.half_gap
        speed = -(1 - e + j) * u / 2
        before = np.array([place, speed, self.half_gap, u])
        return before, before + np.array([0.0, j * u, 0.0, -(1 + e) * u])

    def _forced(self, phase: float) -> np.ndarray:
        """Steady motion (4,) at a phase, with the body at rest in space at zero."""
        turning = self._steady * np.exp(1j * phase)
        place, rate = turning.real, (1j * self.omega * turning).real
        return np.array([place, rate, -place, -rate])

    def _rates(self, state: np.ndarray, phase: float) -> np.ndarray:
        """Rates (4,) of a state at a phase."""
        load = self.force * math.sin(phase) / self.mass
        rates: np.ndarray = self._generator @ state + np.array([0.0, load, 0.0, -load])
        return rates

    def after(self, turn: float) -> np.ndarray:
        """State (4,) at a phase `turn` after the impact on the right wall, below pi."""
        free = self._struck[1] - self._forced(self.phase)
        moved: np.ndarray = expm(self._generator * turn / self.omega) @ free + self._forced(self.phase + turn)
        return moved

    @property
    def state(self) -> np.ndarray:
        """State (4,) at phase 0 of the force."""
        turn = -self.phase % (2 * math.pi)
        return self.after(turn) if turn < math.pi else -self.after(turn - math.pi)

    @property
    def inside(self) -> bool:
        """Whether the orbit is one: the speed real and above zero, the body between the walls from wall to wall."""
        if self.approaches[0].imag or self.approach <= 0:
            return False
        way = [self.after(turn)[2] for turn in np.linspace(0.0, math.pi, 400)[1:-1]]
        return max(map(abs, way)) < self.half_gap

    @property
    def half(self) -> np.ndarray:
        """Derivative (4, 4) of half a period, mirrored, that begins just before an impact."""
        before, after = self._struck
        e, j = self.restitution, self._passed
        jump = np.diag([1.0, 1.0, 1.0, -e])
        jump[1, 3] = j
        impact = saltation(jump, self._rates(before, self.phase), self._rates(after, self.phase), _GUARD)
        derivative: np.ndarray = -expm(self._generator * self.period / 2) @ impact
        return derivative

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers (4,)."""
        return np.asarray(np.linalg.eigvals(self.half)) ** 2

    @property
    def attached(self) -> float:
        """Share of the body's mass that the structure feels: Re(F / (w^2 X)) / b (harmonics of force and motion).

        Two impulses +-m j u a period have the harmonic F = (4 / T) m j u exp(-i phi).
        """
        return float((self._pushed / (self.omega**2 * self.harmonic)).real / self.body)

    @property
    def harmonic(self) -> complex:
        """X of the harmonic Re(X exp(i w t)) of the structure's motion, m."""
        return self._steady + self._pushed / self._dynamic

    @property
    def _pushed(self) -> complex:
        """F of the harmonic Re(F exp(i w t)) of the force of the impacts on the structure, N."""
        pushed: complex = 4 / self.period * self.mass * self._passed * self.approach * np.exp(-1j * self.phase)
        return pushed

    @property
    def _dynamic(self) -> complex:
        """Dynamic stiffness, N/m."""
        return self.stiffness - self.mass * self.omega**2 + 1j * self.omega * self.damping

    def fold(self, low: float, high: float) -> float:
        """Return the angular frequency between two where the two solutions for u meet: a multiplier of 1."""
        return float(brentq(lambda omega: replace(self, omega=omega)._discriminant, low, high, xtol=1e-15, rtol=1e-14))

    @property
    def _discriminant(self) -> float:
        place, speed = self._share
        a = place[1] ** 2 + (speed[1] / self.omega) ** 2
        b = place[0] * place[1] + speed[0] * speed[1] / self.omega**2
        return float(b * b - a * (place[0] ** 2 + (speed[0] / self.omega) ** 2 - abs(self._steady) ** 2))

    def pitchfork(self, low: float, high: float) -> float:
        """Return the angular frequency between two where the orbit loses its symmetry: det(half + 1) = 0."""
        return float(brentq(
            lambda omega: np.linalg.det(replace(self, omega=omega).half + np.eye(4)), low, high, xtol=1e-15, rtol=1e-14
        ))  # fmt: skip

    def neimark_sacker(self, low: float, high: float) -> float:
        """Return the angular frequency between two where the largest multiplier of a pair passes the unit circle."""
        return float(brentq(
            lambda omega: np.abs(replace(self, omega=omega).multipliers).max() - 1, low, high, xtol=1e-15, rtol=1e-14
        ))  # fmt: skip
